"""Random servos known by command and angle alone, with withheld defects, and acceptable answers.

The table of acceptable answers was fixed before the first diagnosis. A name outside a case's row
is wrong, whatever it explains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from referee.servo_truth import Array, ServoTruth, angles_under

DESCRIPTION = str(Path(__file__).parent / "machines" / "servo.toml")
"""Path of the description."""
NOMINAL = ServoTruth(
    inertia=0.03,
    rotor=0.01,
    weight=1.2,
    stiffness=30.0,
    damping=1.5,
    coulomb=0.0,
    viscous=0.0,
    play=0.0,
    delay=0.0,
)
"""Parameters of the description, typed in by hand."""
ACCEPTED: Mapping[str, tuple[frozenset[str], ...]] = {
    # Each set holds names of one thing; one of each set must be named.
    "delay": (frozenset({"delay@servo", "lag@servo"}),),
    "coulomb": (frozenset({"coulomb@joint"}),),
    "viscous": (frozenset({"viscous@joint", "damping_gain@servo"}),),
    "gains": (frozenset({"gains@servo", "position_gain@servo"}),),
    "play": (frozenset({"backlash@servo"}),),
}
"""Defect → acceptable names."""
BESIDE: Mapping[str, frozenset[str]] = {"gains": frozenset({"damping_gain@servo", "viscous@joint"})}
"""Defect → names that are acceptable beside those of `ACCEPTED`."""
ROUND = (
    ("delay",),
    (),
    ("coulomb",),
    ("delay", "coulomb"),
    ("gains",),
    ("play",),
    ("viscous",),
    (),
    ("delay", "coulomb", "viscous"),
    ("gains", "coulomb"),
)
"""Order in which the defects are drawn."""
RATES = (20.0, 50.0, 100.0, 200.0)
"""Rates of the logs, Hz."""
SECONDS, WAVES = 20.0, 5
"""Length of a test, s, and number of sines of the command."""
BITS = (2e-4, 1.5e-3)
"""Range of the encoder's resolution, rad."""


@dataclass(frozen=True)
class ServoCase:
    """A random servo with its defects, and the number and seed that determine it."""

    defects: tuple[str, ...]
    number: int
    seed: int

    @property
    def demanded(self) -> tuple[frozenset[str], ...]:
        """Sets of names of which one must be named each."""
        return tuple(names for defect in self.defects for names in ACCEPTED[defect])

    @property
    def accepted(self) -> frozenset[str]:
        """All acceptable names."""
        beside = (BESIDE.get(defect, frozenset()) for defect in self.defects)
        return frozenset().union(*self.demanded, *beside)


@dataclass(frozen=True)
class ServoTest:
    """One test of a servo.

    Attributes
    ----------
    columns : dict
        Topic → field → values, shape (rows,).
    period : float
        Time from row to row, s.
    truth : ServoTruth
        The servo that was tested.
    """

    columns: dict[str, dict[str, Array]]
    period: float
    truth: ServoTruth


def draw_servo(number: int, seed: int) -> ServoCase:
    """Return a case by its number: every combination of defects in turn."""
    return ServoCase(ROUND[number % len(ROUND)], number, seed)


def build_servo(case: ServoCase) -> tuple[ServoTruth, float]:
    """Return the servo of a case, which is the same in all its tests, and its period, s."""
    random = np.random.default_rng([case.seed, case.number, 31])
    servo, period = NOMINAL, 1.0 / float(random.choice(RATES))
    if "delay" in case.defects:
        servo = servo._replace(delay=period * _spread(random, 0.5, 5.0))
    if "coulomb" in case.defects:
        servo = servo._replace(coulomb=_spread(random, 0.08, 0.5))
    if "viscous" in case.defects:
        servo = servo._replace(viscous=_spread(random, 0.4, 2.0))
    if "gains" in case.defects:
        factor = float(random.choice([_spread(random, 0.4, 0.7), _spread(random, 1.6, 4.0)]))
        servo = servo._replace(stiffness=factor * servo.stiffness, damping=factor * servo.damping)
    if "play" in case.defects:
        servo = servo._replace(play=_spread(random, 0.03, 0.12))
    return servo, period


def record_servo(case: ServoCase, again: int = 0) -> ServoTest:
    """Record a test of a case; again: number of the repetition on the same machine."""
    servo, period = build_servo(case)
    random = np.random.default_rng([case.seed, case.number, 37, again])
    command = draw_command(period, random)
    angle = angles_under(servo, command, period)
    bit = _spread(np.random.default_rng([case.seed, case.number, 41]), *BITS)
    angle = bit * np.round((angle + 0.3 * bit * random.standard_normal(len(angle))) / bit)
    columns = {"/command": {"servo": command}, "/sensor": {"encoder": angle}}
    return ServoTest(columns, period, servo)


def draw_command(period: float, random: np.random.Generator) -> Array:
    """Draw a command: a sum of sines and some steps, rad, shape (rows,)."""
    time = np.arange(round(SECONDS / period)) * period
    frequency = np.exp(random.uniform(math.log(0.1), math.log(1.5), WAVES))
    size = frequency**-0.5 * random.uniform(0.5, 1.0, WAVES)
    phase = random.uniform(-math.pi, math.pi, WAVES)
    waves = np.sin(2.0 * math.pi * frequency[:, None] * time + phase[:, None])
    command = random.uniform(0.4, 0.8) * np.sum((size / size.sum())[:, None] * waves, axis=0)
    for start in random.uniform(2.0, SECONDS - 2.0, 4):
        command += random.uniform(-0.25, 0.25) * ((time > start) & (time < start + 1.5))
    return command


def _spread(random: np.random.Generator, low: float, high: float) -> float:
    """Draw a number between two bounds, uniform in its logarithm."""
    return float(math.exp(random.uniform(math.log(low), math.log(high))))
