"""Tests under supervision: on the rig's card, on its virtual copy, or on the twin behind the card's
converters; one test, or a list of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from machines import DEFAULT_MACHINE
from rigtwin.api.machines import Effects, Settings, effect_texts, resolve_machine
from rigtwin.api.recordings import Recording, load
from rigtwin.description.changes import read_toml, with_changes
from rigtwin.description.configuration import Configuration
from rigtwin.description.limits import require_order
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import recordable
from rigtwin.hardware.daq import CARD
from rigtwin.hardware.daq.table import load_table
from rigtwin.hardware.daq.wired import InRealTime, WiredTwin
from rigtwin.hardware.session.custom_controller import ControllerFactory, custom_controller
from rigtwin.hardware.session.dry_run import add_dry_run
from rigtwin.hardware.session.permission import key_of, list_obstacles, require_permission
from rigtwin.hardware.session.plan import PlannedTest, is_complete, move_aside, parse_plan
from rigtwin.hardware.session.record import (
    open_virtual_card,
    record_in_real_time,
    record_unpaced,
)
from rigtwin.hardware.session.stops import stop_requests
from rigtwin.hardware.session.test import AnyTest
from rigtwin.hardware.supervision import SessionEnd
from rigtwin.hardware.supervisor import COMPLETED
from rigtwin.recording.owner import open_alone
from rigtwin.simulation.experiment import Experiment, find_experiment
from rigtwin.simulation.peaks import Peak

PORTS = 65535
LOCK = "session.lock"
"""In a session's folder; who holds it runs into that folder alone."""
Stop = Callable[[], str | None]
"""Called in every tick; a text ends the test and is its reason."""


@contextmanager
def _stopped_by(stop: Stop | None, file: str | Path | None) -> Iterator[Stop]:
    """By what a test is stopped: a function, or the operator's keys, signals and file."""
    if stop is not None:
        yield stop
    else:
        with stop_requests(None if file is None else Path(file)) as requests:
            yield requests


@dataclass(frozen=True)
class SessionResult:
    """A test under supervision. path: of its recording; ticks: that were recorded; cause: why it
    ended, in words; completed: whether that was its end."""

    path: Path
    ticks: int
    cause: str
    completed: bool


@dataclass(frozen=True)
class DryRun:
    """A session on the virtual card. cause: why it ended, in words; passed: whether that was its
    end, so that the rig may be armed for it; peaks: how near it comes to every limit; obstacles:
    what would keep it off the rig besides, a line each."""

    recording: Recording | None
    cause: str
    passed: bool
    peaks: tuple[Peak, ...]
    obstacles: tuple[str, ...]


def plan_test(
    experiment: str,
    *,
    machine: Machine | str | Path = DEFAULT_MACHINE,
    card: str | Path | None = None,
    settings: Settings = (),
    seed: int = 0,
    effects: Effects = (),
    controller: ControllerFactory | None = None,
) -> AnyTest:
    """A test ready to be run under supervision.

    Parameters
    ----------
    experiment
        Its name.
    machine
        Whose, by name or description; another than the suspension rig is moved by force actuators
        and servos alone.
    card
        The channel table, TOML; of the suspension rig by default the shipped one.
    settings
        Changes, {"safety": {"force": 1200}}, or a TOML file that holds them, or several.
    seed
        Of the twin's noise, and of the road.
    effects
        What the twin has besides; the machine has its own.
    controller
        A function of the test's configuration that makes one of your own instead of the machine's,
        see `run`; a new one for each session.

    Raises
    ------
    RigtwinError
        For any mistake in these.
    """
    if not isinstance(seed, int) or seed < 0:
        raise RigtwinError(f"seed {seed!r:.60}: expected a whole number from 0")
    on = resolve_machine(machine)
    found = find_experiment(on, experiment)
    configuration = check_settings(on, found.configuration, settings)
    own = None if controller is None else custom_controller(controller)
    told = tuple(effect_texts(effects))
    physics = on.physics
    path = physics.card if card is None else Path(card)
    if path is None:
        raise RigtwinError(f"{on.name}: no channel table; expected that of the card it is on")
    table = load_table(path, physics.signals(on))
    return physics.plan(on, found, configuration, seed, table, told, own)


def check_settings(machine: Machine, base: Configuration, changes: Settings) -> Configuration:
    """The settings of a test that can be run. Raises RigtwinError for one that cannot."""
    configuration = with_changes(base, changes)
    require_order(machine, configuration)
    _ = configuration.ticks, configuration.substeps
    return configuration


