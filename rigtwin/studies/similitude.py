"""Dynamic similitude by the Buckingham Pi theorem (thesis §3.5): dimensionless groups of quantities
with units, and the factors by which a rig of another size or another pace has to differ so that
every group stays as it is."""

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
    """Of a unit such as `kg`, `Ns/m`, `m/s^2`, `N s/m`, `kg/(m s)` or `1`. Raises RigtwinError with
    the symbols there are."""
    plain = re.sub(
        r"[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+",
        lambda raised: "^" + raised[0].translate(_RAISED),
        unit.strip(),
    )
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
        advice = "write what is below the line in brackets: kg/(m s)"
        raise RigtwinError(f"unit {unit!r} can be read in two ways; {advice}")
    return part


def _symbols(factor: str, unit: str) -> list[tuple[str, str]]:
    # `ms` and `mm` would be read as m·s and m·m; they are meant as prefixes.
    if not re.fullmatch(f"(?:{_SYMBOL.pattern})+", factor) or _PREFIXED.match(factor):
        known = ", ".join(_SYMBOLS)
        raise RigtwinError(
            f"unknown unit {unit!r}; there are {known}, without prefixes, as in Ns/m or m/s^2",
        )
    return _SYMBOL.findall(factor)


@dataclass(frozen=True)
class Group:
    """A dimensionless product of powers. exponents: quantity → power, integers without a common
    divisor."""

    exponents: Mapping[str, int]

    def value(self, values: Mapping[str, float]) -> float:
        """The product. values: in the quantities' SI units."""
        for name, exponent in self.exponents.items():
            if values[name] == 0.0 and exponent < 0:
                raise RigtwinError(
                    f"{name} is 0 and stands below the line of {self}; let another quantity repeat",
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
    """The n − rank independent dimensionless groups of n quantities: a rational basis of the null
    space of the matrix of their dimensions. repeating: quantities that may stand in every group; by
    default the first independent ones."""
    _check_known(repeating, units)
    names = [*repeating, *(name for name in units if name not in repeating)]
    rows, pivots = _reduce(_dimensions(names, units))
    if (rank := sum(pivot < len(repeating) for pivot in pivots)) < len(repeating):
        told = f"{', '.join(repeating)} cannot all repeat"
        raise RigtwinError(f"{told}: only {rank} of them are dimensionally independent")
    groups = []
    for free in (column for column in range(len(names)) if column not in pivots):
        powers = {names[free]: Fraction(1)}
        powers |= {names[pivot]: -rows[row][free] for row, pivot in enumerate(pivots)}
        multiple = math.lcm(*(power.denominator for power in powers.values()))
        groups.append(
            Group({name: int(power * multiple) for name, power in powers.items() if power}),
        )
    return tuple(groups)


class Scaling(NamedTuple):
    """Factors of mass, length and time, scaled system over original. time: above 1 slows down
    (pseudo-dynamic testing)."""

    mass: float
    length: float
    time: float

    def factor(self, unit: str) -> float:
        """Of every quantity of that unit: λ_m^a λ_l^b λ_t^c (thesis Eq. 3.8)."""
        power = dimension(unit)
        return self.mass**power.mass * self.length**power.length * self.time**power.time


def scaling(units: Units, scales: Mapping[str, float]) -> Scaling:
    """From the factors of any three dimensionally independent quantities. scales: quantity →
    factor, scaled over original."""
    names = tuple(scales)
    _check_known(names, units)
    if len(names) != 3:
        given = f"{len(names)}: {', '.join(names) or 'none'}"
        raise RigtwinError(f"three quantities have to be given a scale, not {given}")
    for name, scale in scales.items():
        if not (math.isfinite(scale) and scale > 0.0):
            raise RigtwinError(
                f"the scale of {name} is {scale:g}; it has to be positive and finite",
            )
    identity = [[Fraction(int(row == column)) for column in range(3)] for row in range(3)]
    rows, pivots = _reduce(
        [left + right for left, right in zip(_dimensions(names, units), identity, strict=True)],
    )
    if pivots != [0, 1, 2]:
        group = pi_groups({name: units[name] for name in names})[0]
        raise RigtwinError(
            f"{', '.join(names)} are dimensionally dependent: {group} has no unit; choose another",
        )
    factors = tuple(scales.values())
    powers = [[float(row[3 + base]) for row in rows] for base in range(3)]
    pairs = (zip(factors, each, strict=True) for each in powers)
    return Scaling(*(math.prod(factor**power for factor, power in each) for each in pairs))


def scale_values(values: Mapping[str, float], units: Units, scaling: Scaling) -> dict[str, float]:
    """The quantities of the scaled system, in the same units."""
    _check_known(tuple(values), units)
    return {name: value * scaling.factor(units[name]) for name, value in values.items()}


def largest_change(
    units: Units,
    original: Mapping[str, float],
    other: Mapping[str, float],
) -> float:
    """Of all Pi groups from one system to the other, relative: 0 for a true scaling; infinite where
    a quantity is zero in one system only, or of opposite sign."""
    ratios = {name: other[name] / original[name] for name in units if original[name] != 0.0}
    appears = any(other[name] != 0.0 for name in units if name not in ratios)
    if appears or any(ratio <= 0.0 for ratio in ratios.values()):
        return math.inf
    groups = pi_groups({name: units[name] for name in ratios})
    # By logarithms: powers of a group may be too large for the powers themselves.
    logarithms = []
    for group in groups:
        powers = group.exponents.items()
        logarithms.append(math.fsum(power * math.log(ratios[name]) for name, power in powers))
    return max((abs(math.expm1(min(change, 700.0))) for change in logarithms), default=0.0)


def slow_down(scaling: Scaling, velocity: float, limit: float) -> Scaling:
    """The scaling with time stretched just as far as a velocity of the original needs to stay
    within the limit of the scaled system, m/s; unchanged where it does already."""
    if not limit > 0.0:
        raise RigtwinError(f"the limit of the velocity is {limit:g} m/s; it has to be positive")
    return scaling._replace(time=max(scaling.time, scaling.length * abs(velocity) / limit))


def _check_known(names: Sequence[str], units: Units) -> None:
    for name in names:
        if name not in units:
            raise RigtwinError(f"there is no quantity {name!r}; there are {', '.join(units)}")


def _dimensions(names: Sequence[str], units: Units) -> Matrix:
    """A row for each of mass, length and time, a column for each quantity."""
    columns = [dimension(units[name]) for name in names]
    return [[Fraction(power) for power in row] for row in zip(*columns, strict=True)]


def _reduce(matrix: Matrix) -> tuple[Matrix, list[int]]:
    """Reduced row echelon form, and the columns of its pivots."""
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
                rows[row] = [entry - factor * other for entry, other in pairs]
        pivots.append(column)
    return rows, pivots
