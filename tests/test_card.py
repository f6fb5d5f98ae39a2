"""The card: its channel table, volts both ways, the unmodified driver's client on a virtual card,
and what it refuses."""

from __future__ import annotations

import socket
import sys
import time
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controllers import Commands, Measurements
from rigtwin.description.changes import read_toml
from rigtwin.description.configuration import Configuration
from rigtwin.description.settings import Safety
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq import CARD
from rigtwin.hardware.daq.card import Card
from rigtwin.hardware.daq.conversion import CODES, conversion, to_bits, to_values, to_volts
from rigtwin.hardware.daq.driver import CardFault, connect
from rigtwin.hardware.daq.failsafe import release
from rigtwin.hardware.daq.table import ChannelTable, require_ranges, require_trust
from rigtwin.hardware.daq.table_file import load_table, parse_table, to_toml
from rigtwin.hardware.daq.terminals import Terminals
from rigtwin.hardware.daq.transport import LOCAL, InProcess, serve
from rigtwin.hardware.daq.virtual import BAD_VALUE, DriverError, OnDemand, RealTime, VirtualCard
from rigtwin.hardware.daq.wired import WiredTwin

TABLE = load_table(CARD)
PERIOD = 1e-3
TODAY = date(2026, 6, 1)


def virtual(
    table: ChannelTable = TABLE, wiring: ChannelTable = TABLE, timing=None, seed: int = 0
) -> tuple[Card, VirtualCard]:
    card = VirtualCard(Terminals(Configuration(), wiring, seed), wiring, timing or OnDemand())
    clock = (lambda: card.tick * PERIOD) if timing is None else time.monotonic
    return Card(table, PERIOD, InProcess(card), clock=clock), card


def after(card: Card, ticks: int, commands: Commands) -> Any:
    """What is read after so many ticks of the same commands."""
    for _ in range(ticks):
        card.read()
        card.write(commands)
    return card.read()


# The channel table


def test_a_table_survives_being_written(tmp_path):
    path = tmp_path / "t.toml"
    turned = replace(
        TABLE,
        operator='a "b" \\ c',
        note="ø\n2",
        inputs=(TABLE.inputs[0]._replace(sign_checked=True), *TABLE.inputs[1:]),
    )
    path.write_text(to_toml(turned), encoding="utf-8")
    assert load_table(path) == turned


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('line = "ai1"', 'line = "ai0"', "ground_lvdt and structure_lvdt are both on line ai0"),
        ('line = "ao1"', 'line = "ao2"', "ground and structure are both on line ao2"),
        ('line = "ai1"', 'line = "ao1"', "inputs.structure_lvdt.line = 'ao1'"),
        ('line = "ai1"', "line = 1", "inputs.structure_lvdt.line = 1"),
        ("[inputs.load_cell]", "[inputs.load]", "unknown signal [inputs.load]"),
        ("scale = 250.0", "scale = nan", "inputs.load_cell.scale = nan"),
        ("scale = 250.0", "scale = -250.0", "inputs.load_cell.scale = -250.0"),
        (
            "scale = 250.0",
            "scale = 250.0\nsign = 0.5",
            "inputs.load_cell.sign = 0.5: expected 1 or -1",
        ),
        ('unit = "N"', "unit = 'kN'", "inputs.load_cell.unit = 'kN': expected 'N'"),
        ("scale = 250.0", "scale = 250.0\nrange = 100", "inputs.load_cell.range = 100"),
        ("scale = 250.0", "", "inputs.load_cell.scale is missing"),
        ("scale = 250.0", "scale = 250.0\ngain = 2", "unknown setting inputs.load_cell.gain"),
        (
            "sign_checked = false",
            "sign_checked = 'yes'",
            "sign_checked = 'yes': expected true or false",
        ),
        ('pressure = "port0/line0" ', 'pressure = "ao3" ', "card.pressure = 'ao3'"),
        ('timing = "hardware" ', 'timing = "fast" ', "card.timing = 'fast'"),
        ('device = "Dev1"', 'device = "Dev1/ai0"', "card.device = 'Dev1/ai0'"),
        ('device = "Dev1"', "device = 1", "card.device = 1: expected text"),
        ("stuck = 7 ", "stuck = 1 ", "plausible.stuck = 1"),
        ("[plausible]", "[plausibel]", "unknown table [plausibel]"),
    ],
)
def test_mistakes_in_a_table(tmp_path, old, new, said):
    text = CARD.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "t.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(RigtwinError) as caught:
        load_table(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("name", [line.name for line in TABLE.lines])
def test_every_signal_must_be_there(name):
    import tomllib

    tables = tomllib.loads(CARD.read_text(encoding="utf-8"))
    for group in ("inputs", "outputs"):
        tables[group].pop(name, None)
    with pytest.raises(RigtwinError, match=rf"\.{name}\] is missing"):
        parse_table(tables)


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        (
            {"structure": 0.196},
            "structure_lvdt on ai1 reads up to 0.2 m, safety.structure is 0.196 m",
        ),
        ({"travel": 0.25}, "suspension_lvdt on ai2"),
        ({"force": 2400.0}, "load_cell on ai3"),
        ({"ground": 0.3}, "ground_lvdt on ai0"),
    ],
)
def test_a_limit_that_its_line_cannot_show(limit, said):
    require_ranges(TABLE, Safety())
    with pytest.raises(RigtwinError, match="range too small for the limit") as caught:
        require_ranges(TABLE, Safety()._replace(**limit))
    assert said in str(caught.value)


