"""What came out of reproducing the thesis, as text, JSON, one HTML file, or a gallery page with its
pictures."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from experiments.thesis.catalogue import NOTHING_TO_COMPUTE, TABLES, Asked, matching
from experiments.thesis.entry import Entry, share
from experiments.thesis.study import Conclusion, Drawing, Study
from rigtwin import __version__
from rigtwin.console import table
from rigtwin.errors import RigtwinError


@dataclass(frozen=True)
class Chapter:
    """One study and what it found, cut down to what was asked for."""

    study: Study
    conclusion: Conclusion

    def groups(self) -> dict[str, list[Entry]]:
        """Entries by where they stand in the thesis, in its order."""
        found: dict[str, list[Entry]] = {}
        for entry in self.conclusion.entries:
            found.setdefault(entry.where, []).append(entry)
        return found


@dataclass(frozen=True)
class Share:
    """Of one table: how many of its entries agree; why: of those that do not, each reason once."""

    table: str
    agree: str
    whole: bool
    why: str


def cut(study: Study, conclusion: Conclusion, wanted: Asked) -> Chapter:
    """A study's conclusion with only the entries and drawings asked for."""
    if wanted.where is None:
        return Chapter(study, conclusion)
    where = wanted.where
    entries = [entry for entry in conclusion.entries if entry.where == where]
    drawings = [drawing for drawing in conclusion.drawings if matching(drawing.covers, where)]
    return Chapter(study, Conclusion(entries, drawings, conclusion.remarks))


def shares(entries: Sequence[Entry], every: bool) -> list[Share]:
    """For each table with entries, and with `every` for each table of the thesis, how many of its
    entries agree."""
    found = []
    for name in TABLES:
        own = [entry for entry in entries if entry.where == name]
        if own:
            reasons = dict.fromkeys(entry.note or entry.what for entry in own if not entry.agrees)
            found.append(
                Share(name, share(own), all(entry.agrees for entry in own), "; ".join(reasons))
            )
        elif every:
            found.append(
                Share(
                    name, "-", name in NOTHING_TO_COMPUTE, NOTHING_TO_COMPUTE.get(name, "no entry")
                )
            )
    return found


def text(chapters: Sequence[Chapter], every: bool) -> str:
    """Everything as plain text."""
    blocks = []
    for chapter in chapters:
        blocks.append(f"{chapter.study.title} (chapter {chapter.study.chapter})")
        for where, entries in chapter.groups().items():
            rows: list[tuple[str, ...]] = [
                (where, "thesis", "ours", "difference", "unit", share(entries), "by")
            ]
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
        for one in shares(entries, every)
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
        blocks.append(f"in all {share(entries)} entries agree")
    return "\n\n".join(blocks)


def document(chapters: Sequence[Chapter], every: bool) -> dict[str, object]:
    """Everything for other programs."""
    entries = [entry for chapter in chapters for entry in chapter.conclusion.entries]
    return {
        "version": __version__,
        "tables": [asdict(one) for one in shares(entries, every)],
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


def _png(drawing: Drawing, dots_per_inch: int) -> bytes:
    stream = io.BytesIO()
    drawing.figure.savefig(stream, format="png", dpi=dots_per_inch)
    return stream.getvalue()


def page(chapters: Sequence[Chapter], every: bool) -> str:
    """Everything as one HTML file: no network, no script."""
    environment = Environment(
        loader=PackageLoader("experiments.thesis"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    entries = [entry for chapter in chapters for entry in chapter.conclusion.entries]
    pictures = {
        drawing.name: base64.b64encode(_png(drawing, 75)).decode()
        for chapter in chapters
        for drawing in chapter.conclusion.drawings
    }
    return environment.get_template("reproduction.html").render(
        chapters=chapters,
        shares=shares(entries, every),
        share=share,
        total=share(entries),
        pictures=pictures,
        version=__version__,
    )


def gallery(chapters: Sequence[Chapter], folder: Path, every: bool) -> Path:
    """Writes gallery.md and its pictures into a folder. Raises RigtwinError if it cannot."""
    lines = ["# The thesis reproduced", ""]
    lines += [
        "Made by `make gallery`. Every figure is of the nominal twin or "
        "in closed form. Nothing is tuned to the thesis but"
    ]
    lines += [
        "the gains of the force loop of Tables 4.1 and 4.2, "
        "which are found from the first row alone."
    ]
    lines += [
        "",
        "Videos: [drop](gallery/drop.mp4), [road](gallery/road10.mp4), [beams](gallery/beams.mp4).",
        "",
    ]
    entries = [entry for chapter in chapters for entry in chapter.conclusion.entries]
    lines += ["| table | entries that agree | why the others do not |", "|---|---|---|"]
    lines += [
        f"| {one.table} | {one.agree} | {one.why.replace('|', '/')} |"
        for one in shares(entries, every)
    ]
    lines += [
        "",
        f"In all {share(entries)} entries agree, statements of the text and figures included.",
        "",
    ]
    pictures = folder / "gallery"
    try:
        pictures.mkdir(parents=True, exist_ok=True)
        for chapter in chapters:
            lines += [f"## {chapter.study.title}", ""]
            for drawing in chapter.conclusion.drawings:
                name = f"{chapter.study.name}-{drawing.name}.png"
                (pictures / name).write_bytes(_png(drawing, 70))
                lines += [
                    f"**{drawing.covers}.** {drawing.caption}",
                    "",
                    f"![{drawing.covers}](gallery/{name})",
                    "",
                ]
        out = folder / "gallery.md"
        out.write_text("\n".join(lines), encoding="utf-8")
    except OSError as error:
        raise RigtwinError(f"cannot write {folder}: {error.strerror}") from None
    return out
