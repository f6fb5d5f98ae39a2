"""Sessions from the command line: dry runs, arming, lists of tests, calibration, real time and its
guardian."""

from __future__ import annotations

import itertools
import json
import os
import signal
import time
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest

import rigtwin
from controllers import Measurements
from experiments import find
from rigtwin.cli import main
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq import CARD
from rigtwin.hardware.daq.calibration import (
    FORCE,
    correct_signs,
    fit_responses,
    measure_rest,
    plan_bumps,
    set_spans,
    set_zeros,
)
from rigtwin.hardware.daq.table_file import load_table, to_toml
from rigtwin.hardware.daq.terminals import Terminals
from rigtwin.hardware.daq.wired import InRealTime, WiredTwin
from rigtwin.hardware.realtime import Pacer, in_real_time, list_shortcomings, sleep_until
from rigtwin.hardware.session import permission
from rigtwin.hardware.session.dry_run import add_dry_run, digest, has_passed, ledger
from rigtwin.hardware.session.plan import PlannedTest, parse_plan
from rigtwin.hardware.session.record import record_in_real_time
from rigtwin.hardware.session.test import Test
from rigtwin.recording import load
from rigtwin.recording.recorded_test import transitions
from rigtwin.system import monotonic
from tests.helpers.described import NOISY, described
from tests.helpers.settings import from_assignments

TABLE = load_table(CARD)
SHORT = ["--set", "timing.duration=1", "--set", "safety.ramp=0.3", "--set", "safety.hold=0.1"]


@pytest.fixture
def card(tmp_path):
    """A table that somebody answers for, but whose card is nowhere."""
    table = replace(
        TABLE,
        inputs=tuple(line._replace(sign_checked=True) for line in TABLE.inputs),
        outputs=tuple(line._replace(sign_checked=True) for line in TABLE.outputs),
        calibrated="2026-01-31",
        operator="A. Tester",
    )
    path = tmp_path / "card.toml"
    path.write_text(to_toml(table), encoding="utf-8")
    return path


def session(*settings: str, seed: int = 0) -> Test:
    experiment = find("imposed")
    configuration = from_assignments(
        experiment.configuration, ["timing.duration=1", "safety.ramp=0.3", *settings]
    )
    return Test("imposed", configuration, experiment.demands(configuration, seed), seed, TABLE)


# Dry runs


def test_a_dry_run_predicts_and_is_noted(card, tmp_path, capsys):
    out = tmp_path / "d.mcap"
    assert (
        main(
            [
                "run",
                "imposed",
                "--target",
                "daq",
                "--dry-run",
                "--card",
                str(card),
                "--out",
                str(out),
                *SHORT,
            ]
        )
        == 0
    )
    said = capsys.readouterr().out
    for quantity in ("force", "travel", "velocity of travel", "margin"):
        assert quantity in said
    assert "driver is missing" in said
    entries = json.loads(ledger(card).read_text())
    assert [entry["experiment"] for entry in entries.values()] == ["imposed"]
    recording = load(out)
    figures = {figure.name: figure for figure in session().predict_peaks(recording)}
    force = np.abs(recording.column("/sensor", "load_cell"))
    assert figures["force"].peak == pytest.approx(float(force.max()))
    assert figures["force"].margin == pytest.approx(1.0 - float(force.max()) / 1500.0)


