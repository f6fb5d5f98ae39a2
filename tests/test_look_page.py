"""The page of a look, driven in a browser as a person would."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import numpy as np
import pytest

import rigtwin
from rigtwin.looking import Look, Slider
from rigtwin.looking.knob import knob_of
from rigtwin.looking.local_server import HOST, open_server, stop_server
from rigtwin.looking.page import Page
from rigtwin.looking.scale import shorten
from rigtwin.looking.scene import Scene
from rigtwin.looking.shapes import PosedMachine
from rigtwin.looking.starting_point import from_first_look, read_diagnosis
from rigtwin.looking.traces import BUCKETS, mark, thin
from tests.helpers.browser import BROWSER
from tests.helpers.described import NOISY, described
from tests.helpers.devtools import PATIENCE, Tab, browser

EFFECT, TRUE = "coulomb@guide", 6.0
DRAGS = 12
SMALL = (1200, 600)
"""Pixels of a window whose picture is soon drawn without a graphics card."""
DRIVE = """
window.titled = title => [...document.querySelectorAll('.mantine-Paper-root')].find(
  e => e.textContent.trim() === title);
window.after = (text, steps) => {
  const every = [...document.querySelectorAll('label')];
  const suspect = every.findIndex(l => l.textContent.trim() === text);
  if (suspect >= 0) return document.getElementById(every[suspect + steps].htmlFor);
  const [kind, component] = text.split('@');
  const folder = component ? titled(component)?.parentElement : document;
  const all = [...(folder?.querySelectorAll('label') ?? [])];
  const at = all.findIndex(l => l.textContent.trim() === kind);
  return at < 0 ? null : document.getElementById(all[at + steps].htmlFor);
};
window.box = element => {
  if (!element) return null;
  element.scrollIntoView({block: 'center'});
  const b = element.getBoundingClientRect();
  return [b.left, b.top + b.height / 2, b.width, b.height];
};
window.track = (text, steps) => {
  const slider = after(text, steps);
  return box(slider && (slider.querySelector('.mantine-Slider-track') || slider));
};
window.scrubbed = () => parseFloat(
  after('time, s', 0).querySelector('[role=slider]').getAttribute('aria-valuenow'));
window.button = text => box(
  [...document.querySelectorAll('button')].find(b => b.textContent.trim() === text));
