"""Draws arms whose defects are withheld, records tests of them, and says what a person would accept
as an answer about each.

The table of acceptable answers stood before the first diagnosis was made with it. A name that is
not in a case's row is wrong, whatever it explains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from referee.arm_truth import Arm, Array, Drag, Link, Travel, add_ball, drive

OWN = Path(__file__).parent / "machines"
MACHINES: Mapping[str, str] = {
    name: str(OWN / f"{name}.toml") for name in ("arm_2", "arm_3", "cart")
}
"""Sort of machine → its description."""


def _drag(slip: float, viscous: float, rotor: float, slow: float = 0.05) -> Drag:
    return Drag(slip=slip, breakaway=1.2 * slip, slow=slow, viscous=viscous, rotor=rotor)


NOMINAL: Mapping[str, Arm] = {
    "arm_2": Arm(
        None,
        (Link(0.4, 4.0, 0.18, 0.0, 0.06), Link(0.3, 2.5, 0.13, 0.0, 0.022)),
        (_drag(1.8, 1.2, 0.12), _drag(0.9, 0.5, 0.05)),
    ),
    "arm_3": Arm(
        None,
        (
            Link(0.35, 5.0, 0.16, 0.0, 0.06),
            Link(0.3, 3.0, 0.13, 0.0, 0.03),
            Link(0.2, 1.2, 0.07, 0.0, 0.006),
        ),
        (_drag(2.0, 1.5, 0.15), _drag(1.2, 0.8, 0.08), _drag(0.5, 0.3, 0.02)),
        _drag(0.4, 0.2, 0.015),
    ),
    "cart": Arm(
        6.0,
        (Link(0.5, 2.0, 0.4, 0.0, 0.02),),
        (_drag(6.0, 8.0, 1.5, 0.02), _drag(0.15, 0.05, 0.01)),
    ),
}
"""What the descriptions say of the machines, by hand."""
GUIDES = {
    "arm_2": ("shoulder", "elbow"),
    "arm_3": ("shoulder", "elbow", "wrist"),
    "cart": ("rail", "pivot"),
}
ANGLES = {
    "arm_2": ("angle_1", "angle_2"),
    "arm_3": ("angle_1", "angle_2", "angle_3"),
    "cart": ("position_1", "angle_2"),
}
FORCES = {
    "arm_2": ("torque_1", "torque_2"),
    "arm_3": ("torque_1", "torque_2", "torque_3"),
    "cart": ("force_1", "torque_2"),
}
LAST = {"arm_2": "link_2", "arm_3": "link_3", "cart": "pendulum"}
"""Of each machine's joints, and of its last body: what the description calls them."""
ACCEPTED: Mapping[str, tuple[str, ...]] = {
    # what is in it: names, where G is the joint, R its rotor, A and F its sensors, B the last body
    "coulomb": ("coulomb@G",),
    "viscous": ("viscous@G",),
    "constant": ("offset@G", "asymmetry@G"),
    "spring": ("stiffness@G",),
    "rotor": ("armature@R",),
    "gain": ("gain@F",),
    "zero": ("offset@A",),
    "payload": ("payload@B",),
    # of forms that the library does not have
    "warming": ("coulomb@G",),
    "hose": (),
    "sagging": ("gain@F",),
}
SAME: Mapping[str, Mapping[str, frozenset[str]]] = {
    "cart": {"armature@rotor_2": frozenset({"inertia@pendulum"})}
}
"""Machine → name → others that are the very same there: what hangs from a cart, which does not
turn, has one moment of inertia about its pivot, whether rotor or pendulum."""
SINGLES = ("coulomb", "viscous", "constant", "spring", "rotor", "gain", "zero", "payload")
PAIRED = ("coulomb", "viscous", "constant", "spring", "rotor", "gain")
OUTSIDE = ("warming", "hose", "sagging")
ROUND = (
    "single",
    "none",
    "pair",
    "single",
    "single",
    "outside",
    "single",
    "pair",
    "none",
    "single",
)
"""Sorts of case in the order in which they are drawn."""
TRUE = 0.02
"""Share by which the friction of a real machine is off what its description says, at most; the
description tolerates 5 %."""
PERIOD, SECONDS, WAVES = 2e-3, 12.0, 6
"""s, of a tick and of a test, and sines in the motion of each joint."""
ANGULAR, LINEAR = 2e-5, 1e-5
"""rad and m that the encoders tell apart."""
NOISE = (0.01, 0.03)
"""rms of the forces' white noise, from motor currents, as a share of their swing."""
BALL = 0.02
"""m, radius of what is fixed to a link."""
WARMED = 4.0
"""s in which friction changes."""