def test_a_dry_run_in_python_is_that_of_the_command(card, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    short = {"timing": {"duration": 1}, "safety": {"ramp": 0.3, "hold": 0.1}}
    path = tmp_path / "d.mcap"
    result = rigtwin.dry_run("imposed", card, path=path, settings=short)
    assert result.passed
    assert {"force", "travel"} <= {peak.name for peak in result.peaks}
    assert any("driver is missing" in line for line in result.obstacles)
    # So the rig may be armed for just that: it is the driver that is missing then.
    assert main(["run", "imposed", "--target", "daq", "--card", str(card), *SHORT]) == 1
    assert "driver is missing" in capsys.readouterr().err
    assert len(json.loads(ledger(card).read_text())) == 1
    worn = {"coulomb@rail": 60.0}
    noted = rigtwin.dry_run("imposed", card, path=path, settings=short, effects=worn)
    assert noted.passed
    assert len(json.loads(ledger(card).read_text())) == 1


def test_another_setting_is_another_session(tmp_path):
    def key(test: Test) -> str:
        return digest(test.experiment, test.configuration, test.list_demands(), test.table)

    base = session()
    changed = [
        session("controller.kp=0.31"),
        session("safety.force=1400"),
        session("timing.duration=1.1"),
    ]
    changed.append(replace(base, experiment="drop"))
    changed.append(replace(base, demands=base.demands * 1.0001))
    changed.append(replace(base, table=replace(TABLE, device="Dev2")))
    keys = [key(test) for test in (base, *changed)]
    assert len(set(keys)) == len(keys)
    assert key(base) == key(session())
    path = tmp_path / "card.toml"
    assert not has_passed(path, keys[0])
    add_dry_run(path, keys[0], {"experiment": "imposed"})
    add_dry_run(path, keys[1], {"experiment": "imposed"})
    assert has_passed(path, keys[0])
    assert has_passed(path, keys[1])
    assert not has_passed(path, keys[2])
    ledger(path).write_text("[]")
    with pytest.raises(RigtwinError, match="not a list of dry runs"):
        has_passed(path, keys[0])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--target", "daq"], "needs the card's channel table"),
        (
            ["--target", "daq", "--card", "nowhere.toml"],
            "channel table nowhere.toml does not exist",
        ),
        (["--dry-run"], "--dry-run requires --target daq"),
        (["--arm"], "--arm requires --target daq"),
        (["--live"], "--live requires --card or --real-time"),
        (["--card", "CARD", "--arm"], "require --target daq"),
        (["--card", "CARD", "--live"], "--live requires a session in real time"),
        (["--target", "daq", "--card", "CARD"], "the NI-DAQmx driver is missing"),
        (["--target", "daq", "--card", "UNSIGNED"], "sign not checked: ground_lvdt"),
        (
            ["--target", "daq", "--card", "CARD", "--effect", "coulomb@rail=80"],
            "--effect is the twin's",
        ),
        (
            ["--target", "daq", "--card", "CARD", "--set", "safety.structure=0.3"],
            "range too small for the limit",
        ),
        (
            ["--target", "daq", "--dry-run", "--card", "CARD", "--set", "safety.structure=0.3"],
            "range too small for the limit",
        ),
        (
            ["--target", "daq", "--dry-run", "--card", "CARD", "--out", "/nowhere/x.mcap"],
            "its folder does not exist",
        ),
        (
            ["--target", "daq", "--dry-run", "--card", "CARD", "--set", "safety.stuck=2"],
            "safety.stuck = 2",
        ),
        (["--card", "CARD", "--out", "CARD"], "is the input; name another output"),
        (["--real-time", "--live", "70000"], "live 70000: expected a port"),
    ],
)
def test_mistakes_are_said_before_anything_moves(
    card, capsys, arguments, said, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    names = {"CARD": str(card), "UNSIGNED": str(CARD)}
    assert main(["run", "imposed", *(names.get(text) or text for text in arguments)]) == 1
    shown = capsys.readouterr()
    assert said in shown.err
    assert len(shown.err.splitlines()) == 1
    assert not list(tmp_path.glob("*.mcap"))


@pytest.mark.slow
def test_the_rig_is_armed_only_after_a_dry_run_of_just_that(card, capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(permission, "open_card", lambda *_: None)
    monkeypatch.chdir(tmp_path)
    run = ["run", "imposed", "--target", "daq", "--card", str(card), *SHORT]
    assert main(run) == 1
    assert "has had no dry run" in capsys.readouterr().err
    assert main([*run, "--dry-run", "--set", "controller.kp=0.31"]) == 0
    assert main(run) == 1
    assert "has had no dry run" in capsys.readouterr().err
    assert main([*run, "--dry-run"]) == 0
    assert main(run) == 1
    assert "no terminal to ask for arming" in capsys.readouterr().err
    assert main([*run, "--set", "controller.kp=0.4", "--without-dry-run", "A. Tester"]) == 1
    assert "no terminal to ask for arming" in capsys.readouterr().err


@pytest.mark.parametrize("missing", ["nidaqmx", "grpc"])
def test_without_the_drivers_client_one_line_says_how_to_get_it(
    card, capsys, monkeypatch, missing, tmp_path
):
    import sys

    monkeypatch.setitem(sys.modules, missing, None)
    monkeypatch.chdir(tmp_path)
    for command in (
        ["run", "imposed", "--target", "daq", "--card", str(card), "--dry-run"],
        ["run", "imposed", "--target", "daq", "--card", str(card)],
        ["card", "serve", str(card)],
        [
            "card",
            "check",
            str(card),
            "-o",
            "new.toml",
            "--operator",
            "a",
            "--zero",
            "--virtual",
            str(card),
        ],
        ["faults", "--each", "1"],
    ):
        assert main(command) == 1
        assert "pip install 'rigtwin[daq]'" in capsys.readouterr().err


# Lists of tests


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({}, r"no \[\[test\]\]"),
        ({"tests": []}, "unknown 'tests'"),
        ({"test": [1]}, "test 1 = 1; expected a table"),
        ({"test": [{"experiment": "drop", "name": "a\0b"}]}, "expected what a file can be called"),
        ({"test": [{}]}, "test 1: experiment is missing"),
        ({"test": [{"experiment": "x"}]}, "unknown experiment"),
        ({"test": [{"experiment": "drop", "seed": -1}]}, "test 1: seed = -1"),
        ({"test": [{"experiment": "drop", "pause": "long"}]}, "pause = 'long'"),
        ({"test": [{"experiment": "drop", "wait": 1}]}, "unknown 'wait'"),
        ({"test": [{"experiment": "drop", "set": 3}]}, "set = 3"),
        ({"test": [{"experiment": "drop", "name": "../a"}]}, "expected what a file can be called"),
        (
            {"test": [{"experiment": "drop", "name": "a"}, {"experiment": "drop", "name": "a"}]},
            "another test's",
        ),
    ],
)
def test_mistakes_in_a_list(tables, said):
    with pytest.raises(RigtwinError, match=said):
        parse_plan(tables, find)


