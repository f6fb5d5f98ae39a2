"""The first look at a gap: a recording against the twin, replay by replay, or against another recording of the same test."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from controllers import Measurements
from rigtwin.diagnosis.checks import SHORTEST
from rigtwin.diagnosis.replays import REPLAYS, Replays, Undetermined
from rigtwin.diagnosis.residual import Residual, single
from rigtwin.errors import RigtwinError
from rigtwin.machine.configuration import Configuration, overridden
from rigtwin.recording import Recording
from rigtwin.signals.noise import white_noise, without_mains


@dataclass(frozen=True)
class Comparison:
    """All replays of a recording, by name, and what could not be replayed and why."""

    replays: dict[str, Residual]
    left_out: dict[str, str]
    notes: tuple[str, ...]


def configuration_of(recording: Recording, base: Configuration | None = None) -> Configuration:
    """The operator's settings of a recording over `base` (the nominal rig). Raises RigtwinError for settings unknown here."""
    start = base or Configuration()
    substeps = max(1, math.ceil(recording.period / start.timing.timestep - 1e-9))
    duration = max(recording.ticks * recording.period, 0.01)
    timing = {"period": recording.period, "duration": duration, "timestep": recording.period / substeps}
    changes: dict[str, dict[str, object]] = {"controller": dict(recording.controller), "timing": dict(timing)}
    if start.plant.gas_spring.force == 0.0:
        # What the operator says stands beside the motor does stand there.
        keys = {"force": "gas_force", "length": "gas_length", "exponent": "gas_exponent"}
        changes["gas_spring"] = {
            key: changes["controller"][name] for key, name in keys.items() if name in changes["controller"]
        }
    try:
        return overridden(start, changes)
    except RigtwinError as error:
        raise RigtwinError(f"{recording.path}: {error}") from None


def compare(
    recording: Recording, configuration: Configuration, progress: Callable[[str], object] = lambda _: None
) -> Comparison:
    """Replays everything. configuration: of the twin, see `configuration_of`; progress is called with each replay's name."""
    replays = Replays(recording, configuration)
    left_out: dict[str, str] = {}
    if not recording.controller:
        reason = "the recording does not say what the controller was told to do"
        left_out = {"controller": reason, "closed_loop": reason}
    results: dict[str, Residual] = {}
    for name, replay in REPLAYS.items():
        if name not in left_out:
            progress(name)
            try:
                results[name] = replay(replays)
            except Undetermined as reason:
                left_out[name] = str(reason)
    notes = (*recording.notes, *(fault.message for fault in replays.faults))
    return Comparison(results, left_out, notes)


def differences(first: Recording, second: Recording) -> tuple[str, ...]:
    """What was not the same in two tests, a line each; empty if they were asked the same."""
    notes = []
    if first.experiment != second.experiment:
        notes.append(f"different experiments: {first.experiment} and {second.experiment}")
    settings = {*first.controller, *second.controller}
    unlike = sorted(key for key in settings if first.controller.get(key) != second.controller.get(key))
    if unlike:
        notes.append(f"different controller settings: {', '.join(unlike)}")
    ticks = min(first.ticks, second.ticks)
    if first.has("/command", "ground") and second.has("/command", "ground"):
        apart = first.column("/command", "ground")[:ticks] - second.column("/command", "ground")[:ticks]
        if np.max(np.abs(apart)) > 1e-6:
            notes.append("different ground motions were commanded")
    if str(first.controller.get("mode")) == "mil":
        notes.append("with a model in the loop a limit cycle drifts in phase, so two runs of one rig differ too")
    return tuple(notes)


def compare_recordings(first: Recording, second: Recording) -> dict[str, Residual]:
    """Two recordings of one test, channel by channel over their common length. The floor is both sensors' noise together.

    Raises RigtwinError if their periods differ or they share no channel.
    """
    if first.period != second.period:
        raise RigtwinError(f"periods differ: {first.path} has {first.period:g} s, {second.path} has {second.period:g} s")
    ticks = min(first.ticks, second.ticks)
    if ticks < SHORTEST:
        raise RigtwinError(f"only {ticks} ticks in common; a comparison needs at least {SHORTEST}")
    results: dict[str, Residual] = {}
    for name, unit in zip(Measurements._fields, ("m", "m", "m", "N"), strict=True):
        if first.has("/sensor", name) and second.has("/sensor", name):
            one, other = first.column("/sensor", name)[:ticks], second.column("/sensor", name)[:ticks]
            if not (np.isfinite(one).all() and np.isfinite(other).all()):
                raise RigtwinError(f"/sensor.{name} is not a number somewhere in {first.path} or {second.path}")
            difference = without_mains(one - other, first.period, 50.0)
            results[name] = single(difference, math.hypot(white_noise(one), white_noise(other)), unit, first.period)
    if not results:
        raise RigtwinError(f"{first.path} and {second.path} share no sensor")
    return results
