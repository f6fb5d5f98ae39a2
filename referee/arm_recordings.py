"""Recordings of the referee's arms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from referee.arm_cases import ANGLES, FORCES, GUIDES, NOMINAL, OUTSIDE, ArmCase, ArmTest
from referee.arm_truth import Arm, Array, JointTravel, Resistance, add_ball, motor_forces

FRICTION_SPREAD = 0.02
"""Largest relative deviation of a machine's friction from its description.

The description tolerates 5 %.
"""
PERIOD, SECONDS, WAVES = 2e-3, 12.0, 6
"""Sample period and length of a test, s, and number of sines in the motion of a joint."""
ANGULAR, LINEAR = 2e-5, 1e-5
"""Resolution of the encoders, rad and m."""
NOISE = (0.01, 0.03)
"""Range of the white noise of the forces, rms, as a share of their standard deviation."""
BALL = 0.02
"""Radius of a payload, m."""
WARMED = 4.0
"""Time constant of warming friction, s."""


@dataclass(frozen=True)
class DefectiveArm:
    """An arm with its defects.

    Attributes
    ----------
    arm : Arm
        Arm with the defects that change its parameters.
    gains : ndarray
        Gains of the force sensors, shape (joints,).
    zeros : ndarray
        Offsets of the position sensors, m or rad, shape (joints,).
    unmodelled : tuple
        Word, joint and size, N or Nm, of every force whose form the library does not have.
    magnitudes : tuple of float
        Magnitude of every defect, in its unit.
    swings : ndarray
        Standard deviation of the forces without defects, N or Nm, shape (joints,).
    """

    arm: Arm
    gains: Array
    zeros: Array
    unmodelled: tuple[tuple[str, int, float], ...]
    magnitudes: tuple[float, ...]
    swings: Array


def build_arm(case: ArmCase) -> DefectiveArm:
    """Return the machine of a case, which is the same in all its tests.

    A reference motion, independent of the tests, sets the magnitudes of the defects.
    """
    random = np.random.default_rng([case.seed, case.number, 11])
    arm = _vary(NOMINAL[case.machine], random)
    travel = draw_travel(case.machine, np.random.default_rng([case.seed, case.number, 17]))
    # Forces without defects set the scale of every defect.
    swings = np.std(motor_forces(arm, travel), axis=1)
    gains, zeros = np.ones(len(swings)), np.zeros(len(swings))
    unmodelled: list[tuple[str, int, float]] = []
    magnitudes: list[float] = []
    for word, joint in case.defects:
        share = _spread(random, 0.06, 0.25) * (1.0 if random.random() < 0.5 else -1.0)
        force = share * float(swings[joint])
        if word == "gain":
            gains[joint] += share
            magnitudes.append(float(gains[joint]))
        elif word == "zero":
            zeros[joint] = math.copysign(_spread(random, 0.015, 0.08), share)
            magnitudes.append(float(zeros[joint]))
        elif word == "payload":
            last = arm.links[-1]
            mass = _spread(random, 0.05, 0.4) * last.mass
            along, across = random.uniform(0.3, 1.0), random.uniform(-0.1, 0.1)
            ball = add_ball(last, mass, along * last.length, across * last.length, BALL)
            arm = arm._replace(links=(*arm.links[:-1], ball))
            magnitudes.append(mass)
        elif word in OUTSIDE:
            unmodelled.append((word, joint, abs(force)))
            magnitudes.append(abs(force))
        else:
            # The defect changes the joint's force by `share` of its usual standard deviation.
            drag, size = _change(
                arm.resistances[joint], word, force, [each[joint] for each in travel]
            )
            resistances = tuple(
                drag if n == joint else each for n, each in enumerate(arm.resistances)
            )
            arm = arm._replace(resistances=resistances)
            magnitudes.append(size)
    return DefectiveArm(arm, gains, zeros, tuple(unmodelled), tuple(magnitudes), swings)


def record_arm(case: ArmCase, again: int = 0) -> ArmTest:
    """Record a test of a case; again: number of the repetition on the same machine."""
    defective = build_arm(case)
    random = np.random.default_rng([case.seed, case.number, 13, again])
    travel = draw_travel(case.machine, random)
    force = motor_forces(defective.arm, travel)
    for word, joint, size in defective.unmodelled:
        force[joint] += _unmodelled_force(word, joint, travel, force[joint], size)
    # Noise in proportion to the force, as from a current sensor of suitable range.
    noise = _spread(random, *NOISE) * defective.swings
    force = defective.gains[:, None] * force + noise[:, None] * random.standard_normal(force.shape)
    readings = travel.position + defective.zeros[:, None]
    resolution = np.full(len(readings), ANGULAR)
    if case.machine == "cart":
        resolution[0] = LINEAR
    readings = np.round(readings / resolution[:, None]) * resolution[:, None]
    sensors = dict(zip(ANGLES[case.machine], readings, strict=True))
    sensors.update(zip(FORCES[case.machine], force, strict=True))
    return ArmTest({"/sensor": sensors}, PERIOD, defective.magnitudes)


def draw_travel(machine: str, random: np.random.Generator) -> JointTravel:
    """Draw a motion of all joints, every one a sum of sines."""
    time = np.arange(round(SECONDS / PERIOD)) * PERIOD
    joints = []
    for guide in GUIDES[machine]:
        reach = 0.12 if guide == "rail" else random.uniform(0.6, 1.0)
        frequency = np.sort(np.exp(random.uniform(math.log(0.12), math.log(1.3), WAVES)))
        # Slow waves are larger, so all contribute to speed and acceleration.
        size = frequency**-0.8 * random.uniform(0.5, 1.0, WAVES)
        phase = random.uniform(-math.pi, math.pi, WAVES)
        rate = 2.0 * math.pi * frequency[:, None]
        phase_angle = rate * time + phase[:, None]
        size = reach * (size / np.sum(size))[:, None]
        middle = 0.0 if guide == "rail" else random.uniform(-0.5, 0.5)
        joints.append(
            [
                middle + np.sum(size * np.sin(phase_angle), axis=0),
                np.sum(size * rate * np.cos(phase_angle), axis=0),
                -np.sum(size * rate**2 * np.sin(phase_angle), axis=0),
            ]
        )
    return JointTravel(*np.stack(joints, axis=1))


def _spread(random: np.random.Generator, low: float, high: float) -> float:
    """Draw a number between two bounds, uniform in its logarithm."""
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def _vary(arm: Arm, random: np.random.Generator) -> Arm:
    """Return an arm whose friction deviates from its description within `FRICTION_SPREAD`."""

    def vary(drag: Resistance) -> Resistance:
        dry, viscous = 1.0 + FRICTION_SPREAD * random.uniform(-1.0, 1.0, 2)
        return drag._replace(
            slip=dry * drag.slip, breakaway=dry * drag.breakaway, viscous=viscous * drag.viscous
        )

    return arm._replace(
        resistances=tuple(vary(drag) for drag in arm.resistances), belt=vary(arm.belt)
    )


def _change(
    drag: Resistance, word: str, force: float, motion: list[Array]
) -> tuple[Resistance, float]:
    """Return the resistance of a joint with a defect, and the magnitude of the defect.

    force: rms force that the defect adds, N or Nm, with sign; motion: position, speed and
    acceleration of the joint, each of shape (ticks,).
    """
    position, speed, acceleration = (float(np.sqrt(np.mean(each**2))) for each in motion)
    if word == "coulomb":
        # Negative changes stop at 30 % of the nominal friction: it never vanishes.
        added = max(force, -0.7 * drag.slip)
        changed = drag._replace(slip=drag.slip + added, breakaway=drag.breakaway + added)
        return changed, changed.slip
    if word == "viscous":
        changed = drag._replace(viscous=drag.viscous + max(force / speed, -0.7 * drag.viscous))
        return changed, changed.viscous
    if word == "constant":
        return drag._replace(constant=force), force
    if word == "spring":
        rate = abs(force) / position
        return drag._replace(spring=rate), rate
    changed = drag._replace(rotor=drag.rotor + abs(force) / acceleration)
    return changed, changed.rotor


def _unmodelled_force(
    word: str, joint: int, travel: JointTravel, usual: Array, size: float
) -> Array:
    """Return a force whose form the library does not have, N or Nm, shape (ticks,).

    usual: force of the joint without it; size: magnitude of the additional force.
    """
    if word == "warming":
        time = np.arange(len(usual)) * PERIOD
        return 2.0 * size * np.sign(travel.speed[joint]) * np.exp(-time / WARMED)
    if word == "hose":
        # A hose between two links pulls by the position of the neighbour.
        neighbour = travel.position[joint - 1 if joint else 1]
        pull = np.tanh(3.0 * (neighbour - np.mean(neighbour)) / np.std(neighbour))
        return size * pull * np.cos(travel.position[joint])
    # A force that saturates softly at 2.5 standard deviations, as a sagging supply does.
    limit = 2.5 * float(np.std(usual))
    return limit * np.tanh(usual / limit) - usual