window.overall = () => parseFloat(document.getElementById('overall')?.textContent);
window.notes = () => [...document.querySelectorAll('.note')].map(n => n.textContent).join('\\n');
window.charts = () => Object.values(window.__viserTestpoints?.uplots ?? {}).map(u => u.chart);
window.traces = () => charts().map(c => c.data);
window.late = {text: [], trace: []};
window.moved = {text: 0, trace: 0};
window.addEventListener('mousemove', () => {
  if (event.buttons) moved = {text: performance.now(), trace: performance.now()};
}, true);
(() => {
  let text = null, trace = null;
  const look = () => {
    const now = performance.now();
    const seen = document.getElementById('overall')?.textContent, drawn = charts()[0]?.data;
    if (seen !== text && moved.text) { late.text.push(now - moved.text); moved.text = 0; }
    if (drawn !== trace && moved.trace) { late.trace.push(now - moved.trace); moved.trace = 0; }
    [text, trace] = [seen, drawn];
    requestAnimationFrame(look);
  };
  look();
})();
true
"""


@pytest.fixture(scope="module")
def look(tmp_path_factory) -> Look:
    machine = described(tmp_path_factory.mktemp("look"), "slide", NOISY)
    recording = rigtwin.run(machine, "shake", seed=1, effects={EFFECT: TRUE})
    return rigtwin.look(recording, machine=machine)


@pytest.fixture
def page(look, tmp_path) -> Iterator[Page]:
    with rigtwin.show_look(look, save_twin=tmp_path / "twin.toml") as page:
        yield page


SLOWEST = 3.0
"""s, until a busy computer shows a prediction."""


def opened(tab: Tab) -> Tab:
    """A tab whose page is there, with what drives it."""
    tab.wait_for("document.getElementById('overall')?.textContent")
    tab.wait_for("Object.keys(window.__viserTestpoints?.uplots ?? {}).length === 2")
    tab.ask(DRIVE)
    return tab


def drag(tab: Tab, name: str, shares: list[float], steps: int = 1) -> list[float]:
    """Moves the slider under a tick to shares of its length; the error at each."""
    x, y, width, _ = tab.wait_for(f"track('{name}', {steps})")
    tab.mouse("Pressed", x + shares[0] * width, y)
    errors = []
    for share in shares:
        before = tab.ask("overall()")
        tab.mouse("Moved", x + share * width, y)
        time.sleep(0.4)
        # On a busy computer the prediction takes longer; it may also be the same as before.
        until = time.monotonic() + SLOWEST
        while tab.ask("overall()") == before and time.monotonic() < until:
            time.sleep(0.1)
        errors.append(tab.ask("overall()"))
    tab.mouse("Released", x + shares[-1] * width, y)
    return errors


def in_front(tab: Tab) -> float:
    """The error that a tab shows once it is in front and had time to draw."""
    tab.call("Page.bringToFront")
    time.sleep(0.5)
    return tab.wait_for("overall()")


def press(tab: Tab, text: str) -> None:
    x, y, width, _ = tab.wait_for(f"button('{text}')")
    tab.click(x + width / 2, y)


def open_folder(tab: Tab, title: str) -> None:
    tab.ask(f"titled('{title}').click()")
    time.sleep(1.0)


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="needs chromium")
def test_a_person_drags_scrubs_fits_and_saves(look, page, tmp_path):
    with browser(tmp_path, SMALL) as running, running.tab(page.url) as first:
        tab = opened(first)
        assert tab.ask("overall()") == pytest.approx(look.nominal.overall, rel=0.01)
        (slider,) = look.sliders[EFFECT]
        open_folder(tab, "guide")
        shares = [(n + 1) / (DRAGS + 1) for n in range(DRAGS)]
        drag(tab, EFFECT, shares[:2])
        tab.ask("late = {text: [], trace: []}; true")
        errors = drag(tab, EFFECT, shares)
        # What is shown is what the library says of that value.
        knob = knob_of(slider)
        least = min(range(DRAGS), key=lambda n: errors[n])
        value = knob.value(knob.low + shares[least] * (knob.high - knob.low))
        assert value == pytest.approx(TRUE, abs=(knob.high - knob.low) / DRAGS / knob.factor)
        assert errors[least] == pytest.approx(look.predict({EFFECT: (value,)}).overall, abs=4.0)
        late = tab.ask("late")
        # On a busy computer a later value overtakes an earlier one, which is then not shown.
        for seen in (late["text"], late["trace"]):
            assert len(seen) >= DRAGS // 2, late
        # A second tab shows the same, and the first goes on without it.
        with running.tab(page.url) as second:
            other = opened(second)
            # The last move's prediction may arrive in one tab before the other, and a browser draws
            # only the tab in front.
            until = time.monotonic() + PATIENCE
            while in_front(other) != in_front(tab):
                assert time.monotonic() < until, "the tabs show different values"
        tab.ask("marked = JSON.stringify(Array.from(traces()[0][0])); true")
        drag(tab, "time, s", [0.5], steps=0)
        assert tab.wait_for("JSON.stringify(Array.from(traces()[0][0])) !== marked")
        x, y, width, _ = tab.wait_for("box(after('play', 0))")
        seen = tab.ask("scrubbed()")
        tab.click(x + width / 2, y)
        tab.wait_for(f"scrubbed() > {seen} + 0.2 || scrubbed() < {seen}")
        tab.click(x + width / 2, y)
        press(tab, "fit what is ticked")
        tab.wait_for("notes().includes('fitted in')")
        # The page shows the fitted values before it has predicted with them.
        tab.wait_for(f"overall() < {0.06 * look.nominal.overall}")
        press(tab, "write the corrected twin")
        tab.wait_for("notes().includes('the corrected twin is in')")
        assert not tab.errors
        assert {url.split("/")[2] for url in tab.asked if url.startswith("http")} == {
            page.url.split("/")[2]
        }
    again = rigtwin.look(look.recording, machine=look.machine, settings=page.saved_to)
    (finding,) = rigtwin.diagnose(look.recording, machine=look.machine).effects
    interval = finding.parameters["coulomb"]
    assert interval.low <= again.plant({}).guide.coulomb <= interval.high


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="needs chromium")
def test_an_arm_of_six_joints_follows_a_drag(tmp_path):
    recording = rigtwin.run(
        rigtwin.machine("tx40"), "swing", seed=1, effects={"viscous@joint_2": 9.0}
    )
    with rigtwin.show_look(rigtwin.look(recording)) as page, browser(tmp_path, SMALL) as running:  # noqa: SIM117
        with running.tab(page.url) as first:
            tab = opened(first)
            open_folder(tab, "joint_2")
            drag(tab, "viscous@joint_2", [0.1, 0.15])
            tab.ask("late = {text: [], trace: []}; true")
            errors = drag(tab, "viscous@joint_2", [0.05 * n for n in range(1, 11)])
            late = tab.ask("late")
            assert np.median(late["text"]) < 300.0, late
            assert np.median(late["trace"]) < 300.0, late
            assert min(errors) < 0.3 * errors[-1]
            assert not tab.errors


def test_a_page_is_served_to_this_computer_until_it_is_closed(look, page):
    with urlopen(page.url) as reply:
        assert b"<html" in reply.read()[:1000].lower()
    with pytest.raises(rigtwin.RigtwinError, match="no page on port") as error:
        rigtwin.show_look(look, port=int(page.url.rpartition(":")[2]))
    assert "\n" not in str(error.value)
    page.close()
    with pytest.raises(URLError):
        urlopen(page.url)
    page.wait()


def test_a_page_cannot_be_shared_with_the_world():
    server = open_server(0, "")
    try:
        assert server.get_host() == HOST
        assert server.request_share_url() is None
    finally:
        stop_server(server)


@pytest.mark.slow
def test_the_command_ends_with_ctrl_c(look, tmp_path):
    recording = tmp_path / "shaken.mcap"
    rigtwin.run(look.machine, "shake", seed=1, effects={EFFECT: TRUE}, path=recording)
    command = [sys.executable, "-m", "rigtwin", "look", str(recording), "--port", "0"]
    running = subprocess.Popen(
        [*command, "--machine", str(look.machine.path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert running.stdout is not None
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+, until Ctrl-C\n", running.stdout.readline())
    running.send_signal(signal.SIGINT)
    said, complaints = running.communicate(timeout=30.0)
    assert (running.returncode, said, complaints) == (0, "closing\n", "")


def answer_of(look: Look, effect: str, values: tuple[float, ...]) -> dict[str, object]:
    return {
        "machine": look.machine.name,
        "recordings": [str(look.recording.path)],
        "verdict": "explained",
        "sentence": "dry friction of the guide",
        "effects": [
            entry_of(effect, look, values),
            {"component": "controller", "kind": "setting", "parameters": {}, "confidence": 0.9},
        ],
    }


def entry_of(effect: str, look: Look, values: tuple[float, ...]) -> dict[str, object]:
    """A finding as a diagnosis' JSON has it."""
    kind, _, component = effect.partition("@")
    names = look.effects[effect].kind.parameters
    return {
        "component": component,
        "kind": kind,
        "parameters": {n: {"value": v} for n, v in zip(names, values, strict=True)},
        "confidence": 0.97,
    }