def test_two_sessions_do_not_run_into_one_folder(tmp_path):
    plan, folder = tmp_path / "list.toml", tmp_path / "out"
    plan.write_text('[[test]]\nexperiment = "imposed"\nname = "one"\n')
    inner = []

    def run(_test: PlannedTest, path: Path) -> bool:
        with pytest.raises(RigtwinError, match="another session is running into") as error:
            rigtwin.run_session(plan, folder, run)
        inner.append(str(error.value))
        path.write_text("the first one's")
        return True

    assert rigtwin.run_session(plan, folder, run)
    assert inner
    assert (folder / "one.mcap").read_text() == "the first one's"
    with pytest.raises(RigtwinError, match="holds one.mcap already"):
        rigtwin.run_session(plan, folder, run)


def test_a_list_is_run_compared_and_resumed(tmp_path, capsys):
    plan, folder = tmp_path / "list.toml", tmp_path / "out"
    plan.write_text(
        '[[test]]\nexperiment = "imposed"\nname = "one"\n'
        '[[test]]\nexperiment = "drop"\nname = "two"\nseed = 2\n'
        "set = {safety = {structure = 0.01}}\n"
        '[[test]]\nexperiment = "imposed"\nname = "three"\n'
    )
    base = ["session", str(plan), "--card", str(CARD), "--folder", str(folder), *SHORT]
    assert main(base) == 3
    said = capsys.readouterr().out
    assert "closed_loop" in said
    assert "two did not complete" in said
    assert load(folder / "one.mcap").end == "completed"
    assert not (folder / "three.mcap").exists()
    assert main(base) == 1
    assert "resume it" in capsys.readouterr().err
    plan.write_text(plan.read_text().replace("0.01", "0.15"))
    assert main([*base, "--resume"]) == 0
    assert "1 of 3 tests are done already" in capsys.readouterr().out
    assert all(load(folder / f"{name}.mcap").end == "completed" for name in ("one", "two", "three"))
    assert (folder / "two.1.mcap").exists()


