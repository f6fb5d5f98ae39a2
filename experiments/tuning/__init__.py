"""The shipped tuning studies, one TOML file each: the parameters, the objective, the limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.studies.tuning.study import Study
from rigtwin.studies.tuning.study_file import read_study

STUDIES = {path.stem: path for path in sorted(Path(__file__).parent.glob("*.toml"))}
"""Path of the file of every shipped study, by name."""


def find_study(
    name: str,
    assignments: Sequence[str] = (),
    *,
    machine: Machine | None = None,
    **numbers: int | None,
) -> Study:
    """Read a study by its name, or by the path of its file.

    Parameters
    ----------
    name : str
        Name in `STUDIES`, or the path of a TOML file.
    assignments : sequence of str, optional
        Settings `group.name=value` for every run. They override those of the study.
    machine : Machine, optional
        Machine whose controller is tuned. Defaults to the one named in the study.
    **numbers : int or None
        Values of `roads`, `held_out` and `evaluations`. None keeps the study's value.

    Returns
    -------
    Study
        Study with the overriding values applied.

    Raises
    ------
    RigtwinError
        If no study has this name, or its file is invalid.
    """
    # A shipped study's name comes before a file of that name in the working folder.
    path = STUDIES.get(name, Path(name))
    if path.suffix != ".toml" and not path.exists():
        known = ", ".join(STUDIES)
        advice = "or give the path of a study, F.toml"
        raise RigtwinError(f"unknown study {name!r}; there are {known}, {advice}")
    return read_study(path, machine, assignments, **numbers)
