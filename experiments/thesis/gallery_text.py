"""Text of the gallery's page: agreement of the tables, a picture of each study, links to others."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import pairwise

_NUMBERED = re.compile(r"(Figure|Table) ([A-Z]?\d+\.)(\d+)$")


def shorten_names(names: Sequence[str]) -> str:
    """Return names of figures or tables as one phrase, such as `Figures A1.1 to A1.5`.

    Parameters
    ----------
    names : sequence of str
        Names in the order of the thesis, such as `Figure A1.1`.

    Returns
    -------
    str
        Phrase; names that have no number, or no common kind, are joined by commas.
    """
    kinds = {name.split()[0] for name in names if _NUMBERED.match(name)}
    if len(names) < 2 or len(kinds) != 1 or not all(map(_NUMBERED.match, names)):
        return ", ".join(names)
    labels = [name.split()[1] for name in names]
    runs = [[labels[0]]]
    for before, now in pairwise(labels):
        if _is_next(before, now):
            runs[-1].append(now)
        else:
            runs.append([now])
    parts = [f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs]
    return f"{kinds.pop()}s {', '.join(parts)}"


def _is_next(before: str, now: str) -> bool:
    head, _, number = before.rpartition(".")
    next_head, _, next_number = now.rpartition(".")
    return head == next_head and int(next_number) == int(number) + 1


def agreement_lines(rows: Iterable[tuple[str, str, str]]) -> list[str]:
    """Return the tables that agree as a sentence, and a table of the others by their first reason.

    Parameters
    ----------
    rows : iterable of tuple
        Name, agreement such as `3 of 4`, and reasons of each table; no reasons if all agrees.

    Returns
    -------
    list of str
        Lines of the page.
    """
    groups: dict[str, list[tuple[str, str]]] = {}
    for name, agree, why in rows:
        # A bar would end the cell of a Markdown table.
        first = why.partition("; ")[0].replace("|", "/")
        groups.setdefault(first, []).append((name, agree))
    whole = groups.pop("", [])
    lines = []
    if whole:
        lines += [f"All entries of {shorten_names([name for name, _ in whole])} agree.", ""]
    if groups:
        lines += ["| table | entries that agree | why the others do not |", "|---|---|---|"]
    for why, members in groups.items():
        counts = [agree for _, agree in members]
        same = len(counts) > 1 and len(set(counts)) == 1
        agreement = f"{counts[0]} each" if same else ", ".join(counts)
        lines.append(f"| {shorten_names([name for name, _ in members])} | {agreement} | {why} |")
    return lines


def _drop_repeated_kind(names: Sequence[str]) -> list[str]:
    """Return names without the word `Figure` or `Table` where the name before has the same one."""
    kinds = [name.partition(" ")[0].removesuffix("s") for name in names]
    return [
        name.partition(" ")[2] if kind == before and kind in ("Figure", "Table") else name
        for name, kind, before in zip(names, kinds, ["", *kinds], strict=False)
    ]


def picture_lines(pictures: Sequence[tuple[str, str, str]]) -> list[str]:
    """Return the first picture of a study with its caption's first sentence, and links to others.

    Parameters
    ----------
    pictures : sequence of tuple
        Figures that a picture covers, its caption, and its file in the folder `gallery`.

    Returns
    -------
    list of str
        Lines of the page.
    """
    covers, caption, file = pictures[0]
    sentence = re.split(r"(?<=\.) (?=[A-Z])", caption)[0]
    lines = [f"**{covers}.** {sentence}".rstrip(), "", f"![{covers}](gallery/{file})", ""]
    if len(pictures) > 1:
        names = _drop_repeated_kind([name for name, _, _ in pictures[1:]])
        files = [file for _, _, file in pictures[1:]]
        links = [f"[{name}](gallery/{file})" for name, file in zip(names, files, strict=True)]
        lines += [f"Also {', '.join(links)}.", ""]
    return lines
