"""Logs whose numbered state holds positions and velocities."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.stacked_states import split_state
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import ARM, arm_motion, write_log


def states(order: str) -> dict[str, Array]:
    time = 0.01 * np.arange(500)
    places = [np.sin(2.0 * time), 0.3 * np.cos(3.1 * time)]
    rates = [np.gradient(place, time) for place in places]
    noise = np.random.default_rng(1).normal(0.0, 1e-3, (2, 500))
    places = [place + part for place, part in zip(places, noise, strict=True)]
    listed = {
        "stacked": [*places, *rates],
        "in turn": [places[0], rates[0], places[1], rates[1]],
        "neither": [*places, *places],
    }[order]
    return {f"state[{number}]": values for number, values in enumerate(listed)}


@pytest.mark.parametrize(
    ("order", "columns"),
    [("stacked", ["state[0]", "state[1]"]), ("in turn", ["state[0]", "state[2]"]), ("neither", [])],
)
def test_rates_tell_positions_from_velocities(order: str, columns: list[str]) -> None:
    values = states(order)
    matches = split_state(list(values), values, ["a", "b"])
    placed = [match for match in matches if match.quantity is JointQuantity.POSITION]
    assert [match.column for match in placed] == columns
    assert [match.joint for match in placed] == ["a", "b"][: len(columns)]
    assert len(matches) == 2 * len(columns)


def test_a_model_of_another_number_of_joints_is_not_meant() -> None:
    values = states("stacked")
    assert not split_state(list(values), values, ["a", "b", "c"])


def test_an_arm_is_described_by_its_stacked_state(tmp_path: Path) -> None:
    model = tmp_path / "arm.xml"
    model.write_text(ARM.format(rest=""))
    motion = arm_motion({"shoulder": 0.0, "elbow": 0.0})
    rates = [np.gradient(motion[name], motion["time"]) for name in ("q1", "q2")]
    columns = {"timestamp": motion["time"]}
    state = [motion["q1"], motion["q2"], *rates]
    columns |= {f"observation.state[{n}]": values for n, values in enumerate(state)}
    columns |= {f"observation.effort[{n}]": motion[f"tau{n + 1}"] for n in range(2)}
    answer = rigtwin.describe(model, write_log(tmp_path / "log.csv", columns))
    taken = {signal.key: signal.column for signal in answer.reading.signals}
    assert taken["elbow.position"] == "observation.state[1]"
    assert taken["elbow.force"] == "observation.effort[1]"
    del columns["observation.state[3]"]
    with pytest.raises(RigtwinError, match="no column is named as the position of"):
        rigtwin.describe(model, write_log(tmp_path / "short.csv", columns))