def test_a_real_rig_needs_a_table_that_somebody_answers_for():
    checked = tuple(line._replace(sign_checked=True) for line in TABLE.inputs)
    outputs = tuple(line._replace(sign_checked=True) for line in TABLE.outputs)
    good = replace(
        TABLE, inputs=checked, outputs=outputs, calibrated="2026-05-30", operator="A. Tester"
    )
    require_trust(good, TODAY)
    for change, said in (
        ({"inputs": (*checked[:3], TABLE.inputs[3])}, "sign not checked: load_cell"),
        ({"calibrated": "last week"}, "expected the date of calibration"),
        ({"calibrated": "2026-06-02"}, "after today"),
        ({"operator": " "}, "card.operator is missing"),
    ):
        with pytest.raises(RigtwinError, match=said):
            require_trust(replace(good, **change), TODAY)


# Volts


def test_values_come_back_from_volts():
    random = np.random.default_rng(0)
    for _ in range(200):
        scalings = [
            line.scaling._replace(
                scale=10.0 ** random.uniform(-3, 3),
                offset=random.normal(),
                sign=random.choice([-1.0, 1.0]),
                range=10.0,
            )
            for line in TABLE.inputs
        ]
        model = conversion(
            [line._replace(scaling=s) for line, s in zip(TABLE.inputs, scalings, strict=True)]
        )
        volts, back, values = random.uniform(-10, 10, 4), np.empty(4), np.empty(4)
        to_values(model, volts, values)
        to_volts(model, values, back)
        assert np.max(np.abs(back - volts)) < 1e-9 * 10 * max(
            1.0, float(np.max(np.abs(model.offset / model.factor)))
        )
        expected = [s.sign * s.scale * v + s.offset for s, v in zip(scalings, volts, strict=True)]
        assert np.allclose(values, expected, rtol=1e-12)


def test_bits_round_to_half_of_one_and_stop_at_the_range():
    model = conversion(TABLE.inputs)
    bit = 20.0 / CODES
    for volts in (*np.linspace(-9.99, 9.99, 999), 25.0, -25.0):
        out = np.empty(4)
        to_bits(model, np.full(4, volts), out)
        assert np.allclose(out / bit, np.round(out / bit), atol=1e-9)
        if abs(volts) < 9.999:
            assert np.max(np.abs(out - volts)) <= 0.5 * bit + 1e-12
        assert -10.0 <= out[0] <= 10.0 - bit


def test_a_value_beyond_the_range_is_held_at_it():
    volts = np.empty(3)
    to_volts(conversion(TABLE.outputs), np.array([1.0, -1.0, 99.0]), volts)
    assert volts.tolist() == [10.0, -10.0, 10.0]


# The virtual card


def test_card_and_twin_behind_the_same_converters_read_the_same():
    card, _ = virtual(seed=3)
    twin = WiredTwin(Terminals(Configuration(), TABLE, 3), TABLE)
    for rig in (card, twin):
        rig.start()
    for tick in range(600):
        assert card.read() == twin.read()
        commands = Commands(
            0.01 * np.sin(tick / 50), -0.004 * min(tick / 300, 1.0), 0.0, min(tick / 300, 1.0)
        )
        for rig in (card, twin):
            rig.power(tick > 20)
            rig.write(commands)
    assert card.missed == twin.missed == 0


def test_no_pressure_no_motion():
    card, _ = virtual()
    card.start()
    assert abs(after(card, 200, Commands(0.05, 0.05, 0.0, 0.0)).structure_lvdt) < 2e-3
    card.power(True)
    assert after(card, 600, Commands(0.05, 0.05, 0.0, 0.0)).structure_lvdt == pytest.approx(
        0.05, abs=2e-3
    )
    card.stop()


