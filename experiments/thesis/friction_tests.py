"""Tests of chapter 4 on the twin: force errors with a compensator, and steps at known times."""

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
from experiments.thesis.actuator_tests import thesis_cylinder
from experiments.thesis.study import Result
from experiments.thesis.trial import ThesisTrial, trial
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Timing
from rigtwin.numerics.arrays import Array
from rigtwin.recording import load
from rigtwin.signals.excitation import fade_in
from rigtwin.signals.noise import rms
from rigtwin.simulation.runner import record, simulate
from rigtwin.simulation.twin import Twin
from rigtwin.studies.friction_loop import detections, filter_lag
from rigtwin.studies.friction_spikes import BOUNDS, Calibration, find_compensator

LOOPS: dict[str, dict[str, float]] = {
    "fitted": {"kp": 1.0, "ki": 190.0},
    "nominal": {"kp": 0.3, "ki": 10.0},
}
"""Gains of the force loop, K_p and K_i (1/s). The thesis gives none.

With `nominal` the twin reproduces Table 3.5. With `fitted` it reproduces the first row of Table
4.1, so the rows below that one are predictions.
"""
CALIBRATION_SEED = 1000
"""Seed of the recording for the calibration. No other test uses it."""
AFTER = 0.04
"""Time after a reversal within which the peak of a spike is searched, s."""


def run_compensated(seed: int, **settings: object) -> ThesisTrial:
    """Run the road test of chapter 4 with some controller settings changed."""
    return trial(
        "friction-road", seed, lambda c: c._replace(controller=c.controller._replace(**settings))
    )


def errors(test: ThesisTrial) -> dict[str, float]:
    """Return the force errors of a test, N.

    `tracking` is the rms of demanded minus true force, `numerical` that of ideal minus demanded
    force. `spike` is the mean size of the friction spikes in the filtered force that the
    controller sees.
    """
    asked = test.simulation.commands[:, 2]
    return {
        "tracking": rms(asked - test.force),
        "numerical": rms(test.ideal.force - asked),
        "spike": float(np.mean(spikes(test))),
    }


def spikes(test: ThesisTrial) -> Array:
    """Return the size of the friction spike at every isolated reversal, N, shape (reversals,).

    A spike is the peak of the filtered force error in the new direction, minus the mean before the
    reversal.
    """
    settings, period = test.configuration.controller, test.configuration.timing.period
    # The true travel, lightly smoothed: quantisation would add reversals.
    velocity = np.gradient(gaussian_filter1d(test.travel, 2), period)
    reversals = np.flatnonzero(np.diff(np.sign(velocity)) != 0)
    window = round(AFTER / period)
    # Padding at both ends by a window lets the first and last reversal count as isolated.
    reversals = reversals[
        (np.diff(reversals, prepend=-window) > window)
        & (np.diff(reversals, append=len(velocity) + window) > window)
    ]
    # The first second and the end have no complete surroundings.
    reversals = reversals[(reversals > 1000) & (reversals < len(velocity) - window)]
    filtered = filter_lag(np.ascontiguousarray(test.force), settings.filter_force, period)
    error = test.simulation.commands[:, 2] - filtered
    # Three ticks later the sign is safe: at the reversal itself the velocity is zero.
    directions = np.sign(velocity[reversals + 3])
    # The three ticks before the reversal are left out, as its tick is uncertain by some ticks.
    before = np.array([np.mean(error[reversal - 15 : reversal - 3]) for reversal in reversals])
    peaks = np.array(
        [
            np.max(direction * error[reversal - 3 : reversal + window])
            for reversal, direction in zip(reversals, directions, strict=True)
        ]
    )
    return peaks - directions * before


