"""Is this recording fit to be compared? Faults of the data, recognised before anybody takes them for physics."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from controllers import Commands, Measurements
from controllers.force import MOTOR_CONSTANT
from rigtwin.diagnosis.component import replay_cylinder
from rigtwin.machine.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.recording.channels import SUSPENSION_RIG
from rigtwin.signals.noise import rms, smallest_step, white_noise
from rigtwin.signals.runs import FLAT, longest_run
from rigtwin.simulation.plant import deflected

SHORTEST = 200
"""Ticks below which a noise floor cannot be estimated."""
STUCK = 200
"""Equal samples in a row of a sensor that has noise: it is not alive."""
COARSE = 20.0
"""Times its nominal bit from which a sensor is coarse."""
MOVES = 10.0
"""A motion this many times its sensor's noise says what its scale is."""
FAR_OFF = 5.0
"""A scale this far from 1 either way is a unit, no gain."""
WOUND_UP = 0.05
"""Share of ticks with the motor's voltage at its limit from which its force loop is no measure of the load cell."""
UNITS = {"m": ((1e3, "mm"), (1e2, "cm"), (39.37, "inch")), "N": ((1e-3, "kN"), (0.2248, "lbf"), (9.81**-1, "kgf"))}
"""SI unit → (how many of another make one, its name)."""
MOVED_BY = {
    "ground_lvdt": ("ground",),
    "structure_lvdt": ("structure",),
    "suspension_lvdt": ("ground", "structure"),
    "load_cell": ("voltage",),
}
"""Which commands move what a sensor measures: one that stays put under a command that does not is no fault."""
PLAUSIBLE = 1e7
"""In any unit of the channels; above it a number is damage."""
LVDTS = ("ground_lvdt", "structure_lvdt", "suspension_lvdt")


@dataclass(frozen=True)
class Fault:
    """One thing wrong with the data. kind: short name; where: the channel, or the recording; message: one line; fatal: no
    comparison makes sense."""

    kind: str
    where: str
    message: str
    fatal: bool = True


def check(recording: Recording, configuration: Configuration) -> tuple[Fault, ...]:
    """All faults found, the gravest first. Later checks are left out where earlier ones make them meaningless."""
    stages: tuple[Callable[[], Iterator[Fault]], ...] = (
        lambda: _presence(recording),
        lambda: gaps(recording),
        lambda: _numbers(recording),
        lambda: _alive(recording, configuration),
        lambda: _order(recording, configuration),
        lambda: _scale(recording, configuration),
    )
    found: list[Fault] = []
    for stage in stages:
        found += stage()
        if any(fault.fatal for fault in found):
            break
    return tuple(sorted(found, key=lambda fault: not fault.fatal))


def _presence(recording: Recording) -> Iterator[Fault]:
    if recording.machine != SUSPENSION_RIG:
        yield Fault("wrong machine", "recording", f"it is of machine {recording.machine!r}; this twin is {SUSPENSION_RIG!r}")
    for topic, names in (("/sensor", Measurements._fields), ("/command", Commands._fields)):
        for name in names:
            if not recording.has(topic, name):
                there = ", ".join(f"{t}.{n}" for t, fields in recording.columns.items() for n in fields)
                yield Fault("missing", f"{topic}.{name}", f"channel {topic}.{name} is missing; it has {there}")
    if recording.ticks < SHORTEST:
        yield Fault("too short", "recording", f"it has {recording.ticks} ticks; a comparison needs at least {SHORTEST}")


def gaps(recording: Recording) -> Iterator[Fault]:
    steps = np.diff(recording.time)
    gaps = np.nonzero(np.abs(steps - recording.period) > 0.5 * recording.period)[0]
    if len(gaps):
        first = gaps[0]
        message = f"{len(gaps)} gaps in time, the first of {steps[first]:.4g} s at {recording.time[first]:.3f} s"
        yield Fault("gap", "recording", message)


def _numbers(recording: Recording) -> Iterator[Fault]:
    for topic, names in (("/sensor", Measurements._fields), ("/command", Commands._fields)):
        for name in names:
            wrong = ~np.isfinite(recording.column(topic, name))
            if wrong.any():
                when = recording.time[np.argmax(wrong)]
                yield Fault("not a number", f"{topic}.{name}", f"{topic}.{name} is not a number at {when:.3f} s")
                continue
            largest = float(np.max(np.abs(recording.column(topic, name))))
            if largest > PLAUSIBLE:
                message = f"{topic}.{name} reaches {largest:.3g}; no such rig goes above {PLAUSIBLE:g}"
                yield Fault("implausible", f"{topic}.{name}", message)


