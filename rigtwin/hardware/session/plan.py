"""`rigtwin session`: a list of tests one after the other, a recording and a comparison each."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rigtwin.cli.session_commands import plan_test, require_permission, run
from rigtwin.description.configuration import read_toml
from rigtwin.errors import RigtwinError
from rigtwin.recording import load

LONGEST = 3600.0
"""s of a pause."""


@dataclass(frozen=True)
class PlannedTest:
    """One test of a list. pause: s before it; settings: `key=value` texts, as --set takes them."""

    name: str
    experiment: str
    seed: int = 0
    pause: float = 0.0
    settings: list[str] = field(default_factory=list)


def parse_plan(tables: Mapping[str, Any]) -> list[PlannedTest]:
    """The tests of a TOML list. Raises RigtwinError naming the test and what is wrong with it."""
    from experiments import find

    unknown = [name for name in tables if name != "test"]
    tests = tables.get("test")
    if unknown or not isinstance(tests, list) or not tests:
        raise RigtwinError(
            f"unknown {unknown[0]!r}; expected [[test]] tables" if unknown else "no [[test]] in it"
        )
    found: list[PlannedTest] = []
    for number, test in enumerate(tests, start=1):
        where = f"test {number}"
        if not isinstance(test, Mapping):
            raise RigtwinError(f"{where} = {test!r}; expected a table, [[test]]")
        for key in test:
            if key not in ("experiment", "name", "seed", "pause", "set"):
                raise RigtwinError(
                    f"{where}: unknown {key!r}; there are experiment, name, seed, pause, set"
                )
        experiment, seed, pause = (
            test.get("experiment"),
            test.get("seed", 0),
            test.get("pause", 0.0),
        )
        if not isinstance(experiment, str):
            raise RigtwinError(f"{where}: experiment is missing")
        find(experiment)
        if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
            raise RigtwinError(f"{where}: seed = {seed!r}; expected 0 or more")
        if (
            isinstance(pause, bool)
            or not isinstance(pause, int | float)
            or not 0.0 <= pause <= LONGEST
        ):
            raise RigtwinError(f"{where}: pause = {pause!r}; expected 0 to {LONGEST:g} s")
        settings = test.get("set", {})
        if not isinstance(settings, Mapping):
            raise RigtwinError(f"{where}: set = {settings!r}; expected a table of settings")
        name = test.get("name", f"{number:02d}-{experiment}-{seed}")
        if (
            not isinstance(name, str)
            or not name.strip()
            or "/" in name
            or name.startswith(".")
            or not name.isprintable()
        ):
            raise RigtwinError(f"{where}: name = {name!r}; expected what a file can be called")
        if name in (other.name for other in found):
            raise RigtwinError(f"{where}: name {name!r} is another test's; expected one of its own")
        found.append(PlannedTest(name, experiment, seed, float(pause), list(_assignments(settings))))
    return found


def _assignments(settings: Mapping[str, Any]) -> list[str]:
    """`group.name=value` of nested or dotted tables."""
    lines: list[str] = []
    for key, value in settings.items():
        if isinstance(value, Mapping):
            lines += [f"{key}.{line}" for line in _assignments(value)]
        else:
            lines.append(f"{key}={value}")
    return lines


def session(parsed: Namespace) -> int:
    """Runs the list. Stops at the first test that did not end as it should. Returns the exit code."""
    if parsed.target == "daq" and parsed.card is None:
        raise RigtwinError("--target daq needs the card's channel table: --card CARD.toml")
    tests = read_toml(parsed.list, parse_plan)
    try:
        parsed.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RigtwinError(f"cannot make {parsed.folder}: {error.strerror}") from None
    real = parsed.target == "daq" and not parsed.dry_run
    todo = [
        test
        for test in tests
        if not (parsed.resume and is_complete(parsed.folder / f"{test.name}.mcap", real))
    ]
    taken = [test.name for test in todo if (parsed.folder / f"{test.name}.mcap").exists()]
    if taken and not parsed.resume:
        raise RigtwinError(
            f"{parsed.folder} holds {taken[0]}.mcap already; --resume goes on, or name another --folder"
        )
    # Every mistake is found before the first test moves anything.
    ready = [(test, plan_test(_of(parsed, test), test.experiment)) for test in todo]
    for _, one in ready:
        _ = one.card_configuration
        if real:
            require_permission(parsed, one)
    if len(todo) < len(tests):
        print(f"{len(tests) - len(todo)} of {len(tests)} tests are done already")
    for test, one in ready:
        if test.pause:
            print(f"pause of {test.pause:g} s before {test.name}", flush=True)
            time.sleep(test.pause)
        path = parsed.folder / f"{test.name}.mcap"
        aside = move_aside(path)
        code = run(parsed, one, path)
        if aside is not None:
            print(f"what was there before is in {aside}")
        if code != 0:
            print(f"{test.name} did not complete; see {path}, then --resume")
            return code
        _compared(path)
    return 0


def _of(parsed: Namespace, test: PlannedTest) -> Namespace:
    """The command line of one test: its own settings after those of the session."""
    return Namespace(**{**vars(parsed), "seed": test.seed, "set": [*parsed.set, *test.settings]})


def is_complete(path: Path, real: bool) -> bool:
    """Whether it is there, of the rig itself where that is asked for."""
    if not path.exists():
        return False
    try:
        recording = load(path)
    except RigtwinError:
        return False
    return recording.end == "completed" and real == (not recording.twin)


def move_aside(path: Path) -> Path | None:
    """A recording of a test that did not complete is kept under another name."""
    if not path.exists():
        return None
    number = 1
    while (aside := path.with_suffix(f".{number}.mcap")).exists():
        number += 1
    return path.rename(aside)


def _compared(path: Path) -> None:
    """Where the rig and the twin disagree, at once."""
    from rigtwin.cli.diagnosis_commands import compare

    arguments = {
        "recording": path,
        "other": None,
        "json": None,
        "machine": None,
        "effect": [],
        "set": [],
        "config": None,
    }
    try:
        compare(Namespace(**arguments))
    except RigtwinError as error:
        print(f"not compared: {error}")