# Calibration


WIRINGS = list(itertools.product((1, -1), repeat=len(TABLE.lines)))
EACH_LINE_BOTH_WAYS = (WIRINGS[0b0101010], WIRINGS[0b1010101])


@pytest.mark.parametrize(
    "signs",
    [
        EACH_LINE_BOTH_WAYS[0],
        *(
            pytest.param(signs, marks=pytest.mark.slow)
            for signs in (EACH_LINE_BOTH_WAYS[1], *WIRINGS[4::22])
        ),
    ],
)
def test_every_wrong_sign_is_found(signs):
    from rigtwin.hardware.daq.card import Card
    from rigtwin.hardware.daq.transport import InProcess
    from rigtwin.hardware.daq.virtual import OnDemand, VirtualCard
    from rigtwin.hardware.rig_operation import RigOperation
    from rigtwin.hardware.session.recorder import RIG_LAYOUT
    from rigtwin.hardware.supervision import supervise
    from rigtwin.hardware.supervisor import COMPLETED

    turned = [
        line._replace(scaling=line.scaling._replace(sign=float(sign)))
        for line, sign in zip(TABLE.lines, signs, strict=True)
    ]
    wiring = replace(TABLE, inputs=tuple(turned[:4]), outputs=tuple(turned[4:]))
    configuration, demands = plan_bumps(0.005, FORCE, 1e-3)
    device = VirtualCard(Terminals(configuration, wiring, 0), wiring, OnDemand())
    rows = []

    class Rows:
        fault = None

        def tick(self, row):
            if np.isfinite(row[RIG_LAYOUT.number]):
                rows.append(row)

        def transition(self, transition): ...

        def beat(self, outputs): ...

        def ready(self): ...

        def flush(self): ...

    card = Card(TABLE, 1e-3, InProcess(device), clock=lambda: device.tick * 1e-3)
    ended = supervise(card, RigOperation(configuration, demands), Rows())  # type: ignore[arg-type]
    assert ended.cause == COMPLETED
    measured = np.array(rows)[:, list(RIG_LAYOUT.topics["/sensor"].values())]
    moved = {line.name: sign for line, sign in zip(TABLE.outputs, signs[4:], strict=True)}
    corrected, _ = correct_signs(TABLE, fit_responses(measured, demands), moved)
    assert [line.scaling.sign for line in corrected.lines] == list(signs)
    assert all(line.sign_checked for line in corrected.lines)


def test_a_dead_signal_is_no_sign():
    demands = plan_bumps(0.005, FORCE, 1e-3)[1]
    noise = np.random.default_rng(0).normal(0.0, 1e-4, (len(demands), 4))
    with pytest.raises(RigtwinError, match="hardly answers"):
        correct_signs(
            TABLE, fit_responses(noise, demands), {"ground": 1, "structure": 1, "voltage": 1}
        )


class Standing:
    """A rig that stands at true values, read through a table that is off."""

    missed = 0

    def __init__(self, values: list[float]) -> None:
        self._values, self._random = values, np.random.default_rng(0)

    def read(self) -> Measurements:
        return Measurements(*(self._values + self._random.normal(0.0, 1e-4, 4)).tolist())


def test_zero_and_span():
    still = measure_rest(Standing([0.003, -0.002, 0.001, 12.5]), 500)  # type: ignore[arg-type]
    table = set_zeros(TABLE, still, {"structure_lvdt": 0.1})
    offsets = [line.scaling.offset for line in table.inputs]
    assert offsets == pytest.approx([-0.003, 0.102, -0.001, -12.5], abs=5e-5)
    still = measure_rest(Standing([0.0, 0.0, 0.105, 0.0]), 500)  # type: ignore[arg-type]
    spread = set_spans(TABLE, still, {"suspension_lvdt": 0.1})
    assert spread.inputs[2].scaling.scale == pytest.approx(0.025 * 0.1 / 0.105, rel=1e-3)
    for name, said in (("ground_lvdt", "which is noise"),):
        with pytest.raises(RigtwinError, match=said):
            set_spans(TABLE, still, {name: 0.1})
    with pytest.raises(RigtwinError, match="check signs first"):
        set_spans(TABLE, still, {"suspension_lvdt": -0.1})


