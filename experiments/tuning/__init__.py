"""The studies that come along, each a TOML file beside this one: what to tune, and for what."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.studies.tuning.study import Study
from rigtwin.studies.tuning.study_file import read_study

STUDIES = {path.stem: path for path in sorted(Path(__file__).parent.glob("*.toml"))}
"""Name → file."""


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
        Of `STUDIES`, or the path of a TOML file.
    assignments : sequence of str, optional
        `group.name=value` for every run, over the study's own.
    machine : Machine, optional
        Whose controller is tuned; by default that which the study names.
    **numbers : int or None
        Of roads, held_out, evaluations; None for the study's own.

    Raises
    ------
    RigtwinError
        With what there is, or what is wrong with it.
    """
    path = STUDIES.get(name, Path(name))
    if path.suffix != ".toml" and not path.exists():
        known = ", ".join(STUDIES)
        advice = "or give the path of a study, F.toml"
        raise RigtwinError(f"unknown study {name!r}; there are {known}, {advice}")
    return read_study(path, machine, assignments, **numbers)