@dataclass(frozen=True)
class ArmCase:
    """machine: which; sort: none, single, pair or outside; defects: (word of `ACCEPTED`, number of
    its joint) each; number, seed: it was drawn with."""

    machine: str
    sort: str
    defects: tuple[tuple[str, int], ...]
    number: int
    seed: int

    def accept(self, defect: tuple[str, int]) -> frozenset[str]:
        """Names that a person would accept for one defect, kind@component."""
        word, joint = defect
        places = {
            "G": GUIDES[self.machine][joint],
            "R": f"rotor_{joint + 1}",
            "A": ANGLES[self.machine][joint],
            "F": FORCES[self.machine][joint],
            "B": LAST[self.machine],
        }
        pairs = (name.split("@") for name in ACCEPTED[word])
        found = frozenset(f"{kind}@{places[place]}" for kind, place in pairs)
        return found | SAME.get(self.machine, {}).get(next(iter(found), ""), frozenset())


@dataclass(frozen=True)
class ArmTest:
    """One test. columns: topic → field → values, shape (ticks,); period: s; magnitudes: of each
    defect, in its unit."""

    columns: dict[str, dict[str, Array]]
    period: float
    magnitudes: tuple[float, ...]


def draw_arm(number: int, seed: int) -> ArmCase:
    """The case of that number: every sort in turn, every machine and kind by chance."""
    sort = ROUND[number % len(ROUND)]
    random = np.random.default_rng([seed, number, 7])
    machine = str(random.choice(list(MACHINES)))
    joints = len(GUIDES[machine])
    before = sum(ROUND[n % len(ROUND)] == sort for n in range(number))
    defects: tuple[tuple[str, int], ...] = ()
    if sort == "single":
        word = SINGLES[(before + seed) % len(SINGLES)]
        # A position along the rail changes no force, so its zero cannot be seen.
        blind = word == "zero" and machine == "cart"
        defects = ((word, 1 if blind else int(random.integers(joints))),)
    elif sort == "pair":
        places = random.choice(joints, 2, replace=False)
        words = random.choice(PAIRED, 2)
        defects = tuple((str(w), int(p)) for w, p in zip(words, places, strict=True))
    elif sort == "outside":
        word = OUTSIDE[(before + seed) % len(OUTSIDE)]
        defects = ((word, int(random.integers(joints))),)
    return ArmCase(machine, sort, defects, number, seed)


@dataclass(frozen=True)
class Broken:
    """A machine with its defects. gains, zeros: of the sensors of force and motion, shape
    (joints,); strange: (word, joint, N or Nm) of forces that the library has no form for;
    magnitudes: of each defect, in its unit; swings: of the usual forces, shape (joints,)."""

    arm: Arm
    gains: Array
    zeros: Array
    strange: tuple[tuple[str, int, float], ...]
    magnitudes: tuple[float, ...]
    swings: Array


def build_arm(case: ArmCase) -> Broken:
    """The machine of a case, in all its tests the same: defects are sized by a motion of their
    own."""
    own = np.random.default_rng([case.seed, case.number, 11])
    arm = _vary(NOMINAL[case.machine], own)
    travel = wave(case.machine, np.random.default_rng([case.seed, case.number, 17]))
    swings = np.std(drive(arm, travel), axis=1)
    gains, zeros = np.ones(len(swings)), np.zeros(len(swings))
    strange: list[tuple[str, int, float]] = []
    magnitudes: list[float] = []
    for word, joint in case.defects:
        share = _spread(own, 0.06, 0.25) * (1.0 if own.random() < 0.5 else -1.0)
        force = share * float(swings[joint])
        if word == "gain":
            gains[joint] += share
            magnitudes.append(float(gains[joint]))
        elif word == "zero":
            zeros[joint] = math.copysign(_spread(own, 0.015, 0.08), share)
            magnitudes.append(float(zeros[joint]))
        elif word == "payload":
            last = arm.links[-1]
            mass = _spread(own, 0.05, 0.4) * last.mass
            along, across = own.uniform(0.3, 1.0), own.uniform(-0.1, 0.1)
            ball = add_ball(last, mass, along * last.length, across * last.length, BALL)
            arm = arm._replace(links=(*arm.links[:-1], ball))
            magnitudes.append(mass)
        elif word in OUTSIDE:
            strange.append((word, joint, abs(force)))
            magnitudes.append(abs(force))
        else:
            # So large that it changes the joint's force by that share of what it usually is.
            drag, size = _change(arm.drags[joint], word, force, [each[joint] for each in travel])
            drags = tuple(drag if n == joint else each for n, each in enumerate(arm.drags))
            arm = arm._replace(drags=drags)
            magnitudes.append(size)
    return Broken(arm, gains, zeros, tuple(strange), tuple(magnitudes), swings)


