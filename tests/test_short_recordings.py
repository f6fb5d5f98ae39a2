"""Sets of short recordings: judged together, refused alone, the shortest left out by name."""

from __future__ import annotations

import numpy as np
import pytest

import rigtwin
from rigtwin.diagnosis.data_checks import SHORTEST, SHORTEST_PART
from rigtwin.diagnosis.short_recordings import drop_short, least_ticks
from rigtwin.errors import RigtwinError

BENCH = rigtwin.machine("damper-bench")


def demands(configuration, seed):
    time = np.arange(configuration.ticks) * configuration.timing.period
    return {"displacement": 0.02 * np.sin(6 * time + seed) + 0.01 * np.sin(17 * time + 2 * seed)}


@pytest.fixture(scope="module")
def short(tmp_path_factory) -> list[rigtwin.Recording]:
    """Four recordings of 80 ticks and one of 20, of a damper with hidden friction."""
    folder = tmp_path_factory.mktemp("short")
    return [
        rigtwin.run(
            BENCH,
            demands,
            seed=seed,
            effects={"viscous@damper": 300},
            settings={"timing": {"period": 0.01, "duration": seconds}},
            path=folder / f"{seed}.mcap",
        )
        for seed, seconds in enumerate([0.8, 0.8, 0.8, 0.8, 0.2])
    ]


def test_short_recordings_of_one_machine_are_diagnosed_together(short):
    answer = rigtwin.diagnose(short[:4])
    assert answer.verdict == "explained"
    (effect,) = answer.effects
    assert str(effect.name) == "viscous@damper"
    assert effect.parameters["viscous"].value == pytest.approx(300.0, rel=0.02)


def test_one_of_them_alone_is_too_short(short):
    answer = rigtwin.diagnose(short[:1])
    assert answer.verdict == "unusable"
    assert f"it has 80 ticks; a comparison needs at least {SHORTEST}" in answer.sentence


def test_a_set_whose_total_is_too_short_says_so_first(short):
    answer = rigtwin.diagnose(short[:2])
    assert answer.verdict == "unusable"
    assert f"160 ticks together; a diagnosis needs at least {SHORTEST}" in answer.sentence


def test_the_shortest_are_left_out_and_named(short):
    kept, notes = drop_short(short)
    assert kept == short[:4]
    (note,) = notes
    assert note == (
        "4.mcap is left out: it has 20 ticks in 0.2 s; "
        f"a recording of a set needs at least {SHORTEST_PART} ticks and 0.5 s"
    )
    assert note in rigtwin.diagnose([*short[:3], short[4]]).answer.notes


def test_a_set_of_nothing_but_the_shortest_is_left_to_the_data_checks(short):
    assert drop_short([short[4], short[4]]) == ([short[4], short[4]], [])
    assert least_ticks(short[:1]) == SHORTEST
    assert least_ticks(short[:2]) == SHORTEST
    assert least_ticks(short[:3]) == SHORTEST_PART


def test_held_out_recordings_are_judged_as_a_set_too(short):
    with pytest.raises(RigtwinError, match=f"80 ticks; a comparison needs at least {SHORTEST}"):
        rigtwin.diagnose(short[:3], held_out=short[3])