def test_it_begins_with_the_suspects_and_diagnoses_on_request(look, page):
    start = from_first_look(look)
    assert next(iter(start.suspects)) == EFFECT
    assert "suspects coulomb@guide" in start.sentence
    # A suspect has a slider at its place but is not in the twin.
    assert page.values == {}
    assert page.prediction.overall == look.nominal.overall
    page.diagnose()
    until = time.monotonic() + 120.0
    while EFFECT not in page.values and time.monotonic() < until:
        time.sleep(0.05)
    assert page.values[EFFECT][0] == pytest.approx(TRUE, rel=0.05)


BARE = """
<mujoco model="bare">
  <worldbody>
    <body name="boom" pos="3 0 1">
      <joint name="lift" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 2 0 0" size="0.05"/>
      <body name="arm" pos="2 0 0">
        <joint name="swing" axis="0 0 1"/>
        <geom type="box" pos="0.5 0 0" size="0.5 0.05 0.05"/>
      </body>
    </body>
  </worldbody>
  <sensor>
    <jointpos name="lift" joint="lift"/>
    <jointpos name="swing" joint="swing"/>
    <jointactuatorfrc name="lift_torque" joint="lift"/>
    <jointactuatorfrc name="swing_torque" joint="swing"/>
  </sensor>
</mujoco>
"""
"""Model without camera and floor, away from the origin."""


