"""Sizes in the units that engineers write them in."""

from __future__ import annotations

import math

import pytest

from rigtwin.diagnosis.units import find_unit, say, shorten, spell, write


@pytest.mark.parametrize(
    ("value", "unit", "written"),
    [
        (16083.0, "N", "16.08 kN"),
        (1.499e-7, "m/N", "0.1499 µm/N"),
        (7.96e-3, "s", "7.96 ms"),
        (0.25, "s", "0.25 s"),
        (0.012, "m", "0.012 m"),
        (4.52e-3, "m", "4.52 mm"),
        (75.0, "N", "75 N"),
        (102.0, "%", "102 %"),
        (0.5, "1", "0.5"),
        (0.0, "m", "0 m"),
        (2.0e5, "N/m", "200 kN/m"),
        (3.0e6, "Pa", "3000 kPa"),
    ],
)
def test_a_long_number_gets_the_unit_that_makes_it_short(value, unit, written):
    assert write(value, unit) == written
    assert write(-value, unit) == (f"-{written}" if value else written), "no minus zero"


@pytest.mark.parametrize("unit", ["m", "m/s", "m/N", "rad", "rad/s", "s", "N", "Nm/rad", "1", "%"])
@pytest.mark.parametrize("value", [1e-8, 3e-6, 2e-3, 0.4, 7.0, 5e2, 3e4, 2e6])
def test_whatever_the_unit_it_is_the_same_size(unit, value):
    """Read back, the number times its prefix is the value."""
    prefixes = {"µ": 1e-6, "m": 1e-3, "k": 1e3, "°": math.pi / 180.0}
    factor, shown = find_unit(unit, value)
    prefix = shown[:1] if shown != unit and shown else ""
    if unit == "1":
        assert (factor, shown) == (1.0, "")
    else:
        assert factor * prefixes.get(prefix, 1.0) == pytest.approx(1.0)


def test_an_angle_is_drawn_in_degrees():
    assert say(math.pi, "rad") == "180 °"
    assert say(math.pi / 2, "rad/s") == "90 °/s"


def test_numbers_of_one_row_share_the_unit_of_the_greatest():
    assert shorten("N", 5.0, -16083.0, math.inf) == (1e-3, "kN")
    assert shorten("N", math.nan) == (1.0, "N")


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(102.3, 2, "102"), (99.6, 2, "1e+02"), (1.5e8, 3, "1.5e+08"), (0.1234, 2, "0.12")],
)
def test_no_exponent_where_it_is_shorter_without(value, digits, text):
    assert spell(value, digits) == (text if text != "1e+02" else "100")
