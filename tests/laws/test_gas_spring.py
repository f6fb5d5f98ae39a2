"""A gas spring: polytropic compression of a closed gas column."""

from __future__ import annotations

import math

import pytest

from rigtwin.components import GasSpring
from rigtwin.components.gas_spring import (
    design,
    equilibrium,
    find_charge,
    spring_force,
    stiffness,
)
from rigtwin.errors import RigtwinError

SPRINGS = [GasSpring(230.0), GasSpring(800.0, 0.673, 1.1), GasSpring(50.0, 0.3, 1.0)]


@pytest.mark.parametrize("spring", SPRINGS)
@pytest.mark.parametrize("stroke", [-0.02, 0.0, 0.05, 0.15])
def test_force_and_stiffness_follow_the_polytropic_law(spring, stroke):
    """F = F₀ (L/(L − x))^γ and dF/dx = γ F/(L − x)."""
    room = spring.length - stroke
    force = spring.force * math.exp(spring.exponent * math.log(spring.length / room))
    assert spring_force(spring, stroke) == pytest.approx(force)
    assert stiffness(spring, stroke) == pytest.approx(spring.exponent * force / room)


def test_the_nominal_rig_runs_without_gas_in_a_column_of_217_mm():
    assert spring_force(GasSpring(), 0.1) == 0.0
    assert spring_force(GasSpring(100.0), 0.1085) == pytest.approx(100.0 * 2.0**1.4)


def test_no_room_for_the_gas_is_infinitely_stiff():
    spring = GasSpring(230.0)
    for stroke in (0.217, 0.3):
        assert spring_force(spring, stroke) == math.inf
        assert stiffness(spring, stroke) == math.inf
    assert math.isfinite(stiffness(spring, 0.2169))


@pytest.mark.parametrize("spring", SPRINGS)
@pytest.mark.parametrize("times", [1.2, 2.0, 5.0])
def test_the_equilibrium_is_where_the_gas_bears_the_load(spring, times):
    """x = L (1 − (F₀/F)^(1/γ))."""
    expected = spring.length * (1.0 - times ** (-1.0 / spring.exponent))
    assert equilibrium(spring, times * spring.force) == pytest.approx(expected)
    assert equilibrium(spring, 0.9 * spring.force) == 0.0


def test_a_design_reaches_both_forces():
    """L = x r/(r − 1) with r = (F₁/F₀)^(1/γ)."""
    spring = design(100.0, 300.0, 0.12, 1.3)
    ratio = 3.0 ** (1.0 / 1.3)
    assert spring.length == pytest.approx(0.12 * ratio / (ratio - 1.0))
    assert (spring.force, spring.exponent) == (100.0, 1.3)


def test_a_charge_is_pressure_and_volumes_of_a_cylinder():
    """p = F/A, V_cylinder = A x, V_gas = A L."""
    charge = find_charge(GasSpring(230.0, 0.25, 1.4), 0.002, 0.1)
    assert charge == pytest.approx((115_000.0, 2e-4, 5e-4))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: design(0.0, 300.0, 0.1, 1.3), "force fully extended of the gas spring is 0 N"),
        (lambda: design(100.0, 300.0, -0.1, 1.3), "stroke of the gas spring is -0.1 m"),
        (lambda: design(100.0, 300.0, 0.1, math.nan), "exponent of the gas spring is nan;"),
        (
            lambda: design(math.inf, 300.0, 0.1, 1.3),
            "force fully extended of the gas spring is inf",
        ),
        (lambda: design(100.0, 100.0, 0.1, 1.3), "force of the compressed gas spring is 100 N"),
        (lambda: design(100.0, math.inf, 0.1, 1.3), "force of the compressed gas spring is inf N"),
        (lambda: find_charge(GasSpring(1.0, 0.2), 0.0, 0.1), "area of the gas spring is 0 m²"),
        (lambda: find_charge(GasSpring(1.0, 0.2), 0.1, 0.0), "stroke of the gas spring is 0 m"),
        (lambda: find_charge(GasSpring(1.0, 0.2), 0.1, 0.2), "expected less than its gas column"),
    ],
)
def test_an_impossible_gas_spring_is_refused(make, says):
    with pytest.raises(RigtwinError, match=says):
        make()