@pytest.mark.slow
def test_the_check_writes_a_table_that_is_trusted(tmp_path, capsys):
    from rigtwin.hardware.daq.table import require_trust

    wiring = replace(TABLE, inputs=(*TABLE.inputs[:3], TABLE.inputs[3]._replace(
        scaling=TABLE.inputs[3].scaling._replace(sign=-1.0, offset=12.5))))  # fmt: skip
    (tmp_path / "wiring.toml").write_text(to_toml(wiring))
    out = tmp_path / "checked.toml"
    check = [
        "card",
        "check",
        str(CARD),
        "--operator",
        "A. Tester",
        "--note",
        "first",
        "--signs",
        "--zero",
    ]
    assert main([*check, "--virtual", str(tmp_path / "wiring.toml"), "-o", str(out)]) == 0
    assert "load_cell: reads the wrong way" in capsys.readouterr().out
    checked = load_table(out)
    require_trust(checked, date.today())
    cell = checked.inputs[3].scaling
    assert cell.sign == -1.0
    assert cell.offset == pytest.approx(12.5, abs=0.5)
    assert (checked.operator, checked.note) == ("A. Tester", "first")
    assert main([*check, "--virtual", str(tmp_path / "wiring.toml"), "-o", str(CARD)]) == 1
    assert (
        main(["card", "check", str(CARD), "-o", str(out), "--operator", "a", "--span", "x=1"]) == 1
    )
    signs = ["--operator", "a", "--signs"]
    mistakes = (
        ["--operator", " ", "--zero"],
        [*signs, "--moved", "up=+"],
        [*signs, "--stroke", "nan"],
        [*signs, "--stroke", "-0.01"],
    )
    for wrong in mistakes:
        assert main(["card", "check", str(CARD), "-o", str(out), *wrong]) == 1
    capsys.readouterr()
    assert main(["card", "serve", str(CARD), "--port", "99999"]) == 1
    assert main(["card", "serve", str(CARD), "--seed", "-1"]) == 1
    assert main(["card", "release", str(CARD)]) == 1
    assert "card.address is empty" in capsys.readouterr().err


# Real time


def test_deadlines_do_not_drift():
    pacer, period = Pacer(0.004), 0.004
    begun, waits = monotonic(), 40
    missed = 0
    for number in range(waits):
        missed += pacer.wait()
        if number == 10:
            time.sleep(3.3 * period)
    took = monotonic() - begun
    assert missed >= 2
    assert took >= (waits - 1 + missed) * period - 1e-6
    assert took - (waits - 1 + missed) * period == pytest.approx(pacer.late, abs=2e-3)


def test_sleeping_ends_at_its_time():
    deadline = monotonic() + 0.01
    sleep_until(deadline)
    assert monotonic() >= deadline


@pytest.mark.slow
def test_what_was_taken_for_real_time_is_given_back():
    import gc

    before = os.sched_getscheduler(0) if hasattr(os, "sched_getscheduler") else None
    with in_real_time() as grants:
        assert not gc.isenabled()
        assert all(grant.name for grant in grants)
    assert gc.isenabled()
    if before is not None:
        assert os.sched_getscheduler(0) == before
    assert all(": " in line for line in list_shortcomings())


def patient() -> Test:
    """One that waits for a busy computer."""
    return session("safety.missed=5000", "timing.duration=2.5")


@pytest.mark.slow
def test_a_session_in_real_time_is_kept_by_the_guardian(tmp_path):
    test = patient()
    twin = InRealTime(WiredTwin(test.terminals(), TABLE), 1e-3)
    begun = monotonic()
    ended = record_in_real_time(twin, test, tmp_path / "r.mcap", lambda: None, guarded=False)
    assert monotonic() - begun > 2.0
    recording = load(tmp_path / "r.mcap")
    assert ended.cause.name == recording.transitions[-1]["cause"] == "completed"
    assert recording.ticks == ended.ticks
    assert recording.ticks + int(recording.lateness["missed"]) >= 2500
    counts = json.loads(recording.lateness["histogram"])["counts"]
    assert sum(counts) == int(recording.lateness["ticks"])
    assert "FIFO scheduling" in recording.lateness["scheduling"]


