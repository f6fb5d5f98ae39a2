"""Positions that a log holds as counts of an encoder."""

from __future__ import annotations

import re

from rigtwin.describing.heading import split_words
from rigtwin.describing.quantity import COUNTS
from rigtwin.describing.question import ask, option
from rigtwin.describing.units import Unit
from rigtwin.importing.columns import Columns

_PER_TURN = re.compile(
    r"(\d+)\s*(?:(?:counts?|ticks?|pulses?)\s*(?:/|per|an?|each)\s*(?:rev|turn|rotation)|cpr\b)"
    r"|(?:cpr|(?:counts?|ticks?|pulses?)\s*(?:/|per|an?)\s*(?:revolution|rev|turn|rotation))"
    r"\s*[=:]\s*(\d+)",
    re.IGNORECASE,
)
"""Counts of a turn, as in "2048 counts/rev", "CPR = 4096" and "8192 ticks per turn"."""


def count_unit(columns: Columns, column: str, turns: bool, key: str) -> Unit | None:
    """Return the unit of a position in counts; None where it is not in counts.

    Parameters
    ----------
    columns
        Columns of the log.
    column
        Column of the position.
    turns
        Whether the joint is a hinge.
    key
        Name of the quantity, for a question.

    Raises
    ------
    Question
        If the log does not say how many counts make a turn, or says it of several encoders.
    """
    written = split_words(columns.units.get(column, ""))
    if not COUNTS & {*written, *split_words(column)}:
        return None
    per_turn = {int(a or b) for line in columns.remarks for a, b in _PER_TURN.findall(line)}
    if turns and len(per_turn) == 1 and (count := per_turn.pop()):
        return Unit("rev", f"{count} counts a turn, as the log says above its data", 1.0 / count)
    what = "how many of them make a turn" if turns else "how many metres is one of them"
    factor = f"6.283185 / NUMBER * {column}" if turns else f"METRES * {column}"
    raise ask(f"column {column!r} is in counts; {what}?", option(key, factor))
