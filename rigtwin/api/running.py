"""A test on a machine's twin."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rigtwin.api.machines import resolve_machine
from rigtwin.api.recordings import Recording, with_machine
from rigtwin.api.twin import Effects, Settings, effect_texts
from rigtwin.description.changes import with_changes
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.physics import TwinTest
from rigtwin.errors import RigtwinError
from rigtwin.files import forbid_overwriting, recordable
from rigtwin.recording import reader
from rigtwin.simulation.experiment import Demands, Experiment, find_experiment
from rigtwin.simulation.loop import TickController

Demanding = Callable[[Configuration, int], Demands]
"""Function that returns the demands of a test for (configuration, seed)."""


def run(
    machine: Machine | str | Path,
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
    """Simulate a test on a machine's twin and return its recording.

    Parameters
    ----------
    machine
        Machine, its name, or the path of its description. A corrected machine,
        `Diagnosis.machine`, can be run as well.
    experiment
        Name of an experiment of the machine (`experiments` lists them), an `Experiment`, or a
        function of (configuration, seed) that returns the demands of every tick: an array of shape
        (ticks, 3) on the suspension rig (ground in m, structure in m, force in N), a dictionary
        demand → array of shape (ticks,) on any other machine.
    seed
        Seed of the excitation and of the sensor noise, at least 0. The same seed gives the same
        recording, byte for byte.
    effects
        Hidden effects: simulated, but not stored in the recording's settings. For example
        {"coulomb@rail": 80}, with the magnitude in the unit that `effects(machine)` states.
    effects_from
        Time at which the effects begin, in s from the test's start. Only the suspension rig's twin
        takes a time other than 0.
    settings
        Changes of the configuration, which the recording states: group → name → value, or the path
        of a TOML file, or a sequence of both.
    controller
        Controller in place of the machine's own: an object with `tick(measured, demand)`, or such a
        function, compiled or not. On the suspension rig it returns `controllers.Commands`; on any
        other machine, measurements and demands are passed by name and it returns the actuator's
        command.
    path
        File of the recording, MCAP. By default the recording is kept in memory only.
    progress
        Function called with the number of ticks since its last call.

    Returns
    -------
    Recording
        The recorded test. `recording["/sensor.load_cell"]` is a channel of shape (ticks,);
        `recording.time` is in s; `recording.end` states why the test ended, and `recording.tripped`
        whether a limit ended it.

    Raises
    ------
    RigtwinError
        If the machine, experiment, an effect or a setting is unknown or not allowed. No file is
        written then.

    Examples
    --------
    >>> import rigtwin
    >>> recording = rigtwin.run("emps", "positioning", effects={"coulomb@guide": 20})
    >>> recording.tripped
    False
    >>> rigtwin.run("suspension-rig", "drop", seed=1, path="drop.mcap")  # doctest: +SKIP
    """
    if not isinstance(seed, int) or seed < 0:
        raise RigtwinError(f"seed {seed!r:.60}: expected a whole number from 0")
    # Checked before the machine is built, which may take seconds.
    if controller is not None and not callable(getattr(controller, "tick", controller)):
        raise RigtwinError(f"controller {controller!r:.60}: expected a function, or a method tick")
    described = resolve_machine(machine)
    test = _resolve_experiment(described, experiment)
    configuration = with_changes(test.configuration, settings)
    _check_onset(effects_from, bool(effects), described, configuration)

    def record(target: Path) -> None:
        twin_test = TwinTest(
            experiment=test.name,
            configuration=configuration,
            demands=test.demands(configuration, seed),
            seed=seed,
            effects=effect_texts(effects),
            effects_from=effects_from,
            controller=getattr(controller, "tick", controller),
        )
        described.physics.record(target, described, twin_test, progress)

    if path is not None:
        record(recordable(forbid_overwriting(path, *described.files)))
        return with_machine(reader.load(Path(path)), described)
    # The writer needs a file. The recording is loaded completely before the folder is deleted, and
    # keeps only the name of the file.
    with TemporaryDirectory(prefix="rigtwin-") as folder:
        file = Path(folder) / f"{test.name}-{seed}.mcap"
        record(file)
        return replace(with_machine(reader.load(file), described), path=Path(file.name))


def _check_onset(
    effects_from: float, has_effects: bool, machine: Machine, configuration: Configuration
) -> None:
    """Refuse a time of the effects' onset, in s, that cannot be simulated."""
    if not 0.0 <= effects_from < math.inf:
        raise RigtwinError(f"effects from {effects_from:g} s: expected 0 s or more")
    if not effects_from:
        return
    if not machine.physics.delays_effects:
        raise RigtwinError(
            f"{machine.name}: `effects_from`: the twin of {machine.physics.title} takes effects "
            "from the start only"
        )
    if not has_effects:
        raise RigtwinError(f"`effects_from` = {effects_from:g} s requires `effects`")
    if effects_from >= configuration.timing.duration:
        raise RigtwinError(
            f"effects from {effects_from:g} s on: the test is over at "
            f"{configuration.timing.duration:g} s"
        )


def _resolve_experiment(machine: Machine, experiment: str | Experiment | Demanding) -> Experiment:
    """Return the experiment that an argument of `run` names or defines."""
    if isinstance(experiment, str):
        return find_experiment(machine, experiment)
    if isinstance(experiment, Experiment):
        return experiment
    if not callable(experiment):
        raise RigtwinError(f"experiment {experiment!r:.60}: expected a name, or a function")
    # An object, or a partial function, has no name of its own.
    name = getattr(experiment, "__name__", "own")
    return Experiment(name, "", "", machine.configuration, experiment)