def test_a_model_without_camera_and_floor_is_seen_whole(tmp_path):
    (tmp_path / "bare.xml").write_text(BARE)
    machine = rigtwin.machine(tmp_path / "bare.xml")
    motion = {"lift": np.linspace(0.0, 0.5 * np.pi, 30), "swing": np.zeros(30)}
    body = PosedMachine(machine)
    extent = body.extent(motion)
    # From level to hanging straight down: 3.05 m to either direction, and 0.05 m to the side.
    assert extent.low == pytest.approx([2.95, -0.05, -2.0], abs=0.05)
    assert extent.high == pytest.approx([6.0, 0.05, 1.05], abs=0.05)
    place, target, angle = body.camera(extent)
    distance = float(np.linalg.norm(place - target))
    assert np.allclose(target, extent.centre)
    assert np.arcsin(extent.radius / distance) <= 0.5 * angle
    assert extent.radius / distance > 0.2
    server = open_server(0, "bare")
    try:
        floor = Scene(server, machine, ghost=False, motion=motion).floor
        assert floor is not None
        assert floor.position[2] == pytest.approx(extent.low[2])
        assert min(floor.width, floor.height) > 2.0 * extent.radius
    finally:
        stop_server(server)


def test_a_model_with_a_plane_gets_no_second_floor():
    rig = rigtwin.machine("suspension-rig")
    server = open_server(0, "rig")
    try:
        assert PosedMachine(rig).has_floor == (Scene(server, rig, ghost=False).floor is None)
    finally:
        stop_server(server)


def test_it_begins_with_what_was_diagnosed(look, tmp_path):
    path = tmp_path / "why.json"
    path.write_text(json.dumps(answer_of(look, EFFECT, (TRUE,))))
    start = read_diagnosis(path, look)
    assert start.values == {EFFECT: (TRUE,)}
    assert start.without_slider == ("setting@controller",)
    with rigtwin.show_look(look, diagnosis=path) as page:
        assert page.values == start.values


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"machine": "emps"}, "is a diagnosis of emps; the recording is of bench"),
        ({"recordings": ["other.mcap"]}, "is a diagnosis of other.mcap; expected"),
        ({"effects": [{}]}, "expected the JSON of rigtwin diagnose --json"),
        ({"effects": 3}, "expected the JSON of rigtwin diagnose --json"),
        ({"verdict": 5}, "expected the JSON of rigtwin diagnose --json"),
        (
            {"effects": [{"component": "no", "kind": "gain", "parameters": {}, "confidence": 1}]},
            "bench can have no gain@no",
        ),
        (None, "expected the JSON of rigtwin diagnose --json"),
    ],
)
def test_what_is_no_diagnosis_of_it_is_said_in_one_line(look, tmp_path, change, said):
    path = tmp_path / "why.json"
    path.write_text(
        "[" * 100_000
        if change is None
        else json.dumps({**answer_of(look, EFFECT, (TRUE,)), **change})
    )
    with pytest.raises(rigtwin.RigtwinError, match=re.escape(said)) as error:
        rigtwin.show_look(look, diagnosis=path)
    assert "\n" not in str(error.value)


def test_a_position_of_a_slider_means_its_value(look):
    for sliders in look.sliders.values():
        for slider in sliders:
            knob = knob_of(slider)
            assert knob.low < knob.high
            assert knob.step < (knob.high - knob.low) / 100
            for value in np.linspace(slider.low, slider.high, 7):
                assert knob.value(knob.position(value)) == pytest.approx(value, abs=1e-12)
            assert knob.value(knob.position(np.inf)) == pytest.approx(slider.high)


def test_a_wide_positive_range_is_logarithmic():
    knob = knob_of(Slider("stribeck@guide", "stribeck_velocity", "m/s", 1e-3, 1.0, 0.01, 0.03))
    assert knob.logarithmic
    assert knob.value(0.5 * (knob.low + knob.high)) == pytest.approx(np.sqrt(1e-3))
    assert knob.label(0.03) == "stribeck_velocity 0.03 m/s"
    small = knob_of(Slider("backlash@guide", "backlash", "m", 0.0, 0.016, 0.0, 0.001))
    assert (small.label(0.0), small.low, small.high) == ("backlash, mm", 0.0, 16.0)


