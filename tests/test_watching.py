"""A test watched while it runs: a recording that grows, an alarm where there is a gap alone."""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.recording.growing import GrowingRecording
from rigtwin.watching.cusum import RATIO, Cusum
from rigtwin.watching.mending import LONGEST, mend
from rigtwin.watching.watch import LIMIT, WINDOW

LATER = 6.0
"""s, from when on an effect is there."""
EFFECT = ("coulomb@rail", 60.0)
LENGTH = {"timing": {"duration": 9.0}}


@pytest.fixture(scope="module")
def nominal(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("watch") / "nominal.mcap"
    rigtwin.run("suspension-rig", "imposed", seed=4, settings=LENGTH, path=path)
    return path


@pytest.fixture(scope="module")
def changed(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("watch") / "changed.mcap"
    rigtwin.run(
        "suspension-rig",
        "imposed",
        seed=4,
        settings=LENGTH,
        effects=dict([EFFECT]),
        effects_from=LATER,
        path=path,
    )
    return path


def test_a_nominal_test_gives_no_alarm(nominal):
    watch = rigtwin.watch(nominal)
    assert watch.alarm is None
    assert watch.highest < 0.5
    assert watch.judged == pytest.approx(9.0, abs=0.01)
    assert watch.seconds == pytest.approx(watch.judged, abs=0.5)
    for signal, ratio in watch.ratios.items():
        assert 0.7 < ratio < 1.3, signal


@pytest.mark.slow
def test_an_effect_from_a_time_on_gives_an_alarm_and_its_name(changed):
    updates: list[tuple[float, bool]] = []
    watch = rigtwin.watch(
        changed, on_update=lambda now: updates.append((now.judged, now.alarm is None))
    )
    alarm = watch.alarm
    assert alarm is not None
    assert LATER < alarm.time < LATER + 1.0
    assert alarm.since == pytest.approx(LATER, abs=0.6)
    assert all(calm for judged, calm in updates if judged < LATER)
    assert alarm.suspects[0].effect == EFFECT[0]
    assert alarm.suspects[0].values["coulomb"] == pytest.approx(EFFECT[1], rel=0.1)
    assert sum(each.probability for each in alarm.suspects) <= 1.0 + 1e-9
    assert alarm.component == "rail"
    assert EFFECT[0] in str(alarm)


@pytest.mark.slow
def test_with_its_effect_in_the_twin_there_is_no_alarm(tmp_path):
    path = tmp_path / "known.mcap"
    settings = [LENGTH, {"rail": {"coulomb": EFFECT[1]}}]
    rigtwin.run(
        "suspension-rig", "imposed", seed=5, settings=LENGTH, effects=dict([EFFECT]), path=path
    )
    assert rigtwin.watch(path, suspects=False).alarm is not None
    assert rigtwin.watch(path, settings=settings[1:], suspects=False).alarm is None


def test_up_to_when_an_effect_begins_a_run_is_the_nominal_one(nominal, changed):
    before, after = rigtwin.load(nominal), rigtwin.load(changed)
    early = before.time < LATER
    assert early.sum() > 5000
    for topic, columns in before.columns.items():
        for name, values in columns.items():
            expected = after.columns[topic][name]
            np.testing.assert_array_equal(values[early], expected[early], err_msg=name)
    travel, identical = (
        after.column("/truth", "suspension"),
        before.column("/truth", "suspension"),
    )
    count_early = int(early.sum())
    # A rig that changes its friction does not jump.
    assert np.max(np.abs(np.diff(travel[count_early - 5 : count_early + 5]))) < 2.0 * np.max(
        np.abs(np.diff(identical))
    )
    assert np.max(np.abs(travel - identical)) > 1e-4
    assert float(after.twin["effects_from"]) == LATER
    assert "effects_from" not in before.twin


@pytest.mark.parametrize("wrong", [-1.0, math.inf, math.nan])
def test_effects_begin_at_a_time(wrong):
    with pytest.raises(rigtwin.RigtwinError, match="effects from"):
        rigtwin.run("suspension-rig", "imposed", effects_from=wrong)


def test_effects_of_other_machines_are_there_all_along():
    with pytest.raises(rigtwin.RigtwinError, match="from the start only"):
        rigtwin.run("emps", "positioning", effects={"coulomb@guide": 20.0}, effects_from=1.0)


def grow(whole: Path, path: Path, pieces: int, pause: float) -> threading.Thread:
    """Writes a file again, piece by piece."""
    data = whole.read_bytes()
    edges = np.linspace(0, len(data), pieces + 1).astype(int)

    def write() -> None:
        with path.open("wb", buffering=0) as file:
            for first, last in itertools.pairwise(edges.tolist()):
                file.write(data[first:last])
                time.sleep(pause)

    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    return thread


@pytest.mark.slow
def test_what_grows_is_judged_as_what_is_whole(nominal, tmp_path):
    path = tmp_path / "growing.mcap"
    writer = grow(nominal, path, 40, 0.02)
    followed = rigtwin.watch(path, suspects=False)
    writer.join()
    assert followed.alarm is None
    assert followed.judged == rigtwin.watch(nominal, suspects=False).judged


def test_a_growing_recording_is_read_whatever_the_pieces(nominal, tmp_path):
    data, path = nominal.read_bytes(), tmp_path / "growing.mcap"
    whole = rigtwin.load(nominal)
    growing = GrowingRecording(path, 1e6)
    random = np.random.default_rng(1)
    edges = np.sort(random.choice(np.arange(1, len(data)), 60, replace=False))
    for edge in [*edges.tolist(), len(data)]:
        path.write_bytes(data[:edge])
        growing.read()
    assert growing.ended
    again = growing.recording()
    np.testing.assert_array_equal(again.time, whole.time)
    np.testing.assert_array_equal(
        again.column("/sensor", "load_cell"), whole.column("/sensor", "load_cell")
    )
    assert (again.end, again.notes, again.twin) == (whole.end, whole.notes, whole.twin)


def test_only_its_last_seconds_are_kept(nominal):
    growing = GrowingRecording(nominal, 3.0)
    while not growing.ended:
        before = growing.latest
        assert growing.read(before + 1.0) or growing.ended
        assert growing.latest < before + 3.0
    recording = growing.recording()
    assert recording.time[-1] == growing.latest
    assert recording.time[-1] - recording.time[0] == pytest.approx(3.0, abs=2e-3)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"no recording, but longer than a beginning", "is not an MCAP file"),
        (b"", "nothing was added to it for 0.3 s"),
        (b"\x89MCAP0\r\n", "nothing was added to it for 0.3 s"),
    ],
)
def test_what_is_no_recording_is_said(tmp_path, content, said):
    path = tmp_path / "wrong.mcap"
    path.write_bytes(content)
    with pytest.raises(rigtwin.RigtwinError, match=said) as error:
        rigtwin.watch(path, patience=0.3)
    assert "\n" not in str(error.value)


