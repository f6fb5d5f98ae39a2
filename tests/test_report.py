"""The report: opened in a browser where there is one, without errors, requests or sideways scrolling."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from rigtwin.diagnosis.diagnose import Outcome, diagnose
from rigtwin.diagnosis.report import bars, html, plots
from rigtwin.description.configuration import Configuration
from tests.browser import BROWSER, looked_at
from tests.test_diagnose import RIG, drifting, spoilt
from tests.test_fit import recorded


@pytest.fixture(scope="module")
def outcomes() -> dict[str, Outcome]:
    base = Configuration()
    return {
        "explained": diagnose(RIG, [recorded("imposed", ("coulomb@rail=75",))], base),
        "unknown": diagnose(RIG, [drifting()], base),
        "no gap": diagnose(RIG, [recorded("imposed")], base),
        "unusable": diagnose(RIG, [spoilt("unit")], base),
    }


pytestmark = pytest.mark.xdist_group("report")
"""One worker makes the four diagnoses once."""
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
    result = looked_at(html(outcomes[verdict]), width, tmp_path)
    assert result["wide"] <= width
    assert result["first"] < 500
    assert result["small"] == 0
