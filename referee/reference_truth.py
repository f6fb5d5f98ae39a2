"""The parameters of the referee's rig.

Every defect of the rig is a field of `Truth`, whose defaults are the rig without defects.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP = 5e-5
"""Integration step, s."""
NEVER = 1e9
"""Value of a limit that is never reached."""


class ReferenceSlider(NamedTuple):
    """Sliding part with dry and viscous friction.

    Attributes
    ----------
    coulomb, viscous : float
        Coulomb friction, N, and viscous friction, Ns/m.
    peak, peak_speed, peak_shape : float
        Additional friction at standstill, N, the speed at which it fades, m/s, and the exponent.
    asymmetry : float
        Difference of the dry friction between the two directions, N.
    play : float
        Play in series with the friction, m.
    wave, wave_length : float
        Share by which friction varies along the way, and its wavelength, m.
    drag : float
        Friction with the squared speed, N/(m/s)².
    """

    coulomb: float
    viscous: float = 0.0
    peak: float = 0.0
    peak_speed: float = 0.01
    peak_shape: float = 2.0
    asymmetry: float = 0.0
    play: float = 0.0
    wave: float = 0.0
    wave_length: float = 0.02
    drag: float = 0.0


class CommandPath(NamedTuple):
    """Path of a command to its actuator.

    Attributes
    ----------
    gain : float
        Gain.
    lag, delay : float
        First-order lag and delay, s.
    limit, rate : float
        Largest command, in its unit, and largest rate, per second.
    dead_zone : float
        Half width of a dead zone, in the command's unit.
    fading : float
        Share of the gain lost within a minute.
    """

    gain: float = 1.0
    lag: float = 0.0
    delay: float = 0.0
    limit: float = NEVER
    dead_zone: float = 0.0
    rate: float = NEVER
    fading: float = 0.0


class Hydraulic(NamedTuple):
    """Hydraulic cylinder.

    Attributes
    ----------
    speed : float
        Largest speed, m/s.
    compliance : float
        Yield under load, m/N.
    play : float
        Play between piston and plate, m.
    slowdown : float
        Share by which the natural frequencies are lower than nominal.
    creep : float
        Own motion of the piston, m/s.
    """

    speed: float = 0.3
    compliance: float = 0.0
    play: float = 0.0
    slowdown: float = 0.0
    creep: float = 0.0


class Sensor(NamedTuple):
    """Sensor with its noise and defects; `u` stands for the sensor's unit.

    Attributes
    ----------
    white, mains : float
        White noise, u rms, and amplitude of the 50 Hz hum, u.
    bit : float
        Resolution, u.
    gain, offset : float
        Gain, and offset, u.
    lag, delay : float
        First-order lag and delay, s.
    curvature, full_scale : float
        Share of the reading lost at full scale, and the full scale, u.
    drift : float
        Drift, u/s.
    crosstalk : float
        Reading per acceleration of the carriage, u/(m/s²).
    """

    white: float
    mains: float
    bit: float
    gain: float = 1.0
    offset: float = 0.0
    lag: float = 0.0
    delay: float = 0.0
    curvature: float = 0.0
    full_scale: float = 1.0
    drift: float = 0.0
    crosstalk: float = 0.0


LVDT = Sensor(6e-5, 2e-4, 4.6e-6, full_scale=0.03)
CELL = Sensor(1.5, 5.0, 0.076, full_scale=400.0)


class Truth(NamedTuple):
    """Parameters of the whole rig.

    Attributes
    ----------
    mass : float
        Mass of the carriage, kg.
    rail, motor : Slider
        Friction of the rail and of the motor's rod.
    tyre, tyre_damping, tyre_hardening : float
        Stiffness, N/m, and damping, Ns/m, of the tyre, and its stiffening, 1/m.
    relaxing, relaxing_time : float
        Share of the tyre's stiffness that relaxes, and its time constant, s.
    motor_constant, electrical_lag : float
        Force per voltage of the motor, N/V, and lag of its current, s.
    ripple, ripple_pitch, ripple_phase : float
        Cogging of the motor: amplitude, N, pitch, m, and phase, rad.
    voltage, ground, structure : Drive
        Paths of the three commands.
    ground_hydraulic, structure_hydraulic : Hydraulic
        Cylinders.
    ground_lvdt, structure_lvdt, suspension_lvdt, load_cell : Sensor
        Sensors.
    computation_delay : float
        Delay of all commands by the computer, s.
    missed : float
        Share of missed ticks.
    bristle : float
        Stiffness of bristle friction, N/m. 0 stands for set-valued friction.
    load_lag : float
        Lag of a compliant cylinder behind its load, s. 0 stands for none.
    """

    mass: float = 34.0
    rail: ReferenceSlider = ReferenceSlider(50.0)
    tyre: float = 50_000.0
    tyre_damping: float = 0.0
    tyre_hardening: float = 0.0
    relaxing: float = 0.0
    relaxing_time: float = 0.05
    motor_constant: float = 186.0
    electrical_lag: float = 1.26e-3
    motor: ReferenceSlider = ReferenceSlider(14.0)
    ripple: float = 0.0
    ripple_pitch: float = 0.03
    ripple_phase: float = 0.0
    voltage: CommandPath = CommandPath()
    ground: CommandPath = CommandPath()
    structure: CommandPath = CommandPath()
    ground_hydraulic: Hydraulic = Hydraulic()
    structure_hydraulic: Hydraulic = Hydraulic()
    ground_lvdt: Sensor = LVDT
    structure_lvdt: Sensor = LVDT
    suspension_lvdt: Sensor = LVDT
    load_cell: Sensor = CELL
    computation_delay: float = 0.0
    missed: float = 0.0
    bristle: float = 0.0
    load_lag: float = 4e-3
