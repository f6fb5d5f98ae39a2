"""Plan: a list of tests to be recorded one after another, of which some may exist already."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rigtwin.description.changes import parse_assignments
from rigtwin.errors import RigtwinError
from rigtwin.recording import load
from rigtwin.simulation.experiment import Experiment

LONGEST = 3600.0
"""Longest pause, in s."""
KEYS = ("experiment", "name", "seed", "pause", "set")


@dataclass(frozen=True)
class PlannedTest:
    """One test of a plan.

    Parameters
    ----------
        Name of the recording without its suffix.
        Of its recording, without the ending.
        Name of the experiment.
        What is run.
        Seed of the demands.
        Of the demands.
        Pause before the test, in s.
        s before it.
        Settings `key=value`, as --set takes them.
        `key=value` texts, as --set takes them.
    """

    name: str
    experiment: str
    seed: int = 0
    pause: float = 0.0
    settings: list[str] = field(default_factory=list)

    @property
    def changes(self) -> list[dict[str, dict[str, str]]]:
        """Settings as group → name → value, one by one. Raises RigtwinError for a wrong text."""
        return list(parse_assignments(self.settings))


def parse_plan(
    tables: Mapping[str, object], find: Callable[[str], Experiment]
) -> list[PlannedTest]:
    """Parse the tests of a plan.

    Parameters
    ----------
    tables : mapping
        TOML tables; `test` is a list of tables.
    find : callable
        Function that returns an experiment by name, or raises RigtwinError.

    Returns
    -------
    list of PlannedTest
        Tests in the order of the list.

    Raises
    ------
    RigtwinError
        If a test is wrong; the message names it and the mistake.
    """
    unknown = [name for name in tables if name != "test"]
    if unknown:
        raise RigtwinError(f"unknown {unknown[0]!r}; expected [[test]] tables")
    tests = tables.get("test")
    if not isinstance(tests, list) or not tests:
        raise RigtwinError("no [[test]] in it")
    plan: list[PlannedTest] = []
    for number, table in enumerate(tests, start=1):
        test = _parse_test(number, table, find)
        # Two tests of one name would overwrite each other's recording.
        if test.name in (earlier.name for earlier in plan):
            raise RigtwinError(
                f"test {number}: name {test.name!r} is another test's; expected one of its own"
            )
        plan.append(test)
    return plan


def _parse_test(number: int, table: object, find: Callable[[str], Experiment]) -> PlannedTest:
    where = f"test {number}"
    if not isinstance(table, Mapping):
        raise RigtwinError(f"{where} = {table!r}; expected a table, [[test]]")
    for key in table:
        if key not in KEYS:
            raise RigtwinError(f"{where}: unknown {key!r}; expected {', '.join(KEYS)}")
    experiment, seed, pause = table.get("experiment"), table.get("seed", 0), table.get("pause", 0.0)
    if not isinstance(experiment, str):
        raise RigtwinError(f"{where}: experiment is missing")
    # Raises an error for an unknown experiment.
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
    """Return nested or dotted tables as texts `group.name=value`."""
    lines: list[str] = []
    for key, value in settings.items():
        if isinstance(value, Mapping):
            lines += [f"{key}.{line}" for line in list_assignments(value)]
        else:
            lines.append(f"{key}={value}")
    return lines


def is_complete(path: Path, real: bool) -> bool:
    """Return whether a test need not be repeated.

    Parameters
    ----------
    path : Path
        Path of the recording, which may not exist.
    real : bool
        Whether a recording of the rig itself is required, instead of one of a twin.

    Returns
    -------
    bool
        True if the recording exists and was completed.
    """
    if not path.exists():
        return False
    try:
        recording = load(path)
    except RigtwinError:
        return False
    # A dry run's recording does not replace a test on the rig, nor the reverse.
    return recording.end == "completed" and real == (not recording.twin)


def move_aside(path: Path) -> Path | None:
    """Rename the recording of an incomplete test, and return its new path."""
    if not path.exists():
        return None
    number = 1
    # Earlier attempts are kept, each under its own number.
    while (aside := path.with_suffix(f".{number}.mcap")).exists():
        number += 1
    return path.rename(aside)
