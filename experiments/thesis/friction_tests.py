"""The tests of chapter 4 on the twin: what a compensator leaves of the force errors, and steps made
at known times."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from controllers import (
    Commands,
    Compensator,
    Demand,
    Mode,
    Settings,
    controller,
    initial_state,
    update,
)
from controllers.force import MOTOR_CONSTANT
from experiments import find
from experiments.experiment import time_of
from experiments.thesis.identification import hydraulic
from experiments.thesis.study import Result
from experiments.thesis.trial import Trial, trial
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Timing
from rigtwin.numerics.arrays import Array
from rigtwin.recording import load
from rigtwin.signals.excitation import fade_in
from rigtwin.signals.noise import rms
from rigtwin.simulation.runner import record, simulate
from rigtwin.simulation.twin import Twin
from rigtwin.studies.friction_spikes import (
    BOUNDS,
    Calibration,
    detections,
    filter_lag,
    find_compensator,
)

LOOPS: dict[str, dict[str, float]] = {
    "fitted": {"kp": 1.0, "ki": 190.0},
    "nominal": {"kp": 0.3, "ki": 10.0},
}
"""Gains of the force loop. The thesis gives none: `nominal` are those with which the twin shows
Table 3.5, `fitted` those with which it shows the first row of Table 4.1; the rows below are then
predictions."""
CALIBRATION_SEED = 1000
"""Of the recording that the compensator is calibrated on; no other test uses it."""
AFTER = 0.04
"""s after a reversal within which a spike's peak is looked for."""


def compensated(seed: int, **settings: object) -> Trial:
    """The road test of chapter 4 with some controller settings changed."""
    return trial(
        "friction-road", seed, lambda c: c._replace(controller=c.controller._replace(**settings))
    )


def errors(test: Trial) -> dict[str, float]:
    """rms tracking and numerical error (N) of the force that is felt, and the mean size of the
    friction spikes (N) in the force as the controller sees it, through its filter."""
    asked = test.ran.commands[:, 2]
    return {
        "tracking": rms(asked - test.force),
        "numerical": rms(test.should.force - asked),
        "spike": float(np.mean(spikes(test))),
    }


def spikes(test: Trial) -> Array:
    """How far the filtered force error shoots at every reversal that stands alone, N: its peak
    after it, towards the new direction, less what it was before."""
    settings, period = test.configuration.controller, test.configuration.timing.period
    velocity = np.gradient(gaussian_filter1d(test.travel, 2), period)
    turns = np.flatnonzero(np.diff(np.sign(velocity)) != 0)
    wide = round(AFTER / period)
    turns = turns[
        (np.diff(turns, prepend=-wide) > wide)
        & (np.diff(turns, append=len(velocity) + wide) > wide)
    ]
    turns = turns[(turns > 1000) & (turns < len(velocity) - wide)]
    felt = filter_lag(np.ascontiguousarray(test.force), settings.filter_force, period)
    error = test.ran.commands[:, 2] - felt
    directions = np.sign(velocity[turns + 3])
    before = np.array([np.mean(error[turn - 15 : turn - 3]) for turn in turns])
    peaks = np.array(
        [
            np.max(way * error[turn - 3 : turn + wide])
            for turn, way in zip(turns, directions, strict=True)
        ]
    )
    return peaks - directions * before


