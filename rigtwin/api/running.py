"""A test on a machine's twin."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rigtwin.api.machines import Effects, Settings, effect_texts, the_machine
from rigtwin.api.recordings import Recording, faced
from rigtwin.description.changes import with_changes
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.files import forbid_overwriting, recordable
from rigtwin.recording import reader
from rigtwin.simulation.experiment import Demands, Experiment, find_experiment
from rigtwin.simulation.loop import TickController

Demanding = Callable[[Configuration, int], Demands]
"""An experiment of one's own: what is demanded of the machine for (settings, seed)."""


def run(
    on: Machine | str | Path,
    experiment: str | Experiment | Demanding,
    *,
    seed: int = 0,
    effects: Effects = (),
    effects_from: float = 0.0,
    settings: Settings = (),
    controller: TickController | Callable[..., Any] | None = None,
    path: str | Path | None = None,
    progress: Callable[[int], object] = lambda _ticks: None,
) -> Recording:
    """Runs a test on a machine's twin.

    Parameters
    ----------
    on
        The machine, its name or its description's path, see `machine`; also a corrected one,
        `Diagnosis.machine`.
    experiment
        Its name among `experiments`, an `Experiment`, or a function that gives the demands.
    seed
        Of the excitation and of the sensors' noise; the same seed gives the same recording.
    effects
        What the twin has and its operator does not know of.
    effects_from
        s of the test from when on it has them; the suspension rig alone.
    settings
        Changes of what the operator knows.
    controller
        One of your own instead of the machine's: an object with `tick(measured, demand)`, or a
        function, compiled or not; it returns `controllers.Commands` on the suspension rig, the
        actuator's command on any other machine, for measurements and demands by name.
    path
        Where to record; by default nowhere but in memory.
    progress
        Called with the ticks done since its last call.

    Raises
    ------
    RigtwinError
        If anything asked for is not known or not allowed, before the test starts.
    """
    if not isinstance(seed, int) or seed < 0:
        raise RigtwinError(f"seed {seed!r:.60}: expected a whole number from 0")
    if controller is not None and not callable(getattr(controller, "tick", controller)):
        raise RigtwinError(f"controller {controller!r:.60}: expected a function, or a method tick")
    on = the_machine(on)
    if not 0.0 <= effects_from < math.inf:
        raise RigtwinError(f"effects from {effects_from:g} s: expected 0 s or more")
    if effects_from and not on.physics.delays_effects:
        raise RigtwinError(
            f"{on.name}: `effects_from`: the twin of {on.physics.title} takes effects "
            "from the start only"
        )
    if effects_from and not effects:
        raise RigtwinError(f"`effects_from` = {effects_from:g} s requires `effects`")
    test = _experiment(on, experiment)
    configuration = with_changes(test.configuration, settings)
    if effects_from and effects_from >= configuration.timing.duration:
        raise RigtwinError(
            f"effects from {effects_from:g} s on: the test is over at "
            f"{configuration.timing.duration:g} s"
        )

    def work(kept: Path) -> None:
        _record(
            path=kept,
            on=on,
            test=test,
            configuration=configuration,
            seed=seed,
            effects=effect_texts(effects),
            effects_from=effects_from,
            controller=controller,
            progress=progress,
        )

    if path is not None:
        work(recordable(forbid_overwriting(path, *on.files)))
        return faced(reader.load(Path(path)), on)
    with TemporaryDirectory(prefix="rigtwin-") as folder:
        kept = Path(folder) / f"{test.name}-{seed}.mcap"
        work(kept)
        return replace(faced(reader.load(kept), on), path=Path(kept.name))


def _experiment(of: Machine, experiment: str | Experiment | Demanding) -> Experiment:
    if isinstance(experiment, str):
        return find_experiment(of, experiment)
    if isinstance(experiment, Experiment):
        return experiment
    if not callable(experiment):
        raise RigtwinError(f"experiment {experiment!r:.60}: expected a name, or a function")
    name = getattr(experiment, "__name__", "own")
    return Experiment(name, "", "", of.configuration, experiment)


def _record(
    path: Path,
    on: Machine,
    test: Experiment,
    configuration: Configuration,
    seed: int,
    effects: Sequence[str],
    effects_from: float,
    controller: TickController | Callable[..., Any] | None,
    progress: Callable[[int], object],
) -> None:
    tick: Any = getattr(controller, "tick", controller)
    demands = test.demands(configuration, seed)
    on.physics.record(
        path,
        on,
        test.name,
        configuration,
        demands,
        seed,
        effects=effects,
        effects_from=effects_from,
        controller=tick,
        progress=progress,
    )
