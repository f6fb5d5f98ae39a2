"""Reports of the reproduced thesis: text, JSON, one HTML file, or a gallery with pictures."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from experiments.thesis.catalogue import NOTHING_TO_COMPUTE, TABLES, ThesisSelection, covers_figure
from experiments.thesis.entry import Entry, count_agreeing
from experiments.thesis.gallery_text import agreement_lines, picture_lines, shorten_names
from experiments.thesis.study import Conclusion, Drawing, ThesisStudy
from rigtwin import __version__
from rigtwin.console import table
from rigtwin.errors import RigtwinError


@dataclass(frozen=True)
class Chapter:
    """One study and its conclusion, restricted to the requested part."""

    study: ThesisStudy
    conclusion: Conclusion

    def groups(self) -> dict[str, list[Entry]]:
        """Return the entries by their place in the thesis, in the order of the study."""
        groups: dict[str, list[Entry]] = {}
        for entry in self.conclusion.entries:
            groups.setdefault(entry.where, []).append(entry)
        return groups


@dataclass(frozen=True)
class TableAgreement:
    """Agreement of one table.

    Attributes
    ----------
    table : str
        Name of the table.
    agree : str
        Number of entries that agree, such as `7 of 8`.
    whole : bool
        Whether all entries agree.
    why : str
        Distinct reasons of the entries that do not agree.
    """

    table: str
    agree: str
    whole: bool
    why: str


def restrict(study: ThesisStudy, conclusion: Conclusion, wanted: ThesisSelection) -> Chapter:
    """Return a study with only the requested entries and drawings."""
    if wanted.where is None:
        return Chapter(study, conclusion)
    where = wanted.where
    entries = [entry for entry in conclusion.entries if entry.where == where]
    drawings = [drawing for drawing in conclusion.drawings if covers_figure(drawing.covers, where)]
    return Chapter(study, Conclusion(entries, drawings, conclusion.remarks))


def agreement_by_table(entries: Sequence[Entry], every: bool) -> list[TableAgreement]:
    """Return the agreement of each table that has entries.

    With `every`, tables of the thesis without entries are listed too.
    """
    tables = []
    for name in TABLES:
        entries_of_table = [entry for entry in entries if entry.where == name]
        if entries_of_table:
            # A dictionary keeps equal reasons once, in the order of the table.
            reasons = dict.fromkeys(
                entry.note or entry.what for entry in entries_of_table if not entry.agrees
            )
            tables.append(
                TableAgreement(
                    name,
                    count_agreeing(entries_of_table),
                    all(entry.agrees for entry in entries_of_table),
                    "; ".join(reasons),
                )
            )
        elif every:
            tables.append(
                TableAgreement(
                    name, "-", name in NOTHING_TO_COMPUTE, NOTHING_TO_COMPUTE.get(name, "no entry")
                )
            )
    return tables


def text(chapters: Sequence[Chapter], every: bool) -> str:
    """Return all chapters as plain text."""
    blocks = []
    for chapter in chapters:
        blocks.append(f"{chapter.study.title} (chapter {chapter.study.chapter})")
        for where, entries in chapter.groups().items():
            rows: list[tuple[str, ...]] = [
                (where, "thesis", "ours", "difference", "unit", count_agreeing(entries), "by")
            ]
            # Equal notes share a number, so a table prints each of them once.
            notes: dict[str, int] = {}
            for entry in entries:
                mark = "agrees" if entry.agrees else "differs"
                if entry.note:
                    mark += f" [{notes.setdefault(entry.note, len(notes) + 1)}]"
                rows.append(
                    (
                        f"  {entry.what}",
                        entry.thesis,
                        entry.ours,
                        entry.difference,
                        entry.unit,
                        mark,
                        entry.rule,
                    )
                )
            blocks.append(
                "\n".join(
                    [table(rows), *(f"  [{number}] {note}" for note, number in notes.items())]
                )
            )
        if chapter.conclusion.remarks:
            blocks.append("\n".join(f"* {remark}" for remark in chapter.conclusion.remarks))
    entries = [entry for chapter in chapters for entry in chapter.conclusion.entries]
    rows = [("table", "agree", "why not")]
    rows += [
        (one.table, one.agree, "" if one.whole and not one.why else one.why)
        for one in agreement_by_table(entries, every)
    ]
    if len(rows) > 1:
        blocks.append(
            table(
                [
                    (name, agree, why if len(why) < 120 else why[:117] + "...")
                    for name, agree, why in rows
                ]
            )
        )
    if entries:
        blocks.append(f"in all {count_agreeing(entries)} entries agree")
    return "\n\n".join(blocks)


def document(chapters: Sequence[Chapter], every: bool) -> dict[str, object]:
    """Return all chapters as a JSON document."""
    entries = [entry for chapter in chapters for entry in chapter.conclusion.entries]
    return {
        "version": __version__,
        "tables": [asdict(one) for one in agreement_by_table(entries, every)],
        "studies": [
            {
                "name": chapter.study.name,
                "title": chapter.study.title,
                "chapter": chapter.study.chapter,
                "entries": [asdict(entry) for entry in chapter.conclusion.entries],
                "remarks": list(chapter.conclusion.remarks),
                "figures": [
                    {"covers": one.covers, "caption": one.caption}
                    for one in chapter.conclusion.drawings
                ],
            }
            for chapter in chapters
        ],
    }


_GALLERY_HEAD = (
    "`make gallery` writes this page. Figures show the nominal twin or closed forms. "
    "Only the force loop's gains of Tables 4.1 and 4.2",
    "are tuned to the thesis, by the first row.",
    "",
    "Videos: [drop](gallery/drop.mp4), [road](gallery/road10.mp4), [beams](gallery/beams.mp4).",
)
"""First lines of the gallery's page."""


