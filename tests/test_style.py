"""Figures for a screen and for papers."""

from __future__ import annotations

import re

import matplotlib as mpl
import pytest

import rigtwin
from rigtwin.cli import main
from rigtwin.render.style import STYLES, find_style


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("style") / "drop.mcap"
    settings = {"timing": {"duration": 2.0}}
    return rigtwin.run("suspension-rig", "drop", settings=settings, path=path)


@pytest.mark.parametrize("name", STYLES)
def test_a_figure_has_its_styles_width_and_leaves_no_trace(recording, tmp_path, name):
    before = dict(mpl.rcParams)
    out = recording.plot(tmp_path / "figure.pdf", style=name)
    assert dict(mpl.rcParams) == before
    (box,) = re.findall(rb"/MediaBox \[ 0 0 ([0-9.]+) ([0-9.]+) \]", out.read_bytes())
    assert float(box[0]) == pytest.approx(72.0 * find_style(name).width, abs=1.0)


def test_text_of_a_papers_figure_stays_text(recording, tmp_path):
    drawn = recording.plot(
        tmp_path / "f.svg", style="paper", panels=["wheel", "ground"]
    ).read_text()
    titles = re.findall(r">(wheel, mm|ground, mm|time, s|suspension travel, mm)<", drawn)
    assert sorted(titles) == ["ground, mm", "time, s", "wheel, mm"]
    assert drawn.index(">wheel, mm<") < drawn.index(">ground, mm<")
    assert recording.path.name not in drawn


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--style", "papers"], "unknown style 'papers'; expected screen, paper, paper-wide"),
        (["--panel", "tyre"], "no panel 'tyre'; expected one of 'ground, mm'"),
    ],
)
def test_what_there_is_not_is_said(recording, tmp_path, capsys, arguments, said):
    assert main(["plot", str(recording.path), "-o", str(tmp_path / "f.png"), *arguments]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
