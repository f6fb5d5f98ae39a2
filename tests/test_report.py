"""What a diagnosis is told in: a document, a corrected twin, a page that a browser opens where
there is one."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import rigtwin.diagnosis
from rigtwin.description.changes import override, with_changes
from rigtwin.description.configuration import Configuration
from rigtwin.description.posterior import load_posterior
from rigtwin.diagnosis.calibrated import toml
from rigtwin.diagnosis.overlay import Overlay
from rigtwin.diagnosis.report import headlines, html
from rigtwin.diagnosis.report_bars import bars
from rigtwin.diagnosis.result import Diagnosis
from tests.helpers.browser import BROWSER, looked_at
from tests.helpers.recordings import replace_sensors
from tests.helpers.twin import answer, recorded

SCHEMA = Path(rigtwin.diagnosis.__file__).parent / "answer.schema.json"
VERDICTS = ("explained", "unknown", "no gap", "unusable")

pytestmark = pytest.mark.slow
"""Four diagnoses come first; the answers of other tests are written as reports too."""


@pytest.fixture(scope="module")
def outcomes() -> dict[str, Diagnosis]:
    """Of a twin with more dry friction than told; of one with a sensor that runs away,
    which is no effect of the library; of one as told; of one with a sensor in mm."""
    sound = recorded("imposed", seconds=3.5)
    wander = 1.5e-3 * sound.time**2
    structure = sound.column("/sensor", "structure_lvdt") + wander
    travel = 1e3 * sound.column("/sensor", "suspension_lvdt")
    return {
        "explained": answer(recorded("imposed", ("coulomb@rail=75",), 3.5)),
        "unknown": answer(replace_sensors(sound, structure_lvdt=structure)),
        "no gap": answer(sound),
        "unusable": answer(replace_sensors(sound, suspension_lvdt=travel)),
    }


@pytest.fixture
def explained(outcomes) -> Diagnosis:
    return outcomes["explained"]


def test_the_document_has_every_field(explained):
    document = json.loads(json.dumps(explained.document()))
    assert document["verdict"] == "explained"
    (effect,) = document["effects"]
    fields = {
        "component",
        "kind",
        "parameters",
        "confidence",
        "class",
        "share",
        "support",
        "rivals",
    }
    assert set(effect) == fields
    assert set(effect["parameters"]["coulomb"]) == {"value", "low", "high", "nominal", "unit"}
    assert effect["class"][0] == {"component": "rail", "kind": "coulomb"}
    assert set(document["where"][0]) >= {"component", "share", "band_hz", "region"}
    assert set(document["gap"]) >= {
        "before",
        "after",
        "floor",
        "shrinkage_predicted",
        "shrinkage_held_out",
    }
    assert set(document["gap"]["shrinkage_held_out"]) == {"value", "low", "high"}
    assert {"next_test", "not_observable", "seconds"} <= set(document)


def test_the_corrected_twin_is_one_that_run_and_compare_take(explained, tmp_path):
    path = tmp_path / "twin.toml"
    path.write_text(toml(explained))
    assert with_changes(Configuration(), path).plant == explained.corrected.plant
    assert "coulomb = " in toml(explained)


def test_a_corrected_twin_says_how_sure_it_is(explained, tmp_path):
    path = tmp_path / "twin.toml"
    path.write_text(toml(explained))
    posterior = load_posterior(path)
    (effect,) = explained.effects
    estimate = effect.parameters["coulomb"]
    assert posterior.intervals == {"rail.coulomb": (estimate.low, estimate.high)}
    assert posterior.probability == effect.confidence
    assert posterior.at_best(Configuration()).plant == explained.corrected.plant
    for other in posterior.alternatives:
        assert other.effect != "coulomb@rail"
        assert 0.01 <= other.probability <= 1.0 - posterior.probability + 0.05
        assert override(Configuration(), other.changes).plant != Configuration().plant


def test_what_has_no_name_is_not_named_but_placed(outcomes):
    found = outcomes["unknown"]
    assert found.verdict == "unknown"
    assert not found.effects
    place = found.where[0]
    assert place.component == "structure_lvdt"
    assert place.region == "growing with time"
    assert "time" in place.evidence


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_page_says_the_answer_first(outcomes, verdict):
    outcome = outcomes[verdict]
    assert outcome.verdict == verdict
    page = html(outcome)
    assert (
        page.index(f">{verdict}<") < page.index("<h1>") < page.index("The rig from ground cylinder")
    )
    written = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"(src|href)=\"(?!data:)", written)
    assert not re.search(r"<script[^>]*\ssrc=", page)
    assert len(page.encode()) < 5e6


def test_the_guilty_component_is_marked(outcomes):
    page = html(outcomes["explained"])
    marked = re.findall(r'<g class="guilty"><title>([^<]*)', page)
    assert marked == ["rail"]
    assert 'class="guilty"' not in html(outcomes["no gap"])


def test_bars_are_of_every_replay_and_on_one_scale(outcomes):
    found = bars(outcomes["explained"].answer)
    assert found[0].name == "all sensors"
    assert len(found) >= 5
    assert max(max(bar.before_width, bar.after_width) for bar in found) == pytest.approx(100.0)
    assert not bars(outcomes["unusable"].answer)


def test_every_sensor_is_overlaid_and_every_effect_has_its_picture(outcomes):
    found = outcomes["explained"]
    assert {each.sensor for each in found.overlays()} == set(found.evidence.names)
    (picture,) = found.pictures()
    assert (picture.effect, picture.form) == ("coulomb@rail", "velocity")
    page = html(found)
    assert all(each.sensor.replace("_", " ") in page for each in found.overlays())
    assert page.count("<figure") == 1 + len(found.overlays())
    assert picture.caption in page
    assert "<figure" not in html(outcomes["unusable"])
    assert outcomes["unusable"].overlays() == outcomes["unusable"].pictures() == ()


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_document_keeps_to_its_schema(outcomes, verdict):
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    document = json.loads(json.dumps(outcomes[verdict].document()))
    jsonschema.validate(document, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(document | {"verdict": "perhaps"}, schema)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_no_explanation_is_ranked_twice(outcomes, verdict):
    names = [frozenset(name.split(" + ")) for name, _ in outcomes[verdict].answer.ranking]
    assert len(set(names)) == len(names)


def test_the_page_says_what_to_do_next_before_any_evidence(outcomes):
    for outcome in outcomes.values():
        page = html(outcome)
        assert page.index("<h1>") < page.index("What to do next") < page.index("What was checked")
    found = html(outcomes["explained"])
    assert found.index("What to do next") < found.index(">Evidence<")
    assert "--save-twin twin.toml</code>" in found


def test_names_from_files_cannot_write_the_page(outcomes):
    outcome = outcomes["no gap"]
    hostile = replace(outcome, answer=replace(outcome.answer, notes=("<script>alert(1)</script>",)))
    assert "<script>alert" not in html(hostile)


@pytest.mark.skipif(BROWSER is None, reason="no chromium")
@pytest.mark.parametrize(
    ("verdict", "width"),
    [
        ("explained", 1280),
        *((verdict, 390) for verdict in VERDICTS),
    ],
)
def test_a_browser_shows_it_without_errors_requests_or_sideways_scrolling(
    outcomes, verdict, width, tmp_path: Path
):
    result = looked_at(html(outcomes[verdict]), width, tmp_path)
    assert result["wide"] <= width
    assert result["first"] < 500
    assert result["small"] == 0
    assert result["serious"] == []
    drawn = 0 if verdict == "unusable" else 4 + len(outcomes[verdict].effects)
    assert result["drawn"] == drawn


def overlay_of(name: str, nominal: float, left: float, held_out: bool = True) -> Overlay:
    """A sine of which a twin predicts shares."""
    time = np.arange(400) * 0.01
    measured = np.sin(5.0 * time)
    return Overlay(
        recording=name,
        held_out=held_out,
        sensor="load_cell",
        kind="force",
        unit="N",
        time=time,
        measured=measured,
        nominal=nominal * measured,
        corrected=(1.0 - left) * measured,
        counts=np.ones(400),
        noise=1e-3,
    )


def test_the_top_says_how_good_the_twin_is_and_where_it_is_not():
    good = [overlay_of("a", 0.5, 0.1), overlay_of("b", 0.6, 0.12), overlay_of("c", 0.5, 0.1)]
    said = headlines([*good, overlay_of("fitted", 0.0, 0.9, held_out=False)], corrected=True)
    assert len(said) == 1
    assert "not fitted, in percent of the signal's standard deviation: 4" in said[0]
    assert "before, 1" in said[0]
    said = headlines([*good, overlay_of("fast", 0.5, 0.6)], corrected=True)
    assert said[1].startswith("In fast the residual of the load cell is 6")
    assert "do not rely on the corrected twin in such tests" in said[1]
    # What noise makes of a small signal is no fault of the twin.
    noisy = replace(overlay_of("quiet", 0.5, 0.3), noise=0.3)
    assert len(headlines([*good, noisy], corrected=True)) == 1
    assert len(headlines([overlay_of("alone", 0.5, 0.3)], corrected=True)) == 1
    (said,) = headlines([overlay_of("a", 0.001, 0.5)], corrected=False)
    assert "predicts almost nothing" in said
    assert not headlines([], corrected=True)