def record_arm(case: ArmCase, again: int = 0) -> ArmTest:
    """A test of a case. again: another one of the same machine."""
    broken = build_arm(case)
    test = np.random.default_rng([case.seed, case.number, 13, again])
    travel = wave(case.machine, test)
    force = drive(broken.arm, travel)
    for word, joint, size in broken.strange:
        force[joint] += _act_strangely(word, joint, travel, force[joint], size)
    noise = _spread(test, *NOISE) * broken.swings
    force = broken.gains[:, None] * force + noise[:, None] * test.standard_normal(force.shape)
    read = travel.position + broken.zeros[:, None]
    bits = np.full(len(read), ANGULAR)
    if case.machine == "cart":
        bits[0] = LINEAR
    read = np.round(read / bits[:, None]) * bits[:, None]
    sensors = dict(zip(ANGLES[case.machine], read, strict=True))
    sensors.update(zip(FORCES[case.machine], force, strict=True))
    return ArmTest({"/sensor": sensors}, PERIOD, broken.magnitudes)


def wave(machine: str, random: np.random.Generator) -> Travel:
    """A motion of all joints, each a sum of sines of its own."""
    time = np.arange(round(SECONDS / PERIOD)) * PERIOD
    found = []
    for guide in GUIDES[machine]:
        reach = 0.12 if guide == "rail" else random.uniform(0.6, 1.0)
        frequency = np.sort(np.exp(random.uniform(math.log(0.12), math.log(1.3), WAVES)))
        size = frequency**-0.8 * random.uniform(0.5, 1.0, WAVES)
        phase = random.uniform(-math.pi, math.pi, WAVES)
        rate = 2.0 * math.pi * frequency[:, None]
        turned = rate * time + phase[:, None]
        size = reach * (size / np.sum(size))[:, None]
        middle = 0.0 if guide == "rail" else random.uniform(-0.5, 0.5)
        found.append(
            [
                middle + np.sum(size * np.sin(turned), axis=0),
                np.sum(size * rate * np.cos(turned), axis=0),
                -np.sum(size * rate**2 * np.sin(turned), axis=0),
            ]
        )
    return Travel(*np.stack(found, axis=1))


def _spread(random: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def _vary(arm: Arm, random: np.random.Generator) -> Arm:
    """A machine as it was made, whose friction is not quite what its description says."""

    def vary(drag: Drag) -> Drag:
        dry, viscous = 1.0 + TRUE * random.uniform(-1.0, 1.0, 2)
        return drag._replace(
            slip=dry * drag.slip, breakaway=dry * drag.breakaway, viscous=viscous * drag.viscous
        )

    return arm._replace(drags=tuple(vary(drag) for drag in arm.drags), belt=vary(arm.belt))


def _change(drag: Drag, word: str, force: float, motion: list[Array]) -> tuple[Drag, float]:
    """What resists at a joint with a defect that is worth that force, rms, and its magnitude.
    motion: position, speed and acceleration of the joint, shape (ticks,) each."""
    position, speed, acceleration = (float(np.sqrt(np.mean(each**2))) for each in motion)
    if word == "coulomb":
        more = max(force, -0.7 * drag.slip)
        changed = drag._replace(slip=drag.slip + more, breakaway=drag.breakaway + more)
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


def _act_strangely(word: str, joint: int, travel: Travel, usual: Array, size: float) -> Array:
    """What the library has no form for, at a joint, N or Nm, shape (ticks,): of that size, beside
    what its force is otherwise."""
    if word == "warming":
        time = np.arange(len(usual)) * PERIOD
        return 2.0 * size * np.sign(travel.speed[joint]) * np.exp(-time / WARMED)
    if word == "hose":
        # It hangs from the neighbour, and pulls by where that is.
        beside = travel.position[joint - 1 if joint else 1]
        pull = np.tanh(3.0 * (beside - np.mean(beside)) / np.std(beside))
        return size * pull * np.cos(travel.position[joint])
    limit = 2.5 * float(np.std(usual))
    return limit * np.tanh(usual / limit) - usual