@pytest.mark.parametrize(
    ("largest", "unit", "scale"),
    [
        (0.0, "m", (1.0, "m")),
        (0.5, "m", (1.0, "m")),
        (0.05, "m", (1e3, "mm")),
        (2e-4, "rad", (1e3, "mrad")),
        (2e-5, "m/N", (1e6, "1e-6 m/N")),
        (0.01, "1", (1e3, "1e-3")),
        (2e5, "N/m", (1e-6, "1e6 N/m")),
    ],
)
def test_numbers_are_short_in_their_unit(largest, unit, scale):
    factor, named = shorten(largest, unit)
    assert (factor, named) == (pytest.approx(scale[0]), scale[1])
    assert largest == 0.0 or 0.1 <= factor * largest < 1e5


@pytest.mark.parametrize("ticks", [2, 2 * BUCKETS, 10_007])
def test_no_peak_is_lost_however_few_points_are_drawn(ticks):
    time_ = np.arange(ticks) * 1e-3
    trace = np.random.default_rng(ticks).normal(size=ticks)
    trace[ticks // 3] = 50.0
    shown, (drawn,) = thin(time_, [trace])
    assert len(shown) == len(drawn) <= 2 * BUCKETS
    assert (drawn.max(), drawn.min()) == (trace.max(), trace.min())
    assert np.all(np.diff(shown) > 0.0)


def test_a_time_is_marked_from_bottom_to_top():
    time_, trace = np.arange(5.0), np.array([0.0, 1.0, 2.0, 1.0, -1.0])
    times, drawn, line = mark(time_, [trace], 2.5)
    assert times[line == 2.0].tolist() == [2.5]
    assert set(line) == {-1.0, 2.0}
    assert drawn[times == 2.5].tolist() == [1.5] * 3


@pytest.mark.parametrize("name", rigtwin.machines())
def test_every_machine_can_be_drawn_and_posed(name):
    machine = rigtwin.machine(name)
    body = PosedMachine(machine)
    shapes = body.shapes()
    assert any(shape.moves for shape in shapes)
    assert all(len(shape.faces) and shape.faces.max() < len(shape.vertices) for shape in shapes)
    joint = next(each.joint for each in machine.components.values() if each.joint)
    still, _ = body.poses({})
    moved, turned = body.poses({joint: 0.1})
    posed, back = body.poses({})
    assert np.array_equal(still, posed)
    assert not (np.array_equal(moved, still) and np.array_equal(turned, back))


@pytest.mark.slow
@pytest.mark.parametrize("name", rigtwin.machines())
def test_every_machine_has_a_page_that_follows_its_effects(name):
    machine = rigtwin.machine(name)
    experiments = list(rigtwin.experiments(machine))
    if not experiments:
        pytest.skip("described without an experiment")
    experiment = "imposed" if name == "suspension-rig" else experiments[0]
    settings = {"timing": {"duration": 4.0}}
    look = rigtwin.look(rigtwin.run(machine, experiment, seed=1, settings=settings))
    effect = next(iter(look.effects))
    largest = {effect: tuple(slider.high for slider in look.sliders[effect])}
    answer = answer_of(look, effect, largest[effect])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "why.json"
        path.write_text(json.dumps(answer))
        with rigtwin.show_look(look, diagnosis=path) as page:
            until = time.monotonic() + 20.0
            while page.prediction.overall == look.nominal.overall and time.monotonic() < until:
                time.sleep(0.05)
            assert page.prediction.overall == look.predict(largest).overall


@pytest.mark.parametrize(
    ("host", "origin", "status"),
    [
        ("127.0.0.1", None, 101),
        ("127.0.0.1", "http://127.0.0.1", 101),
        ("127.0.0.1", "http://evil.example", 403),
        ("evil.example", None, 403),
    ],
)
def test_it_answers_pages_of_its_own_alone(look, host, origin, status):
    with rigtwin.show_look(look) as page:
        port = int(page.url.rsplit(":", 1)[1])
        lines = ["GET / HTTP/1.1", f"Host: {host}:{port}", "Upgrade: websocket"]
        lines += [f"Origin: {origin}:{port}"] if origin else []
        lines += ["Connection: Upgrade", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="]
        lines += ["Sec-WebSocket-Version: 13", "Sec-WebSocket-Protocol: viser-v1.1.1", "", ""]
        with socket.create_connection(("127.0.0.1", port), timeout=10.0) as asked:
            asked.sendall("\r\n".join(lines).encode())
            assert asked.recv(64).startswith(f"HTTP/1.1 {status} ".encode())
