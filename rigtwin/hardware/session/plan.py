"""A list of tests to be recorded one after the other, and what is there of it already."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rigtwin.description.changes import parse_assignments
from rigtwin.errors import RigtwinError
from rigtwin.recording import load
from rigtwin.simulation.experiment import Experiment

LONGEST = 3600.0
"""s of a pause."""
KEYS = ("experiment", "name", "seed", "pause", "set")


@dataclass(frozen=True)
class PlannedTest:
    """One test of a list.

    Parameters
    ----------
    name : str
        Of its recording, without the ending.
    experiment : str
        What is run.
    seed : int
        Of the demands.
    pause : float
        s before it.
    settings : list of str
        `key=value` texts, as --set takes them.
    """

    name: str
    experiment: str
    seed: int = 0
    pause: float = 0.0
    settings: list[str] = field(default_factory=list)

    @property
    def changes(self) -> list[dict[str, dict[str, str]]]:
        """The settings, group → name → value, one after the other. Raises RigtwinError."""
        return list(parse_assignments(self.settings))


def parse_plan(
    tables: Mapping[str, object], find: Callable[[str], Experiment]
) -> list[PlannedTest]:
    """Reads the tests of a list.

    Parameters
    ----------
    tables : mapping
        TOML's tables: `test`, a list of tables.
    find : callable
        Gives the experiment of a name; raises RigtwinError if there is none.

    Returns
    -------
    list of PlannedTest
        In the order of the list.

    Raises
    ------
    RigtwinError
        Naming the test and what is wrong with it.
    """
    unknown = [name for name in tables if name != "test"]
    if unknown:
        raise RigtwinError(f"unknown {unknown[0]!r}; expected [[test]] tables")
    tests = tables.get("test")
    if not isinstance(tests, list) or not tests:
        raise RigtwinError("no [[test]] in it")
    found: list[PlannedTest] = []
    for number, table in enumerate(tests, start=1):
        test = _parse_test(number, table, find)
        if test.name in (other.name for other in found):
            raise RigtwinError(
                f"test {number}: name {test.name!r} is another test's; expected one of its own"
            )
        found.append(test)
    return found


def _parse_test(number: int, table: object, find: Callable[[str], Experiment]) -> PlannedTest:
    where = f"test {number}"
    if not isinstance(table, Mapping):
        raise RigtwinError(f"{where} = {table!r}; expected a table, [[test]]")
    for key in table:
        if key not in KEYS:
            raise RigtwinError(f"{where}: unknown {key!r}; there are {', '.join(KEYS)}")
    experiment, seed, pause = table.get("experiment"), table.get("seed", 0), table.get("pause", 0.0)
    if not isinstance(experiment, str):
        raise RigtwinError(f"{where}: experiment is missing")
    find(experiment)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise RigtwinError(f"{where}: seed = {seed!r}; expected 0 or more")
    is_number = isinstance(pause, int | float) and not isinstance(pause, bool)
    if not is_number or not 0.0 <= pause <= LONGEST:
        raise RigtwinError(f"{where}: pause = {pause!r}; expected 0 to {LONGEST:g} s")
    settings = table.get("set", {})
    if not isinstance(settings, Mapping):
        raise RigtwinError(f"{where}: set = {settings!r}; expected a table of settings")
    name = table.get("name", f"{number:02d}-{experiment}-{seed}")
    if not isinstance(name, str) or not _is_file_name(name):
        raise RigtwinError(f"{where}: name = {name!r}; expected what a file can be called")
    return PlannedTest(
        name, experiment, seed=seed, pause=float(pause), settings=list_assignments(settings)
    )


def _is_file_name(name: str) -> bool:
    whole = name.strip() != "" and name.isprintable()
    return whole and "/" not in name and not name.startswith(".")


def list_assignments(settings: Mapping[str, object]) -> list[str]:
    """Gives `group.name=value` texts of nested or dotted tables."""
    lines: list[str] = []
    for key, value in settings.items():
        if isinstance(value, Mapping):
            lines += [f"{key}.{line}" for line in list_assignments(value)]
        else:
            lines.append(f"{key}={value}")
    return lines


def is_complete(path: Path, real: bool) -> bool:
    """Says whether a test need not be done again.

    Parameters
    ----------
    path : Path
        Where its recording is, or would be.
    real : bool
        Whether the recording must be of the rig itself, else of a twin.

    Returns
    -------
    bool
        True if it is there and completed.
    """
    if not path.exists():
        return False
    try:
        recording = load(path)
    except RigtwinError:
        return False
    return recording.end == "completed" and real == (not recording.twin)


def move_aside(path: Path) -> Path | None:
    """Keeps a recording of a test that did not complete under another name, which it returns."""
    if not path.exists():
        return None
    number = 1
    while (aside := path.with_suffix(f".{number}.mcap")).exists():
        number += 1
    return path.rename(aside)
