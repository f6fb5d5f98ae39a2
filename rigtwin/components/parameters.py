"""The rig: every physical value with its unit, bounds and source. One NamedTuple a component; defaults are the nominal rig.

A value that the nominal rig does not have (a delay, a gap, a drift of gain) is here with its neutral value, so that an effect
is nothing but another value of a parameter. Compiled code reads these tuples as they are; `rigtwin.machine.configuration` overrides
them by name, e.g. `rail.coulomb`.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from controllers.quantity import Quantity

_H = "identified closed loop H(s), thesis Eq. 6.2"
_NONE = "none in the nominal rig"
UNLIMITED = 1e9
"""Of a limit: so high that it is never reached."""


class Carriage(NamedTuple):
    """Rail-guided carriage with wheel and tyre."""

    mass: Annotated[float, Quantity("kg", 1.0, 1e4, "34 kg with wheel and tyre; thesis ch. 3")] = 34.0


class Rail(NamedTuple):
    """Friction of the rail guide, with true stiction. Its friction parameters are those of Motor too."""

    coulomb: Annotated[float, Quantity("N", 0.0, 1000.0, "breakaway, thesis §6.1.3")] = 50.0
    viscous: Annotated[float, Quantity("Ns/m", 0.0, 1e4, _NONE)] = 0.0
    stribeck: Annotated[float, Quantity("N", -500.0, 1000.0, _NONE)] = 0.0
    stribeck_velocity: Annotated[float, Quantity("m/s", 1e-4, 0.1, "of the order seen in rail guides, assumed")] = 0.01
    asymmetry: Annotated[float, Quantity("N", -500.0, 500.0, _NONE)] = 0.0
    backlash: Annotated[float, Quantity("m", 0.0, 0.05, _NONE)] = 0.0


class Tyre(NamedTuple):
    """Tyre: a compliant contact that only pushes, stiffness·δ·(1 + hardening·δ·(δ/10 mm)^(power − 1)) + damping·dδ/dt."""

    stiffness: Annotated[float, Quantity("N/m", 1e3, 1e7, "best match of the tests, thesis §6.3")] = 50_000.0
    damping: Annotated[float, Quantity("Ns/m", 0.0, 1e4, "0 in the ideal model, thesis Table 7.1")] = 0.0
    hardening: Annotated[float, Quantity("1/m", -50.0, 500.0, _NONE)] = 0.0
    hardening_power: Annotated[float, Quantity("1", 1.0, 3.0, "1: a quadratic law, assumed; 2: a cubic one")] = 1.0


class Motor(NamedTuple):
    """Linear motor Dunkermotoren STB3810 and its amplifier."""

    constant: Annotated[float, Quantity("N/V", 1.0, 1e3, "±10 V ↔ ±1860 N, assumed linear")] = 186.0
    time_constant: Annotated[float, Quantity("s", 2e-4, 0.1, "data sheet: 1.26 ms")] = 1.26e-3
    force_limit: Annotated[float, Quantity("N", 1.0, 1e4, "data sheet: peak force")] = 1860.0
    voltage_limit: Annotated[float, Quantity("V", 0.1, 10.0, "amplifier input ±10 V")] = 10.0
    stroke: Annotated[float, Quantity("m", 0.01, 2.0, "data sheet: 0.21 m")] = 0.21
    coulomb: Annotated[float, Quantity("N", 0.0, 500.0, "0.15 V step is 2·F_c, thesis §4.4: 0.15·186/2")] = 14.0
    viscous: Annotated[float, Quantity("Ns/m", 0.0, 1e4, _NONE)] = 0.0
    stribeck: Annotated[float, Quantity("N", -500.0, 500.0, _NONE)] = 0.0
    stribeck_velocity: Annotated[float, Quantity("m/s", 1e-4, 0.1, "of the order seen in rail guides, assumed")] = 0.01
    asymmetry: Annotated[float, Quantity("N", -500.0, 500.0, _NONE)] = 0.0
    backlash: Annotated[float, Quantity("m", 0.0, 0.05, _NONE)] = 0.0
    gain: Annotated[float, Quantity("1", 0.1, 3.0, "1: the amplifier as specified")] = 1.0
    lag: Annotated[float, Quantity("s", 0.0, 0.1, _NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 0.05, _NONE)] = 0.0
    deadband: Annotated[float, Quantity("V", 0.0, 5.0, _NONE)] = 0.0
    saturation: Annotated[float, Quantity("V", 1e-3, UNLIMITED, _NONE)] = UNLIMITED
    rate_limit: Annotated[float, Quantity("V/s", 1e-3, UNLIMITED, _NONE)] = UNLIMITED
    cogging: Annotated[float, Quantity("N", 0.0, 200.0, _NONE)] = 0.0
    cogging_pitch: Annotated[float, Quantity("m", 1e-3, 0.12, "pole pitch of such a motor, assumed")] = 0.03
    cogging_phase: Annotated[float, Quantity("rad", -6.3, 6.3, "0 at zero travel, assumed")] = 0.0


class Cylinder(NamedTuple):
    """Position-controlled hydraulic cylinder: (b2 s² + b1 s + b0) / (s⁴ + a3 s³ + a2 s² + a1 s + a0), scaled to unit
    static gain, then a limit of the speed."""

    b2: Annotated[float, Quantity("1/s^2", -1e6, 1e6, _H)] = 1817.0
    b1: Annotated[float, Quantity("1/s^3", -1e8, 1e8, _H)] = 7.719e4
    b0: Annotated[float, Quantity("1/s^4", 1.0, 1e10, _H)] = 6.243e5
    a3: Annotated[float, Quantity("1/s", 0.0, 1e5, _H)] = 165.9
    a2: Annotated[float, Quantity("1/s^2", 0.0, 1e8, _H)] = 6674.0
    a1: Annotated[float, Quantity("1/s^3", 0.0, 1e10, _H)] = 8.598e4
    a0: Annotated[float, Quantity("1/s^4", 1.0, 1e10, _H)] = 6.281e5
    speed_limit: Annotated[float, Quantity("m/s", 0.001, 10.0, "Vickers cylinder, thesis §3.2")] = 0.3
    gain: Annotated[float, Quantity("1", 0.1, 3.0, "1: follows its command at rest")] = 1.0
    lag: Annotated[float, Quantity("s", 0.0, 0.5, _NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 0.05, _NONE)] = 0.0
    deadband: Annotated[float, Quantity("m", 0.0, 0.05, _NONE)] = 0.0
    saturation: Annotated[float, Quantity("m", 1e-4, UNLIMITED, _NONE)] = UNLIMITED
    compliance: Annotated[float, Quantity("m/N", 0.0, 2e-5, "0: a cylinder in position control does not yield, §3.2")] = 0.0


class GasSpring(NamedTuple):
    """A real gas spring beside the motor, between carriage and plate; the load cell is on the motor's rod and does not feel it.
    Travel 0 is its full extension."""

    force: Annotated[
        float, Quantity("N", 0.0, 1e7, "fully extended, initial pressure times area; 0: the rig ran without, §3.2")
    ] = 0.0
    length: Annotated[float, Quantity("m", 0.01, 10.0, "of the gas column, volume over area; 0.673 m at rig scale, §3.5")] = (
        0.217
    )
    exponent: Annotated[float, Quantity("1", 1.0, 1.7, "1 isothermal to 1.4 adiabatic air; thesis Eq. 3.3")] = 1.4


class Lvdt(NamedTuple):
    """Position sensor as the DAQ reads it."""

    white: Annotated[float, Quantity("m", 0.0, 0.01, "rms, thesis §3.4 (±5e-4 m in all)")] = 6e-5
    hum: Annotated[float, Quantity("m", 0.0, 0.01, "amplitude of the mains line, thesis §3.4")] = 2e-4
    resolution: Annotated[float, Quantity("m", 0.0, 0.01, "16 bit")] = 4.6e-6
    gain: Annotated[float, Quantity("1", 0.1, 3.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("m", -0.05, 0.05, "0: calibrated")] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 0.1, _NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 0.05, _NONE)] = 0.0


class LoadCell(NamedTuple):
    """Force sensor Interface 1010AF between motor rod and plate, as the DAQ reads it."""

    white: Annotated[float, Quantity("N", 0.0, 500.0, "rms, thesis §3.4 (±12 N in all)")] = 1.5
    hum: Annotated[float, Quantity("N", 0.0, 500.0, "amplitude of the mains line, thesis §3.4")] = 5.0
    resolution: Annotated[float, Quantity("N", 0.0, 100.0, "16 bit of ±2.5 kN")] = 0.076
    gain: Annotated[float, Quantity("1", 0.1, 3.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("N", -500.0, 500.0, "0: calibrated")] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 0.1, _NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 0.05, _NONE)] = 0.0


class Computer(NamedTuple):
    """The computer that runs the controller."""

    missed_ticks: Annotated[float, Quantity("1", 0.0, 0.5, "0: real-time computer; a share of all ticks")] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 0.02, "0: no computation delay, assumed")] = 0.0


class Mains(NamedTuple):
    """The hum that all sensors pick up, each with a phase of its own."""

    frequency: Annotated[float, Quantity("Hz", 1.0, 400.0, "mains, thesis §3.4")] = 50.0


class Plant(NamedTuple):
    """The whole rig; by default the nominal one."""

    carriage: Carriage = Carriage()
    rail: Rail = Rail()
    tyre: Tyre = Tyre()
    motor: Motor = Motor()
    gas_spring: GasSpring = GasSpring()
    ground_cylinder: Cylinder = Cylinder()
    structure_cylinder: Cylinder = Cylinder()
    ground_lvdt: Lvdt = Lvdt()
    structure_lvdt: Lvdt = Lvdt()
    suspension_lvdt: Lvdt = Lvdt()
    load_cell: LoadCell = LoadCell()
    computer: Computer = Computer()
    mains: Mains = Mains()
