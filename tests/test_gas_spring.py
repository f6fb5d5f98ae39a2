"""The gas spring against closed forms, and what it says of bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit

from rigtwin.components.gas_spring import (
    GasSpring,
    design,
    equilibrium,
    find_charge,
    spring_force,
    stiffness,
)
from rigtwin.errors import RigtwinError

SPRING = GasSpring(167_285.0, 0.673, 1.4)


def test_isothermal_gas_keeps_pressure_times_volume():
    spring = GasSpring(400.0, 0.25, 1.0)
    for stroke in (-0.1, 0.0, 0.1, 0.2):
        assert spring_force(spring, stroke) * (spring.length - stroke) == pytest.approx(
            400.0 * 0.25
        )


@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.4])
@pytest.mark.parametrize("stroke", [-0.05, 0.0, 0.2, 0.42, 0.6])
def test_stiffness_is_the_derivative_of_the_force(exponent: float, stroke: float):
    spring, step = SPRING._replace(exponent=exponent), 1e-6
    slope = (spring_force(spring, stroke + step) - spring_force(spring, stroke - step)) / (
        2.0 * step
    )
    assert stiffness(spring, stroke) == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize("share", [1.0, 1.5, 4.0, 30.0])
def test_the_equilibrium_carries_the_load(share: float):
    assert spring_force(SPRING, equilibrium(SPRING, share * SPRING.force)) == pytest.approx(
        share * SPRING.force
    )


def test_a_load_below_the_precharge_compresses_nothing():
    assert equilibrium(SPRING, 0.9 * SPRING.force) == 0.0
    assert equilibrium(SPRING, 0.0) == 0.0


def test_no_room_left_is_infinite():
    for stroke in (SPRING.length, 1.0):
        assert spring_force(SPRING, stroke) == math.inf
        assert stiffness(SPRING, stroke) == math.inf
    assert math.isfinite(spring_force(SPRING, 0.999 * SPRING.length))


@pytest.mark.parametrize("seed", range(5))
def test_a_designed_spring_has_the_forces_asked_for(seed: int):
    draw = np.random.default_rng(seed)
    extended, ratio, stroke, exponent = draw.uniform([10.0, 1.1, 0.01, 1.0], [1e6, 20.0, 2.0, 1.4])
    spring = design(extended, ratio * extended, stroke, exponent)
    assert spring.length > stroke
    assert spring_force(spring, 0.0) == pytest.approx(extended)
    assert spring_force(spring, stroke) == pytest.approx(ratio * extended)


def test_the_charge_is_that_spring_again():
    """P V^γ is constant from the full gas volume to what the cylinder leaves of it."""
    area, stroke = 0.00116, 0.18
    spring = design(395.0, 12.0 * 395.0, stroke, 1.4)
    charge = find_charge(spring, area, stroke)
    left = charge.gas - charge.cylinder
    assert charge.pressure * area == pytest.approx(395.0)
    assert charge.pressure * (charge.gas / left) ** 1.4 * area == pytest.approx(
        spring_force(spring, stroke)
    )
    assert charge.cylinder / charge.gas == pytest.approx(stroke / spring.length)


def test_compiled_code_has_the_same_force():
    @njit
    def compiled(spring: GasSpring, stroke: float, load: float) -> tuple[float, float, float]:
        return spring_force(spring, stroke), stiffness(spring, stroke), equilibrium(spring, load)

    expected = spring_force(SPRING, 0.3), stiffness(SPRING, 0.3), equilibrium(SPRING, 5e5)
    assert compiled(SPRING, 0.3, 5e5) == pytest.approx(expected, rel=1e-14)
    assert compiled(SPRING, 0.7, 5e5)[0] == math.inf


def test_bad_input_is_one_line():
    for make, words in (
        (
            lambda: design(0.0, 10.0, 0.1, 1.4),
            "force fully extended of the gas spring is 0 N; expected a positive",
        ),
        (
            lambda: design(10.0, 10.0, 0.1, 1.4),
            "force of the compressed gas spring is 10 N; expected more than the 10 N of the",
        ),
        (lambda: design(10.0, 40.0, math.nan, 1.4), "stroke of the gas spring is nan m"),
        (lambda: design(10.0, 40.0, 0.1, -1.0), "exponent of the gas spring is -1; expected"),
        (lambda: find_charge(SPRING, -1e-3, 0.5), "area of the gas spring is -0.001 m²"),
        (
            lambda: find_charge(SPRING, 1e-3, 0.7),
            "stroke of the gas spring is 0.7 m; expected less than its gas column of 0.673 m",
        ),
    ):
        with pytest.raises(RigtwinError) as raised:
            make()
        assert words in str(raised.value)
        assert "\n" not in str(raised.value)