def dry_run(
    experiment: str,
    card: str | Path,
    *,
    path: str | Path,
    machine: Machine | str | Path = DEFAULT_MACHINE,
    settings: Settings = (),
    seed: int = 0,
    controller: ControllerFactory | None = None,
    effects: Effects = (),
    progress: Callable[[int], object] = lambda _: None,
    stop: Stop | None = None,
    stop_file: str | Path | None = None,
) -> DryRun:
    """Runs the exact session of a test on the virtual card, before the machine is armed for it.

    A session that passes is noted beside the channel table; the machine is armed by a person, for
    just what has passed.

    Parameters
    ----------
    experiment, machine, card, settings, seed, controller, effects
        As of `run_on_card`; with any effects, or with the shipped table, nothing is noted.
    path
        Of the recording.
    progress
        Called with the ticks that were done since its last call.
    stop, stop_file
        Gives a reason to end the session; by default it ends at a key, at a signal such as
        Ctrl-C's, or when that file appears.

    Raises
    ------
    RigtwinError
        For what the session could not be run with on the rig either.
    """
    test = plan_test(
        experiment,
        machine=machine,
        card=card,
        settings=settings,
        seed=seed,
        effects=effects,
        controller=controller,
    )
    virtual, _ = open_virtual_card(test)
    with _stopped_by(stop, stop_file) as asked:
        ended = record_unpaced(virtual, test, Path(path), asked, progress)
    recording = load(Path(path)) if ended.ticks else None
    passed = ended.cause == COMPLETED
    peaks = test.predict_peaks(recording) if recording is not None else ()
    # The shipped table arms nothing, and where it lies nothing is written.
    shipped = Path(card).resolve().parent == CARD.resolve().parent
    if passed and not test.effects and not shipped:
        said = {"experiment": test.experiment, "date": date.today().isoformat()}
        add_dry_run(Path(card), key_of(test), said)
    return DryRun(recording, ended.cause.reason, passed, peaks, list_obstacles(test))


def run_on_twin(
    experiment: str,
    *,
    path: str | Path,
    machine: Machine | str | Path = DEFAULT_MACHINE,
    card: str | Path | None = None,
    real_time: bool = False,
    settings: Settings = (),
    seed: int = 0,
    controller: ControllerFactory | None = None,
    effects: Effects = (),
    live: int = 0,
    progress: Callable[[int], object] = lambda _: None,
    stop: Stop | None = None,
    stop_file: str | Path | None = None,
) -> SessionResult:
    """Runs a test under supervision on the twin, behind the card's converters.

    Parameters
    ----------
    experiment, machine, card, settings, seed, controller, effects
        As of `plan_test`.
    path
        Of the recording.
    real_time
        At the pace of the clock, or as fast as it goes.
    live
        Port of a live view; 0 for none.
    progress
        Called with the ticks that were done since its last call.
    stop, stop_file
        As of `dry_run`.

    Raises
    ------
    RigtwinError
        Before anything is run.
    """
    _require_port(live)
    test = plan_test(
        experiment,
        machine=machine,
        card=card,
        settings=settings,
        seed=seed,
        effects=effects,
        controller=controller,
    )
    twin = WiredTwin(test.terminals(), test.table)
    with _stopped_by(stop, stop_file) as asked:
        if real_time:
            timed = InRealTime(twin, test.period)
            ended = record_in_real_time(
                timed, test, recordable(path), asked, guarded=False, live=live, progress=progress
            )
        else:
            ended = record_unpaced(twin, test, recordable(path), asked, progress)
    return _result(Path(path), ended)


def run_on_card(
    experiment: str,
    card: str | Path,
    *,
    path: str | Path,
    arm: Callable[[AnyTest], bool],
    machine: Machine | str | Path = DEFAULT_MACHINE,
    without_dry_run: str | None = None,
    settings: Settings = (),
    seed: int = 0,
    controller: ControllerFactory | None = None,
    live: int = 0,
    progress: Callable[[int], object] = lambda _: None,
    stop: Stop | None = None,
    stop_file: str | Path | None = None,
) -> SessionResult | None:
    """Runs a test on the machine itself.

    Parameters
    ----------
    experiment, machine, settings, seed, controller
        As of `plan_test`.
    card
        The channel table that somebody answers for.
    path
        Of the recording.
    arm
        Asks whoever stands at it whether everybody is clear of it. Nothing has moved when it
        is called, and nothing moves if it says no.
    without_dry_run
        Who answers for it that there was no dry run of just this, if there was none.
    live
        Port of a live view; 0 for none.
    progress
        Called with the ticks that were done since its last call.
    stop, stop_file
        As of `dry_run`.

    Returns
    -------
    SessionResult or None
        How it ended; None if it was not armed.

    Raises
    ------
    RigtwinError
        If the test must not be run on it, before anything moves.
    """
    _require_port(live)
    test = plan_test(
        experiment,
        machine=machine,
        card=card,
        settings=settings,
        seed=seed,
        controller=controller,
    )
    permission = require_permission(test, Path(card), without_dry_run)
    if not arm(test):
        return None
    with _stopped_by(stop, stop_file) as asked:
        ended = record_in_real_time(
            permission.card,
            test,
            Path(path),
            asked,
            guarded=True,
            notes=permission.notes,
            live=live,
            progress=progress,
        )
    return _result(Path(path), ended)


