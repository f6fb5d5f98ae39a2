"""A sensor whose zero moves with time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.components import ForceSensor, PositionSensor, VelocitySensor
from rigtwin.components.sensors import apply_sensor
from rigtwin.models.measured_motion import recover_motion
from rigtwin.recording import RecordedTest
from tests.helpers.twin import recorded

PERIOD = 2e-3
TIME = np.arange(10_000) * PERIOD
WAVE = 0.01 * np.sin(9.0 * TIME) + 0.004 * np.sin(23.0 * TIME + 1.0)


@pytest.mark.parametrize("sensor", [PositionSensor, VelocitySensor, ForceSensor])
def test_the_zero_moves_evenly(sensor):
    made = sensor(gain=1.1, offset=0.2, drift=-0.03)
    read = apply_sensor(made, WAVE, PERIOD)
    assert read == pytest.approx(1.1 * WAVE + 0.2 - 0.03 * TIME, abs=1e-9)
    assert recover_motion(made, read, PERIOD) == pytest.approx(WAVE, abs=1e-9)


def bench(drift: float, coulomb: float) -> RecordedTest:
    """A damper of 900 Ns/m and dry friction, whose load cell drifts."""
    random = np.random.default_rng(8)
    speed = np.gradient(WAVE, PERIOD)
    force = 900.0 * speed + coulomb * np.tanh(speed / 1e-3) + drift * TIME
    columns = {
        "/sensor": {
            "displacement": WAVE + 1e-6 * random.standard_normal(TIME.size),
            "force": force + 0.5 * random.standard_normal(TIME.size),
        }
    }
    return RecordedTest(Path("bench"), "damper-bench", "", PERIOD, TIME, columns, {})


@pytest.mark.slow
def test_a_drift_is_found_beside_friction():
    answer = rigtwin.diagnose(bench(3.0, 25.0), machine="damper-bench")
    found = {str(each.name): next(iter(each.parameters.values())) for each in answer.effects}
    assert set(found) == {"viscous@damper", "coulomb@damper", "drift@load_cell"}
    assert found["drift@load_cell"].value == pytest.approx(3.0, rel=0.03)
    assert found["drift@load_cell"].unit == "N/s"


@pytest.mark.slow
def test_without_drift_none_is_named():
    answer = rigtwin.diagnose(bench(0.0, 25.0), machine="damper-bench")
    assert {str(each.name) for each in answer.effects} == {"viscous@damper", "coulomb@damper"}


@pytest.mark.parametrize(
    ("sensor", "drift"),
    [("load_cell", 1.0)],
)
@pytest.mark.slow
def test_a_drift_on_the_suspension_rig_is_no_offset(sensor: str, drift: float):
    answer = rigtwin.diagnose(recorded("imposed", (f"drift@{sensor}={drift}",), 8.0))
    assert [str(each.name) for each in answer.effects] == [f"drift@{sensor}"]
    (value,) = answer.effects[0].parameters.values()
    assert value.value == pytest.approx(drift, rel=0.05)
