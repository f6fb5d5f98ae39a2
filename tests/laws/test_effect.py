"""Sizes of a motion, from which a search starts, and what an effect is called."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.components import (
    Carriage,
    Computer,
    ForceSensor,
    Mass,
    Motion,
    Motor,
    RigPlant,
    Scales,
    Starts,
    Swing,
    find,
    title,
    with_parameters,
)
from rigtwin.components.effect import GROUPS, NAMES, Context
from rigtwin.components.plant import plant_of
from rigtwin.errors import RigtwinError

PERIOD = 1e-3
TIME = PERIOD * np.arange(2000)
RATE = 4.0 * np.pi
POSITION = 0.01 + 0.03 * np.sin(RATE * TIME)
SPEED = 0.03 * RATE * np.cos(RATE * TIME)


def test_sizes_of_a_sine_are_its_amplitude_and_rms_values():
    """Half the stroke A; rms speed A ω/√2; fastest A ω; rms acceleration A ω²/√2."""
    scales = Scales.of(Motion(POSITION, SPEED, 5.0 * np.sin(RATE * TIME)), 2.0, PERIOD)
    assert scales.stroke == pytest.approx(0.03, rel=1e-4)
    assert scales.speed == pytest.approx(0.03 * RATE / np.sqrt(2.0))
    assert scales.fastest == pytest.approx(0.03 * RATE)
    assert scales.acceleration == pytest.approx(0.03 * RATE**2 / np.sqrt(2.0), rel=1e-3)
    assert scales.force == pytest.approx(5.0 / np.sqrt(2.0))
    assert scales.period == PERIOD
    assert scales.time == pytest.approx(np.sqrt(2.0) / RATE, rel=1e-4)
    assert Scales.of(Motion(POSITION, SPEED, 0.0 * SPEED), 2.0, PERIOD).force == 2.0
    backward = Scales.of(Motion(POSITION, np.minimum(SPEED, 0.0), 0.0 * SPEED), 2.0, PERIOD)
    assert backward.fastest == pytest.approx(0.03 * RATE, rel=1e-5)


def test_sizes_of_what_stands_still_are_tiny_but_not_zero():
    scales = Scales.of(Motion(0.0 * TIME, 0.0 * TIME, 0.0 * TIME), 0.0, PERIOD)
    sizes = (scales.stroke, scales.speed, scales.fastest, scales.acceleration, scales.force)
    assert sizes == (1e-12,) * 5
    quick = Scales(1e-6, (0.0, 0.0), 1.0, 1.0, 1.0, 1.0, PERIOD)
    assert quick.time == PERIOD


def test_a_swing_is_zero_unless_measured():
    assert Swing().largest == Swing().fastest == (0.0,) * 7


def test_a_single_start_has_one_value_and_one_step():
    starts = Starts.single([1.0, -2.0], 0.1)
    assert (starts.values, starts.steps) == (((1.0,), (-2.0,)), (0.1,))
    assert starts.quadrature is False
    assert starts.bounds is None


def test_an_effect_is_named_by_its_kind_and_component():
    plant = RigPlant()
    mass, late = find("mass@carriage", plant), find("delay@controller", plant)
    assert (mass.name, mass.group, mass.of) == ("mass@carriage", "carriage", Carriage)
    assert (late.name, late.group, late.of) == ("delay@controller", "computer", Computer)
    assert mass.nominal(plant) == {"mass": 34.0}
    assert mass.searched is True
    sizes = Scales.of(Motion(POSITION, SPEED, SPEED), 1.0, PERIOD)
    cogging = plant._replace(motor=Motor(cogging=2.0))
    context = Context(find("cogging@motor", plant), cogging, Swing(), lambda: sizes)
    assert context.nominal == 2.0
    assert context.scales is sizes
    assert find("missed_ticks@controller", plant).searched is False
    assert {name: GROUPS[shown] for name, shown in NAMES.items()} == {"computer": "computer"}
    assert title("coulomb") == "Coulomb friction"
    assert title("unheard") == "unheard"


def test_a_plant_with_another_value_keeps_all_others():
    heavier = with_parameters(RigPlant(), "carriage", {"mass": 40.0})
    assert heavier == RigPlant(carriage=Carriage(40.0))


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("coulomb@tyre", "unknown effect 'coulomb' at tyre; there are"),
        ("coulomb@axle", "unknown effect 'coulomb@axle'; did you mean"),
    ],
)
def test_an_unknown_effect_is_refused_with_what_there_is(name, says):
    with pytest.raises(RigtwinError, match=says):
        find(name, RigPlant())


def test_a_search_looks_for_no_weightless_part_and_no_endless_lag():
    """Mass from a tenth of its nominal value on; a force's lag up to twice the motion's time."""
    plant = plant_of({"cart": Mass(2.0), "cell": ForceSensor()})
    sizes = Scales.of(Motion(POSITION, SPEED, SPEED), 1.0, PERIOD)
    bounds = find("mass@cart", plant).starts(plant, Swing(), lambda: sizes).bounds
    assert bounds is not None
    assert bounds[0][0] == pytest.approx(0.2)
    for kind in ("lag", "delay"):
        starts = find(f"{kind}@cell", plant).starts(plant, Swing(), lambda: sizes)
        assert starts.bounds == ((-2.0 * sizes.time, 2.0 * sizes.time),)
        assert all(abs(time) < 2.0 * sizes.time for (time,) in starts.values)
