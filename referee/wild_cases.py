"""Draws machines whose physics have other forms than the library's, and says what a person would
accept as an answer about each.

The table of acceptable answers stood before the first diagnosis was made with it. A name that is
not in a machine's row is wrong, whatever it explains; to name nothing is never wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from referee.benches import wander
from referee.wild_truth import (
    FINE,
    Array,
    Bending,
    Following,
    Rubbing,
    Sensing,
    carriage,
    drive,
    follow,
    hold,
    sense,
)

OWN = Path(__file__).parent / "machines"
MACHINES: Mapping[str, str] = {
    "damper": "damper-bench",
    "actuator": "position-actuator",
    "carriage": "emps",
    "arm": str(OWN / "swinging_arm.toml"),
}
"""Sort of machine → its description."""
GUIDES = {"damper": "damper", "carriage": "guide", "arm": "bearing"}
DRIVES = {"carriage": "drive", "arm": "drive", "actuator": "actuator"}
SENSORS = {"damper": "load_cell", "carriage": "encoder", "arm": "encoder", "actuator": "sensor"}
DRY = ("coulomb", "stribeck", "breakaway")
ACCEPTED: Mapping[str, tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {
    # what is in it: kinds at the guide, at the drive, at the sensor
    "viscous": (("viscous",), (), ()),
    "dry": (("coulomb",), (), ()),
    "lugre": ((*DRY, "compliance", "viscous"), (), ()),
    "tanh": ((*DRY, "viscous", "relaxation"), (), ()),
    "load": ((*DRY, "load_friction"), (), ()),
    "warming": ((*DRY, "viscous"), (), ()),
    "rider": (("mass", "compliance", "relaxation"), ("resonance",), ()),
    "frame": ((*DRY, "viscous", "relaxation", "compliance", "mount"), (), ()),
    "wearing": (("viscous",), (), ()),
    "coloured": ((), (), ("noise",)),
    "steps": ((), (), ("quantisation",)),
    "eccentric": ((), (), ("gain",)),
    "ripple": (("cogging",), ("cogging",), ()),
    "hardening": (("stiffness", "hardening"), (), ()),
    "sag": ((), ("gain", "saturation"), ()),
    "late": ((), ("delay", "lag"), ("delay", "lag")),
    "lagging": ((), ("lag", "two_lags", "delay", "resonance"), ()),
    "soft limit": ((), ("rate_limit", "saturation", "lag", "two_lags"), ()),
    "loose": ((), ("deadband", "backlash"), ()),
    "fading": ((), ("gain",), ()),
    "sprung load": ((), ("resonance", "two_lags", "lag", "delay", "compliance"), ()),
    "curved lag": ((), ("lag", "two_lags", "rate_limit"), ()),
}
SORTS: Mapping[str, tuple[str, ...]] = {
    "damper": (
        "viscous, dry",
        "viscous, lugre",
        "viscous, tanh",
        "viscous, dry, warming",
        "viscous, dry, frame",
        "viscous, wearing",
        "viscous, dry, coloured",
        "dry, steps",
        "dry, hardening",
        "viscous, rider",
        "viscous, late",
        "lugre, hardening",
        "viscous, lugre, steps",
    ),
    "actuator": (
        "lagging",
        "lagging, coloured",
        "lagging, steps",
        "soft limit",
        "lagging, loose",
        "lagging, fading",
        "lagging, sprung load",
        "curved lag",
        "lagging, late",
    ),
    "carriage": (
        "lugre",
        "tanh",
        "dry, ripple",
        "dry, sag",
        "dry, rider",
        "dry, steps",
        "dry, warming",
    ),
    "arm": (
        "viscous, dry",
        "viscous, lugre",
        "viscous, load",
        "viscous, dry, eccentric",
        "viscous, dry, steps",
        "viscous, dry, ripple",
        "viscous, dry, hardening",
        "viscous, dry, sag",
    ),
}
"""Sort of machine → what may be in it."""
ROUND = ("damper", "actuator", "damper", "actuator", "carriage", "damper", "actuator", "arm")
"""Machines in the order in which they are drawn."""
GAINS = (35.15065, 160.18, 243.45)
"""Of the carriage's controller."""


@dataclass(frozen=True)
class WildCase:
    """machine: which sort; parts: what is in it, words of `ACCEPTED`; number, seed: it was drawn
    with."""

    machine: str
    parts: tuple[str, ...]
    number: int
    seed: int

    @property
    def accepted(self) -> frozenset[str]:
        """Names that a person would accept, kind@component."""
        found = set()
        for part in self.parts:
            for places, kinds in zip((GUIDES, DRIVES, SENSORS), ACCEPTED[part], strict=True):
                if self.machine in places:
                    found |= {f"{kind}@{places[self.machine]}" for kind in kinds}
            if "mass" in ACCEPTED[part][0]:
                found |= {"mass@carriage", "mass@arm"}
        return frozenset(found)