def run_session(
    plan: str | Path,
    folder: str | Path,
    run: Callable[[PlannedTest, Path], bool],
    *,
    machine: Machine | str | Path = DEFAULT_MACHINE,
    resume: bool = False,
    real: bool = False,
    prepare: Callable[[PlannedTest], object] | None = None,
    told: Callable[[str], object] = lambda _: None,
) -> bool:
    """Runs a list of tests, up to the first that does not complete.

    Parameters
    ----------
    plan
        The list, TOML.
    folder
        Of the recordings.
    run
        Runs one test into a recording, by `run_on_twin`, `run_on_card` or, of any machine,
        `rigtwin.run`; whether it completed.
    machine
        Whose experiments the list names.
    resume
        Whether to leave out what has completed already.
    real
        Whether only a recording of the rig itself counts as that.
    prepare
        Called with every test before the first is run; raises for one that cannot be. By default
        that is one whose settings the machine does not have.
    told
        Called with a line for people.

    Returns
    -------
    bool
        Whether all completed.

    Raises
    ------
    RigtwinError
        For a mistake in any test of the list, or a folder into which another session runs, before
        anything moves.
    """
    folder, on = Path(folder), resolve_machine(machine)

    def find_test(name: str) -> Experiment:
        return find_experiment(on, name)

    def check(test: PlannedTest) -> object:
        experiment = find_test(test.experiment)
        configuration = check_settings(on, experiment.configuration, test.changes)
        return experiment.demands(configuration, test.seed)

    tests = read_toml(Path(plan), lambda tables: parse_plan(tables, find_test))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RigtwinError(f"cannot make {folder}: {error.strerror}") from None
    with _alone(folder):
        return _run_tests(
            tests=tests,
            folder=folder,
            run=run,
            resume=resume,
            real=real,
            prepare=prepare or check,
            told=told,
        )


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Keeps a folder for this session while it runs. Raises RigtwinError if another one runs into
    it."""
    try:
        held = open_alone(folder / LOCK)
    except OSError as error:
        raise RigtwinError(f"cannot write {folder / LOCK}: {error.strerror}") from None
    except RigtwinError:
        raise RigtwinError(
            f"another session is running into {folder}; wait for it, or name another folder"
        ) from None
    with held:
        yield


def _run_tests(
    tests: Sequence[PlannedTest],
    folder: Path,
    run: Callable[[PlannedTest, Path], bool],
    resume: bool,
    real: bool,
    prepare: Callable[[PlannedTest], object],
    told: Callable[[str], object],
) -> bool:
    paths = {test.name: folder / f"{test.name}.mcap" for test in tests}
    todo = [test for test in tests if not (resume and is_complete(paths[test.name], real))]
    taken = [test.name for test in todo if paths[test.name].exists()]
    if taken and not resume:
        raise RigtwinError(
            f"{folder} holds {taken[0]}.mcap already; resume it, or name another folder"
        )
    # Every mistake is found before the first test moves anything.
    for test in todo:
        prepare(test)
    if len(todo) < len(tests):
        told(f"{len(tests) - len(todo)} of {len(tests)} tests are done already")
    for test in todo:
        if test.pause:
            told(f"pause of {test.pause:g} s before {test.name}")
            time.sleep(test.pause)
        path = paths[test.name]
        aside = move_aside(path)
        completed = run(test, path)
        if aside is not None:
            told(f"what was there before is in {aside}")
        if not completed:
            told(f"{test.name} did not complete; see {path}, then resume")
            return False
    return True


def _result(path: Path, ended: SessionEnd) -> SessionResult:
    return SessionResult(path, ended.ticks, ended.cause.reason, ended.cause == COMPLETED)


def _require_port(live: int) -> None:
    if not isinstance(live, int) or not 0 <= live <= PORTS:
        raise RigtwinError(f"live {live!r:.40}: expected a port up to {PORTS}")
