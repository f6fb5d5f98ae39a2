"""Sessions: the states and the ways between them, ramps, stops; the same on the twin and on the
virtual card; faults."""

from __future__ import annotations

import itertools
import json
import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controllers import update as healthy
from experiments import find
from rigtwin.cli import main
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq import CARD
from rigtwin.hardware.daq.table_file import load_table
from rigtwin.hardware.daq.wired import WiredTwin
from rigtwin.hardware.faults import outcome as outcomes
from rigtwin.hardware.faults.campaign import draw_faults, try_fault
from rigtwin.hardware.faults.kinds import KINDS
from rigtwin.hardware.faults.outcome import InjectedFault, read_final_cause
from rigtwin.hardware.faults.processes import FaultNotReached, try_process_fault
from rigtwin.hardware.session.record import open_virtual_card, record_unpaced
from rigtwin.hardware.session.stops import stop_requests
from rigtwin.hardware.session.test import Test
from rigtwin.hardware.supervisor import COMPLETED, NEXT, Cause, Phase, Supervisor
from rigtwin.recording import load
from rigtwin.recording.recorded_test import transitions
from rigtwin.simulation.trip import Trip
from tests.helpers.settings import from_assignments

TABLE = load_table(CARD)
HERE = [kind for kind in KINDS if kind.place != "process"]
APART = [kind for kind in KINDS if kind.place == "process"]
SHORT = ("timing.duration=1.5", "safety.ramp=0.4", "safety.hold=0.1")


def session(name: str, *settings: str, seed: int = 0) -> Test:
    experiment = find(name)
    configuration = from_assignments(experiment.configuration, list(settings or SHORT))
    return Test(name, configuration, experiment.demands(configuration, seed), seed, TABLE)


def states(path: Path) -> list[str]:
    return [transition["to"] for transition in transitions(path)]


# States


@pytest.mark.parametrize(("before", "after"), list(itertools.product(Phase, Phase)))
def test_only_the_ways_that_there_are(before, after):
    messages = []
    supervisor = Supervisor(messages.append)
    supervisor.phase = before
    if after in NEXT[before]:
        supervisor.go(after, COMPLETED, 1.0)
        assert (messages[0].before, messages[0].after) == (before, after)
    else:
        with pytest.raises(RigtwinError, match="no way from"):
            supervisor.go(after, COMPLETED, 1.0)
        assert (supervisor.phase, messages) == (before, [])


def test_motion_is_reached_and_left_through_every_state_between():
    """Every walk from idle to running passes armed and ramping; every walk out of motion passes
    stopping."""
    ways = [[Phase.IDLE]]
    for _ in range(8):
        ways += [
            [*way, after]
            for way in ways
            if way[-1] != Phase.IDLE or len(way) == 1
            for after in NEXT[way[-1]]
        ]
    to_running = [way for way in ways if way[-1] == Phase.RUNNING]
    assert to_running
    assert all(way[:3] == [Phase.IDLE, Phase.ARMED, Phase.RAMPING] for way in to_running)
    ends = [way for way in ways if way[-1] in (Phase.STOPPED, Phase.FAULTED) and Phase.ARMED in way]
    assert ends
    assert all(way[-2] == Phase.STOPPING for way in ends)


# The same on the twin and on the card


@pytest.mark.parametrize(
    ("name", "seconds"),
    [("imposed", 2), pytest.param("road1.6", 15, marks=pytest.mark.slow)],
)
def test_card_and_twin_give_the_same_recording(tmp_path, name, seconds):
    test = session(name, f"timing.duration={seconds}", seed=2)
    card, _ = open_virtual_card(test)
    ended = record_unpaced(card, test, tmp_path / "card.mcap")
    assert ended.cause == COMPLETED
    record_unpaced(WiredTwin(test.terminals(), TABLE), test, tmp_path / "twin.mcap")
    assert (tmp_path / "card.mcap").read_bytes() == (tmp_path / "twin.mcap").read_bytes()
    recording = load(tmp_path / "card.mcap")
    assert (recording.ticks, recording.time[0], recording.notes) == (1000 * seconds, 0.0, ())


