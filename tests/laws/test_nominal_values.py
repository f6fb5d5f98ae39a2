"""The nominal values of every component, written out a second time."""

from __future__ import annotations

import pytest

import rigtwin.components as components
from rigtwin.components import (
    Base,
    Body,
    Carriage,
    Computer,
    Cylinder,
    ForceActuator,
    ForceSensor,
    GasSpring,
    Guide,
    LoadCell,
    Lvdt,
    Mains,
    Mass,
    Motor,
    PositionActuator,
    PositionSensor,
    Rail,
    RigPlant,
    Rotor,
    Schedule,
    Servo,
    Tyre,
    VelocitySensor,
    VelocityServo,
    Warming,
)

NO_LIMIT = 1e9
STRIBECK = {"stribeck_velocity": 0.01, "stribeck_exponent": 2.0}
RANGE = {"command_low": -NO_LIMIT, "command_high": NO_LIMIT}
NOMINAL: dict[type, dict[str, float]] = {
    Base: {},
    Body: {"mass": 1.0, "inertia": 1.0, "reach": 1.0},
    Carriage: {"mass": 34.0},
    Computer: {},
    Cylinder: {
        "b2": 1817.0,
        "b1": 77190.0,
        "b0": 624300.0,
        "a3": 165.9,
        "a2": 6674.0,
        "a1": 85980.0,
        "a0": 628100.0,
        "speed_limit": 0.3,
        "gain": 1.0,
        "saturation": NO_LIMIT,
    },
    ForceActuator: {
        "constant": 1.0,
        "force_limit": NO_LIMIT,
        "gain": 1.0,
        "saturation": NO_LIMIT,
        "rate_limit": NO_LIMIT,
        "rotor_share": 0.5,
        "full_command": 1.0,
        **RANGE,
    },
    ForceSensor: {"gain": 1.0},
    GasSpring: {"length": 0.217, "exponent": 1.4},
    Guide: {
        **STRIBECK,
        "cogging_pitch": 0.03,
        "curve_half_range": 1.0,
        "stop_low": -1.0,
        "stop_high": 1.0,
    },
    LoadCell: {"white": 1.5, "hum": 5.0, "resolution": 0.076, "gain": 1.0},
    Lvdt: {"white": 6e-5, "hum": 2e-4, "resolution": 4.6e-6, "gain": 1.0},
    Mains: {"frequency": 50.0},
    Mass: {},
    Schedule: {},
    Warming: {"time": 10.0},
    Motor: {
        "constant": 186.0,
        "time_constant": 1.26e-3,
        "force_limit": 1860.0,
        "voltage_limit": 10.0,
        "stroke": 0.21,
        "coulomb": 14.0,
        "gain": 1.0,
        "saturation": NO_LIMIT,
        "rate_limit": NO_LIMIT,
        "cogging_pitch": 0.03,
        **STRIBECK,
    },
    PositionActuator: {
        "gain": 1.0,
        "natural_frequency": NO_LIMIT,
        "damping_ratio": 0.7,
        "saturation": NO_LIMIT,
        "rate_limit": NO_LIMIT,
        **RANGE,
    },
    PositionSensor: {"gain": 1.0},
    Rail: {"coulomb": 50.0, **STRIBECK},
    Rotor: {},
    Servo: {
        "position_gain": 1.0,
        "force_limit": NO_LIMIT,
        "gain": 1.0,
        "gains": 1.0,
        "rate_limit": NO_LIMIT,
        "rotor_share": 0.5,
        **RANGE,
    },
    Tyre: {"stiffness": 50_000.0, "hardening_power": 1.0},
    VelocitySensor: {"gain": 1.0},
    VelocityServo: {
        "velocity_gain": 1.0,
        "damping_gain": 1.0,
        "force_limit": NO_LIMIT,
        "gain": 1.0,
        "gains": 1.0,
        "saturation": NO_LIMIT,
        "rate_limit": NO_LIMIT,
        **RANGE,
    },
}
"""Component type → its nominal values that are not zero."""
PARTS = {
    "carriage": Carriage,
    "rail": Rail,
    "tyre": Tyre,
    "motor": Motor,
    "gas_spring": GasSpring,
    "ground_cylinder": Cylinder,
    "structure_cylinder": Cylinder,
    "ground_lvdt": Lvdt,
    "structure_lvdt": Lvdt,
    "suspension_lvdt": Lvdt,
    "load_cell": LoadCell,
    "computer": Computer,
    "mains": Mains,
}


@pytest.mark.parametrize("kind", NOMINAL)
def test_a_component_has_the_nominal_values_of_the_table(kind):
    values = kind()._asdict()
    assert {name: value for name, value in values.items() if value != 0.0} == NOMINAL[kind]


def test_every_component_type_is_in_the_table():
    types = {kind for of in components.KINDS for kind in of.at} | {GasSpring, Mains}
    assert types == set(NOMINAL)


def test_the_rig_consists_of_nominal_components():
    assert RigPlant()._asdict() == {name: kind() for name, kind in PARTS.items()}


def test_no_limit_is_so_high_that_it_is_never_reached():
    assert components.UNLIMITED == NO_LIMIT