@dataclass(frozen=True)
class WildData:
    """One test. columns: topic → field → values, shape (ticks,); period: s; magnitudes: what is
    true of the parameters that have a true value, by kind@component."""

    columns: dict[str, dict[str, Array]]
    period: float
    magnitudes: dict[str, float]


def draw_wild(number: int, seed: int) -> WildCase:
    """The case of that number: every sort of every machine in turn."""
    machine = ROUND[number % len(ROUND)]
    before = sum(ROUND[n % len(ROUND)] == machine for n in range(number))
    sorts = SORTS[machine]
    parts = tuple(sorts[(before + seed) % len(sorts)].split(", "))
    return WildCase(machine, parts, number, seed)


def record_wild(case: WildCase, again: int = 0) -> WildData:
    """A test of a case. again: another one of the same machine."""
    own = np.random.default_rng([case.seed, case.number, 11])
    test = np.random.default_rng([case.seed, case.number, 13, again])
    return RECORD[case.machine](case, own, test)


def _spread(random: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def _rubbing(
    parts: tuple[str, ...], random: np.random.Generator, slip: float, viscous: float, speed: float
) -> Rubbing:
    """Of sizes about `slip` N and `viscous` Ns/m, for a machine that goes up to `speed` m/s."""
    size = slip * _spread(random, 0.4, 2.0)
    damping = viscous * _spread(random, 0.4, 2.0)
    lugre, warms = "lugre" in parts, "warming" in parts
    breakaway, slow = 1.0 + random.uniform(0.2, 0.8), speed * _spread(random, 0.02, 0.1)
    bristle, smooth = _spread(random, 2e-4, 2e-3) * speed, speed * _spread(random, 0.02, 0.1)
    by_load, cooled = _spread(random, 0.01, 0.04), random.uniform(0.2, 0.45)
    warming, worn = random.uniform(2.0, 8.0), random.uniform(0.02, 0.05)
    return Rubbing(
        slip=size if {"dry", "lugre", "tanh"} & set(parts) else 0.0,
        breakaway=breakaway if lugre else 1.0,
        slow=slow,
        bristle=bristle if lugre else (2e-5 if "frame" in parts else 2e-6) * speed,
        smooth=smooth if "tanh" in parts else 0.0,
        by_load=by_load if "load" in parts else 0.0,
        viscous=damping if {"viscous", "wearing"} & set(parts) else 0.0,
        cooled=cooled if warms else 0.0,
        warming=warming,
        worn=worn if "wearing" in parts else 0.0,
    )


def _true_sizes(case: WildCase, r: Rubbing) -> dict[str, float]:
    """Magnitudes of what has the library's form: interval and truth can be compared."""
    guide, found = GUIDES[case.machine], {}
    if "dry" in case.parts and not r.cooled:
        found[f"coulomb@{guide}"] = r.slip
    if "viscous" in case.parts and not r.cooled and not r.worn and not r.smooth:
        found[f"viscous@{guide}"] = r.viscous
    return found


def _record_damper(case: WildCase, own: np.random.Generator, test: np.random.Generator) -> WildData:
    period, seconds, parts = float(own.choice([1e-3, 2e-3])), 12.0, case.parts
    r = _rubbing(parts, own, 100.0, 900.0, 0.15)
    bending = Bending(
        rate=_spread(own, 500.0, 3000.0) if "hardening" in parts else 0.0,
        cubic=_spread(own, 5e5, 5e6) if "hardening" in parts else 0.0,
        rider=_spread(own, 1.0, 4.0) if "rider" in parts else 0.0,
        frequency=_spread(own, 4.0, 12.0),
        ratio=_spread(own, 0.03, 0.2),
        frame=_spread(own, 2e4, 1e5) if "frame" in parts else 0.0,
    )
    reach = float(test.uniform(0.02, 0.04))
    motion = wander(test, seconds, period / FINE, reach, 0.1, 3.0)
    force = hold(r, bending, motion, period)
    size = float(np.std(force))
    cell = Sensing(
        noise=0.01 * size,
        coloured=_spread(own, 0.02, 0.06) * size if "coloured" in parts else 0.0,
        bit=10.0 * size / 4096.0 * _spread(own, 1.0, 8.0) if "steps" in parts else 0.0,
        late=_spread(own, 0.004, 0.02) if "late" in parts else 0.0,
    )
    place = Sensing(noise=5e-6, bit=0.2 / 4096.0 if "steps" in parts else 1e-6)
    columns = {
        "displacement": sense(test, motion[::FINE], place, period),
        "force": sense(test, force, cell, period),
    }
    return WildData({"/sensor": columns}, period, _true_sizes(case, r))


def _record_actuator(
    case: WildCase, own: np.random.Generator, test: np.random.Generator
) -> WildData:
    period, parts = float(own.choice([1e-3, 2e-3])), case.parts
    lag = _spread(own, 0.01, 0.05)
    truth = Following(
        lag=0.3 * lag if "sprung load" in parts else lag,
        late=_spread(own, 0.006, 0.03) if "late" in parts else 0.0,
        fastest=_spread(own, 0.08, 0.2) if "soft limit" in parts else 0.0,
        loose=_spread(own, 5e-4, 3e-3) if "loose" in parts else 0.0,
        fades=_spread(own, 0.005, 0.02) if "fading" in parts else 0.0,
        own=(_spread(own, 5.0, 15.0), float(own.uniform(0.1, 0.5)))
        if "sprung load" in parts
        else None,
        curved=_spread(own, 50.0, 300.0) if "curved lag" in parts else 0.0,
    )
    command = wander(test, 12.0, period, float(test.uniform(0.02, 0.04)), 0.1, 8.0)
    moved = follow(truth, command, period)
    by = Sensing(
        noise=2e-5,
        coloured=_spread(own, 1e-4, 5e-4) if "coloured" in parts else 0.0,
        bit=0.2 / 4096.0 if "steps" in parts else 1e-6,
    )
    columns = {"position": command}, {"position": sense(test, moved, by, period)}
    plain = set(parts) <= {"lagging", "steps"}
    return WildData(
        {"/command": columns[0], "/sensor": columns[1]},
        period,
        {"lag@actuator": truth.lag} if plain else {},
    )


def _record_carriage(
    case: WildCase, own: np.random.Generator, test: np.random.Generator
) -> WildData:
    period, parts = 1e-3, case.parts
    r = _rubbing((*parts, "viscous"), own, 20.0, 203.5, 0.15)._replace(viscous=203.5)
    bending = Bending(
        ripple=_spread(own, 2.0, 8.0) if "ripple" in parts else 0.0,
        pitch=_spread(own, 0.008, 0.03),
        phase=float(own.uniform(-3.0, 3.0)),
        rider=_spread(own, 8.0, 25.0) if "rider" in parts else 0.0,
        frequency=_spread(own, 8.0, 25.0),
        ratio=_spread(own, 0.03, 0.15),
    )
    time = np.arange(10000) * period
    slow, fast = test.uniform(0.5, 0.8), test.uniform(2.5, 4.0)
    reference = 0.11 - 0.11 * np.cos(slow * time) + 0.012 * np.sin(fast * time)
    by = Sensing(noise=2e-7)
    noise = by.noise * test.standard_normal(len(time))
    sag = _spread(own, 5e-4, 3e-3) if "sag" in parts else 0.0
    bit = 2e-6 if "steps" in parts else 0.0
    read, force = carriage(r, bending, 95.1, GAINS, reference, noise, sag, bit, period)
    columns = {
        "/command": {
            "reference": reference,
            "pulse_voltage": np.zeros(len(time)),
            "force": force,
        },
        "/sensor": {"position": read},
    }
    return WildData(columns, period, _true_sizes(case, r))


def _record_arm(case: WildCase, own: np.random.Generator, test: np.random.Generator) -> WildData:
    period, parts = 5e-3, case.parts
    r = _rubbing(parts, own, 0.02, 0.008, 4.0)
    bending = Bending(
        rate=_spread(own, 0.05, 0.3) if "hardening" in parts else 0.0,
        cubic=_spread(own, 0.1, 0.6) if "hardening" in parts else 0.0,
        ripple=_spread(own, 0.02, 0.08) if "ripple" in parts else 0.0,
        pitch=2.0 * math.pi / float(own.integers(6, 16)),
        phase=float(own.uniform(-3.0, 3.0)),
    )
    ticks = 1600
    # Arms come once a round, at the same place in it: every second round has a free swing.
    free = not ({"sag", "ripple"} & set(parts)) and case.number // len(ROUND) % 2 == 0
    torque, start = np.zeros(ticks), float(test.uniform(0.8, 1.5))
    if not free:
        torque, start = 0.4 * wander(test, ticks * period, period, 1.0, 0.2, 2.0), 0.0
    sag = _spread(own, 0.3, 1.0) if "sag" in parts else 0.0
    inertia, arm = 0.5 * 0.15**2 + 0.002, 0.5 * 0.15 * 9.80665
    angle = drive(r, bending, inertia, arm, start, torque, sag, period)
    by = Sensing(
        noise=1e-4,
        bit=2.0 * math.pi / 4096.0 if "steps" in parts else 2.0 * math.pi / 65536.0,
        eccentric=_spread(own, 0.01, 0.03) / (2.0 * math.pi) if "eccentric" in parts else 0.0,
        pitch=2.0 * math.pi,
    )
    columns = {
        "/command": {"torque": torque},
        "/sensor": {"position": sense(test, angle, by, period)},
    }
    return WildData(columns, period, _true_sizes(case, r))


RECORD: Mapping[str, Callable[[WildCase, np.random.Generator, np.random.Generator], WildData]] = {
    "damper": _record_damper,
    "actuator": _record_actuator,
    "carriage": _record_carriage,
    "arm": _record_arm,
}