def test_a_software_timed_card_gives_the_same_too(tmp_path):
    test = session("imposed")
    records = []
    for timing in ("hardware", "software"):
        timed = replace(test, table=replace(TABLE, timing=timing))
        card, _ = open_virtual_card(timed)
        record_unpaced(card, timed, tmp_path / f"{timing}.mcap")
        records.append(load(tmp_path / f"{timing}.mcap"))
    for topic, names in records[0].columns.items():
        for name in names:
            assert np.array_equal(records[0].column(topic, name), records[1].column(topic, name))


def test_the_ramp_has_no_jump_and_ends_where_the_test_begins(tmp_path):
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    test = session("drop")
    card, device = open_virtual_card(test)
    record_unpaced(card, test, tmp_path / "r.mcap")
    with (tmp_path / "r.mcap").open("rb") as file:
        messages = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(
            topics=["/session"]
        )
        rows = np.array(
            [(m.time, m.phase, m.structure, m.voltage, m.pressure) for *_, m in messages]
        )
    assert np.allclose(np.diff(rows[:, 0]), 1e-3)
    assert sorted(set(rows[:, 1])) == [0.0, 1.0, 2.0, 3.0, 4.0]
    ramping = rows[rows[:, 1] == Phase.RAMPING]
    assert np.max(np.abs(np.diff(ramping[:, 2]))) < 2.5e-5
    assert ramping[-1, 2] == pytest.approx(-0.004, abs=1e-9)
    assert rows[rows[:, 0] < 0.0][-1, 3] == pytest.approx(200.0 / 186.0)
    idle = rows[rows[:, 1] == Phase.IDLE]
    assert not idle[:, 3:].any()
    assert rows[-1, 3] == 0.0
    assert not device.power
    assert device.outputs[0] == 0.0


def test_the_rest_before_arming_may_be_ended_too(tmp_path):
    test = session("imposed")
    card, _ = open_virtual_card(test)
    with pytest.raises(RigtwinError, match="not armed: stopped by the operator"):
        record_unpaced(card, test, tmp_path / "r.mcap", lambda: "stopped by the operator: test")
    assert states(tmp_path / "r.mcap") == ["faulted"]


# Stopping


@pytest.mark.parametrize("seconds", [-0.75, -0.5, 0.5, 1.49, 1.6])
def test_the_operator_stops_in_every_state(tmp_path, seconds):
    """Armed, ramping, running, at the end, and while it is being ramped out."""
    test = session("imposed")
    card, device = open_virtual_card(test)
    at = device.tick + round(1000 * (seconds + 1.1))
    outputs = []

    def stop() -> str | None:
        outputs.append((device.tick, float(device.outputs[0]), device.power))
        return "stopped by the operator: test" if device.tick >= at else None

    ended = record_unpaced(card, test, tmp_path / "r.mcap", stop)
    assert ended.cause.name == "operator"
    assert states(tmp_path / "r.mcap")[-2:] == ["stopping", "stopped"]
    assert device.outputs[0] == 0.0
    assert not device.power
    last_driven = max((tick for tick, volts, _ in outputs if volts != 0.0), default=0)
    assert last_driven <= at


def test_signals_files_and_nothing_else_stop(tmp_path):
    file = tmp_path / "stop"
    before = signal.getsignal(signal.SIGTERM)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        with stop_requests(file) as asked:
            assert asked() is None
            os.kill(os.getpid(), number)
            assert signal.Signals(number).name in (asked() or "")
    with stop_requests(file) as asked:
        file.touch()
        assert str(file) in (asked() or "")
    assert signal.getsignal(signal.SIGTERM) == before


def test_any_key_stops():
    import pty
    import subprocess
    import sys

    main, terminal = pty.openpty()
    code = (
        "import time\nfrom rigtwin.hardware.session.stops import stop_requests\n"
        "with stop_requests() as asked:\n print('ready', flush=True)\n"
        " while asked() is None: time.sleep(0.01)\n print(asked.__name__, 'stopped', flush=True)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=terminal,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: __import__("fcntl").ioctl(0, __import__("termios").TIOCSCTTY, 0),
    )
    assert process.stdout is not None
    assert "ready" in process.stdout.readline()
    os.write(main, b"x")
    assert "stopped" in process.stdout.readline()
    process.wait(10)