def calibrate(loop: str) -> tuple[Calibration, dict[str, float]]:
    """Return the compensator calibrated on a recording without compensation, and its settings."""
    experiment = find("friction-road")
    configuration = experiment.configuration
    configuration = configuration._replace(
        controller=configuration.controller._replace(**LOOPS[loop])
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "friction-road.mcap"
        demands = experiment.demands(configuration, CALIBRATION_SEED)
        record(path, "friction-road", configuration, demands, CALIBRATION_SEED)
        calibration = find_compensator(load(path), configuration.controller)
    return calibration, {
        name: float(getattr(calibration.settings, name)) for name in (*BOUNDS, "friction_step")
    }


def variant_errors(
    loop: str, variants: Mapping[str, Mapping[str, object]], seed: int
) -> dict[str, float]:
    """Return the errors of every variant of the settings, N, by `variant/error`."""
    table: dict[str, float] = {}
    for name, settings in variants.items():
        table |= {
            f"{name}/{key}": value
            for key, value in errors(run_compensated(seed, **LOOPS[loop], **settings)).items()
        }
    return table


def calibrated_errors(
    loop: str, calibration: Calibration, settings: Mapping[str, float], seeds: int
) -> Result:
    """Return the results of a calibration, and the errors with it for every seed.

    The errors are arrays of shape (seeds,), in N; the other values are numbers.
    """
    variants = {
        kind.label: {"compensator": kind, **settings}
        for kind in (
            Compensator.ONE_STEP,
            Compensator.TWO_STEP,
            Compensator.FORCE_PROFILE,
            Compensator.FORCE_THRESHOLD,
        )
    }
    table = [variant_errors(loop, variants, seed) for seed in range(seeds)]
    result: dict[str, Array | float] = {
        name: np.array([row[name] for row in table]) for name in table[0]
    }
    result |= {f"setting {name}": value for name, value in settings.items()}
    result |= {
        "envelope": calibration.envelope,
        "friction": calibration.friction,
        "reversals": float(calibration.reversals),
    }
    return result | {
        "detected": float(calibration.detected),
        "false": float(calibration.false),
        "delay": calibration.delay,
    }


def sine_test(frequency: float, amplitude: float, seconds: float) -> tuple[Configuration, Array]:
    """Return configuration and demands of a constant force on a sine motion of the plate.

    frequency: Hz; amplitude: of the plate itself, m; seconds: length of the test.
    """
    # Imposed motion: no vehicle model closes a loop, so the reversals come when they are due.
    settings = Settings(
        mode=Mode.IMPOSED, filter_force=0.004, filter_velocity=0.0064, filter_position=0.004
    )._replace(**LOOPS["fitted"])
    configuration = Configuration(controller=settings, timing=Timing(duration=seconds))
    time = time_of(configuration)
    # The cylinder attenuates: the command is larger by 1/|H| of thesis Eq. 6.2.
    command = amplitude / abs(thesis_cylinder(np.array([frequency]))[0])
    # The motion is about the starting position and fades in, so it excites no transient.
    position = settings.start + command * fade_in(time) * np.sin(2 * math.pi * frequency * time)
    return configuration, np.column_stack(
        [np.zeros_like(time), position, np.full_like(time, 220.0)]
    )


def detect_reversals(
    frequency: float, amplitude: float, seconds: float, seed: int, **settings: float
) -> Result:
    """Return how well the detector finds the reversals of a sine motion (Fig. 4.8, 4.9).

    No compensating step is made. `reversals`, `seen` and `false` are counts, `delay` the median
    delay of a detection, s, or NaN if there is none.
    """
    configuration, demands = sine_test(frequency, amplitude, seconds)
    ran = simulate(configuration, demands, seed)
    period = configuration.timing.period
    # The detector runs over the recorded signals, so its steps do not change the motion.
    # One step suffices to detect: the second step of two follows by itself.
    tuned = configuration.controller._replace(compensator=Compensator.ONE_STEP, **settings)
    steps = detections(
        tuned, ran.measurements[:, 2], ran.commands[:, 2], ran.measurements[:, 3], period
    )
    velocity = np.gradient(gaussian_filter1d(ran.truth[:, 2], 2), period)
    reversals = np.flatnonzero(np.diff(np.sign(velocity)) != 0)
    # The motion fades in at first, and its small reversals prove nothing.
    reversals = reversals[reversals > 1000]
    directions = np.sign(velocity[reversals + 3])
    detection_ticks = np.flatnonzero(steps)
    seen = [
        bool(np.any(steps[turn - 2 : turn + 40] == direction))
        for turn, direction in zip(reversals, directions, strict=True)
    ]
    delays = [
        # Windows begin two ticks early, as the reversal's own tick is uncertain; −2 restores its
        # origin.
        np.flatnonzero(steps[turn - 2 : turn + 40] == direction)[0] - 2
        for turn, direction, s in zip(reversals, directions, seen, strict=True)
        if s
    ]
    # A detection further than 40 ticks from every reversal is false.
    distances = np.array(
        [
            np.min(np.abs(reversals - tick)) if len(reversals) else 10**9
            for tick in detection_ticks[detection_ticks > 1000]
        ]
    )
    return {
        "reversals": float(len(reversals)),
        "seen": float(np.sum(seen)),
        "false": float(np.sum(distances > 40)),
        "delay": float(np.median(delays)) * period if delays else math.nan,
    }


def run_timed_steps(offset: float | None, seed: int = 0) -> Result:
    """Run a constant force on a 1 Hz motion, with friction steps at known times (Fig. 4.6).

    The step of twice the Coulomb force is made `offset` seconds after every reversal. None makes
    no step.
    """
    configuration, demands = sine_test(1.0, 0.02, 4.0)
    period = configuration.timing.period
    # A first run without steps gives the times of the reversals in advance.
    uncompensated = simulate(configuration, demands, seed)
    velocity = np.gradient(gaussian_filter1d(uncompensated.truth[:, 2], 2), period)
    levels = np.sign(velocity)
    if offset is not None:
        shift = round(offset / period)
        # A shift in time, with the first or last direction held at the end that becomes empty.
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
        # ± 14 N, the Coulomb friction of the motor, is a step of twice that force at a reversal.
        added = 0.0 if offset is None else 14.0 * levels[tick]
        twin.write(
            Commands(
                commands.ground,
                commands.structure,
                commands.force,
                commands.voltage + added / MOTOR_CONSTANT,
            )
        )
    # The fade-in of the motion is over after 1.5 s.
    late = slice(1500, None)
    return {
        "time": np.arange(len(error))[late] * period,
        "error": error[late],
        "rms": rms(error[late]),
    }
