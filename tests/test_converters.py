"""Noise, hum and quantisation as the facts of the rig give them."""

from __future__ import annotations

import numpy as np
import pytest

from controllers import Measurements
from rigtwin.components import RigPlant
from rigtwin.signals.noise import remove_mains, white_noise
from rigtwin.simulation.converters import Disturbance, quantise, sensors


def test_disturbances_have_the_sizes_of_the_table_and_do_not_depend_on_the_block():
    plant = RigPlant()
    whole = Disturbance(plant, 1e-3, 4).take(20_000)
    parts = Disturbance(plant, 1e-3, 4)
    assert np.array_equal(whole, np.concatenate([parts.take(n) for n in (1, 249, 9750, 10_000)]))
    for column, sensor in enumerate(sensors(plant)):
        signal = whole[:, column]
        left = remove_mains(signal, 1e-3, 50.0)
        assert np.std(left) == pytest.approx(sensor.white, rel=0.03)
        assert np.sqrt(2) * np.std(signal - left) == pytest.approx(sensor.hum, rel=0.03)
        assert white_noise(signal) == pytest.approx(sensor.white, rel=0.1)
    assert len(sensors(plant)) == len(Measurements._fields)


def test_channels_are_independent():
    plant = RigPlant()
    louder = plant._replace(load_cell=plant.load_cell._replace(white=3.0))
    one, other = Disturbance(plant, 1e-3, 4).take(100), Disturbance(louder, 1e-3, 4).take(100)
    assert np.array_equal(one[:, :3], other[:, :3])
    assert not np.array_equal(one[:, 3], other[:, 3])


def test_quantisation():
    assert quantise(0.100, 0.02, 0.076) == pytest.approx(0.152)
    assert quantise(0.1234, 0.0, 0.0) == 0.1234
    values = np.linspace(-1, 1, 999)
    assert np.max(np.abs([quantise(v, 0.0, 0.076) - v for v in values])) <= 0.038 + 1e-12
