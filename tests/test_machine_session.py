"""Sessions of described machines: on their twin behind a card's converters, on the virtual card,
and what ends them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import machines
import rigtwin
from rigtwin.api.planning import plan_test
from rigtwin.cli import main
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.signals import signals_of
from rigtwin.hardware.daq.table_file import load_table, to_toml
from rigtwin.hardware.daq.wired import WiredTwin
from rigtwin.hardware.session.record import open_virtual_card, record_unpaced
from rigtwin.hardware.session.test import MachineTest
from tests.test_commanding import lqr
from tests.test_commanding import machine as upright

CARD = Path(machines.__file__).parent / "cards" / "cart_pole.toml"
SHORT = {"timing": {"duration": 1.0}}
CHANNELS = ("/sensor.place", "/sensor.angle", "/command.force")
SESSION = ("time", "phase", "drive", "enable", "place", "angle", "late", "missed")


def pushes(path: Path, **options) -> MachineTest:
    text = CARD.read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    planned = plan_test("pushes", machine="cart-pole", card=path, settings=SHORT, seed=2, **options)
    assert isinstance(planned, MachineTest)
    return planned


def test_a_session_is_the_run_but_for_noise_and_bits(tmp_path: Path) -> None:
    options = {"seed": 2, "settings": SHORT}
    path = tmp_path / "s.mcap"
    ended = rigtwin.run_on_twin("pushes", machine="cart-pole", card=CARD, path=path, **options)
    assert ended.completed
    recording, run = rigtwin.load(path), rigtwin.run("cart-pole", "pushes", **options)
    assert {t: tuple(n) for t, n in recording.columns.items()} == {
        t: tuple(n) for t, n in run.columns.items()
    }
    assert recording.ticks == run.ticks == 500
    assert recording.machine == "cart-pole"
    # Noise of the sensor twice, and a bit of 16.
    for channel, noise, span in (("/sensor.place", 2e-5, 5.0), ("/sensor.angle", 1e-4, 4.0)):
        difference = np.std(recording[channel] - run[channel])
        assert difference < 1.5 * np.sqrt(2.0 * noise**2 + 2.0 * (2 * span / 65536) ** 2 / 12.0)
    assert np.array_equal(recording["/command.force"], run["/command.force"])


def test_on_the_virtual_card_it_is_the_same_to_the_last_bit(tmp_path: Path) -> None:
    test = pushes(tmp_path / "card.toml")
    card, device = open_virtual_card(test)
    record_unpaced(card, test, tmp_path / "card.mcap")
    record_unpaced(WiredTwin(test.terminals(), test.table), test, tmp_path / "twin.mcap")
    ours, theirs = (rigtwin.load(tmp_path / f"{name}.mcap") for name in ("card", "twin"))
    for channel in CHANNELS:
        assert np.array_equal(ours[channel], theirs[channel])
    assert not device.power
    assert not device.outputs.any()


def test_the_session_itself_is_recorded(tmp_path: Path) -> None:
    test = pushes(tmp_path / "card.toml")
    assert test.layout.session == SESSION
    record_unpaced(WiredTwin(test.terminals(), test.table), test, tmp_path / "s.mcap")
    from mcap.reader import make_reader

    with (tmp_path / "s.mcap").open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert topics == {"/session", "/sensor", "/command"}


def test_a_pole_stays_upright_under_a_controller_behind_a_card(tmp_path: Path) -> None:
    of = upright(tmp_path)
    card = tmp_path / "card.toml"
    lines = [f'[inputs.{n}]\nline = "ai{i}"\nscale = 0.1\n' for i, n in enumerate(NAMES)]
    card.write_text('[card]\nenable = "port0/line0"\n' + "".join(lines) + OUTPUT, encoding="utf-8")
    ended = rigtwin.run_on_twin(
        "step", machine=of, card=card, path=tmp_path / "s.mcap", controller=lambda _: lqr
    )
    assert ended.completed
    recording = rigtwin.load(tmp_path / "s.mcap")
    run = rigtwin.run(of, "step", controller=lqr)
    # Bits of 0.03 mm and 0.03 mrad, and their differences, go round the loop.
    assert np.max(np.abs(recording["/sensor.place"] - run["/sensor.place"])) < 2e-3
    assert np.max(np.abs(recording["/sensor.angle"])) < 0.02


NAMES = ("place", "pace", "angle", "rate")
OUTPUT = '[outputs.drive]\nline = "ao0"\nscale = 3.0\n'


def stumbling(_: object) -> Callable[..., float]:
    def tick(sensed: dict[str, float], demanded: dict[str, float]) -> float:
        if abs(sensed["place"]) > 0.01:
            raise ZeroDivisionError("float division by zero")
        return 5.0

    return tick


def test_what_ends_a_session_leaves_no_force_and_no_power(tmp_path: Path) -> None:
    test = pushes(tmp_path / "card.toml")
    narrow = {"safety": {"place_low": -0.02, "place_high": 0.02}}
    strict = plan_test(
        "pushes", machine="cart-pole", card=tmp_path / "card.toml", settings=[SHORT, narrow]
    )
    for operation, stop, cause in (
        (strict, None, "limit"),
        (plan_own(test, stumbling), None, "controller"),
        (plan_own(test, lambda _: lambda *_: float("nan")), None, "controller"),
        (plan_own(test, lambda _: lambda *_: 25.0), None, "limit"),
        (test, lambda: "enough", "operator"),
    ):
        card, device = open_virtual_card(operation)
        asked = iter([None] * 300)
        ended = record_unpaced(
            card,
            operation,
            tmp_path / "s.mcap",
            stop=lambda stop=stop, asked=asked: next(asked, stop() if stop else None),
        )
        assert ended.cause.name == cause, ended.cause
        assert not device.power
        assert not device.outputs.any()
        assert ended.transitions[-1].after.name == ("STOPPED" if stop else "FAULTED")


def plan_own(test: MachineTest, make: Callable[[object], object]) -> MachineTest:
    from rigtwin.hardware.session.custom_controller import custom_controller

    still = {"aim": np.zeros(test.ticks)}
    return replace(test, controller=custom_controller(make), demands=still)  # type: ignore[arg-type]


def test_it_is_not_armed_outside_its_limits(tmp_path: Path) -> None:
    shifted = {"safety": {"place_low": 0.1, "place_high": 2.0}}
    with pytest.raises(RigtwinError, match=r"not armed: place is .*its limits are 0.1 and 2"):
        rigtwin.run_on_twin(
            "pushes",
            machine="cart-pole",
            card=CARD,
            path=tmp_path / "s.mcap",
            settings=[SHORT, shifted],
        )


def test_a_table_survives_being_written(tmp_path: Path) -> None:
    signals = signals_of(rigtwin.machine("cart-pole"))
    table = load_table(CARD, signals)
    (tmp_path / "t.toml").write_text(to_toml(table), encoding="utf-8")
    assert load_table(tmp_path / "t.toml", signals) == table


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[inputs.place]", "[inputs.spot]", r"unknown signal \[inputs.spot\]; there are place"),
        ('unit = "N"', 'unit = "V"', "outputs.drive.unit = 'V': expected 'N'"),
        ("enable =", "pressure =", "unknown setting card.pressure"),
        ('"port0/line0"', '"ai9"', "card.enable = 'ai9'"),
        ("scale = 0.4", "scale = 0.1", "angle on ai1 reads up to 1 rad, safety.angle is 2 rad"),
        ("scale = 5.0", "scale = 1.0", "drive on ao0 commands up to 10 N, safety.drive is 20 N"),
        ("stuck = 0 ", "stuck = -1 ", "plausible.stuck = -1"),
    ],
)
def test_mistakes_in_a_table(tmp_path: Path, capsys, old: str, new: str, said: str) -> None:
    text = CARD.read_text(encoding="utf-8")
    assert old in text
    card = tmp_path / "card.toml"
    card.write_text(text.replace(old, new, 1), encoding="utf-8")
    out = tmp_path / "s.mcap"
    line = ["run", "pushes", "--machine", "cart-pole", "--card", str(card), "--out", str(out)]
    assert main(line) == 1
    (message,) = capsys.readouterr().err.strip().splitlines()
    import re

    assert re.search(said, message), message
    assert not out.exists()


def test_what_no_card_can_move_is_said(tmp_path: Path) -> None:
    with pytest.raises(RigtwinError, match="angle_1 prescribes a motion"):
        plan_test("swing", machine="tx40", card=CARD)
    with pytest.raises(RigtwinError, match="no channel table"):
        plan_test("pushes", machine="cart-pole")


def test_a_machine_without_limits_is_not_moved(tmp_path: Path) -> None:
    card = tmp_path / "card.toml"
    card.write_text(EMPS_CARD, encoding="utf-8")
    options = {"machine": "emps", "settings": SHORT, "path": tmp_path / "e.mcap"}
    result = rigtwin.dry_run("positioning", card, **options)
    assert result.passed
    assert any("drive has no limits" in line for line in result.obstacles)
    assert (tmp_path / "card.dry-runs.json").exists()
    signed = EMPS_CARD.replace('"port0/line0"', '"port0/line0"\ncalibrated = "2026-01-31"')
    signed = signed.replace("calibrated", 'operator = "me"\ncalibrated')
    card.write_text(signed.replace("scale", "sign_checked = true\nscale"), encoding="utf-8")
    with pytest.raises(RigtwinError, match="drive has no limits"):
        rigtwin.run_on_card("positioning", card, arm=lambda _: True, **options)


EMPS_CARD = """
[card]
enable = "port0/line0"
[inputs.encoder]
line = "ai0"
scale = 0.05
[outputs.drive]
line = "ao0"
scale = 200.0
"""


@pytest.mark.slow
def test_the_machine_itself_is_run_and_guarded(tmp_path: Path) -> None:
    card = tmp_path / "card.toml"
    text = CARD.read_text(encoding="utf-8").replace('calibrated = ""', 'calibrated = "2026-01-31"')
    text = text.replace('operator = ""', 'operator = "me"').replace("= false", "= true")
    card.write_text(text, encoding="utf-8")
    slow = {"timing": {"duration": 1.0, "period": 0.02, "timestep": 2.5e-4}}
    served = rigtwin.serve_card(card, machine="cart-pole", settings=slow)
    try:
        card.write_text(text.replace('address = ""', f'address = "{served.address}"'))
        options = {"machine": "cart-pole", "settings": slow, "path": tmp_path / "s.mcap"}
        with pytest.raises(RigtwinError, match="no dry run"):
            rigtwin.run_on_card("pushes", card, arm=lambda _: True, **options)
        assert (
            rigtwin.run_on_card(
                "pushes", card, arm=lambda _: False, without_dry_run="me", **options
            )
            is None
        )
        ended = rigtwin.run_on_card(
            "pushes", card, arm=lambda _: True, without_dry_run="me", **options
        )
        assert ended is not None
        assert ended.completed, ended
        recording = rigtwin.load(tmp_path / "s.mcap")
        # A computer that is no real-time computer may lose some of the 50 ticks.
        assert 40 <= recording.ticks <= 50
        assert not rigtwin.release_card(card, machine="cart-pole")
    finally:
        served.close()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: None, "it cannot be made: TypeError"),
        (lambda _: 3, "made 3; expected a function, or a method tick"),
    ],
)
def test_a_controller_that_cannot_be_made_is_found_before_the_start(
    tmp_path: Path, make: Callable[..., Any], said: str
) -> None:
    out, card = tmp_path / "s.mcap", tmp_path / "card.toml"
    card.write_text(EMPS_CARD, encoding="utf-8")
    for name, options in (("positioning", {"machine": "emps", "card": card}), ("drop", {})):
        with pytest.raises(RigtwinError, match=said):
            rigtwin.run_on_twin(name, path=out, controller=make, settings=SHORT, **options)
        assert not out.exists()


def test_every_test_of_a_list_is_looked_at_before_the_first(tmp_path: Path, capsys) -> None:
    plan, folder = tmp_path / "list.toml", tmp_path / "out"
    plan.write_text(
        '[[test]]\nexperiment = "pushes"\nname = "a"\n[test.set]\n"timing.duration" = 0.1\n'
        '[[test]]\nexperiment = "pushes"\nname = "b"\n[test.set]\n"safety.place_low" = 3.0\n'
    )
    line = ["session", str(plan), "--machine", "cart-pole", "--folder", str(folder)]
    assert main(line) == 1
    assert "expected low below" in capsys.readouterr().err
    assert not list(folder.glob("*.mcap"))