def test_a_rig_that_is_out_of_its_limits_is_not_armed(tmp_path):
    test = session("imposed")
    wrong = TABLE.inputs[1]._replace(scaling=TABLE.inputs[1].scaling._replace(offset=-0.14))
    wired = replace(test, table=replace(TABLE, inputs=(TABLE.inputs[0], wrong, *TABLE.inputs[2:])))
    card, device = open_virtual_card(test, wired.terminals())
    with pytest.raises(RigtwinError, match=r"structure_lvdt is .*; arming needs it within 0\.135"):
        record_unpaced(card, test, tmp_path / "r.mcap")
    assert states(tmp_path / "r.mcap") == ["faulted"]
    assert device.outputs[0] == 0.0
    assert not device.power


def test_limits_of_the_card_reach_the_session():
    assert session("imposed").card_configuration.safety.stuck == 7.0
    with pytest.raises(RigtwinError, match="range too small"):
        _ = session("single-mass-road").card_configuration


# Faults


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=() if kind in HERE[::3] else pytest.mark.slow) for kind in HERE],
    ids=lambda kind: kind.name,
)
def test_every_kind_of_fault_stops_the_rig(tmp_path, kind):
    [fault] = draw_faults(1, 11, [kind])
    outcome = try_fault(fault, find(fault.experiment), TABLE, tmp_path)
    assert outcome.ok, outcome


@pytest.mark.parametrize(
    ("kind", "experiment", "at", "place", "seed", "cause"),
    [
        # The force changes by 100 N before the load cell has repeated a reading seven times.
        ("stuck", "imposed-fast", 2732, 3, 36166931, "motor"),
        # The cylinder creeps to the command at which its valve stuck, which nobody can measure.
        ("valve stuck", "road1.6", 1583, 1, 1179248456, "following"),
    ],
)
def test_a_fault_counts_as_visible_where_its_measurements_are_implausible(
    tmp_path, kind, experiment, at, place, seed, cause
):
    [kind] = [each for each in KINDS if each.name == kind]
    fault = InjectedFault(kind, experiment, at, place, seed)
    outcome = try_fault(fault, find(experiment), TABLE, tmp_path)
    assert outcome.cause == cause
    assert outcome.late is not None
    assert outcome.late <= 5
    assert outcome.ok, outcome


@pytest.mark.slow
def test_blaming_the_load_cell_for_another_sensor_is_wrong(tmp_path, monkeypatch):
    [kind] = [each for each in KINDS if each.name == "stuck"]
    fault = InjectedFault(kind, "imposed-fast", 2732, 3, 36166931)
    experiment = find(fault.experiment)
    assert try_fault(fault, experiment, TABLE, tmp_path).right
    monkeypatch.setattr(outcomes, "SIGNALS", ("load_cell", "", "", "ground_lvdt"))
    assert not try_fault(fault, experiment, TABLE, tmp_path).right


def test_who_interrupts_a_campaign_fails_no_session(tmp_path, monkeypatch, capsys):
    def interrupt(*arguments):
        os.kill(os.getpid(), signal.SIGINT)
        return healthy(*arguments)

    monkeypatch.setattr("rigtwin.hardware.session.test.update", interrupt)
    page = tmp_path / "faults.md"
    assert main(["faults", "--each", "1", "--processes", "0", "--out", str(page)]) == 130
    out = capsys.readouterr().out
    assert "not run: interrupted after 0 of" in out
    assert "failed:" not in out
    assert not page.exists()


def test_a_campaign_without_sessions_is_refused(capsys):
    assert main(["faults", "--each", "0", "--processes", "0"]) == 1
    assert "no session to run" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="Linux")
def test_a_dead_controller_process_is_stopped_for(tmp_path):
    [fault] = draw_faults(1, 3, APART)
    fault = replace(fault, at=1300 + fault.at % 500)
    try:
        outcome = try_process_fault(fault, find(fault.experiment), TABLE, tmp_path)
    except FaultNotReached as busy:
        # Every session was cut short before its fault came: that says nothing of the fault.
        pytest.skip(str(busy))
    assert (outcome.cause, outcome.right, outcome.readable) == ("process", True, True)
    assert outcome.exceeded <= 1.1
    # In ticks of a card whose clock is slowed; a busy computer may add to them.
    assert outcome.late is not None