def calibration(loop: str) -> tuple[Calibration, dict[str, float]]:
    """The compensator calibrated on a recording without compensation, and its settings by name."""
    experiment = find("friction-road")
    configuration = experiment.configuration
    configuration = configuration._replace(
        controller=configuration.controller._replace(**LOOPS[loop])
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "friction-road.mcap"
        demands = experiment.demands(configuration, CALIBRATION_SEED)
        record(path, "friction-road", configuration, demands, CALIBRATION_SEED)
        found = find_compensator(load(path), configuration.controller)
    return found, {
        name: float(getattr(found.settings, name)) for name in (*BOUNDS, "friction_step")
    }


def rows(loop: str, variants: Mapping[str, Mapping[str, object]], seed: int) -> dict[str, float]:
    """Errors of every variant of the settings, `variant/error`."""
    found: dict[str, float] = {}
    for name, settings in variants.items():
        found |= {
            f"{name}/{key}": value
            for key, value in errors(compensated(seed, **LOOPS[loop], **settings)).items()
        }
    return found


def calibrated_rows(
    loop: str, found: Calibration, settings: Mapping[str, float], seeds: int
) -> Result:
    """What the calibration found, and the errors with it for every seed: arrays of shape
    (seeds,)."""
    variants = {
        kind.label: {"compensator": kind, **settings}
        for kind in (
            Compensator.ONE_STEP,
            Compensator.TWO_STEP,
            Compensator.FORCE_PROFILE,
            Compensator.FORCE_THRESHOLD,
        )
    }
    table = [rows(loop, variants, seed) for seed in range(seeds)]
    result: dict[str, Array | float] = {
        name: np.array([row[name] for row in table]) for name in table[0]
    }
    result |= {f"setting {name}": value for name, value in settings.items()}
    result |= {
        "envelope": found.envelope,
        "friction": found.friction,
        "reversals": float(found.reversals),
    }
    return result | {
        "detected": float(found.detected),
        "false": float(found.false),
        "delay": found.delay,
    }


def sine_test(frequency: float, amplitude: float, seconds: float) -> tuple[Configuration, Array]:
    """Constant force while the plate moves by a sine (Hz, m of the plate itself): configuration and
    demands."""
    settings = Settings(
        mode=Mode.IMPOSED, filter_force=0.004, filter_velocity=0.0064, filter_position=0.004
    )._replace(**LOOPS["fitted"])
    configuration = Configuration(controller=settings, timing=Timing(duration=seconds))
    time = time_of(configuration)
    command = amplitude / abs(hydraulic(np.array([frequency]))[0])
    # It swings about where it starts, gently set going.
    moved = settings.start + command * fade_in(time) * np.sin(2 * math.pi * frequency * time)
    return configuration, np.column_stack([np.zeros_like(time), moved, np.full_like(time, 220.0)])


def detected(
    frequency: float, amplitude: float, seconds: float, seed: int, **settings: float
) -> Result:
    """How many reversals of a sine motion the detector sees, no step being made (Fig. 4.8, 4.9)."""
    configuration, demands = sine_test(frequency, amplitude, seconds)
    ran = simulate(configuration, demands, seed)
    period = configuration.timing.period
    tuned = configuration.controller._replace(compensator=Compensator.ONE_STEP, **settings)
    steps = detections(
        tuned, ran.measurements[:, 2], ran.commands[:, 2], ran.measurements[:, 3], period
    )
    velocity = np.gradient(gaussian_filter1d(ran.truth[:, 2], 2), period)
    turns = np.flatnonzero(np.diff(np.sign(velocity)) != 0)
    turns = turns[turns > 1000]
    directions = np.sign(velocity[turns + 3])
    made = np.flatnonzero(steps)
    seen = [
        bool(np.any(steps[t - 2 : t + 40] == way)) for t, way in zip(turns, directions, strict=True)
    ]
    delays = [
        np.flatnonzero(steps[t - 2 : t + 40] == way)[0] - 2
        for t, way, s in zip(turns, directions, seen, strict=True)
        if s
    ]
    near = np.array(
        [np.min(np.abs(turns - tick)) if len(turns) else 10**9 for tick in made[made > 1000]]
    )
    return {
        "reversals": float(len(turns)),
        "seen": float(np.sum(seen)),
        "false": float(np.sum(near > 40)),
        "delay": float(np.median(delays)) * period if delays else math.nan,
    }


def timed(offset: float | None, seed: int = 0) -> Result:
    """Constant force on a 1 Hz motion with a step of twice the Coulomb force `offset` s after every
    reversal, known in advance; None for no step (Fig. 4.6)."""
    configuration, demands = sine_test(1.0, 0.02, 4.0)
    period = configuration.timing.period
    free = simulate(configuration, demands, seed)
    velocity = np.gradient(gaussian_filter1d(free.truth[:, 2], 2), period)
    levels = np.sign(velocity)
    if offset is not None:
        shift = round(offset / period)
        levels = (
            np.concatenate([np.full(shift, levels[0]), levels[:-shift]])
            if shift > 0
            else np.concatenate([levels[-shift:], np.full(-shift, levels[-1])])
        )
    twin = Twin(configuration, float(demands[0, 0]), seed)
    controlling = controller(configuration.controller, period)
    state, error = initial_state(controlling), np.empty(len(demands))
    for tick, demand in enumerate(demands):
        state, commands = update(controlling, state, twin.read(), Demand(*demand.tolist()))
        error[tick] = commands.force - twin.truth.load_cell
        added = 0.0 if offset is None else 14.0 * levels[tick]
        twin.write(
            Commands(
                commands.ground,
                commands.structure,
                commands.force,
                commands.voltage + added / MOTOR_CONSTANT,
            )
        )
    late = slice(1500, None)
    return {
        "time": np.arange(len(error))[late] * period,
        "error": error[late],
        "rms": rms(error[late]),
    }