def test_a_table_that_is_not_the_wiring_reads_wrong():
    wiring = replace(
        TABLE,
        inputs=(
            *TABLE.inputs[:3],
            TABLE.inputs[3]._replace(scaling=TABLE.inputs[3].scaling._replace(sign=-1.0)),
        ),
    )
    (right, _), (wrong, _) = virtual(), virtual(wiring=wiring)
    forces = []
    for card in (right, wrong):
        card.start()
        forces.append(after(card, 50, Commands(0.0, 0.0, 0.0, 0.5)).load_cell)
    assert forces[0] == pytest.approx(93.0, abs=25.0)
    assert forces[1] == pytest.approx(-forces[0], abs=5.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: replace(t, device="Dev7"), "no card 'Dev7'; the driver knows Dev1"),
        (
            lambda t: replace(t, inputs=(t.inputs[0]._replace(line="ai40"), *t.inputs[1:])),
            "PCI-6229 has no line ai40",
        ),
        (lambda t: replace(t, power="port0/line77"), "PCI-6229 has no line port0/line77"),
        (
            lambda t: replace(t, outputs=(t.outputs[0]._replace(line="ao7"), *t.outputs[1:])),
            "PCI-6229 has no line ao7",
        ),
        (
            lambda t: replace(
                t,
                inputs=(
                    t.inputs[0]._replace(scaling=t.inputs[0].scaling._replace(range=2.0)),
                    *t.inputs[1:],
                ),
            ),
            "PCI-6229 has 0.2, 1, 5, 10 V",
        ),
    ],
)
def test_what_the_card_does_not_have_is_found_before_anything_moves(change, said):
    card, device = virtual(change(TABLE))
    with pytest.raises(CardFault, match=said):
        card.inspect()
    assert not device.power
    assert device.tick == 0
    assert np.all(device.outputs == 0.0)


def test_two_programs_cannot_have_the_card():
    card, device = virtual()
    card.start()
    second = Card(TABLE, PERIOD, InProcess(device))
    with pytest.raises(CardFault, match="in use"):
        second.start()
    card.stop()
    second.start()


def test_outputs_beyond_the_range_and_no_numbers_are_refused():
    card, device = virtual()
    card.start()
    card.read()
    card.write(Commands(0.0, 0.0, 0.0, 1.0))
    with pytest.raises(CardFault, match="takes no output"):
        card.write(Commands(0.0, 0.0, 0.0, float("nan")))
    assert device.outputs[0] == 1.0
    card.stop()
    assert device.outputs[0] == 0.0


def test_a_card_that_refuses_its_outputs_for_good_is_reset(monkeypatch):
    card, device = virtual()
    card.start()
    card.power(True)
    card.read()
    card.write(Commands(0.0, 0.0, 0.0, 1.0))

    def refuse(*_):
        raise DriverError(BAD_VALUE, "no")

    monkeypatch.setattr(device, "_WriteAnalogF64", refuse)
    card.stop()
    assert np.all(device.outputs == 0.0)
    assert not device.power


def test_a_disconnected_card_says_so_and_has_no_output():
    card, device = virtual()
    card.start()
    card.power(True)
    card.read()
    card.write(Commands(0.0, 0.0, 0.0, 1.0))
    device.disconnect()
    with pytest.raises(CardFault, match="not present"):
        card.read()
    assert np.all(device.outputs == 0.0)
    assert not device.power
    card.stop()


def test_a_late_reader_gets_the_last_sample_and_knows_what_it_missed():
    card, device = virtual()
    card.start()
    card.read()
    device.run_until(device.tick + 5)
    first = card.read()
    assert card.missed == 4
    twin = WiredTwin(Terminals(Configuration(), TABLE, 0), TABLE)
    rows = [twin.read() for _ in range(6)]
    assert first == rows[-1]


def test_calls_that_the_virtual_card_does_not_know_are_refused():
    import nidaqmx
    from nidaqmx.errors import Error
    from nidaqmx.grpc_session_options import GrpcSessionOptions

    _, device = virtual()
    task = nidaqmx.Task("t", grpc_options=GrpcSessionOptions(InProcess(device), "t"))
    with pytest.raises(Error):
        task.ai_channels.add_ai_thrmcpl_chan("Dev1/ai0")
    with pytest.raises(Error, match="does not exist"):
        task.ai_channels.add_ai_voltage_chan("Dev1/ai99")
    with pytest.raises(Error, match="invalid"):
        task.ai_channels.add_ai_voltage_chan("Dev9/ai0")
    with pytest.raises(Error, match="Maximum"):
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0", min_val=-20, max_val=20)
    with pytest.raises(Error):
        task.timing.cfg_samp_clk_timing(1e6)


