"""Sessions on the card, as far as they can be run without a rig."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments import find
from rigtwin.api.machines import Effects, Settings, effect_texts
from rigtwin.api.recordings import Recording, load
from rigtwin.description.changes import with_changes
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq import CARD
from rigtwin.hardware.daq.card import require_client
from rigtwin.hardware.daq.table import load_table, require_trust
from rigtwin.hardware.faults.campaign import Fault, FaultResult, draw_faults, try_fault
from rigtwin.hardware.faults.kinds import KINDS
from rigtwin.hardware.faults.processes import try_process_fault
from rigtwin.hardware.session.dry_run import Peak, digest, enter, predict_peaks
from rigtwin.hardware.session.record import (
    Test,
    open_card,
    open_virtual_card,
    record_at_leisure,
)
from rigtwin.hardware.supervisor import COMPLETED

MOST = 1000


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


def dry_run(
    experiment: str,
    card: str | Path,
    *,
    path: str | Path,
    settings: Settings = (),
    seed: int = 0,
    effects: Effects = (),
    progress: Callable[[int], object] = lambda _: None,
    stop: Callable[[], str | None] = lambda: None,
) -> DryRun:
    """Runs the exact session of a test on the suspension rig on the virtual card, before the rig is
    armed for it.

    A session that passes is noted beside the channel table; the rig is armed by a person at a
    terminal, for just what has passed.

    Parameters
    ----------
    experiment
        Its name.
    card
        The channel table, TOML.
    path
        Of the recording.
    settings
        Changes, {"safety": {"force": 1200}}, or a TOML file that holds them.
    seed
        Of the virtual rig's noise, and of the road.
    effects
        What the virtual rig has besides; with any, nothing is noted.
    progress
        Called with the ticks that were done since its last call.
    stop
        Gives a reason to end the session.

    Raises
    ------
    RigtwinError
        For what the session could not be run with on the rig either.
    """
    found = find(experiment)
    configuration = with_changes(found.configuration, settings)
    demands = found.demands(configuration, seed)
    table, texts = load_table(Path(card)), effect_texts(effects)
    return rehearse(
        Test(found.name, configuration, demands, seed, table, texts),
        Path(card),
        Path(path),
        progress,
        stop,
    )


def rehearse(
    test: Test,
    card: Path,
    path: Path,
    progress: Callable[[int], object],
    stop: Callable[[], str | None],
) -> DryRun:
    """The dry run of a test that is ready. card: where it is noted; path: of its recording."""
    virtual, _ = open_virtual_card(test)
    ended = record_at_leisure(virtual, test, path, stop, progress)
    recording = load(path) if ended.ticks else None
    passed = ended.cause == COMPLETED
    peaks = predict_peaks(recording, test.card_configuration) if recording is not None else ()
    if passed and not test.effects:
        said = {"experiment": test.experiment, "date": date.today().isoformat()}
        enter(card, key_of(test), said)
    return DryRun(recording, ended.cause.reason, passed, peaks, tuple(_obstacles(test)))


def key_of(test: Test) -> str:
    """By which a dry run of just this session is known."""
    return digest(test.experiment, test.configuration, test.demands, test.table)


def _obstacles(test: Test) -> list[str]:
    lacking: list[str] = []
    for look in (lambda: require_trust(test.table, date.today()), lambda: open_card(test)):
        try:
            look()
        except RigtwinError as error:
            lacking.append(str(error))
    return lacking


@dataclass(frozen=True)
class Campaign:
    """What faults did in sessions on the virtual card. undone: those that this computer could not
    run, in words; drawn: how many there were to be."""

    results: tuple[FaultResult, ...]
    undone: tuple[str, ...]
    drawn: int

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
    progress
        Called with the kind that begins, the faults done and how many there are.

    Raises
    ------
    RigtwinError
        For a number that makes no sense, a mistake in the table, or a missing package.
    """
    require_client()
    if seed < 0 or not 0 <= each <= MOST or not 0 <= processes <= MOST:
        raise RigtwinError(f"--seed: expected 0 or more; --each and --processes: 0 to {MOST}")
    channels = load_table(Path(card))
    todo = _draw(seed, each, processes)
    results, undone = list[FaultResult](), list[str]()
    with TemporaryDirectory(prefix="rigtwin-faults-") as folder:
        try:
            for number, fault in enumerate(todo):
                progress(fault.kind.name, number, len(todo))
                run = try_process_fault if fault.kind.place == "process" else try_fault
                try:
                    results.append(run(fault, find(fault.experiment), channels, Path(folder)))
                except RigtwinError as error:
                    undone.append(f"{fault.kind.name}, seed {fault.seed}: {error}")
        except KeyboardInterrupt:
            undone.append(f"interrupted after {len(results)} of {len(todo)}")
    return Campaign(tuple(results), tuple(undone), len(todo))


def _draw(seed: int, each: int, processes: int) -> list[Fault]:
    here = [kind for kind in KINDS if kind.place != "process"]
    apart = [kind for kind in KINDS if kind.place == "process"]
    return [
        *draw_faults(each * len(here), seed, here),
        *draw_faults(processes * len(apart), seed + 1, apart),
    ]