def test_what_is_not_there_is_said(tmp_path):
    with pytest.raises(rigtwin.RigtwinError, match="No such file"):
        rigtwin.watch(tmp_path / "none.mcap", patience=0.2)


def test_a_test_that_stops_without_an_end_is_given_up(nominal, tmp_path):
    path = tmp_path / "killed.mcap"
    path.write_bytes(nominal.read_bytes()[: nominal.stat().st_size // 2])
    with pytest.raises(rigtwin.RigtwinError, match=re.escape("it does not say that its test is")):
        rigtwin.watch(path, patience=0.3)


def test_a_file_that_is_replaced_is_said(nominal, tmp_path):
    path = tmp_path / "replaced.mcap"
    path.write_bytes(nominal.read_bytes()[:200_000])
    growing = GrowingRecording(path, WINDOW)
    growing.read()
    path.write_bytes(b"")
    with pytest.raises(rigtwin.RigtwinError, match="was replaced"):
        growing.read()


def test_a_damaged_stretch_does_not_end_the_watch(nominal, tmp_path):
    data = bytearray(nominal.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 8] = bytes(8)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    watch = rigtwin.watch(path, suspects=False)
    assert watch.alarm is None
    assert watch.judged == pytest.approx(9.0, abs=0.01)


def test_it_can_be_stopped(nominal):
    updates: list[float] = []
    watch = rigtwin.watch(
        nominal, on_update=lambda now: updates.append(now.judged), stop=lambda: len(updates) > 2
    )
    assert len(updates) == 3
    assert watch.judged < 6.0


def test_of_another_machine_nothing_is_judged(nominal):
    with pytest.raises(rigtwin.RigtwinError, match="emps"):
        rigtwin.watch(nominal, machine="emps")


def test_a_shorter_stretch_is_its_end(nominal):
    whole = rigtwin.load(nominal)
    part = whole.between(7.0, math.inf)
    assert part.time[0] == pytest.approx(7.0)
    np.testing.assert_array_equal(
        part.column("/sensor", "load_cell"), whole.column("/sensor", "load_cell")[-part.ticks :]
    )
    assert whole.between(-1.0, math.inf) is whole


def without(recording: rigtwin.Recording, missing: np.ndarray) -> rigtwin.Recording:
    recorded = np.setdiff1d(np.arange(recording.ticks), missing)
    columns = {
        topic: {name: values[recorded] for name, values in names.items()}
        for topic, names in recording.columns.items()
    }
    return dataclasses.replace(recording, time=recording.time[recorded], columns=columns)


def test_missed_ticks_are_filled_in_and_not_judged(nominal):
    whole = rigtwin.load(nominal)
    missing = np.array([3000, 3001, 3002, 7000])
    mended, recorded = mend(without(whole, missing))
    np.testing.assert_allclose(mended.time, whole.time, atol=1e-9)
    np.testing.assert_array_equal(np.flatnonzero(~recorded), missing)
    command = mended.column("/command", "structure")
    np.testing.assert_array_equal(command[3000:3003], whole.column("/command", "structure")[2999])
    cell = whole.column("/sensor", "load_cell")
    filled = mended.column("/sensor", "load_cell")
    np.testing.assert_array_equal(filled[recorded], cell[recorded])
    assert filled[7000] == pytest.approx(0.5 * (cell[6999] + cell[7001]))


def test_after_a_long_gap_it_begins_anew(nominal):
    whole = rigtwin.load(nominal)
    gone = np.arange(5000, 5000 + round(LONGEST / whole.period) + 1)
    mended, recorded = mend(without(whole, gone))
    assert recorded.all()
    assert mended.time[0] == pytest.approx(whole.time[gone[-1] + 1])
    assert mended.ticks == whole.ticks - gone[-1] - 1


def test_a_cusum_stays_low_under_what_is_explained_and_rises_under_more():
    random = np.random.default_rng(3)
    count = 40
    calm, gap = Cusum(0.0), Cusum(0.0)
    highest = 0.0
    for block in range(20_000):
        highest = max(
            highest, calm.add(float(np.sum(random.normal(size=count) ** 2)), count, block)
        )
    # Page's bound: it is beyond a level less often than once in exp(level) blocks.
    assert highest < math.log(20_000) + 5.0
    taken = 0
    while gap.value < LIMIT:
        taken += 1
        gap.add(RATIO * float(np.sum(random.normal(size=count) ** 2)), count, float(taken))
    # Each block adds the divergence of the two distributions.
    gain = 0.5 * count * (RATIO - 1.0 - math.log(RATIO))
    assert taken == pytest.approx(LIMIT / gain, abs=3)
    assert gap.since == 0.0


def test_a_cusum_says_since_when():
    cusum = Cusum(0.0)
    for block in range(1, 10):
        cusum.add(1.0, 1.0, float(block))
    assert (cusum.value, cusum.since) == (0.0, 9.0)
    cusum.add(50.0, 1.0, 10.0)
    assert cusum.value > 0.0
    assert cusum.since == 9.0


@pytest.mark.slow
def test_the_command_says_in_its_exit_code_whether_there_was_an_alarm(nominal, changed, capsys):
    assert main(["watch", str(nominal)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("no gap beyond noise and tolerances in the ")
    assert main(["watch", str(changed)]) == 4
    first, *_, last = capsys.readouterr().out.splitlines()
    assert first.startswith("alarm at ")
    assert EFFECT[0] in last


def test_effects_from_a_time_on_are_not_of_a_session(capsys):
    command = ["run", "imposed", "--effect", "coulomb@rail=60", "--effects-from", "3"]
    assert main([*command, "--real-time"]) == 1
    assert "--effects-from does not work with" in capsys.readouterr().err
