"""Random arms with withheld defects, and the acceptable answers.

The table of acceptable answers was fixed before the first diagnosis. A name outside a case's row
is wrong, whatever it explains.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from referee.arm_truth import Arm, Array, Link, Resistance

DESCRIPTIONS = Path(__file__).parent / "machines"
MACHINES: Mapping[str, str] = {
    name: str(DESCRIPTIONS / f"{name}.toml") for name in ("arm_2", "arm_3", "cart")
}
"""Path of the description of every machine."""


def _resistance(slip: float, viscous: float, rotor: float, fade_speed: float = 0.05) -> Resistance:
    return Resistance(
        slip=slip, breakaway=1.2 * slip, fade_speed=fade_speed, viscous=viscous, rotor=rotor
    )


NOMINAL: Mapping[str, Arm] = {
    "arm_2": Arm(
        None,
        (Link(0.4, 4.0, 0.18, 0.0, 0.06), Link(0.3, 2.5, 0.13, 0.0, 0.022)),
        (_resistance(1.8, 1.2, 0.12), _resistance(0.9, 0.5, 0.05)),
    ),
    "arm_3": Arm(
        None,
        (
            Link(0.35, 5.0, 0.16, 0.0, 0.06),
            Link(0.3, 3.0, 0.13, 0.0, 0.03),
            Link(0.2, 1.2, 0.07, 0.0, 0.006),
        ),
        (_resistance(2.0, 1.5, 0.15), _resistance(1.2, 0.8, 0.08), _resistance(0.5, 0.3, 0.02)),
        _resistance(0.4, 0.2, 0.015),
    ),
    "cart": Arm(
        6.0,
        (Link(0.5, 2.0, 0.4, 0.0, 0.02),),
        (_resistance(6.0, 8.0, 1.5, 0.02), _resistance(0.15, 0.05, 0.01)),
    ),
}
"""Parameters of the descriptions, typed in by hand."""
# Names of joints, sensors and last bodies in the descriptions.
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
"""Name of the last body of every machine."""
ACCEPTED: Mapping[str, tuple[str, ...]] = {
    # defect: accepted names; G is the joint, R its rotor, A and F its sensors, B the last body
    "coulomb": ("coulomb@G",),
    "viscous": ("viscous@G",),
    "constant": ("offset@G", "asymmetry@G"),
    "spring": ("stiffness@G",),
    "rotor": ("armature@R",),
    "gain": ("gain@F",),
    "zero": ("offset@A",),
    "payload": ("payload@B",),
    # defects whose form the library does not have
    "warming": ("coulomb@G",),
    "hose": (),
    "sagging": ("gain@F",),
}
EQUIVALENT: Mapping[str, Mapping[str, frozenset[str]]] = {
    "cart": {"armature@rotor_2": frozenset({"inertia@pendulum"})}
}
"""Machine → name → names of the same physical effect.

A cart does not rotate, so the pendulum has one moment of inertia about its pivot. Rotor and
pendulum cannot be told apart.
"""
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
"""Order in which the sorts of case are drawn."""


@dataclass(frozen=True)
class ArmCase:
    """A random arm with its defects.

    Attributes
    ----------
    machine : str
        Machine, one of `MACHINES`.
    sort : str
        `none`, `single`, `pair` or `outside`.
    defects : tuple
        Word of `ACCEPTED` and number of the joint of every defect.
    number, seed : int
        Number and seed from which it is drawn.
    """

    machine: str
    sort: str
    defects: tuple[tuple[str, int], ...]
    number: int
    seed: int

    def accept(self, defect: tuple[str, int]) -> frozenset[str]:
        """Return the acceptable names of one defect, kind@component."""
        word, joint = defect
        places = {
            "G": GUIDES[self.machine][joint],
            "R": f"rotor_{joint + 1}",
            "A": ANGLES[self.machine][joint],
            "F": FORCES[self.machine][joint],
            "B": LAST[self.machine],
        }
        pairs = (name.split("@") for name in ACCEPTED[word])
        names = frozenset(f"{kind}@{places[place]}" for kind, place in pairs)
        return names | EQUIVALENT.get(self.machine, {}).get(next(iter(names), ""), frozenset())


@dataclass(frozen=True)
class ArmTest:
    """One test of an arm.

    Attributes
    ----------
    columns : dict
        Topic → field → values, shape (ticks,).
    period : float
        Sample period, s.
    magnitudes : tuple of float
        Magnitude of every defect, in its unit.
    """

    columns: dict[str, dict[str, Array]]
    period: float
    magnitudes: tuple[float, ...]


def draw_arm(number: int, seed: int) -> ArmCase:
    """Return a case by its number: every sort in turn, with random machine and joints."""
    sort = ROUND[number % len(ROUND)]
    random = np.random.default_rng([seed, number, 7])
    machine = str(random.choice(list(MACHINES)))
    joints = len(GUIDES[machine])
    before = sum(ROUND[n % len(ROUND)] == sort for n in range(number))
    defects: tuple[tuple[str, int], ...] = ()
    if sort == "single":
        word = SINGLES[(before + seed) % len(SINGLES)]
        # A position along the rail changes no force, so its offset is unobservable.
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
