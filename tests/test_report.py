"""The report: opened in a browser where there is one, without errors, requests or sideways scrolling."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from rigtwin.configuration import Configuration
from rigtwin.diagnosis.diagnose import Outcome, diagnose
from rigtwin.diagnosis.report import bars, html, plots
from tests.test_diagnose import RIG, drifting, spoilt
from tests.test_fit import recorded

BROWSER = next((found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None)
VIEWER = """<!DOCTYPE html><meta charset="utf-8"><body style="margin:0">
<iframe id="page" src="report.html" style="width:{width}px;height:900px;border:0"></iframe>
<script>
const page = document.getElementById('page');
page.onload = () => {{
  const root = page.contentDocument.documentElement;
  document.body.dataset.result = JSON.stringify({{
    wide: root.scrollWidth, first: page.contentDocument.querySelector('h1').getBoundingClientRect().bottom,
    text: page.contentDocument.querySelector('h1').textContent,
    small: [...page.contentDocument.querySelectorAll('td,li,p,h1,h2')]
      .filter(e => parseFloat(getComputedStyle(e).fontSize) < 12).length
  }});
}};
</script>"""


@pytest.fixture(scope="module")
def outcomes() -> dict[str, Outcome]:
    base = Configuration()
    return {
        "explained": diagnose(RIG, [recorded("imposed", ("coulomb@rail=75",))], base),
        "unknown": diagnose(RIG, [drifting()], base),
        "no gap": diagnose(RIG, [recorded("imposed")], base),
        "unusable": diagnose(RIG, [spoilt("unit")], base),
    }


VERDICTS = ("explained", "unknown", "no gap", "unusable")


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_page_says_the_answer_first(outcomes, verdict):
    outcome = outcomes[verdict]
    assert outcome.diagnosis.verdict == verdict
    page = html(outcome)
    assert page.index(f">{verdict}<") < page.index("<h1>") < page.index("The rig from ground cylinder")
    assert not re.search(r"(src|href)=\"(?!data:)", page.replace('xlink:href="#', "").replace('href="#', ""))
    assert "<script" not in page


def test_the_guilty_component_is_marked(outcomes):
    page = html(outcomes["explained"])
    marked = re.findall(r'<g class="guilty"><title>([^<]*)', page)
    assert marked == ["rail"]
    assert 'class="guilty"' not in html(outcomes["no gap"])


def test_bars_are_of_every_replay_and_on_one_scale(outcomes):
    found = bars(outcomes["explained"].diagnosis)
    assert found[0].name == "all sensors"
    assert len(found) >= 5
    assert max(max(bar.before_width, bar.after_width) for bar in found) == pytest.approx(100.0)
    assert not bars(outcomes["unusable"].diagnosis)


def test_plots_are_by_velocity_frequency_and_time(outcomes):
    assert len(plots(outcomes["explained"])) == 3
    assert plots(outcomes["unusable"]) == []


def test_names_from_files_cannot_write_the_page(outcomes):
    outcome = outcomes["no gap"]
    hostile = replace(outcome, diagnosis=replace(outcome.diagnosis, notes=("<script>alert(1)</script>",)))
    assert "<script>" not in html(hostile)


@pytest.mark.skipif(BROWSER is None, reason="no chromium")
@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_browser_shows_it_without_errors_requests_or_sideways_scrolling(outcomes, verdict, width, tmp_path: Path):
    (tmp_path / "report.html").write_text(html(outcomes[verdict]))
    (tmp_path / "viewer.html").write_text(VIEWER.format(width=width))
    log = tmp_path / "net.json"
    done = subprocess.run(
        [
            str(BROWSER),
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-background-networking",
            "--disable-component-update",
            "--no-first-run",
            "--allow-file-access-from-files",
            "--enable-logging=stderr",
            f"--user-data-dir={tmp_path / 'profile'}",
            f"--log-net-log={log}",
            f"--window-size={max(width, 500)},1000",
            "--virtual-time-budget=3000",
            "--dump-dom",
            (tmp_path / "viewer.html").as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=90,
        check=True,
    )
    assert not re.search(r"CONSOLE.*(error|Error)", done.stderr), done.stderr
    found = re.search(r'data-result="([^"]*)"', done.stdout)
    assert found, done.stdout[-500:]
    result = json.loads(found.group(1).replace("&quot;", '"'))
    assert result["wide"] <= width
    assert result["first"] < 500
    assert result["small"] == 0
    requests = set(re.findall(r'"url":"(https?://[^"]*)"', log.read_text())) if log.exists() else set()
    assert not {url for url in requests if "google" not in url and "gvt" not in url}, requests
