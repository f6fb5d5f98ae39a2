"""The page of a test while it runs."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.looking.live import LivePage
from tests.helpers.browser import BROWSER
from tests.helpers.devtools import browser

EFFECT = ("coulomb@rail", 60.0)
LATER = 5.0
"""s, from when on it is there."""
DURATION = {"timing": {"duration": 10.0}}
NOTES = "[...document.querySelectorAll('.note')].map(n => n.textContent).join('\\n')"
SHOWN = "Object.values(window.__viserTestpoints?.uplots ?? {}).map(u => u.chart)"


def run(path: Path, progress=lambda _: None) -> None:
    rigtwin.run(
        "suspension-rig",
        "imposed",
        seed=3,
        effects=dict([EFFECT]),
        effects_from=LATER,
        settings=DURATION,
        path=path,
        progress=progress,
    )


@pytest.fixture(scope="module")
def changed(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("live") / "changed.mcap"
    run(path)
    return path


def wait_for_the_end(page: LivePage) -> None:
    patience = time.monotonic() + 60.0
    while page.over is None:
        assert time.monotonic() < patience
        time.sleep(0.1)


class Pace:
    """Holds a run to the clock."""

    def __init__(self) -> None:
        self.begun, self.done = time.monotonic(), 0.0

    def __call__(self, ticks: int) -> None:
        self.done += 1e-3 * ticks
        time.sleep(max(self.begun + self.done - time.monotonic(), 0.0))


@pytest.mark.slow
def test_it_says_what_is_wrong_and_becomes_the_page_of_the_whole_test(changed, tmp_path):
    said: list[str] = []
    with rigtwin.show_live(
        changed, on_message=said.append, save_twin=tmp_path / "twin.toml"
    ) as page:
        wait_for_the_end(page)
        assert page.watch is not None
        assert page.watch.alarm is not None
        assert page.over is not None
        assert list(page.over.values) == [EFFECT[0]]
        assert page.over.saved_to == tmp_path / "twin.toml"
    assert said[0].startswith("alarm at ")
    assert EFFECT[0] in said[-1]


def test_a_test_that_stops_without_an_end_is_shown_as_far_as_it_went(changed, tmp_path):
    path = tmp_path / "killed.mcap"
    path.write_bytes(changed.read_bytes()[: changed.stat().st_size // 2])
    said: list[str] = []
    with rigtwin.show_live(path, on_message=said.append, patience=0.5) as page:
        wait_for_the_end(page)
    assert "nothing was added to it for 0.5 s" in said[-1]


def test_what_is_no_recording_ends_the_page(tmp_path):
    path = tmp_path / "none.mcap"
    path.write_bytes(b"no recording, but longer than a beginning")
    with (
        rigtwin.show_live(path) as page,
        pytest.raises(rigtwin.RigtwinError, match="is not an MCAP file"),
    ):
        page.wait()


@pytest.mark.slow
def test_the_command_prints_the_alarm_and_ends_with_ctrl_c(changed):
    command = [sys.executable, "-m", "rigtwin", "look", str(changed), "--live", "--port", "0"]
    running = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=changed.parent
    )
    assert running.stdout is not None
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+, until Ctrl-C\n", running.stdout.readline())
    assert running.stdout.readline().startswith("alarm at ")
    running.send_signal(signal.SIGINT)
    said, complaints = running.communicate(timeout=30.0)
    assert (running.returncode, complaints) == (0, "")
    # A further alarm may be reported while the interrupt is on its way.
    assert "closing" in said.splitlines()


def test_a_diagnosis_is_not_of_a_test_that_runs(changed, capsys):
    assert main(["look", str(changed), "--live", "--diagnosis", "why.json"]) == 1
    assert "not with --live" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="needs chromium")
def test_a_person_sees_the_gap_arise(tmp_path):
    path = tmp_path / "running.mcap"
    with (
        rigtwin.show_live(path, save_twin=tmp_path / "twin.toml") as page,
        browser(tmp_path, (1200, 600)) as running,
        running.tab(page.url) as tab,
    ):
        tab.wait_for(f"{NOTES}.includes('waiting for the test to begin')")
        test = threading.Thread(target=run, args=(path, Pace()), daemon=True)
        test.start()
        tab.wait_for("document.getElementById('watch')?.textContent === 'no gap'")
        # The traces follow.
        tab.wait_for(f"{SHOWN}.length === 2")
        seen = tab.ask(f"{SHOWN}[0].data[0].at(-1)")
        tab.wait_for(f"{SHOWN}[0].data[0].at(-1) > {seen} + 1")
        assert tab.ask(f"{SHOWN}[0].scales.x.max - {SHOWN}[0].data[0].at(-1)") < 0.5
        tab.wait_for("document.getElementById('watch').textContent === 'alarm'")
        assert page.watch is not None
        assert page.watch.alarm is not None
        # The time of the alarm itself depends on how busy the computer is.
        assert page.watch.alarm.since == pytest.approx(LATER, abs=0.5)
        tab.wait_for(f"{NOTES}.includes('{EFFECT[0]}')")
        # Then the whole test, with its sliders.
        tab.wait_for("document.getElementById('overall')?.textContent", patience=60.0)
        tab.wait_for(f"{NOTES}.includes('{EFFECT[0]}')")
        assert not tab.errors
        test.join()