@pytest.mark.parametrize(
    ("number", "said"),
    [(signal.SIGKILL, "guardian process is gone"), (signal.SIGSTOP, "does not answer any more")],
)
@pytest.mark.slow
def test_without_its_guardian_the_session_stops(tmp_path, number, said):
    import multiprocessing

    test = patient()
    twin = InRealTime(WiredTwin(test.terminals(), TABLE), 1e-3)

    asked = 0

    def stop() -> str | None:
        nonlocal asked
        asked += 1
        # Counted in ticks, so that a busy computer has armed the rig by then too.
        if asked == 1200:
            for child in multiprocessing.active_children():
                os.kill(child.pid or 0, number)
        return None

    ended = record_in_real_time(twin, test, tmp_path / "r.mcap", stop, guarded=False)
    assert ended.cause.name == "recording"
    assert said in ended.cause.reason
    assert transitions(tmp_path / "r.mcap")


def test_the_live_view_is_served_on_this_computer_only():
    import socket

    from rigtwin.hardware.session.live import open_live_view
    from rigtwin.hardware.session.recorder import RIG_LAYOUT

    fields = RIG_LAYOUT.fields
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    show = open_live_view(port, fields)
    show("/session", np.zeros((20, len(fields["/session"]))))
    with socket.create_connection(("127.0.0.1", port), 5.0):
        pass
    with pytest.raises(RigtwinError, match="no live view on port"):
        open_live_view(port, fields)
    changed = {
        str(address[4][0])
        for address in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)
    } - {"127.0.0.1"}
    for address in changed:
        with pytest.raises(OSError, match=r".*"), socket.create_connection((address, port), 1.0):
            pass


def test_a_recording_that_cannot_be_written_is_said_at_once(tmp_path):
    test = patient()
    twin = InRealTime(WiredTwin(test.terminals(), TABLE), 1e-3)
    with pytest.raises(RigtwinError, match="cannot write"):
        record_in_real_time(twin, test, tmp_path / "no" / "r.mcap", lambda: None, guarded=False)


def test_a_list_is_run_on_the_twin_of_any_machine(tmp_path, capsys):
    described(tmp_path, "slide", NOISY)
    toml, plan, folder = tmp_path / "bench.toml", tmp_path / "list.toml", tmp_path / "out"
    plan.write_text(
        '[[test]]\nexperiment = "shake"\nname = "one"\nset = {timing = {duration = 1.0}}\n'
        '[[test]]\nexperiment = "shake"\nname = "two"\nseed = 2\n'
    )
    session = ["session", str(plan), "--machine", str(toml), "--folder", str(folder)]
    assert main([*session, "--effect", "coulomb@guide=2"]) == 0
    said = capsys.readouterr().out
    assert "1.000 s recorded" in said
    assert said.count("encoder") == 2
    first, two = (rigtwin.load(folder / f"{name}.mcap", toml) for name in ("one", "two"))
    assert (first.ticks, two.ticks) == (1000, 4000)
    assert main([*session, "--resume"]) == 0
    assert "2 of 2 tests are done already" in capsys.readouterr().out
    for option, said in (
        (["--card", "card.toml"], "channel table card.toml does not exist"),
        (["--target", "daq"], "--target daq needs the card's channel table"),
        (["--real-time"], "--real-time of bench needs a channel table of it"),
        (["--dry-run"], "--dry-run, --without-dry-run and --arm require --target daq"),
    ):
        assert main([*session[:-1], str(tmp_path / "new"), *option]) == 1
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1


def test_a_list_names_the_machines_own_tests(tmp_path):
    plan = tmp_path / "list.toml"
    plan.write_text('[[test]]\nexperiment = "drop"\n')
    described(tmp_path, "slide", NOISY)
    with pytest.raises(RigtwinError, match="unknown experiment 'drop'"):
        rigtwin.run_session(
            plan, tmp_path / "out", lambda *_: True, machine=tmp_path / "bench.toml"
        )
