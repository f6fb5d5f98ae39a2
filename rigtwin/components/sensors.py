"""Sensors: parameters, and the law from the true quantity to the reading.

y(t) = gain·x + eccentricity·(sin(x + phase) − sin(phase)) + offset + drift·t, where x is the
quantity behind a first-order lag and a delay. An encoder whose disc or magnet is off the axis of a
hinge has an eccentricity: an error that repeats once a turn. Noise, hum and quantisation come on
top (`simulation.converters`, `models.reading`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np

from controllers.compiled import compilable
from rigtwin.components.plant import Plant, component_of
from rigtwin.components.quantity import NONE, Quantity
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.numerics.delay import delay_sample, ring

INVERTIBLE = 80.0
"""Highest frequency at which a sensor's lag is inverted, Hz."""
PADDED = 50
"""Smallest number of samples for the zero-phase filter."""


class Lvdt(NamedTuple):
    """Position sensor (LVDT) of the suspension rig, as the data acquisition reads it."""

    # White noise, mains hum and resolution of the converter; then the static and dynamic errors.
    white: Annotated[float, Quantity("m", 0.0, 0.01, "rms, thesis §3.4 (±5e-4 m in all)")] = 6e-5
    hum: Annotated[float, Quantity("m", 0.0, 0.01, "amplitude of the mains line, thesis §3.4")] = (
        2e-4
    )
    resolution: Annotated[float, Quantity("m", 0.0, 0.01, "16 bit")] = 4.6e-6
    gain: Annotated[float, Quantity("1", 0.1, 3.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("m", -0.05, 0.05, "0: calibrated")] = 0.0
    drift: Annotated[float, Quantity("m/s", -0.01, 0.01, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 0.1, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 0.05, NONE)] = 0.0


class LoadCell(NamedTuple):
    """Force sensor Interface 1010AF between motor rod and plate, read by the data acquisition."""

    # White noise, mains hum and resolution of the converter; then the static and dynamic errors.
    white: Annotated[float, Quantity("N", 0.0, 500.0, "rms, thesis §3.4 (±12 N in all)")] = 1.5
    hum: Annotated[float, Quantity("N", 0.0, 500.0, "amplitude of the mains line, thesis §3.4")] = (
        5.0
    )
    resolution: Annotated[float, Quantity("N", 0.0, 100.0, "16 bit of ±2.5 kN")] = 0.076
    gain: Annotated[float, Quantity("1", 0.1, 3.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("N", -500.0, 500.0, "0: calibrated")] = 0.0
    drift: Annotated[float, Quantity("N/s", -100.0, 100.0, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 0.1, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 0.05, NONE)] = 0.0


class PositionSensor(NamedTuple):
    """Sensor of a joint's position; for a turning joint, read rad for m."""

    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("m", -100.0, 100.0, "0: calibrated")] = 0.0
    drift: Annotated[float, Quantity("m/s", -100.0, 100.0, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    eccentricity: Annotated[float, Quantity("m", 0.0, 0.2, "0: centred on the hinge")] = 0.0
    phase: Annotated[float, Quantity("rad", -7.0, 7.0, NONE)] = 0.0
    white: Annotated[float, Quantity("m", 0.0, 1e7, NONE)] = 0.0
    hum: Annotated[float, Quantity("m", 0.0, 1e7, NONE)] = 0.0
    resolution: Annotated[float, Quantity("m", 0.0, 1e7, NONE)] = 0.0


class VelocitySensor(NamedTuple):
    """Sensor of a joint's velocity; for a turning joint, read rad for m."""

    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("m/s", -100.0, 100.0, "0: calibrated")] = 0.0
    drift: Annotated[float, Quantity("m/s^2", -100.0, 100.0, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 10.0, NONE)] = 0.0
    white: Annotated[float, Quantity("m/s", 0.0, 1e7, NONE)] = 0.0
    hum: Annotated[float, Quantity("m/s", 0.0, 1e7, NONE)] = 0.0
    resolution: Annotated[float, Quantity("m/s", 0.0, 1e7, NONE)] = 0.0


class ForceSensor(NamedTuple):
    """Sensor of the force on a joint, positive in the joint's positive direction.

    A negative lag or delay means that the force acts later than it is recorded, as where the
    recording holds the command of an actuator that follows it late.
    """

    gain: Annotated[float, Quantity("1", 0.05, 5.0, "1: calibrated")] = 1.0
    offset: Annotated[float, Quantity("N", -1e7, 1e7, "0: calibrated")] = 0.0
    drift: Annotated[float, Quantity("N/s", -1e7, 1e7, NONE)] = 0.0
    lag: Annotated[float, Quantity("s", -1.0, 10.0, NONE)] = 0.0
    delay: Annotated[float, Quantity("s", -1.0, 10.0, NONE)] = 0.0
    white: Annotated[float, Quantity("N", 0.0, 1e7, NONE)] = 0.0
    hum: Annotated[float, Quantity("N", 0.0, 1e7, NONE)] = 0.0
    resolution: Annotated[float, Quantity("N", 0.0, 1e7, NONE)] = 0.0


DECLARED = (Lvdt, LoadCell)
"""Types of sensors whose noise, hum and resolution are declared."""
Sensor = Lvdt | LoadCell | PositionSensor | VelocitySensor | ForceSensor
MEASURES: Mapping[type, str] = {
    PositionSensor: "position",
    VelocitySensor: "velocity",
    ForceSensor: "force",
    Lvdt: "position",
    LoadCell: "force",
}
"""Type of sensor → quantity that it measures."""


def measures(component: object) -> str:
    """Return the quantity that a component measures: position, velocity or force.

    It is "" for a component that is not a sensor.
    """
    return MEASURES.get(type(component), "")


def sensor_of(plant: Plant, name: str) -> Sensor:
    """Return the sensor of a plant with a name."""
    return component_of(plant, name, Lvdt, LoadCell, PositionSensor, VelocitySensor, ForceSensor)


class Transducer(NamedTuple):
    """Law of a sensor as compiled code takes it, for one tick."""

    neutral: bool  # Whether the reading is the true quantity.
    gain: float  # Gain of the reading.
    eccentricity: float  # Amplitude of the error that repeats once a turn.
    phase: float  # Phase of the error that repeats once a turn, rad.
    offset: float  # Offset of the reading.
    drift: float  # Drift of the reading per tick.
    delay: float  # Delay in ticks.
    share: float  # Share of the remaining distance that the lag covers in a tick.


class TransducerState(NamedTuple):
    """State of a sensor; changed in place."""

    history: Array  # Past values, a ring buffer.
    memory: Array  # Position in the ring (−1 at first), output and input of the lag, drift so far.


def transducer(sensor: Sensor, period: float) -> Transducer:
    """Return the law of a sensor, discretised for ticks of a period, s."""
    drift = sensor.drift * period
    amplitude, phase = _eccentricity(sensor)
    parameters = sensor.gain, sensor.offset, sensor.delay, sensor.lag, drift, amplitude
    neutral = parameters == (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    # Tick by tick, a negative lag or delay would need future values: only `apply_sensor` has them.
    lag, delay = max(sensor.lag, 0.0), max(sensor.delay, 0.0)
    share = 1.0 if lag == 0.0 else 1.0 - math.exp(-period / lag)
    return Transducer(
        neutral, sensor.gain, amplitude, phase, sensor.offset, drift, delay / period, share
    )


def start_transducer(sensor: Transducer) -> TransducerState:
    """Return the state of a sensor before its first sample."""
    return TransducerState(ring(sensor.delay, 0.0), np.array([-1.0, 0.0, 0.0, 0.0]))


def _eccentricity(sensor: Sensor) -> tuple[float, float]:
    """Return amplitude and phase of the error that repeats once a turn, rad."""
    if isinstance(sensor, PositionSensor):
        return sensor.eccentricity, sensor.phase
    return 0.0, 0.0


def undo_static(sensor: Sensor, reading: Array) -> Array:
    """Return the quantity behind readings without drift, lag and delay, of the same shape.

    Parameters
    ----------
    sensor
        Sensor with its parameters.
    reading
        Readings, of any shape.
    """
    amplitude, phase = _eccentricity(sensor)
    quantity = np.asarray((reading - sensor.offset) / sensor.gain)
    # Each step of Newton's method squares the error, which is a few hundredths at first.
    for _ in range(4 if amplitude else 0):
        error = amplitude * (np.sin(quantity + phase) - math.sin(phase))
        excess = sensor.gain * quantity + error + sensor.offset - reading
        quantity = quantity - excess / slope_of(sensor, quantity)
    return quantity


def slope_of(sensor: Sensor, quantity: Array) -> Array:
    """Return by how much a reading grows with the quantity, at quantities of any shape."""
    amplitude, phase = _eccentricity(sensor)
    return np.asarray(sensor.gain + amplitude * np.cos(quantity + phase))


def remove_drift(sensor: Sensor, measured: Array, period: float) -> Array:
    """Return a reading without its drift, shape (ticks,)."""
    if sensor.drift == 0.0:
        return measured
    return measured - sensor.drift * period * np.arange(len(measured))


@compilable
def transduce(sensor: Transducer, state: TransducerState, value: float) -> float:
    """Return the reading of a sensor at this tick and advance its state.

    Parameters
    ----------
    sensor
        Law of the sensor.
    state
        State of the sensor, changed in place.
    value
        True quantity at this tick.
    """
    if sensor.neutral:
        return value
    # Before the first tick, the quantity is taken to have had its first value for long.
    if state.memory[0] < 0.0:
        state.history[:] = value
        state.memory[0], state.memory[1], state.memory[2] = 0.0, value, value
    late = delay_sample(state.history, state.memory, sensor.delay, value)
    # A lag sees the mean of its input over the tick: with the latest value alone it would be half a
    # tick short.
    seen = late if sensor.share == 1.0 else 0.5 * (state.memory[2] + late)
    state.memory[1] += sensor.share * (seen - state.memory[1])
    state.memory[2] = late
    reading = sensor.gain * state.memory[1] + sensor.offset + state.memory[3]
    if sensor.eccentricity != 0.0:
        turned = math.sin(state.memory[1] + sensor.phase) - math.sin(sensor.phase)
        reading += sensor.eccentricity * turned
    state.memory[3] += sensor.drift
    return reading


@kernel
def _transduce_all(sensor: Transducer, state: TransducerState, true: Array, out: Array) -> None:
    """Write the readings of a signal, shape (ticks,), to `out`."""
    for tick in range(len(true)):
        out[tick] = transduce(sensor, state, true[tick])


def apply_sensor(sensor: Sensor, true: Array, period: float) -> Array:
    """Return a sensor's readings of a signal, without noise and quantisation.

    Parameters
    ----------
    sensor
        Sensor with its parameters.
    true
        True quantity, shape (ticks,).
    period
        Time from tick to tick, s.

    Returns
    -------
    array
        Readings, shape (ticks,).
    """
    model, out = transducer(sensor, period), np.empty(len(true))
    if model.neutral:
        return true.copy()
    ahead = _lead(-min(sensor.lag, 0.0), -min(sensor.delay, 0.0), true, period)
    _transduce_all(model, start_transducer(model), np.ascontiguousarray(ahead), out)
    return out


def _lead(lag: float, delay: float, signal: Array, period: float) -> Array:
    """Advance a signal by the inverse of a lag and a delay, s, shape (ticks,).

    A lag T is inverted by x = y + T·y'. The derivative is low-passed at `INVERTIBLE` without phase
    shift, or it would amplify the noise.
    """
    ahead = signal
    if lag > 0.0 and len(signal) > PADDED:
        # Imported late: scipy is slow to load, and most runs do not need it.
        from scipy.signal import butter, sosfiltfilt

        low_pass = butter(2, min(INVERTIBLE, 0.4 / period), fs=1.0 / period, output="sos")
        ahead = signal + lag * np.gradient(sosfiltfilt(low_pass, signal), period)
    if delay > 0.0:
        from scipy.interpolate import make_interp_spline

        # Linear interpolation between two samples would smooth their noise, and so explain some of
        # it.
        ticks = np.arange(len(signal))
        spline = make_interp_spline(ticks, ahead, k=min(3, len(signal) - 1))
        ahead = spline(np.minimum(ticks + delay / period, ticks[-1]))
    return ahead


def undo_sensor(sensor: Sensor, signal: Array, period: float) -> Array:
    """Return the change of the true quantity behind a change of a sensor's reading.

    Gain, lag and delay are inverted. Offset and drift cancel in a change.

    Parameters
    ----------
    sensor
        Sensor with its parameters.
    signal
        Change of the reading, shape (ticks,).
    period
        Time from tick to tick, s.

    Returns
    -------
    array
        Change of the true quantity, shape (ticks,).
    """
    return _lead(max(sensor.lag, 0.0), max(sensor.delay, 0.0), signal, period) / sensor.gain
