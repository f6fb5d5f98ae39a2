"""Faults in sessions on the virtual card."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments import find
from rigtwin.api.machines import Settings
from rigtwin.description.changes import with_changes
from rigtwin.description.control import set_up
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq import CARD
from rigtwin.hardware.daq.card import require_client
from rigtwin.hardware.daq.table import load_table
from rigtwin.hardware.faults.campaign import FaultResult, InjectedFault, draw_faults, try_fault
from rigtwin.hardware.faults.kinds import KINDS
from rigtwin.hardware.faults.processes import try_process_fault
from rigtwin.hardware.session.custom_controller import ControllerFactory, custom_controller

MOST = 1000


@dataclass(frozen=True)
class Campaign:
    """What faults did in sessions on the virtual card. undone: those that this computer could not
    run, in words; drawn: how many there were to be; interrupted: whether somebody ended it."""

    results: tuple[FaultResult, ...]
    undone: tuple[str, ...]
    drawn: int
    interrupted: bool = False

    @property
    def failed(self) -> tuple[FaultResult, ...]:
        """Those whose session did not end as it must."""
        return tuple(result for result in self.results if not result.ok)


def faults(
    *,
    seed: int = 0,
    each: int = 11,
    processes: int = 4,
    card: str | Path = CARD,
    controller: ControllerFactory | None = None,
    settings: Settings = (),
    progress: Callable[[str, int, int], object] = lambda *_: None,
) -> Campaign:
    """Puts faults into sessions on the virtual card, and sees whether each is stopped.

    Interrupted, it gives back what was done.

    Parameters
    ----------
    seed
        Of the faults' times, tests and places.
    each, processes
        Sessions of each kind in one process, and of each kind that kills a process.
    card
        The channel table.
    controller
        A function of a test's configuration that makes one of your own instead of the rig's, in the
        sessions that no process is killed in.
    settings
        Changes of every session's settings, such as a compensator of the plate.
    progress
        Called with the kind that begins, the faults done and how many there are.

    Raises
    ------
    RigtwinError
        For a number or a setting that makes no sense, a mistake in the table, or a missing package.
    """
    require_client()
    if seed < 0:
        raise RigtwinError(f"seed {seed}: expected 0 or more")
    for name, number in {"each": each, "processes": processes}.items():
        if not 0 <= number <= MOST:
            raise RigtwinError(f"{name} {number}: expected 0 to {MOST}")
    if each == processes == 0:
        raise RigtwinError("each 0, processes 0: no session to run; expected 1 or more of one")
    channels = load_table(Path(card))
    own = None if controller is None else custom_controller(controller)
    todo = _draw(seed, each, processes)
    tests = {
        name: replace(found, configuration=with_changes(found.configuration, settings))
        for name, found in ((fault.experiment, find(fault.experiment)) for fault in todo)
    }
    for test in tests.values():
        set_up(test.configuration.controller, test.configuration.timing.period)
    results, undone, interrupted = list[FaultResult](), list[str](), False
    with TemporaryDirectory(prefix="rigtwin-faults-") as folder:
        try:
            for number, fault in enumerate(todo):
                progress(fault.kind.name, number, len(todo))
                asked = fault, tests[fault.experiment], channels, Path(folder)
                try:
                    if fault.kind.place == "process":
                        results.append(try_process_fault(*asked))
                    else:
                        results.append(try_fault(*asked, own))
                except RigtwinError as error:
                    undone.append(f"{fault.kind.name}, seed {fault.seed}: {error}")
        except KeyboardInterrupt:
            interrupted = True
            undone.append(f"interrupted after {len(results)} of {len(todo)}")
    return Campaign(tuple(results), tuple(undone), len(todo), interrupted)


def _draw(seed: int, each: int, processes: int) -> list[InjectedFault]:
    here = [kind for kind in KINDS if kind.place != "process"]
    apart = [kind for kind in KINDS if kind.place == "process"]
    return [
        *draw_faults(each * len(here), seed, here),
        *draw_faults(processes * len(apart), seed + 1, apart),
    ]
