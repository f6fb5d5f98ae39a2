"""Whether the measured forces of a log are those that the model's servos give."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from rigtwin.describing.command_signals import position_command, travel
from rigtwin.describing.log import STATED, Log
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.replay_kind import are_servos
from rigtwin.describing.signal import LogSignal
from rigtwin.description.joint_elements import actuator_on
from rigtwin.numerics.arrays import Array
from rigtwin.signals.noise import smallest_step, white_noise

LAW_ERROR = 0.15
"""Largest share of a force's standard deviation that a servo's law may miss."""
ROUGH_ERROR = 0.6
"""The same at a joint whose speed changes so much from row to row that the law is uncertain."""
SCALE_ERROR = 0.05
"""Largest error of the law's scale, and largest mean that it leaves, as a share of the force's
standard deviation. A larger one is that of a force sensor, which the commands do not show."""
AVERAGED = 10
"""Number of rows over which a force and its law are averaged before they are compared."""
NOISE_FACTOR = 1.5
"""Factor on the noise that a law may have, as its speed has noise as well."""


def come_from_servos(
    log: Log, positions: Mapping[str, Array], forces: Mapping[str, LogSignal]
) -> bool:
    """Return whether the measured force at every joint is that of the model's servo.

    A servo holds its command from row to row, so that its force jumps with every row. A sample of
    such a force is not the one that the smooth measured motion requires: for the gain kp and the
    period h, both differ by kp h / 2 times the speed, as if the joint had less damping. The
    commands and the positions hold all that such forces can tell.

    Parameters
    ----------
    log
        The log.
    positions
        Joint → position, SI, shape (rows,).
    forces
        Joint → measured force.
    """
    if not forces or not are_servos(log.mechanism, list(positions)):
        return False
    # A force whose column the owner states is meant to be judged.
    if any(force.why == STATED for force in forces.values()):
        return False
    errors = [
        _law_error(log, joint, positions, log.values(force)) for joint, force in forces.items()
    ]
    return max(errors) <= ROUGH_ERROR and float(np.median(errors)) <= LAW_ERROR


def _law_error(log: Log, joint: str, positions: Mapping[str, Array], force: Array) -> float:
    """Return what the law kp · (command − position) − kv · velocity misses of a force.

    It is a share of the force's standard deviation beyond noise, and infinite where another
    force, scale or mean is certain.
    """
    servo = log.mechanism.servo(actuator_on(log.mechanism, joint) or "")
    if servo is None or log.clock is None or not log.slots.has(joint, JointQuantity.COMMAND):
        return math.inf
    open_questions = list(log.questions)
    signal, position = position_command(log, joint, positions), travel(log, joint, positions)
    # What is not clear about a command is asked only where a test needs it.
    log.questions[:] = open_questions
    if signal is None:
        return math.inf
    command, gain = log.values(signal), servo["position_gain"]
    speed = np.gradient(position, log.clock.period)
    limit = servo.get("force_limit", math.inf)
    noise = math.hypot(gain * _noise(position), _noise(force)) / math.sqrt(AVERAGED)
    # A row holds the force before or after the command of the same row.
    laws = [
        gain * (held - position[1:]) - servo["damping_gain"] * speed[1:]
        for held in (command[1:], command[:-1])
    ]
    return min(_compare(force[1:], np.clip(law, -limit, limit), noise) for law in laws)


def _noise(signal: Array) -> float:
    """Return the standard deviation of a signal's noise, at least that of its steps."""
    return max(white_noise(signal), smallest_step(signal) / math.sqrt(12.0))


def _compare(force: Array, law: Array, noise: float) -> float:
    """Return the share of a force that a law misses beyond noise, see `_law_error`."""
    # Averages hardly contain the noise of the speed, which is large from row to row.
    weights = np.full(AVERAGED, 1.0 / AVERAGED)
    force, law = np.convolve(force, weights, "valid"), np.convolve(law, weights, "valid")
    spread, variance, rest = float(np.std(force)), float(np.var(law)), force - law
    if spread == 0.0 or variance == 0.0 or abs(float(np.mean(rest))) > SCALE_ERROR * spread:
        return math.inf
    power = max(float(np.var(rest)) - (NOISE_FACTOR * noise) ** 2, 0.0)
    missed = math.sqrt(power) / spread
    scale = float(np.cov(force, law)[0, 1]) / variance
    # Errors of the law flatten the regression on it, by their share of its variance.
    flattened = missed**2 + (NOISE_FACTOR * noise) ** 2 / variance
    return missed if abs(scale - 1.0) <= SCALE_ERROR + flattened else math.inf
