"""A session: a list of tests that are recorded one after another into a folder."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from machines import DEFAULT_MACHINE
from rigtwin.api.machines import resolve_machine
from rigtwin.api.planning import check_settings
from rigtwin.description.changes import read_toml
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.hardware.session.plan import PlannedTest, is_complete, move_aside, parse_plan
from rigtwin.recording.owner import open_alone
from rigtwin.simulation.experiment import find_experiment

LOCK = "session.lock"
"""Lock file in a session's folder: only one session at a time writes into a folder."""


def run_session(
    plan: str | Path,
    folder: str | Path,
    run: Callable[[PlannedTest, Path], bool],
    *,
    machine: Machine | str | Path = DEFAULT_MACHINE,
    resume: bool = False,
    real: bool = False,
    prepare: Callable[[PlannedTest], object] | None = None,
    on_message: Callable[[str], object] = lambda _: None,
) -> bool:
    """Run a list of tests, up to the first one that does not complete.

    Parameters
    ----------
    plan
        File of the list, TOML.
    folder
        Folder of the recordings. It is created if it does not exist.
    run
        Function of (test, path) that records one test, by `run_on_twin`, `run_on_card` or
        `rigtwin.run`, and returns whether it completed.
    machine
        Machine whose experiments the list names, or its name, or the path of its description.
    resume
        Whether to skip tests that are already complete.
    real
        Whether only a recording of the rig itself counts as complete.
    prepare
        Function called with every test before the first one starts; it raises RigtwinError for a
        test that cannot be run. By default settings and demands are checked.
    on_message
        Function called with one line for the operator.

    Returns
    -------
    bool
        Whether all tests completed.

    Raises
    ------
    RigtwinError
        For a mistake in any test of the list, or if another session writes into the folder. It is
        raised before anything moves.
    """
    folder, described = Path(folder), resolve_machine(machine)
    find_test = partial(find_experiment, described)
    tests = read_toml(Path(plan), lambda tables: parse_plan(tables, find_test))
    with _alone(folder):
        return _run_tests(
            tests=tests,
            folder=folder,
            run=run,
            resume=resume,
            real=real,
            prepare=prepare or partial(_check_planned, described),
            on_message=on_message,
        )


def _check_planned(machine: Machine, test: PlannedTest) -> None:
    """Raise RigtwinError unless a planned test can be run."""
    experiment = find_experiment(machine, test.experiment)
    configuration = check_settings(machine, experiment.configuration, test.changes)
    # Demands are computed as well, since a mistake in them shows only then.
    experiment.demands(configuration, test.seed)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Make and lock a session's folder. Raises RigtwinError if another session has locked it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RigtwinError(f"cannot make {folder}: {error.strerror}") from None
    try:
        held = open_alone(folder / LOCK)
    except OSError as error:
        raise RigtwinError(f"cannot write {folder / LOCK}: {error.strerror}") from None
    except RigtwinError:
        raise RigtwinError(
            f"another session is running into {folder}; wait for it, or name another folder"
        ) from None
    # The lock ends with the file, also if this program is killed.
    with held:
        yield


def _run_tests(
    tests: Sequence[PlannedTest],
    folder: Path,
    run: Callable[[PlannedTest, Path], bool],
    resume: bool,
    real: bool,
    prepare: Callable[[PlannedTest], object],
    on_message: Callable[[str], object],
) -> bool:
    paths = {test.name: folder / f"{test.name}.mcap" for test in tests}
    todo = [test for test in tests if not (resume and is_complete(paths[test.name], real))]
    taken = [test.name for test in todo if paths[test.name].exists()]
    if taken and not resume:
        raise RigtwinError(
            f"{folder} holds {taken[0]}.mcap already; resume it, or name another folder"
        )
    # All tests are checked before the first one moves anything: a list that stops halfway because
    # of a typing error wastes the time on the rig.
    for test in todo:
        prepare(test)
    if len(todo) < len(tests):
        on_message(f"{len(tests) - len(todo)} of {len(tests)} tests are done already")
    for test in todo:
        if test.pause:
            on_message(f"pause of {test.pause:g} s before {test.name}")
            time.sleep(test.pause)
        path = paths[test.name]
        # An incomplete recording may still be worth a look, so it is renamed, not overwritten.
        aside = move_aside(path)
        completed = run(test, path)
        if aside is not None:
            on_message(f"the previous recording is in {aside}")
        if not completed:
            on_message(f"{test.name} did not complete; see {path}, then resume")
            return False
    return True
