"""Dynamic similitude by the Buckingham Pi theorem (thesis §3.5).

The module computes dimensionless groups of quantities with units, and the scale factors of a rig of
another size or speed that leave every group unchanged.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from rigtwin.errors import RigtwinError

Units = Mapping[str, str]
"""Name of a quantity → its SI unit, such as `Ns/m`."""
Matrix = list[list[Fraction]]
"""Exact rational matrix: rank decisions must not depend on rounding."""


class Dimension(NamedTuple):
    """Exponents of mass, length and time: (1, 0, -2) for N/m."""

    mass: int
    length: int
    time: int


_SYMBOLS = {
    "kg": Dimension(1, 0, 0),
    "m": Dimension(0, 1, 0),
    "s": Dimension(0, 0, 1),
    "N": Dimension(1, 1, -2),
    "Pa": Dimension(1, -1, -2),
    "J": Dimension(1, 2, -2),
    "W": Dimension(1, 2, -3),
    "Hz": Dimension(0, 0, -1),
    "rad": Dimension(0, 0, 0),
    "1": Dimension(0, 0, 0),
}
_SYMBOL = re.compile(r"(kg|Pa|Hz|rad|[mNsJW1])(?:\^(-?\d+))?")
_SEPARATOR = re.compile(r"[\s·*]+")
_PREFIXED = re.compile(r"m[A-Za-z]")
_RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def dimension(unit: str) -> Dimension:
    """Return the dimension of a unit such as `kg`, `Ns/m`, `m/s^2`, `N s/m`, `kg/(m s)` or `1`.

    Raises
    ------
    RigtwinError
        If the unit contains an unknown symbol; the message lists the known ones.
    """
    plain = re.sub(
        r"[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda raised: "^" + raised[0].translate(_RAISED), unit.strip()
    )
    # Several slashes divide in turn: m/s/s is m/s².
    above, *below = plain.split("/")
    total = [0, 0, 0]
    for sign, product in ((1, above), *((-1, _denominator(part, unit)) for part in below)):
        for factor in _SEPARATOR.split(product.strip()):
            for symbol, exponent in _symbols(factor, unit):
                for base, power in enumerate(_SYMBOLS[symbol]):
                    total[base] += sign * int(exponent or 1) * power
    return Dimension(*total)


def _denominator(part: str, unit: str) -> str:
    part = part.strip()
    if part.startswith("(") and part.endswith(")"):
        return part[1:-1]
    if _SEPARATOR.search(part):
        # "kg/m s" is ambiguous: kg/(m s) or (kg/m) s.
        advice = "write the denominator in brackets: kg/(m s)"
        raise RigtwinError(f"unit {unit!r} can be read in two ways; {advice}")
    return part


def _symbols(factor: str, unit: str) -> list[tuple[str, str]]:
    # `ms` and `mm` are prefixed units to their author, but would parse as m·s and m·m.
    if not re.fullmatch(f"(?:{_SYMBOL.pattern})+", factor) or _PREFIXED.match(factor):
        known = ", ".join(_SYMBOLS)
        raise RigtwinError(
            f"unknown unit {unit!r}; expected {known}, without prefixes, as in Ns/m or m/s^2"
        )
    return _SYMBOL.findall(factor)


@dataclass(frozen=True)
class Group:
    """Dimensionless product of powers of quantities.

    Attributes
    ----------
    exponents
        Quantity → power; integers without a common divisor.
    """

    exponents: Mapping[str, int]

    def value(self, values: Mapping[str, float]) -> float:
        """Return the product for values of the quantities in SI units."""
        for name, exponent in self.exponents.items():
            if values[name] == 0.0 and exponent < 0:
                raise RigtwinError(
                    f"{name} is 0 and in the denominator of {self}; "
                    "choose another repeating quantity"
                )
        return math.prod(values[name] ** exponent for name, exponent in self.exponents.items())

    def __str__(self) -> str:
        above, below = [], []
        for name, power in self.exponents.items():
            factor = name if abs(power) == 1 else f"{name}^{abs(power)}"
            (above if power > 0 else below).append(factor)
        product, under = " · ".join(above or ["1"]), " · ".join(below)
        if not below:
            return product
        return f"{product} / ({under})" if len(below) > 1 else f"{product} / {under}"


def pi_groups(units: Units, repeating: Sequence[str] = ()) -> tuple[Group, ...]:
    """Return the independent dimensionless groups of some quantities.

    By the Buckingham Pi theorem n quantities have n − r groups, with r the rank of the matrix of
    their dimensions. The groups are a rational basis of the matrix's null space.

    Parameters
    ----------
    units
        Quantities and their units.
    repeating
        Quantities that may appear in every group. Defaults to the first independent ones.
    """
    _check_known(repeating, units)
    names = [*repeating, *(name for name in units if name not in repeating)]
    # Repeating quantities come first, so that the reduction chooses them as pivots.
    rows, pivots = _reduce(_dimensions(names, units))
    if (rank := sum(pivot < len(repeating) for pivot in pivots)) < len(repeating):
        raise RigtwinError(
            f"{', '.join(repeating)} cannot all repeat: only {rank} of them are dimensionally "
            "independent"
        )
    groups = []
    # Each column without a pivot is free: set its power to 1 and solve for the pivots' powers.
    for free in (column for column in range(len(names)) if column not in pivots):
        powers = {names[free]: Fraction(1)}
        powers |= {names[pivot]: -rows[row][free] for row, pivot in enumerate(pivots)}
        # Multiply by the least common denominator to get integer powers.
        multiple = math.lcm(*(power.denominator for power in powers.values()))
        groups.append(
            Group({name: int(power * multiple) for name, power in powers.items() if power})
        )
    return tuple(groups)


class Scaling(NamedTuple):
    """Factors of mass, length and time, scaled system over original.

    A time factor above 1 slows the test down (pseudo-dynamic testing).
    """

    mass: float
    length: float
    time: float

    def factor(self, unit: str) -> float:
        """Return the factor of all quantities of a unit: λ_m^a λ_l^b λ_t^c (thesis Eq. 3.8)."""
        power = dimension(unit)
        return self.mass**power.mass * self.length**power.length * self.time**power.time


def scaling(units: Units, scales: Mapping[str, float]) -> Scaling:
    """Return the scaling that follows from the factors of three quantities.

    Parameters
    ----------
    units
        Quantities and their units.
    scales
        Factors, scaled over original, of three dimensionally independent quantities.

    Raises
    ------
    RigtwinError
        If there are not three quantities, they are dependent, or a factor is not positive.
    """
    names = tuple(scales)
    _check_known(names, units)
    if len(names) != 3:
        count = f"{len(names)}: {', '.join(names) or 'none'}"
        raise RigtwinError(f"scales: expected the factors of three quantities, got {count}")
    for name, scale in scales.items():
        if not (math.isfinite(scale) and scale > 0.0):
            raise RigtwinError(f"scale of {name} = {scale:g}: expected a positive, finite factor")
    # Inverting the dimension matrix A beside the identity gives log λ = A⁻¹ log(factors).
    identity = [[Fraction(int(row == column)) for column in range(3)] for row in range(3)]
    rows, pivots = _reduce(
        [row + unit for row, unit in zip(_dimensions(names, units), identity, strict=True)]
    )
    if pivots != [0, 1, 2]:
        group = pi_groups({name: units[name] for name in names})[0]
        raise RigtwinError(
            f"{', '.join(names)} are dimensionally dependent: {group} has no unit; "
            "expected independent quantities"
        )
    factors = tuple(scales.values())
    powers = [[float(row[3 + base]) for row in rows] for base in range(3)]
    products = (
        math.prod(factor**power for factor, power in zip(factors, row, strict=True))
        for row in powers
    )
    return Scaling(*products)


def scale_values(values: Mapping[str, float], units: Units, scaling: Scaling) -> dict[str, float]:
    """Return the quantities of the scaled system, in the same units."""
    _check_known(tuple(values), units)
    return {name: value * scaling.factor(units[name]) for name, value in values.items()}


def largest_change(
    units: Units, original: Mapping[str, float], changed: Mapping[str, float]
) -> float:
    """Return the largest relative change of a Pi group from one system to another.

    The change is 0 for a true scaling. It is infinite if a quantity is zero in only one of the
    systems, or of opposite sign.
    """
    ratios = {name: changed[name] / original[name] for name in units if original[name] != 0.0}
    # A quantity that appears from zero changes its groups without bound.
    appears = any(changed[name] != 0.0 for name in units if name not in ratios)
    if appears or any(ratio <= 0.0 for ratio in ratios.values()):
        return math.inf
    groups = pi_groups({name: units[name] for name in ratios})
    # Logarithms avoid overflow: a group can contain large powers.
    logarithms = []
    for group in groups:
        # fsum rounds once, so that the logarithms of a true scaling cancel to zero.
        powers = group.exponents.items()
        logarithms.append(math.fsum(power * math.log(ratios[name]) for name, power in powers))
    # exp(700) is about the largest double.
    return max((abs(math.expm1(min(change, 700.0))) for change in logarithms), default=0.0)


def slow_down(scaling: Scaling, velocity: float, limit: float) -> Scaling:
    """Return the scaling with time stretched until a velocity respects a limit.

    Velocities scale as λ_l/λ_t. The scaling is returned unchanged if the limit is respected.

    Parameters
    ----------
    scaling
        Scaling of the system.
    velocity
        Velocity of the original system, in m/s.
    limit
        Largest velocity of the scaled system, in m/s.
    """
    if not limit > 0.0:
        raise RigtwinError(f"limit of the velocity = {limit:g} m/s: expected a positive limit")
    return scaling._replace(time=max(scaling.time, scaling.length * abs(velocity) / limit))


def _check_known(names: Sequence[str], units: Units) -> None:
    for name in names:
        if name not in units:
            raise RigtwinError(f"unknown quantity {name!r}; expected one of {', '.join(units)}")


def _dimensions(names: Sequence[str], units: Units) -> Matrix:
    """Return the dimension matrix: rows mass, length and time, one column per quantity."""
    columns = [dimension(units[name]) for name in names]
    return [[Fraction(power) for power in row] for row in zip(*columns, strict=True)]


def _reduce(matrix: Matrix) -> tuple[Matrix, list[int]]:
    """Return the reduced row echelon form (Gauss-Jordan elimination) and its pivot columns."""
    rows, pivots = [list(row) for row in matrix], []
    for column in range(len(rows[0]) if rows else 0):
        rank = len(pivots)
        chosen = next((row for row in range(rank, len(rows)) if rows[row][column]), None)
        if chosen is None:
            continue
        rows[rank], rows[chosen] = rows[chosen], rows[rank]
        rows[rank] = [entry / rows[rank][column] for entry in rows[rank]]
        for row in range(len(rows)):
            if row != rank:
                pairs = zip(rows[row], rows[rank], strict=True)
                factor = rows[row][column]
                rows[row] = [entry - factor * pivot for entry, pivot in pairs]
        pivots.append(column)
    return rows, pivots
