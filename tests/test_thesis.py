"""Comparison and coverage of the thesis' results, and stored results of finished jobs."""

from __future__ import annotations

import json

import numpy as np
import pytest
from matplotlib.image import imread

from experiments.thesis import quarter_car_tests, validation
from experiments.thesis.actuator_tests import (
    ELECTRIC,
    FITTED,
    fit_transfer_function,
    thesis_cylinder,
    thesis_force_loop,
)
from experiments.thesis.catalogue import (
    NOTHING_TO_COMPUTE,
    STUDIES,
    TABLES,
    covers_figure,
    select_studies,
)
from experiments.thesis.entry import (
    band,
    count_agreeing,
    digits,
    factor,
    last_digit,
    number,
    statement,
)
from experiments.thesis.reproduction import Chapter, agreement_by_table, document, page, text
from experiments.thesis.study import Conclusion, Drawing, ThesisStudy, sheet
from experiments.thesis.work import run_studies
from rigtwin.cli import main
from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep.workers import SerialExecutor


@pytest.mark.parametrize(
    ("printed", "value", "agrees"),
    [
        ("-98.06", -98.0642, True),
        ("-98.06", -98.07, False),
        ("50", 50.4, True),
        ("50", 51.0, False),
        ("-1.7e-5", -1.72e-5, True),
        ("-1.7e-5", -1.72e-3, False),
        ("0.072", 0.0721, True),
        ("0", 0.6, False),
    ],
)
def test_printed_digits(printed, value, agrees):
    assert digits("Table 1.1", "x", printed, value).agrees is agrees


def test_a_printed_number_has_a_value_and_a_last_digit():
    assert number("−0.5") == -0.5
    assert last_digit("4.716e4") == pytest.approx(10.0)
    assert last_digit("0.00850") == pytest.approx(1e-5)


def test_factor_and_band():
    values = np.linspace(0.9, 1.3, 41)
    assert factor("T", "x", "1.5", values, "m", 1.4).agrees
    assert not factor("T", "x", "1.7", values, "m", 1.4).agrees
    assert not factor("T", "x", "0.7", values, "m", 1.4).agrees
    assert "in 5-95 %" in band("T", "x", "1.25", values, "m", 2.0).rule
    assert "outside 5-95 %" in band("T", "x", "1.40", values, "m", 2.0).rule
    assert (
        count_agreeing(
            [statement("T", "x", "says", True, ""), statement("T", "x", "says", False, "")]
        )
        == "1 of 2"
    )


def test_every_numbered_table_is_covered():
    covered = {place for study in STUDIES.values() for place in study.covers}
    assert [
        table for table in TABLES if table not in covered and table not in NOTHING_TO_COMPUTE
    ] == []
    assert len(TABLES) == 51


def test_studies_are_selected_by_name_chapter_or_table():
    assert len(select_studies(None).studies) == len(STUDIES)
    assert [study.name for study in select_studies("skyhook").studies] == ["skyhook"]
    assert [study.name for study in select_studies("chapter 7").studies] == ["skyhook", "beams"]
    assert select_studies("B").studies == select_studies("7").studies
    for study in STUDIES.values():
        for place in study.covers:
            found = select_studies(place.replace(" ", "-").lower())
            assert found.where == place
            assert study in found.studies or place in found.studies[0].covers
    with pytest.raises(RigtwinError, match=r"nothing to reproduce under 'table 9\.9'"):
        select_studies("table 9.9")


def test_a_drawing_covers_the_figures_of_its_range():
    assert covers_figure("Figure 3.11 to 3.14", "Figure 3.12")
    assert not covers_figure("Figure 3.11 to 3.14", "Figure 3.15")
    assert covers_figure("Figure 7.7 to 7.9, B1.1 to B2.6", "Figure B1.1")
    assert covers_figure("Table 4.1 and 4.2", "Table 4.2")
    assert not covers_figure("Table 4.1 and 4.2", "Figure 4.2")


def counting(fails: set[str], monkeypatch: pytest.MonkeyPatch) -> tuple[ThesisStudy, list[str]]:
    ran: list[str] = []

    def job(key: str):
        def work():
            ran.append(key)
            if key in fails:
                raise RigtwinError(f"{key} failed")
            return {"value": float(len(key)), "curve": np.arange(3.0)}

        return work

    def conclude(results):
        figure, _ = sheet(1, 1)
        drawing = Drawing("d", "Figure 1.1", "a caption", figure)
        total = sum(result["value"] for result in results.values())
        return Conclusion(
            [digits("Table 3.1", "total", "15", total, "m", "a note")], [drawing], ["a remark"]
        )

    jobs = lambda seeds: {f"job/{n}": job(f"job/{n}") for n in range(seeds)}  # noqa: E731
    study = ThesisStudy("counted", "Counted", "9", ("Table 3.1",), conclude, jobs)
    monkeypatch.setitem(STUDIES, "counted", study)
    return study, ran