def slowed(device, ticks):
    """A controller that takes so many periods for each of its own ticks, by their number."""
    done = itertools.count()

    def update(controlling, state, measured, demand):
        device.run_until(device.tick + ticks(next(done)))
        return healthy(controlling, state, measured, demand)

    return update


@pytest.mark.parametrize(
    ("ticks", "said"),
    [
        (lambda number: 40 if number == 700 else 0, "39 ticks missed in a row; at most 3 may be"),
        (lambda number: 3 if number > 500 else 0, "% were missed; the loop cannot keep the pace"),
        (lambda number: 3 if number % 40 == 0 else 0, "completed"),
    ],
)
def test_a_loop_that_is_too_slow_is_called_late(tmp_path, ticks, said):
    test = session("road1.6", "timing.duration=3", "safety.ramp=0.4", "safety.hold=0.1")
    card, device = open_virtual_card(test)
    late = test.operation(slowed(device, ticks))
    ended = record_unpaced(card, test, tmp_path / "r.mcap", operation=late)
    assert said in ended.cause.reason
    recording = load(tmp_path / "r.mcap")
    assert recording.time[0] == 0.0
    assert device.outputs[0] == 0.0


def test_ticks_missed_in_the_ramp_do_not_cut_off_the_beginning(tmp_path):
    test = session("imposed")
    card, device = open_virtual_card(test)

    def stop() -> None:
        if device.tick % 50 == 0 and 450 < device.tick < 1000:
            device.run_until(device.tick + 2)

    ended = record_unpaced(card, test, tmp_path / "r.mcap", stop)
    assert ended.cause == COMPLETED
    recording = load(tmp_path / "r.mcap")
    assert (recording.time[0], recording.ticks) == (0.0, len(test.demands))


def test_limits_closer_than_the_tables_are_kept():
    limits = session("imposed", "safety.stuck=5", "safety.motor=80").card_configuration.safety
    assert (limits.stuck, limits.wheel, limits.motor) == (5.0, 0.02, 80.0)


def test_every_cause_of_a_kind_is_one_that_can_be_said():
    said = {trip.name.lower() for trip in Trip} | {
        "card",
        "controller",
        "late",
        "operator",
        "process",
        "recording",
    }
    assert all(set(kind.causes) <= said for kind in KINDS)


class Hopeless:
    """A rig whose writes fail for good once the test has begun."""

    missed, late = 0, 0.0

    def __init__(self, rig: WiredTwin) -> None:
        self._rig, self.ticks, self.stopped = rig, 0, 0

    def start(self) -> None:
        self._rig.start()

    def read(self) -> tuple[float, ...]:
        self.ticks += 1
        return self._rig.read()

    def write(self, commands) -> None:
        if self.ticks > 1500:
            raise OSError("gone")
        self._rig.write(commands)

    def power(self, on: bool) -> None:
        self._rig.power(on)

    def stop(self) -> None:
        self.stopped += 1
        self._rig.stop()


def test_a_rig_that_takes_no_output_any_more_is_stopped_its_own_way(tmp_path):
    test = session("drop")
    rig = Hopeless(WiredTwin(test.terminals(), TABLE))
    ended = record_unpaced(rig, test, tmp_path / "r.mcap")
    assert ended.cause == Cause("rig", "OSError: gone")
    assert rig.stopped >= 1
    assert read_final_cause(tmp_path / "r.mcap") == ("rig", "OSError: gone")
    assert states(tmp_path / "r.mcap")[-1] == "faulted"


def test_lateness_of_a_recording():
    from rigtwin.hardware.realtime import EDGES, Lateness

    lateness = Lateness(10)
    for late in (1e-7, 3e-6, 2e-3, 0.2):
        lateness.add(late, 5e-5)
    lateness.missed = 3
    record = lateness.record("FIFO scheduling: granted")
    histogram = json.loads(record["histogram"])
    assert sum(histogram["counts"]) == 4
    assert len(histogram["counts"]) == len(EDGES) + 1
    assert histogram["counts"][0] == histogram["counts"][-1] == 1
    assert (record["missed"], record["ticks"], float(record["late_max"])) == ("3", "4", 0.2)
