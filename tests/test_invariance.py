"""The answer does not hang on the last bit: data that differ in nothing that matters are explained
alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from referee.wild_cases import MACHINES, draw_wild
from referee.wild_recordings import WildData, record_wild
from rigtwin.description.catalogue import find
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.recording import RecordedTest, load
from tests.helpers.recordings import BESIDE, beginning
from tests.helpers.twin import recorded

CONFIDENCE, SHARE = 0.02, 0.1
"""Difference of a confidence, and of a value in units of its interval, that does not matter."""
CROPPED = 10
"""Ticks that are taken off either end."""
SECONDS = 10.0
"""Length of the shared recordings that are diagnosed, s."""
JOINTS = BESIDE.parent / "joints"

Recordings = Sequence[RecordedTest]
Change = Callable[[Recordings], Recordings]


def add_noise(size: float) -> Change:
    """Relative noise on every column."""

    def change(recordings: Recordings) -> Recordings:
        random = np.random.default_rng(1)
        return [
            replace(
                recording,
                columns={
                    topic: {
                        name: values + size * np.std(values) * random.standard_normal(len(values))
                        for name, values in columns.items()
                    }
                    for topic, columns in recording.columns.items()
                },
            )
            for recording in recordings
        ]

    return change


def crop(recordings: Recordings) -> Recordings:
    inner = slice(CROPPED, -CROPPED)
    return [
        replace(
            recording,
            time=recording.time[inner],
            columns={
                topic: {name: values[inner] for name, values in columns.items()}
                for topic, columns in recording.columns.items()
            },
        )
        for recording in recordings
    ]


def shift(recordings: Recordings) -> Recordings:
    """Shift the time, and reverse the order of the recordings."""
    return [replace(recording, time=recording.time + 123.0) for recording in recordings[::-1]]


def triple(recordings: Recordings) -> Recordings:
    return [
        replace(recording, path=Path(f"{number}-{recording.path.name}"))
        for number in range(3)
        for recording in recordings
    ]


def change_all(recordings: Recordings) -> Recordings:
    """Add noise, crop, shift and reorder: an answer that survives all at once survives each."""
    return shift(crop(add_noise(1e-6)(recordings)))


CHANGES: dict[str, Change] = {
    "noise of 1e-6, cropped, later and reordered": change_all,
    "tripled": triple,
}


def recording_of(data: WildData, machine: str) -> RecordedTest:
    """The recording of a referee's case."""
    ticks = len(next(iter(next(iter(data.columns.values())).values())))
    time = np.arange(ticks) * data.period
    return RecordedTest(Path("case"), machine, "", data.period, time, data.columns, {})


def bring_rig() -> tuple[Machine, Recordings]:
    effects = ("viscous@rail=450",)
    return find("suspension-rig"), [recorded("imposed", effects, 8.0)]


def bring_damper() -> tuple[Machine, Recordings]:
    machine = find(MACHINES["damper"])
    case = draw_wild(8, 4001)
    return machine, [recording_of(record_wild(case, again), machine.name) for again in (0, 1)]


def bring_shared(file: str, machine: str) -> Callable[[], tuple[Machine, Recordings]]:
    def bring() -> tuple[Machine, Recordings]:
        folder = BESIDE if machine == "suspension-rig" else JOINTS
        if not (folder / file).exists():
            pytest.skip(f"{file} is not beside the checkout")
        name = machine if machine == "suspension-rig" else str(JOINTS / machine)
        return find(name), [beginning(load(folder / file), SECONDS)]

    return bring


CASES: dict[str, Callable[[], tuple[Machine, Recordings]]] = {
    "rig": bring_rig,
    "dampers": bring_damper,
    "known-delay": bring_shared("known-delay-structure_cylinder.mcap", "suspension-rig"),
    "nominal-drop": bring_shared("nominal-drop.mcap", "suspension-rig"),
    "joints 003": bring_shared("003-fit.mcap", "arm3.toml"),
}


@pytest.fixture(
    scope="module",
    params=CASES,
    ids=lambda name: name.replace(" ", "-"),
)
def case(request: pytest.FixtureRequest) -> tuple[Machine, Recordings, Diagnosis]:
    machine, recordings = CASES[request.param]()
    return machine, recordings, diagnose(machine, recordings)


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
def test_what_does_not_matter_changes_nothing(
    case: tuple[Machine, Recordings, Diagnosis], change: str
) -> None:
    machine, recordings, expected = case
    answer = diagnose(machine, CHANGES[change](recordings)).answer
    assert {str(e.name) for e in answer.effects} == {str(e.name) for e in expected.answer.effects}
    known = {str(effect.name): effect for effect in expected.answer.effects}
    for effect in answer.effects:
        before = known[str(effect.name)]
        assert effect.confidence == pytest.approx(before.confidence, abs=CONFIDENCE)
        for name, estimate in effect.parameters.items():
            other = before.parameters[name]
            assert abs(estimate.value - other.value) <= SHARE * (other.high - other.low)


@pytest.mark.slow
def test_an_interval_of_what_is_named_does_not_hold_the_nominal_value(
    case: tuple[Machine, Recordings, Diagnosis],
) -> None:
    for effect in case[2].answer.effects:
        first = next(iter(effect.parameters.values()))
        assert not first.low < first.nominal < first.high
