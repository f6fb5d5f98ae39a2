"""A supervised test on the rig's card, on a virtual card, or on the twin behind a card.

`plan_test` reads a test, `dry_run` rehearses it, `run_on_twin` and `run_on_card` run it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from machines import DEFAULT_MACHINE
from rigtwin.api.planning import plan_test
from rigtwin.api.twin import Effects, Settings
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import recordable
from rigtwin.hardware.daq.wired import InRealTime, WiredTwin
from rigtwin.hardware.session.custom_controller import ControllerFactory
from rigtwin.hardware.session.permission import require_permission
from rigtwin.hardware.session.record import record_in_real_time, record_unpaced
from rigtwin.hardware.session.stops import stop_requests
from rigtwin.hardware.session.test import AnyTest
from rigtwin.hardware.supervision import SessionEnd
from rigtwin.hardware.supervisor import COMPLETED

PORTS = 65535
Stop = Callable[[], str | None]
"""Function called in every tick. A returned text ends the test and is recorded as its reason."""


@contextmanager
def stopped_by(stop: Stop | None, file: str | Path | None) -> Iterator[Stop]:
    """Yield the function that may stop a test.

    Parameters
    ----------
    stop
        Function called in every tick. None lets the operator's keys, signals and file stop it.
    file
        File whose appearance stops the test.
    """
    if stop is not None:
        yield stop
    else:
        with stop_requests(None if file is None else Path(file)) as requests:
            yield requests


@dataclass(frozen=True)
class SessionResult:
    """Result of a supervised test.

    Attributes
    ----------
    path : Path
        File of the recording.
    ticks : int
        Number of recorded ticks.
    cause : str
        Reason why the test ended, in words.
    completed : bool
        Whether the test reached its planned end.
    """

    path: Path
    ticks: int
    cause: str
    completed: bool


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
    """Run a supervised test on the twin, behind the card's converters.

    Parameters
    ----------
    experiment, machine, card, settings, seed, controller, effects
        Test to run, see `plan_test`.
    path
        File of the recording, MCAP.
    real_time
        Whether the twin keeps pace with the clock. By default it runs as fast as possible.
    live
        Port of a live view for Foxglove; 0, the default, opens none.
    progress, stop, stop_file
        Report of progress, and reasons to end the test, see `dry_run`.

    Returns
    -------
    SessionResult
        Recording, and the reason why the test ended.

    Raises
    ------
    RigtwinError
        For a mistake in any argument, before the test starts.
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
    with stopped_by(stop, stop_file) as asked:
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
    """Run a test on the machine itself.

    Parameters
    ----------
    experiment, machine, settings, seed, controller
        Test to run, see `plan_test`.
    card
        Channel table of the card, calibrated and signed by an operator.
    path
        File of the recording, MCAP.
    arm
        Function that asks the operator whether everybody is clear of the machine. It is called
        before anything moves, and nothing moves unless it returns True.
    without_dry_run
        Name of the person responsible for a test without a passed dry run. It is recorded.
    live
        Port of a live view for Foxglove; 0, the default, opens none.
    progress
        Function called with the number of ticks since its last call.
    stop, stop_file
        Reasons to end the test, see `dry_run`.

    Returns
    -------
    SessionResult or None
        Recording, and the reason why the test ended. None if the machine was not armed.

    Raises
    ------
    RigtwinError
        If the test is not permitted on this machine, before anything moves.
    """
    _require_port(live)
    test = plan_test(
        experiment, machine=machine, card=card, settings=settings, seed=seed, controller=controller
    )
    permission = require_permission(test, Path(card), without_dry_run)
    if not arm(test):  # A person is asked last: after arming, the rig moves.
        return None
    with stopped_by(stop, stop_file) as asked:
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


def _result(path: Path, ended: SessionEnd) -> SessionResult:
    return SessionResult(path, ended.ticks, ended.cause.reason, ended.cause == COMPLETED)


def _require_port(live: int) -> None:
    if not isinstance(live, int) or not 0 <= live <= PORTS:
        raise RigtwinError(f"live {live!r:.40}: expected a port, 0 to {PORTS}")
