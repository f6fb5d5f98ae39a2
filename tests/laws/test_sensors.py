"""A sensor: delay, lag, gain, offset and drift of what it reads; its noise, hum and bits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rigtwin.components import (
    Computer,
    ForceSensor,
    Guide,
    LoadCell,
    Lvdt,
    Mains,
    PositionSensor,
    RigPlant,
    VelocitySensor,
    measures,
)
from rigtwin.components.plant import plant_of
from rigtwin.components.sensors import (
    apply_sensor,
    remove_drift,
    slope_of,
    start_transducer,
    transduce,
    transducer,
    undo_sensor,
    undo_static,
)
from rigtwin.models.reading import hum_of, make_noise, round_reading
from rigtwin.simulation.converters import Disturbance, quantise
from tests.laws.written import law_of

PERIOD = 1e-3
TIME = PERIOD * np.arange(600)
WAVE = 0.4 + np.sin(2.0 * np.pi * 3.0 * TIME)
JUMP = np.where(TIME < 0.1, 0.2, 1.0)
RAMP = 0.3 + 2.0 * np.maximum(TIME - 0.05, 0.0)
RIG = (Lvdt, LoadCell)
DESCRIBED = (PositionSensor, VelocitySensor, ForceSensor)
SENSORS = (*RIG, *DESCRIBED)


@pytest.mark.parametrize("kind", SENSORS)
def test_a_nominal_sensor_reads_what_there_is(kind):
    read = apply_sensor(kind(), WAVE, PERIOD)
    assert np.array_equal(read, WAVE)
    assert read is not WAVE
    assert transducer(kind(), PERIOD).neutral is True
    for name in ("gain", "offset", "drift", "lag", "delay"):
        assert transducer(kind(**{name: 0.02}), PERIOD).neutral is False


@law_of("gain", *SENSORS)
@law_of("offset", *SENSORS)
@law_of("drift", *SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize(
    ("gain", "offset", "drift"), [(1.1, 0.0, 0.0), (1.0, 0.03, 0.0), (0.9, -0.02, 0.5)]
)
def test_a_sensor_multiplies_and_displaces_and_its_zero_drifts(kind, gain, offset, drift):
    """y = g x + o + d t."""
    sensor = kind(gain=gain, offset=offset, drift=drift)
    expected = gain * WAVE + offset + drift * TIME
    assert apply_sensor(sensor, WAVE, PERIOD) == pytest.approx(expected)
    still = remove_drift(sensor, apply_sensor(sensor, WAVE, PERIOD), PERIOD)
    assert still == pytest.approx(gain * WAVE + offset)


def test_a_sensor_without_drift_is_left_as_it_is():
    assert remove_drift(Lvdt(gain=2.0), WAVE, PERIOD) is WAVE


@law_of("lag", *SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize("lag", [0.004, 0.03])
def test_a_lag_answers_a_jump_with_an_exponential(kind, lag):
    # The quantity rises linearly over the tick before 0.1 s, so the jump lies half a tick earlier.
    since = np.maximum(TIME + 0.5 * PERIOD - 0.1, 0.0)
    expected = 1.0 - 0.8 * np.exp(-since / lag)
    tolerance = 0.8 * (PERIOD / lag) ** 2 / 8.0
    read = apply_sensor(kind(lag=lag), JUMP, PERIOD)
    assert read == pytest.approx(expected, abs=tolerance)


@law_of("lag", *SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize("lag", [0.0008, 0.004, 0.03])
def test_a_lag_follows_a_ramp_by_its_time_constant(kind, lag):
    read = apply_sensor(kind(lag=lag), RAMP, PERIOD)
    behind = (RAMP - read)[-10:] / 2.0
    # To second order in the tick: 1 / (1 − exp(−h/T)) − 1/2 ticks, which is T up to h²/12T.
    assert behind == pytest.approx(lag, abs=1.1 * PERIOD**2 / (12.0 * lag))


@law_of("delay", *SENSORS)
@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize("delay", [0.003, 0.0124])
def test_a_delay_shifts_the_signal(kind, delay):
    read = apply_sensor(kind(delay=delay), RAMP, PERIOD)
    expected = 0.3 + 2.0 * np.maximum(TIME - delay - 0.05, 0.0)
    assert read[80:] == pytest.approx(expected[80:])
    assert read[:50] == pytest.approx(np.full(50, 0.3))


def test_before_the_first_sample_the_quantity_was_what_it_is_then():
    sensor = transducer(Lvdt(gain=1.1, lag=0.02, delay=0.005, drift=0.2), PERIOD)
    state = start_transducer(sensor)
    read = [transduce(sensor, state, 0.7) for _ in range(3)]
    assert read == pytest.approx([0.77, 0.77 + 2e-4, 0.77 + 4e-4])


@law_of("lag", ForceSensor)
@pytest.mark.parametrize(("period", "half"), [(1e-3, 80.0), (1e-2, 40.0)])
def test_a_negative_lag_adds_the_rate_up_to_the_frequency_that_can_be_undone(period, half):
    """y = x + T x', half of x' at 80 Hz or at 0.4 of the sampling rate."""
    time, lag = period * np.arange(3000), 0.004
    warped = math.tan(math.pi * half * period)
    for frequency in (1.0, 0.6 * half, half):
        # A second-order Butterworth filter passed forward and backward, sampled bilinearly.
        share = 1.0 / (1.0 + (math.tan(math.pi * frequency * period) / warped) ** 4)
        angle = 2.0 * np.pi * frequency * time
        # Central differences of a sine are its rate times sin(ωh)/(ωh).
        rate = math.sin(2.0 * np.pi * frequency * period) / period * np.cos(angle)
        read = apply_sensor(ForceSensor(lag=-lag), np.sin(angle), period)
        expected = np.sin(angle) + share * lag * rate
        tolerance = 0.002 * lag * 2.0 * np.pi * frequency
        np.testing.assert_allclose(read[300:-300], expected[300:-300], atol=tolerance)


def test_a_lag_is_not_undone_in_a_recording_of_fifty_samples():
    sensor = ForceSensor(lag=-0.02)
    assert np.array_equal(apply_sensor(sensor, WAVE[:50], PERIOD), WAVE[:50])
    assert not np.array_equal(apply_sensor(sensor, WAVE[:51], PERIOD), WAVE[:51])


@law_of("delay", ForceSensor)
def test_a_negative_delay_reads_what_comes():
    read = apply_sensor(ForceSensor(delay=-0.0124), RAMP, PERIOD)
    expected = 0.3 + 2.0 * np.maximum(TIME + 0.0124 - 0.05, 0.0)
    assert read[60:-20] == pytest.approx(expected[60:-20])
    assert np.array_equal(read[-13:], np.full(13, RAMP[-1]))


def test_a_change_of_a_reading_is_led_back_to_a_change_of_the_quantity():
    """The delay and the gain are undone, the offset is not."""
    sensor = PositionSensor(gain=2.0, offset=0.5, delay=0.004)
    change = np.sin(2.0 * np.pi * 2.0 * TIME)
    expected = np.sin(2.0 * np.pi * 2.0 * (TIME + 0.004)) / 2.0
    found = undo_sensor(sensor, change, PERIOD)
    np.testing.assert_allclose(found[:-5], expected[:-5], atol=1e-4)
    led = undo_sensor(PositionSensor(lag=0.01), change, PERIOD)
    rate = 4.0 * np.pi * np.cos(4.0 * np.pi * TIME)
    np.testing.assert_allclose(led[80:-80], (change + 0.01 * rate)[80:-80], atol=1e-3)


@law_of("eccentricity", PositionSensor)
def test_an_encoder_off_its_axis_errs_once_a_turn():
    """An error of A·(sin(x + φ) − sin φ), and what is behind a reading with it."""
    turns = 9.0 * WAVE
    sensor = PositionSensor(gain=1.1, eccentricity=0.06, phase=0.7, offset=0.2)
    read = apply_sensor(sensor, turns, PERIOD)
    error = 0.06 * (np.sin(turns + 0.7) - math.sin(0.7))
    assert read == pytest.approx(1.1 * turns + error + 0.2)
    assert transducer(PositionSensor(eccentricity=0.01), PERIOD).neutral is False
    assert undo_static(sensor, read) == pytest.approx(turns, abs=1e-9)
    assert slope_of(sensor, turns) == pytest.approx(1.1 + 0.06 * np.cos(turns + 0.7))


def test_a_lead_is_not_undone_twice():
    """A force that acts later than it is recorded was led already when it was read."""
    assert undo_sensor(ForceSensor(lag=-0.01, delay=-0.01), WAVE, PERIOD) == pytest.approx(WAVE)


@pytest.mark.parametrize(
    ("kind", "quantity"),
    [
        (Lvdt, "position"),
        (LoadCell, "force"),
        (PositionSensor, "position"),
        (VelocitySensor, "velocity"),
        (ForceSensor, "force"),
        (Guide, ""),
        (Computer, ""),
    ],
)
def test_a_sensor_says_what_it_measures(kind, quantity):
    assert measures(kind()) == quantity


def spectral_parts(signal: np.ndarray, frequency: float) -> tuple[float, float]:
    """Return the amplitude of a line in Hz, and the rms of what is left beside it."""
    angle = 2.0 * np.pi * frequency * PERIOD * np.arange(len(signal))
    waves = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    parts = np.linalg.lstsq(waves, signal, rcond=None)[0]
    return float(np.hypot(*parts)), float(np.std(signal - waves @ parts))


@law_of("hum", *RIG)
@law_of("noise", *RIG)
@pytest.mark.parametrize(("kind", "place"), [(Lvdt, 0), (LoadCell, 3)])
@pytest.mark.parametrize("changes", [{}, {"white": 3e-4, "hum": 1e-3}, {"white": 0.0, "hum": 2.0}])
def test_the_rigs_sensors_have_white_noise_and_a_mains_line(kind, place, changes):
    sensor = kind(**changes)
    names = ("ground_lvdt", "structure_lvdt", "suspension_lvdt", "load_cell")
    plant = RigPlant(**{names[place]: sensor})
    signal = Disturbance(plant, PERIOD, 3).take(20_000)[:, place]
    hum, white = spectral_parts(signal, 50.0)
    assert hum == pytest.approx(sensor.hum, rel=0.02, abs=0.03 * sensor.white)
    assert white == pytest.approx(sensor.white, rel=0.02, abs=1e-12)


@law_of("hum", *DESCRIBED)
@law_of("noise", *DESCRIBED)
@pytest.mark.parametrize("kind", DESCRIBED)
def test_described_sensors_have_white_noise_and_a_mains_line(kind):
    parts = {"cell": kind(white=0.02, hum=0.5), "computer": Computer(), "mains": Mains(60.0)}
    plant = plant_of(parts)
    signal = make_noise(plant, "cell", 20_000, PERIOD, np.random.default_rng(3))
    hum, white = spectral_parts(signal, 60.0)
    assert hum == pytest.approx(0.5, rel=0.02)
    assert white == pytest.approx(0.02, rel=0.02)
    quarter = np.array([0.0, 1.0 / 240.0])
    assert hum_of(plant, "cell", 0.0, quarter) == pytest.approx([0.0, 0.5])


@law_of("quantisation", *RIG)
@pytest.mark.parametrize("bit", [4.6e-6, 0.076])
def test_the_rigs_readings_are_rounded_to_whole_bits(bit):
    for number in (-7, 0, 3):
        for part in (-0.49, 0.0, 0.49):
            read = quantise((number + part - 0.2) * bit, 0.2 * bit, bit)
            assert read == pytest.approx(number * bit)
    assert quantise(0.123, 0.001, 0.0) == 0.124


@law_of("quantisation", *DESCRIBED)
@pytest.mark.parametrize("kind", DESCRIBED)
def test_described_readings_are_rounded_to_whole_bits(kind):
    plant = plant_of({"cell": kind(resolution=0.05), "fine": kind()})
    reading = np.array([-0.124, 0.026, 0.0, 0.074])
    assert round_reading(plant, "cell", reading) == pytest.approx([-0.1, 0.05, 0.0, 0.05])
    assert np.array_equal(round_reading(plant, "fine", reading), reading)