def test_finished_jobs_are_not_run_again(tmp_path, monkeypatch):
    study, ran = counting(set(), monkeypatch)
    steps: list[tuple[int, int]] = []
    first = run_studies(
        [study], 3, tmp_path, SerialExecutor(), lambda count, total: steps.append((count, total))
    )
    assert sorted(ran) == ["job/0", "job/1", "job/2"]
    assert steps[0] == (0, 3)
    assert steps[-1] == (3, 3)
    again = run_studies([study], 4, tmp_path, SerialExecutor())
    assert sorted(ran) == ["job/0", "job/1", "job/2", "job/3"]
    assert np.array_equal(again["counted"]["job/1"]["curve"], first["counted"]["job/1"]["curve"])


def test_an_interrupted_run_resumes(tmp_path, monkeypatch):
    study, ran = counting({"job/2"}, monkeypatch)
    with pytest.raises(RigtwinError, match="job/2 failed"):
        run_studies([study], 3, tmp_path, SerialExecutor())
    assert ran == ["job/0", "job/1", "job/2"]
    whole, ran = counting(set(), monkeypatch)
    assert len(run_studies([whole], 3, tmp_path, SerialExecutor())["counted"]) == 3
    assert ran == ["job/2"]


def test_text_document_and_page_agree(tmp_path, monkeypatch):
    study, _ = counting(set(), monkeypatch)
    results = run_studies([study], 3, tmp_path, SerialExecutor())
    chapters = [Chapter(study, study.conclude(results["counted"]))]
    plain = text(chapters, every=True)
    assert "1 of 1 entries agree" in plain
    assert "[1] a note" in plain
    assert "Table 2.1" in plain
    found = json.loads(json.dumps(document(chapters, every=False)))
    assert found["studies"][0]["entries"][0]["agrees"] is True
    assert [one["table"] for one in found["tables"]] == ["Table 3.1"]
    html = page(chapters, every=False)
    assert "a caption" in html
    assert "data:image/png;base64," in html
    assert "http" not in html.replace("http-equiv", "")
    assert [
        one.agree for one in agreement_by_table(chapters[0].conclusion.entries, every=False)
    ] == ["1 of 1"]


def test_a_fit_recovers_a_transfer_function():
    frequencies = np.arange(1.0, FITTED + 1.0)
    above, below = fit_transfer_function(
        frequencies, thesis_cylinder(frequencies) * 6.243e5 / 6.281e5, 2, 4
    )
    assert above == pytest.approx([1817, 7.719e4, 6.243e5], rel=1e-6)
    assert below == pytest.approx([1, 165.9, 6674, 8.598e4, 6.281e5], rel=1e-6)
    above, below = fit_transfer_function(frequencies, thesis_force_loop(frequencies), 2, 2)
    assert above == pytest.approx([float(one) for one in ELECTRIC[0]], rel=1e-6)


@pytest.mark.slow
def test_a_study_from_end_to_end(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out = [
        "--html",
        str(tmp_path / "p.html"),
        "--json",
        str(tmp_path / "p.json"),
        "--draw",
        str(tmp_path / "figures"),
    ]
    kept = ["--seeds", "1", "--workers", "1", "--folder", str(tmp_path / "kept")]
    assert main(["reproduce", "table-3.5", *kept, *out]) == 0
    printed = capsys.readouterr().out
    assert "Table 3.5" in printed
    assert "12 of 12" in printed
    assert "Table 3.4" not in printed
    assert json.loads((tmp_path / "p.json").read_text())["tables"][0]["agree"] == "12 of 12"
    drawn = [*kept, "--draw", str(tmp_path / "f")]
    assert main(["reproduce", "figure-3.18", *drawn]) == 0
    (picture,) = (tmp_path / "f").iterdir()
    assert imread(picture).std() > 0.05


@pytest.mark.slow
def test_the_twin_shows_the_statements_about_the_drop():
    """Statements of section 6.3 that the twin shows, of one run each."""
    results = {key: job() for key, job in quarter_car_tests.jobs(1).items()}
    entries = {
        (entry.where, entry.what): entry for entry in quarter_car_tests.conclude(results).entries
    }
    for where, what in (
        ("Figure 6.25", "first swing of the sprung mass"),
        ("Figure 6.25", "body frequency"),
        ("Figure 6.26", "lag of 20 ms on force, or on position"),
        ("Figure 6.26", "lag of 50 ms on the damping force alone"),
        ("Figure 6.30", "force at rest"),
        ("Figure 6.29", "wheel hop after the drop"),
        ("Figure 6.33", "1000 Ns/m at the wheel"),
        ("Figure 6.47", "wheel on the 10 Hz road"),
    ):
        assert entries[where, what].agrees, (where, what, entries[where, what].ours)
    assert entries["Table 6.3", "force e1 + e2"].agrees
    assert (
        not entries["Table 6.3", "position e1 + e2"].agrees
        or "offset" in entries["Table 6.3", "position e1 + e2"].note
    )
    assert validation.WITHIN == 2.0