def test_through_a_socket_it_is_the_same_card():
    device = VirtualCard(Terminals(Configuration(), TABLE, 5), TABLE, OnDemand())
    server, port = serve(device, 0)
    try:
        channel = connect(f"{LOCAL}:{port}")
        assert channel is not None
        far = Card(TABLE, PERIOD, channel, clock=lambda: device.tick * PERIOD)
        near, _ = virtual(seed=5)
        far.inspect()
        for card in (far, near):
            card.start()
        for tick in range(100):
            assert far.read() == near.read()
            for card in (far, near):
                card.power(True)
                card.write(Commands(0.0, -1e-5 * tick, 0.0, 0.01 * tick))
        with pytest.raises(RigtwinError, match="in use"):
            serve(device, port)
        # The owner dies without a word: its tasks are left, and are freed by name.
        with pytest.raises(CardFault, match="rigtwin card release"):
            Card(TABLE, PERIOD, connect(f"{LOCAL}:{port}")).start()
        assert device.outputs[0] > 0.9
        table = replace(TABLE, address=f"{LOCAL}:{port}")
        assert release(table)
        assert not device.power
        assert device.outputs[0] == 0.0
        assert not release(table)
        Card(TABLE, PERIOD, connect(f"{LOCAL}:{port}")).start()
    finally:
        server.stop(0.0).wait()


def test_nobody_there_is_said():
    card = Card(TABLE, PERIOD, connect("localhost:1"))
    with pytest.raises(CardFault, match="card Dev1"):
        card.inspect()


def test_a_card_whose_clock_runs_goes_on_by_itself():
    card, device = virtual(timing=RealTime(PERIOD))
    card.start()
    card.read()
    time.sleep(0.05)
    card.read()
    assert card.missed >= 40
    assert device.tick >= 50


@pytest.mark.skipif(sys.platform != "linux", reason="the driver may be installed")
def test_without_the_driver_one_line_says_how_to_get_it():
    with pytest.raises(CardFault, match="driver is missing"):
        Card(TABLE, PERIOD, connect("")).inspect()


def test_a_table_that_is_no_table(tmp_path):
    for text, said in (
        ("x = [", "not valid TOML"),
        ("card = 3", "expected a table"),
        ("", "card.pressure"),
    ):
        path = Path(tmp_path / "t.toml")
        path.write_text(text)
        with pytest.raises(RigtwinError, match=said):
            read_toml(path, parse_table)


def test_measurements_are_the_inputs_in_their_order():
    assert tuple(line.name for line in TABLE.inputs) == Measurements._fields


def test_whoever_signs_the_table_can_be_read_again(tmp_path):
    for odd in ("Zoë \U000e0001 \x1b[31m", 'a "quoted" \\ name\nline', "\udcff"):
        path = tmp_path / "card.toml"
        path.write_text(to_toml(replace(load_table(CARD), operator=odd)), encoding="utf-8")
        assert load_table(path).operator == odd.encode("utf-8", "replace").decode()


def test_a_calibration_of_another_century_is_none():
    table = load_table(CARD)
    checked = replace(
        table,
        inputs=tuple(line._replace(sign_checked=True) for line in table.inputs),
        outputs=tuple(line._replace(sign_checked=True) for line in table.outputs),
        operator="A. Tester",
    )
    today = date(2026, 5, 1)
    require_trust(replace(checked, calibrated="2026-01-31"), today)
    for calibrated, said in (("1900-01-01", "years ago"), ("2030-01-01", "after today")):
        with pytest.raises(RigtwinError, match=said):
            require_trust(replace(checked, calibrated=calibrated), today)


def test_more_samples_than_the_buffer_holds_are_refused():
    """Nobody waits for them, and so blocks all others."""
    types = pytest.importorskip("nidaqmx._grpc_interpreter").grpc_types
    card = VirtualCard(Terminals(Configuration(), TABLE, 5), TABLE, RealTime(PERIOD))
    request = types.ReadAnalogF64Request(num_samps_per_chan=2**31 - 1)
    with pytest.raises(DriverError, match="2147483647; the buffer holds"):
        card.answer("ReadAnalogF64", request, types.ReadAnalogF64Response)


def test_a_port_that_is_taken_at_one_address_is_taken():
    device = VirtualCard(Terminals(Configuration(), TABLE, 5), TABLE, OnDemand())
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(RigtwinError, match="is in use"):
            serve(device, taken.getsockname()[1])
