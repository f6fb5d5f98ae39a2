"""Text of the gallery's page: agreement of the tables, and captions without repetition."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import pairwise

_NUMBERED = re.compile(r"(Figure|Table) ([A-Z]?\d+\.)(\d+)$")


def shorten_names(names: Sequence[str]) -> str:
    """Return names of figures or tables as one phrase, such as `Figures A1.1 to A1.5`.

    Parameters
    ----------
    names
        Names in the order of the thesis, such as `Figure A1.1`.
    """
    numbers = [_NUMBERED.match(name) for name in names]
    if len(names) < 2 or not all(numbers):
        return ", ".join(names)
    kind, *labels = [names[0].split()[0]] + [name.split()[1] for name in names]
    runs = [[labels[0]]]
    for before, now in pairwise(labels):
        if _is_next(before, now):
            runs[-1].append(now)
        else:
            runs.append([now])
    parts = [f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs]
    return f"{kind}s {', '.join(parts)}"


def _is_next(before: str, now: str) -> bool:
    head, _, number = before.rpartition(".")
    next_head, _, next_number = now.rpartition(".")
    return head == next_head and int(next_number) == int(number) + 1


def shared_sentences(captions: Sequence[str]) -> list[str]:
    """Return the sentences that stand in all of several captions, in their order."""
    if len(captions) < 2:
        return []
    return [
        sentence
        for sentence in _sentences(captions[0])
        if all(sentence in _sentences(caption) for caption in captions)
    ]


def without(caption: str, sentences: Iterable[str]) -> str:
    """Return a caption without some of its sentences."""
    left_out = set(sentences)
    return " ".join(one for one in _sentences(caption) if one not in left_out)


def _sentences(text: str) -> list[str]:
    return re.split(r"(?<=\.) (?=[A-Z])", text)


def agreement_lines(rows: Iterable[tuple[str, str, str]]) -> list[str]:
    """Return the tables that agree as a sentence, and a Markdown table of the others by reason.

    Parameters
    ----------
    rows
        Name, agreement such as `3 of 4`, and reasons of each table; no reasons if all agrees.
    """
    groups: dict[str, list[tuple[str, str]]] = {}
    for name, agree, why in rows:
        # A bar would end the cell of a Markdown table.
        groups.setdefault(why.replace("|", "/"), []).append((name, agree))
    whole = groups.pop("", [])
    lines = [f"All entries agree of {shorten_names([name for name, _ in whole])}.", ""]
    lines += ["| table | entries that agree | why the others do not |", "|---|---|---|"]
    for why, members in groups.items():
        counts = [agree for _, agree in members]
        same = len(counts) > 1 and len(set(counts)) == 1
        agreement = f"{counts[0]} each" if same else ", ".join(counts)
        lines.append(f"| {shorten_names([name for name, _ in members])} | {agreement} | {why} |")
    return lines if whole else lines[2:]
