"""Dry run of a test on the twin with the session's own supervision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from machines import DEFAULT_MACHINE
from rigtwin.api.planning import plan_test
from rigtwin.api.recordings import Recording, load
from rigtwin.api.supervised import Stop, stopped_by
from rigtwin.api.twin import Effects, Settings
from rigtwin.description.machine import Machine
from rigtwin.hardware.daq import CARD
from rigtwin.hardware.session.custom_controller import ControllerFactory
from rigtwin.hardware.session.dry_run import add_dry_run
from rigtwin.hardware.session.permission import key_of, list_obstacles
from rigtwin.hardware.session.record import open_virtual_card, record_unpaced
from rigtwin.hardware.session.test import AnyTest
from rigtwin.hardware.supervision import SessionEnd
from rigtwin.hardware.supervisor import COMPLETED
from rigtwin.simulation.peaks import Peak


@dataclass(frozen=True)
class DryRun:
    """Result of a session on the virtual card.

    Attributes
    ----------
    recording : Recording or None
        Recording of the session; None if it ended before the first tick.
    cause : str
        Reason why the session ended, in words.
    passed : bool
        True if the session reached its planned end. Only then may the rig be armed for this test.
    peaks : tuple of Peak
        Predicted peak of each limited quantity, with its limit and margin.
    obstacles : tuple of str
        Further reasons that prevent the test on the rig, one line each.
    """

    recording: Recording | None
    cause: str
    passed: bool
    peaks: tuple[Peak, ...]
    obstacles: tuple[str, ...]


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
    """Run the exact session of a test on the virtual card, before the machine is armed for it.

    A session that passes is noted beside the channel table. The machine can then be armed by a
    person, for exactly this test.

    Parameters
    ----------
    experiment, machine, card, settings, seed, controller
        Test to rehearse, see `plan_test`. With the shipped channel table nothing is noted.
    effects
        Effects added to the twin. With any effect nothing is noted.
    path
        File of the recording, MCAP.
    progress
        Function called with the number of ticks since its last call.
    stop
        Function that returns a reason to end the session, or None. By default the session ends at
        a key, or at a signal such as Ctrl-C's.
    stop_file
        File whose appearance ends the session, unless `stop` is given.

    Returns
    -------
    DryRun
        Reason of the end, the recording, and the margin to every limit.

    Raises
    ------
    RigtwinError
        If the test could not be run on the machine either.
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
    with stopped_by(stop, stop_file) as asked:
        ended = record_unpaced(open_virtual_card(test)[0], test, Path(path), asked, progress)
    if ended.cause == COMPLETED and not test.effects:
        _note_dry_run(test, Path(card))
    return _judge_dry_run(test, Path(path), ended)


def _judge_dry_run(test: AnyTest, path: Path, ended: SessionEnd) -> DryRun:
    # A session that ended before its test has no ticks, and cannot be loaded.
    recording = load(path) if ended.ticks else None
    peaks = test.predict_peaks(recording) if recording is not None else ()
    passed = ended.cause == COMPLETED
    return DryRun(recording, ended.cause.reason, passed, peaks, list_obstacles(test))


def _note_dry_run(test: AnyTest, card: Path) -> None:
    """Note a passed dry run beside the channel table."""
    # The shipped table arms nothing, and its folder may be read-only.
    if card.resolve().parent != CARD.resolve().parent:
        note = {"experiment": test.experiment, "date": date.today().isoformat()}
        add_dry_run(card, key_of(test), note)