def _png(drawing: Drawing, dots_per_inch: int) -> bytes:
    """Return a drawing as PNG."""
    stream = io.BytesIO()
    drawing.figure.savefig(stream, format="png", dpi=dots_per_inch)
    return stream.getvalue()


def page(chapters: Sequence[Chapter], every: bool) -> str:
    """Return all chapters as one HTML file, without network access or scripts."""
    environment = Environment(
        loader=PackageLoader("experiments.thesis"),
        autoescape=True,
        # A name missing in the template is an error, not an empty cell.
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    entries = [entry for chapter in chapters for entry in chapter.conclusion.entries]
    # Pictures are embedded: the report is one file that can be mailed.
    pictures = {
        drawing.name: base64.b64encode(_png(drawing, 75)).decode()
        for chapter in chapters
        for drawing in chapter.conclusion.drawings
    }
    return environment.get_template("reproduction.html").render(
        chapters=chapters,
        shares=agreement_by_table(entries, every),
        share=count_agreeing,
        total=count_agreeing(entries),
        pictures=pictures,
        version=__version__,
    )


def gallery(chapters: Sequence[Chapter], folder: Path, every: bool) -> Path:
    """Write gallery.md and its pictures. Raises RigtwinError if writing fails."""
    entries = [entry for chapter in chapters for entry in chapter.conclusion.entries]
    lines = ["# The thesis reproduced", "", *_GALLERY_HEAD, ""]
    lines += [
        f"{count_agreeing(entries)} entries agree, statements and figures included; "
        "`rigtwin reproduce --html thesis.html` lists all.",
        "",
    ]
    lines += agreement_lines(
        (row.table, row.agree, row.why) for row in agreement_by_table(entries, every)
    )
    lines += [""]
    pictures = folder / "gallery"
    try:
        pictures.mkdir(parents=True, exist_ok=True)
        for chapter in chapters:
            drawings = chapter.conclusion.drawings
            if not drawings:
                continue
            title = chapter.study.title
            lines += [f"## {title[0].upper()}{title[1:]}", ""]
            shown = []
            for drawing in drawings:
                name = f"{chapter.study.name}-{drawing.name}.png"
                (pictures / name).write_bytes(_png(drawing, 70))
                shown.append((shorten_names(drawing.covers.split(", ")), drawing.caption, name))
            lines += picture_lines(shown)
        out = folder / "gallery.md"
        out.write_text("\n".join(lines), encoding="utf-8")
    except OSError as error:
        raise RigtwinError(f"cannot write {folder}: {error.strerror}") from None
    return out
