"""Units of other programs' data, and their conversion to SI."""

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
    "mil": ("m", 2.54e-5),
    "km": ("m", 1e3),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "deg": ("rad", _TURN),
    "rev": ("rad", 2.0 * math.pi),
    "gon": ("rad", math.pi / 200.0),
    "m/s": ("m/s", 1.0),
    "mm/s": ("m/s", 1e-3),
    "cm/s": ("m/s", 1e-2),
    "km/h": ("m/s", 1.0 / 3.6),
    "in/s": ("m/s", 0.0254),
    "ft/s": ("m/s", 0.3048),
    "mph": ("m/s", 0.44704),
    "rad/s": ("rad/s", 1.0),
    "deg/s": ("rad/s", _TURN),
    "rpm": ("rad/s", math.pi / 30.0),
    "rev/s": ("rad/s", 2.0 * math.pi),
    "rad/s^2": ("rad/s^2", 1.0),
    "deg/s^2": ("rad/s^2", _TURN),
    "m/s^2": ("m/s^2", 1.0),
    "mm/s^2": ("m/s^2", 1e-3),
    "cm/s^2": ("m/s^2", 1e-2),
    "in/s^2": ("m/s^2", 0.0254),
    "ft/s^2": ("m/s^2", 0.3048),
    "g": ("m/s^2", 9.80665),
    "mg": ("m/s^2", 9.80665e-3),
    "N": ("N", 1.0),
    "mN": ("N", 1e-3),
    "kN": ("N", 1e3),
    "daN": ("N", 10.0),
    "MN": ("N", 1e6),
    "kgf": ("N", 9.80665),
    "lbf": ("N", 4.4482216152605),
    "lb": ("N", 4.4482216152605),
    "kip": ("N", 4448.2216152605),
    "ozf": ("N", 0.27801385095378),
    "Nm": ("Nm", 1.0),
    "mNm": ("Nm", 1e-3),
    "kNm": ("Nm", 1e3),
    "Ncm": ("Nm", 1e-2),
    "kgfcm": ("Nm", 0.0980665),
    "lbf in": ("Nm", 0.112984829027617),
    "lbf ft": ("Nm", 1.3558179483314),
    "ozf in": ("Nm", 0.0070615518142261),
    "V": ("V", 1.0),
    "mV": ("V", 1e-3),
    "uV": ("V", 1e-6),
    "kV": ("V", 1e3),
    "A": ("A", 1.0),
    "mA": ("A", 1e-3),
    "uA": ("A", 1e-6),
    "Pa": ("Pa", 1.0),
    "kPa": ("Pa", 1e3),
    "MPa": ("Pa", 1e6),
    "GPa": ("Pa", 1e9),
    "bar": ("Pa", 1e5),
    "mbar": ("Pa", 100.0),
    "psi": ("Pa", 6894.757293168),
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "ns": ("s", 1e-9),
    "min": ("s", 60.0),
    "h": ("s", 3600.0),
    "d": ("s", 86_400.0),
    "1": ("1", 1.0),
    "%": ("1", 1e-2),
}
"""Unit → SI unit, and the factor that converts to it."""
QUANTITIES = frozenset(unit for unit, _ in UNITS.values()) - {"1"}
"""SI units of the quantities that channels have."""
_SPELLINGS = {
    "µm": "um",
    "μm": "um",
    "micron": "um",
    '"': "in",
    "°": "deg",
    "°/s": "deg/s",
    "turn": "rev",
    "turns": "rev",
    "revolutions": "rev",
    "percent": "%",
    "pct": "%",
    "degree": "deg",
    "degrees": "deg",
    "radian": "rad",
    "radians": "rad",
    "deg/sec": "deg/s",
    "rad/sec": "rad/s",
    "m/sec": "m/s",
    "degrees/s": "deg/s",
    "rev/min": "rpm",
    "r/min": "rpm",
    "U/min": "rpm",
    "kips": "kip",
    "klbf": "kip",
    "lbs": "lb",
    "lb in": "lbf in",
    "lb ft": "lbf ft",
    "in lb": "lbf in",
    "ft lb": "lbf ft",
    "in lbf": "lbf in",
    "ft lbf": "lbf ft",
    "oz in": "ozf in",
    "kgf cm": "kgfcm",
    "N m": "Nm",
    "N cm": "Ncm",
    "N mm": "mNm",
    "Nmm": "mNm",
    "inches": "in",
    "feet": "ft",
    "meters": "m",
    "metres": "m",
    "millimeter": "mm",
    "millimeters": "mm",
    "volts": "V",
    "amp": "A",
    "amps": "A",
    "ampere": "A",
    "Newton": "N",
    "newton": "N",
    "volt": "V",
    "Volt": "V",
    "sec": "s",
    "seconds": "s",
    "second": "s",
    "hours": "h",
    "minutes": "min",
    "day": "d",
    "days": "d",
    "msec": "ms",
    "millis": "ms",
    "microseconds": "us",
    "milliseconds": "ms",
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
    """Return the SI unit of a unit, and the factor that converts to it.

    Raises RigtwinError for an unknown unit, with the list of known ones.
    """
    # Units often stand in brackets: [mm], (N).
    name = re.sub(r"^[\[(]|[\])]$", "", text.strip()).strip()
    for spelling in (name, re.sub(r"\s*[·*.\- ]\s*", " ", name)):
        unit = _SPELLINGS.get(spelling, spelling)
        if unit in UNITS:
            return UNITS[unit]
    # Capitals are ignored where they are not part of the unit: KIP, RPM, Deg, but not Mm or mN.
    small = name.lower()
    matches = {
        UNITS[_SPELLINGS.get(known, known)]
        for known in (*UNITS, *_SPELLINGS)
        if known.lower() == small
    }
    # Up to two letters capitals decide: mN and MN, ms and Ms.
    if len(matches) == 1 and len(name) > 2:
        return matches.pop()
    raise RigtwinError(f"unknown unit {text!r}; there are {', '.join(UNITS)}")


def is_unit(text: str) -> bool:
    """Return whether a cell holds a unit's name."""
    try:
        unit_of(text)
    except RigtwinError:
        return False
    return True
