"""Random machines whose physics differ from the library's, with the acceptable answers.

The table of acceptable answers was fixed before the first diagnosis. A name outside a machine's
row is wrong, whatever it explains. To name nothing is never wrong.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

DESCRIPTIONS = Path(__file__).parent / "machines"
MACHINES: Mapping[str, str] = {
    "damper": "damper-bench",
    "actuator": "position-actuator",
    "carriage": "emps",
    "arm": str(DESCRIPTIONS / "swinging_arm.toml"),
}
"""Description of every sort of machine: a name or the path of a file."""
# Component of each sort of machine that can have the effects of a guide, a drive or a sensor.
GUIDES = {"damper": "damper", "carriage": "guide", "arm": "bearing"}
DRIVES = {"carriage": "drive", "arm": "drive", "actuator": "actuator"}
SENSORS = {"damper": "load_cell", "carriage": "encoder", "arm": "encoder", "actuator": "sensor"}
DRY = ("coulomb", "stribeck", "breakaway")
ACCEPTED: Mapping[str, tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {
    # part of a machine: accepted kinds at its guide, at its drive, at its sensor
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
    "eccentric": ((), (), ("gain", "eccentricity")),
    "ripple": (("cogging",), ("cogging",), ()),
    "hardening": (("stiffness", "cubic_stiffness", "position_force"), (), ()),
    "sag": ((), ("gain", "saturation", "curvature"), ()),
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
"""Combinations of parts that are drawn for each sort of machine."""
ROUND = ("damper", "actuator", "damper", "actuator", "carriage", "damper", "actuator", "arm")
"""Order in which the sorts of machine are drawn."""


@dataclass(frozen=True)
class WildCase:
    """A random machine.

    Attributes
    ----------
    machine : str
        Sort of machine, one of `MACHINES`.
    parts : tuple of str
        Parts of its physics, words of `ACCEPTED`.
    number, seed : int
        Number and seed from which it is drawn.
    """

    machine: str
    parts: tuple[str, ...]
    number: int
    seed: int

    @property
    def accepted(self) -> frozenset[str]:
        """Acceptable names, kind@component."""
        names = set()
        for part in self.parts:
            for places, kinds in zip((GUIDES, DRIVES, SENSORS), ACCEPTED[part], strict=True):
                if self.machine in places:
                    names |= {f"{kind}@{places[self.machine]}" for kind in kinds}
            if "mass" in ACCEPTED[part][0]:
                names |= {"mass@carriage", "mass@arm"}
        return frozenset(names)


def draw_wild(number: int, seed: int) -> WildCase:
    """Return a case by its number: all combinations of all machines in turn."""
    machine = ROUND[number % len(ROUND)]
    before = sum(ROUND[n % len(ROUND)] == machine for n in range(number))
    sorts = SORTS[machine]
    parts = tuple(sorts[(before + seed) % len(sorts)].split(", "))
    return WildCase(machine, parts, number, seed)
