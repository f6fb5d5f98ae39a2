"""Campaign of faults in sessions on the virtual card."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments import find
from rigtwin.api.twin import Settings
from rigtwin.description.changes import with_changes
from rigtwin.description.control import set_up
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq import CARD
from rigtwin.hardware.daq.driver import require_client
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.table_file import load_table
from rigtwin.hardware.faults.campaign import draw_faults, try_fault
from rigtwin.hardware.faults.kinds import KINDS
from rigtwin.hardware.faults.outcome import FaultResult, InjectedFault
from rigtwin.hardware.faults.processes import try_process_fault
from rigtwin.hardware.session.custom_controller import (
    ControllerFactory,
    CustomController,
    custom_controller,
)
from rigtwin.simulation.experiment import Experiment

MOST = 1000
"""Largest number of sessions per kind of fault."""


@dataclass(frozen=True)
class Campaign:
    """Results of faults in sessions on the virtual card.

    Attributes
    ----------
    results : tuple of FaultResult
        Outcome of every session.
    undone : tuple of str
        Sessions that this computer could not run, with the reason.
    drawn : int
        Number of planned sessions.
    interrupted : bool
        Whether the user ended the campaign early.
    """

    results: tuple[FaultResult, ...]
    undone: tuple[str, ...]
    drawn: int
    interrupted: bool = False

    @property
    def failed(self) -> tuple[FaultResult, ...]:
        """Return the results of sessions that were not stopped as required."""
        return tuple(result for result in self.results if not result.ok)


def faults(
    *,
    seed: int = 0,
    per_kind: int = 11,
    per_process_kind: int = 4,
    card: str | Path = CARD,
    controller: ControllerFactory | None = None,
    settings: Settings = (),
    progress: Callable[[str, int, int], object] = lambda *_: None,
) -> Campaign:
    """Inject faults into sessions on the virtual card, and check that every session is stopped.

    After an interruption (Ctrl-C) the results so far are returned.

    Parameters
    ----------
    seed
        Seed of the faults' times, tests and places, at least 0.
    per_kind
        Number of sessions for each kind of fault within one process, 0 to 1000.
    per_process_kind
        Number of sessions for each kind of fault that kills or stops a process, 0 to 1000.
    card
        Channel table, TOML. Defaults to the shipped one.
    controller
        Function of a test's configuration that returns a custom controller. It is used in the
        sessions in which no process is killed.
    settings
        Changes of every session's settings, such as a compensator of the plate's delay.
    progress
        Function called with the kind of the next fault, the number of finished faults and their
        total.

    Returns
    -------
    Campaign
        Outcome of every session.

    Raises
    ------
    RigtwinError
        For a number out of range, an invalid setting, a mistake in the table, or a missing package.
    """
    require_client()
    _require_counts(seed, per_kind, per_process_kind)
    channels = load_table(Path(card))
    custom = None if controller is None else custom_controller(controller)
    todo = _draw(seed, per_kind, per_process_kind)
    # A dictionary: each experiment's test is built once, however many faults use it.
    tests = {
        name: replace(test, configuration=with_changes(test.configuration, settings))
        for name, test in ((fault.experiment, find(fault.experiment)) for fault in todo)
    }
    # Settings that the controller refuses are found before the first session starts.
    for test in tests.values():
        set_up(test.configuration.controller, test.configuration.timing.period)
    return _run_sessions(todo, tests, channels, custom, progress)


def _require_counts(seed: int, per_kind: int, per_process_kind: int) -> None:
    """Raise RigtwinError for a seed or numbers of sessions out of range."""
    if seed < 0:
        raise RigtwinError(f"seed {seed}: expected 0 or more")
    for name, number in {
        "per_kind (--each)": per_kind,
        "per_process_kind (--processes)": per_process_kind,
    }.items():
        if not 0 <= number <= MOST:
            raise RigtwinError(f"{name} {number}: expected 0 to {MOST}")
    if per_kind == per_process_kind == 0:
        raise RigtwinError(
            "no session to run: expected per_kind (--each) or per_process_kind (--processes)"
        )


def _run_sessions(
    todo: Sequence[InjectedFault],
    tests: Mapping[str, Experiment],
    channels: ChannelTable,
    controller: CustomController | None,
    progress: Callable[[str, int, int], object],
) -> Campaign:
    """Run a session for each fault, until all are done or the operator interrupts."""
    results, undone, interrupted = list[FaultResult](), list[str](), False
    with TemporaryDirectory(prefix="rigtwin-faults-") as folder:
        try:
            for number, fault in enumerate(todo):
                progress(fault.kind.name, number, len(todo))
                session = fault, tests[fault.experiment], channels, Path(folder)
                try:
                    if fault.kind.place == "process":
                        results.append(try_process_fault(*session))
                    else:
                        results.append(try_fault(*session, controller))
                # A session that could not be run is reported, and does not end the campaign.
                except RigtwinError as error:
                    undone.append(f"{fault.kind.name}, seed {fault.seed}: {error}")
        except KeyboardInterrupt:
            interrupted = True
            undone.append(f"interrupted after {len(results)} of {len(todo)}")
    return Campaign(tuple(results), tuple(undone), len(todo), interrupted)


def _draw(seed: int, per_kind: int, per_process_kind: int) -> list[InjectedFault]:
    """Draw the faults of a campaign, those within one process first."""
    within = [kind for kind in KINDS if kind.place != "process"]
    killing = [kind for kind in KINDS if kind.place == "process"]
    return [
        *draw_faults(per_kind * len(within), seed, within),
        # Another seed, or the two draws would be the same random numbers.
        *draw_faults(per_process_kind * len(killing), seed + 1, killing),
    ]