def _alive(recording: Recording, configuration: Configuration) -> Iterator[Fault]:
    for name in Measurements._fields:
        signal = recording.column("/sensor", name)
        where, first, length = f"/sensor.{name}", *longest_run(signal, np.ones(len(signal), bool))
        throughout = length == len(signal)
        if throughout and not any(np.ptp(recording.column("/command", command)) > 0 for command in MOVED_BY[name]):
            continue
        # Bits as coarse as that stand still while the signal moves between them.
        coarse = smallest_step(signal) > COARSE * getattr(configuration.plant, name).resolution
        if length >= STUCK and (throughout or not coarse):
            since = f"for {length * recording.period:.3g} s from {recording.time[first]:.3f} s"
            span = "throughout" if throughout else since
            yield Fault("dead", where, f"{where} does not change {span}: a dead or disconnected sensor")
            continue
        if coarse:
            continue
        for end, extreme in (("above", signal.max()), ("below", signal.min())):
            at_end = signal == extreme
            _, length = longest_run(signal, at_end)
            if length >= FLAT:
                share = 100 * at_end.mean()
                yield Fault(
                    "clipped", where, f"{where} is cut off {end} {extreme:.4g} ({share:.2g} % of the ticks)", fatal=False
                )


def expected(recording: Recording, configuration: Configuration) -> dict[str, Array]:
    """What each sensor should roughly read, worked out from the commands alone."""
    plant, ground, structure = configuration.plant, *(recording.column("/command", n) for n in ("ground", "structure"))
    u = replay_cylinder(plant.ground_cylinder, configuration, ground, float(ground[0]))
    x = replay_cylinder(plant.structure_cylinder, configuration, structure, configuration.controller.start)
    return {
        "ground_lvdt": u,
        "structure_lvdt": x,
        # The tyre is stiff: the wheel goes with the ground, a preload's deflection apart.
        "suspension_lvdt": x - u + deflected(plant, configuration.controller.preload),
        "load_cell": MOTOR_CONSTANT * recording.column("/command", "voltage"),
    }


def _scale(recording: Recording, configuration: Configuration) -> Iterator[Fault]:
    """Units and signs, by how much a signal goes with what is expected of it."""
    odd: dict[str, float] = {}
    for name, model in expected(recording, configuration).items():
        signal, where = recording.column("/sensor", name), f"/sensor.{name}"
        # Motions have a zero that may be displaced; a force has its preload, which says its scale even at rest.
        a, b = (signal, model) if name == "load_cell" else (signal - signal.mean(), model - model.mean())
        if rms(b) < MOVES * white_noise(signal) / max(rms(a) / max(rms(b), 1e-12), 1e-12):
            continue
        slope = float(a @ b / (b @ b))
        alike = abs(float(a @ b)) / np.sqrt(float(a @ a) * float(b @ b))
        if alike < 0.7:
            continue
        if slope < 0:
            yield Fault("sign", where, f"{where} has the wrong sign: it goes against what was commanded")
        elif not 1 / FAR_OFF < slope < FAR_OFF:
            odd[name] = slope
    voltage = np.abs(recording.column("/command", "voltage"))
    if float(np.mean(voltage >= 0.99 * configuration.controller.voltage_limit)) > WOUND_UP:
        # A force loop at its limit says that the force is not to be had; whose fault it is, is for the diagnosis.
        odd.pop("load_cell", None)
    if {"structure_lvdt", "suspension_lvdt"} <= set(odd) and 0.5 < odd["structure_lvdt"] / odd["suspension_lvdt"] < 2.0:
        # Two sensors that agree on a plate that hardly moves: it hardly moves.
        del odd["structure_lvdt"], odd["suspension_lvdt"]
    for name, slope in odd.items():
        unit = "N" if name == "load_cell" else "m"
        factor, guess = min(UNITS[unit], key=lambda pair: abs(np.log(pair[0] / slope)))
        name_of = f", as if in {guess}" if abs(np.log(factor / slope)) < 0.5 else ""
        where = f"/sensor.{name}"
        yield Fault("unit", where, f"{where} is {slope:.3g} times what was commanded{name_of}; expected {unit}")


def _order(recording: Recording, configuration: Configuration) -> Iterator[Fault]:
    """Swapped channels: another order of the LVDTs fits far better."""
    models = expected(recording, configuration)
    signals = {name: recording.column("/sensor", name) for name in LVDTS}
    misfit = {(s, m): rms(signals[s] - models[m] - np.mean(signals[s] - models[m])) for s in LVDTS for m in LVDTS}

    def total(order: tuple[str, ...]) -> float:
        return float(np.sqrt(sum(misfit[name, model] ** 2 for name, model in zip(LVDTS, order, strict=True))))

    least = min(total(order) for order in permutations(LVDTS))
    if least < total(LVDTS) / 3:
        # Orders that fit about as well differ in what these data cannot tell; the one with the fewest swaps is the likeliest.
        likely = [order for order in permutations(LVDTS) if total(order) < 1.5 * least]
        best = min(likely, key=lambda order: sum(name != model for name, model in zip(LVDTS, order, strict=True)))
        swapped = ", ".join(f"{name} holds {model}" for name, model in zip(LVDTS, best, strict=True) if name != model)
        yield Fault("swapped", "/sensor", f"channels of /sensor are swapped: {swapped}")
