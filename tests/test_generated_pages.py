"""Text of the pages that programs write: the gallery of the thesis, and the table of faults."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from experiments.thesis.gallery_text import agreement_lines, picture_lines, shorten_names
from rigtwin.cli.faults import _page_rows
from rigtwin.hardware.faults.kinds import KINDS


@pytest.mark.parametrize(
    ("names", "short"),
    [
        (["Table 2.1"], "Table 2.1"),
        (["Table 4.1", "Table 4.2"], "Tables 4.1, 4.2"),
        (["Table 5.3", "Table 5.4", "Table 5.5", "Table 5.7"], "Tables 5.3 to 5.5, 5.7"),
        (["Figure A1.8", "Figure A1.9", "Figure A1.10"], "Figures A1.8 to A1.10"),
        (["Table A1.3", "Table A2.1"], "Tables A1.3, A2.1"),
        (["Figure 3.11 to 3.14"], "Figure 3.11 to 3.14"),
        (["Figure 6.3", "Table 6.4"], "Figure 6.3, Table 6.4"),
    ],
)
def test_names_become_one_phrase(names: list[str], short: str) -> None:
    assert shorten_names(names) == short


def test_tables_stand_with_those_of_the_same_reason() -> None:
    rows = [
        ("Table 3.1", "6 of 6", ""),
        ("Table A1.4", "0 of 1", "a | misprint; and more"),
        ("Table A1.5", "0 of 1", "a | misprint"),
        ("Table B1.1", "0 of 4", "friction"),
        ("Table B2.1", "1 of 4", "friction"),
    ]
    assert agreement_lines(rows) == [
        "All entries of Table 3.1 agree.",
        "",
        "| table | entries that agree | why the others do not |",
        "|---|---|---|",
        "| Tables A1.4, A1.5 | 0 of 1 each | a / misprint |",
        "| Tables B1.1, B2.1 | 0 of 4, 1 of 4 | friction |",
    ]


def test_a_study_shows_its_first_picture_and_links_the_others() -> None:
    pictures = [
        ("Figure 5.4", "The critical lag, b/k. Grey: the ideal mass.", "a.png"),
        ("Figure 5.6", "Bode plot.", "b.png"),
        ("Figures 5.7, 5.8", "Root loci.", "c.png"),
        ("Table 5.1", "Poles.", "d.png"),
    ]
    assert picture_lines(pictures) == [
        "**Figure 5.4.** The critical lag, b/k.",
        "",
        "![Figure 5.4](gallery/a.png)",
        "",
        "Also [Figure 5.6](gallery/b.png), [5.7, 5.8](gallery/c.png), [Table 5.1](gallery/d.png).",
        "",
    ]


def test_faults_of_a_place_share_a_row_with_their_worst() -> None:
    dropout, stuck = KINDS[:2]
    card = next(kind for kind in KINDS if kind.place == "card")
    seen = SimpleNamespace(late=2, exceeded=0.5)
    unseen = SimpleNamespace(late=None, exceeded=0.7)
    early = SimpleNamespace(late=-1, exceeded=0.1)
    rows = _page_rows({dropout: [seen, unseen], stuck: [early], card: []})  # pyright: ignore[reportArgumentType]
    assert rows == [
        (
            "sensor",
            "dropout: reads 0 V from then on; stuck: repeats its last reading",
            "2 of 3",
            "1",
            "2",
            "70 %",
        )
    ]
