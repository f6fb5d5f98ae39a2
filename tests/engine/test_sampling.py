"""White noise, hum and bits that a signal shows by itself."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rigtwin.components import LoadCell, Lvdt, Motor
from rigtwin.components.computer import Mains
from rigtwin.diagnosis.sampling import find_outstanding, properties
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import white_noise

PERIOD, TICKS = 1e-3, 8000
TIME = PERIOD * np.arange(TICKS)
MOTION = 0.02 * np.sin(2.0 * np.pi * 0.7 * TIME)
RANDOM = np.random.default_rng(9)
NOISE = RANDOM.standard_normal((3, TICKS))
HUM = np.sin(2.0 * np.pi * 50.0 * TIME + 0.4)


def signal(white: float, hum: float, bit: float, number: int = 0) -> np.ndarray:
    """Return a motion as a sensor with noise, hum and bits reads it, shape (ticks,)."""
    read = MOTION + white * NOISE[number] + hum * HUM
    return np.round(read / bit) * bit if bit > 0.0 else read


@pytest.mark.parametrize(
    ("white", "hum", "bit"), [(1e-4, 3e-4, 1e-6), (3e-4, 0.0, 4e-4), (2e-5, 1e-3, 0.0)]
)
def test_noise_hum_and_bit_are_read_off_the_difference(white, hum, bit):
    """A bit's own variance, bit²/12, is no white noise."""
    read = signal(white, hum, bit)
    found = properties(read, MOTION, PERIOD, 50.0)
    total = min(white_noise(read), white_noise(read - MOTION)) ** 2
    assert found["white"] ** 2 + bit**2 / 12.0 == pytest.approx(total)
    assert found["white"] == pytest.approx(white, rel=0.25 if bit > white else 0.06)
    assert found["hum"] == pytest.approx(hum, rel=0.05, abs=3e-5)
    assert found["resolution"] == pytest.approx(bit, rel=1e-6)


def test_a_bit_that_is_coarser_than_the_noise_leaves_no_white_noise():
    assert properties(np.round(MOTION / 1e-3) * 1e-3, MOTION, PERIOD, 50.0)["white"] < 2e-4


def test_what_a_controller_makes_of_noise_is_no_noise_of_the_sensor():
    """The smaller noise of the signal and of its difference to the prediction counts."""
    shaken = MOTION + 1e-3 * NOISE[1]
    found = properties(shaken + 1e-4 * NOISE[0], shaken, PERIOD, 50.0)
    assert found["white"] == pytest.approx(1e-4, rel=0.06)
    apart = properties(MOTION + 1e-4 * NOISE[0], shaken, PERIOD, 50.0)
    assert apart["white"] == pytest.approx(1e-4, rel=0.06)


NAMES = ("one", "two", "three")
NOMINAL = {"white": 1e-4, "hum": 3e-4, "resolution": 1e-5}


def outstanding(
    values: dict[str, dict[str, float]],
    hidden: tuple[str, ...] = (),
    nominal: dict[str, float] = NOMINAL,
    names: tuple[str, ...] = NAMES,
    recordings: int = 1,
) -> list[tuple[str, str]]:
    """Return what stands out of sensors whose properties differ from the nominal ones."""
    columns = {}
    for number, name in enumerate(names):
        own = {**NOMINAL, **values.get(name, {})}
        columns[name] = signal(own["white"], own["hum"], own["resolution"], number)
    recording = RecordedTest(Path("x"), "bench", "", PERIOD, TIME, {"/sensor": columns}, {})
    rows = [SimpleNamespace(name=name, channel=("/sensor", name)) for name in names]
    rows.append(SimpleNamespace(name="drive", channel=("/sensor", names[0])))
    rows.append(SimpleNamespace(name="quiet", channel=("/sensor", names[0])))
    kinds = ("noise", "hum", "quantisation")
    effects = [
        SimpleNamespace(name=f"{kind}@{name}")
        for kind in kinds
        for name in names
        if f"{kind}@{name}" not in hidden
    ]
    components = {name: SimpleNamespace(quantity="position") for name in names}
    components |= {
        "drive": SimpleNamespace(quantity=""),
        "quiet": SimpleNamespace(quantity="force"),
    }
    machine: Any = SimpleNamespace(rows=rows, effects=lambda: effects, components=components)
    sensors = {name: Lvdt(**nominal) for name in names}
    plant: Any = SimpleNamespace(**sensors, drive=Motor(), quiet=LoadCell(white=0.0), mains=Mains())
    predicted = [np.tile(MOTION, (len(rows), 1))] * recordings
    found = find_outstanding(machine, [recording] * recordings, predicted, plant)
    for each in found:
        assert each.nominal == nominal[each.parameter]
        assert each.value > 1.5 * each.nominal
    return [(each.component, each.kind) for each in found]


def test_nominal_sensors_do_not_stand_out():
    assert outstanding({}) == []


@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ({"white": 1.8e-4}, "noise"),
        ({"hum": 5.4e-4}, "hum"),
        ({"resolution": 5e-4}, "quantisation"),
    ],
)
def test_more_than_1_6_times_the_nominal_value_stands_out(changes, kind):
    assert outstanding({"two": changes}) == [("two", kind)]
    assert outstanding({"two": changes}, recordings=2) == [("two", kind)]
    assert outstanding({"two": changes}, hidden=(f"{kind}@two",)) == []


@pytest.mark.parametrize(("factor", "found"), [(1.5, []), (1.7, [("two", "hum")])])
def test_the_limit_lies_between_1_5_and_1_7(factor, found):
    assert outstanding({"two": {"hum": factor * 3e-4, "white": 1e-5}}) == found


def test_what_all_sensors_have_more_is_the_laboratorys():
    more = {name: {"hum": 6e-4} for name in NAMES}
    assert outstanding(more) == []
    assert outstanding({**more, "two": {"hum": 1.2e-3}}) == [("two", "hum")]


def test_a_sensor_alone_is_held_against_its_nominal_value():
    assert outstanding({"one": {"hum": 6e-4}}, names=("one",)) == [("one", "hum")]
    assert outstanding({}, names=("one",)) == []


def test_bits_within_the_noise_and_noise_within_the_bits_do_not_stand_out():
    """A bit of 5e-5 is five times nominal but below the white noise; under a bit of 1 mm neither
    noise nor hum is seen."""
    assert outstanding({"two": {"resolution": 5e-5}}) == []
    coarse = outstanding({"two": {"resolution": 1.2e-3, "white": 5e-4}})
    assert coarse == [("two", "quantisation")]


def test_a_property_without_a_nominal_value_does_not_stand_out():
    none = {"white": 1e-4, "hum": 0.0, "resolution": 1e-5}
    assert outstanding({"two": {"hum": 1e-3}}, nominal=none) == []
