"""Units that other programs' data come in, and the SI unit of each."""

from __future__ import annotations

import math
import re

from rigtwin.errors import RigtwinError

_TURN = math.pi / 180.0
UNITS: dict[str, tuple[str, float]] = {
    "m": ("m", 1.0),
    "dm": ("m", 0.1),
    "cm": ("m", 1e-2),
    "mm": ("m", 1e-3),
    "um": ("m", 1e-6),
    "nm": ("m", 1e-9),
    "in": ("m", 0.0254),
    "inch": ("m", 0.0254),
    "ft": ("m", 0.3048),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "deg": ("rad", _TURN),
    "rev": ("rad", 2.0 * math.pi),
    "m/s": ("m/s", 1.0),
    "mm/s": ("m/s", 1e-3),
    "cm/s": ("m/s", 1e-2),
    "km/h": ("m/s", 1.0 / 3.6),
    "in/s": ("m/s", 0.0254),
    "rad/s": ("rad/s", 1.0),
    "deg/s": ("rad/s", _TURN),
    "rpm": ("rad/s", math.pi / 30.0),
    "m/s^2": ("m/s^2", 1.0),
    "g": ("m/s^2", 9.80665),
    "N": ("N", 1.0),
    "mN": ("N", 1e-3),
    "kN": ("N", 1e3),
    "daN": ("N", 10.0),
    "MN": ("N", 1e6),
    "kgf": ("N", 9.80665),
    "lbf": ("N", 4.4482216152605),
    "lb": ("N", 4.4482216152605),
    "Nm": ("Nm", 1.0),
    "mNm": ("Nm", 1e-3),
    "kNm": ("Nm", 1e3),
    "V": ("V", 1.0),
    "mV": ("V", 1e-3),
    "A": ("A", 1.0),
    "mA": ("A", 1e-3),
    "Pa": ("Pa", 1.0),
    "kPa": ("Pa", 1e3),
    "MPa": ("Pa", 1e6),
    "bar": ("Pa", 1e5),
    "psi": ("Pa", 6894.757293168),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "min": ("s", 60.0),
    "h": ("s", 3600.0),
    "1": ("1", 1.0),
    "%": ("1", 1e-2),
}
"""Unit → (SI unit, how many of that it is)."""
_SPELLINGS = {
    "µm": "um",
    "μm": "um",
    "micron": "um",
    '"': "in",
    "°": "deg",
    "°/s": "deg/s",
    "degree": "deg",
    "degrees": "deg",
    "N·m": "Nm",
    "N*m": "Nm",
    "Newton": "N",
    "newton": "N",
    "volt": "V",
    "Volt": "V",
    "sec": "s",
    "seconds": "s",
    "meter": "m",
    "metre": "m",
    "": "1",
    "-": "1",
    "µs": "us",
    "μs": "us",
    "m/s²": "m/s^2",
    "1/min": "rpm",
}


def unit_of(text: str) -> tuple[str, float]:
    """(SI unit, factor) of a unit. Raises RigtwinError with what is known."""
    name = re.sub(r"^[\[(]|[\])]$", "", text.strip()).strip()
    name = _SPELLINGS.get(name, name)
    if name not in UNITS:
        raise RigtwinError(f"unknown unit {text!r}; there are {', '.join(UNITS)}")
    return UNITS[name]


def is_unit(text: str) -> bool:
    """Whether a cell holds a unit's name."""
    try:
        unit_of(text)
    except RigtwinError:
        return False
    return True
