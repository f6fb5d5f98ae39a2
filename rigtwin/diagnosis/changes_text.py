"""What changed between recordings, in words: a sentence, and a compact table for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rigtwin.diagnosis.change import Changes, Parameter
from rigtwin.diagnosis.finding import Interval

SAID = {"same": "the same", "changed": "changed", "cannot tell": "cannot tell"}


def describe_changes(changes: Changes) -> str:
    """The sentence, a row for each parameter, and what nobody can tell.

    Parameters
    ----------
    changes
        What was found.

    Returns
    -------
    str
        Lines.
    """
    names = [Path(each).name for each in changes.recordings]
    rows = [("parameter", "unit", *names, "", "p")]
    for each in changes.parameters:
        values = [_value(own) for own in each.values] or ["-"] * len(names)
        chance = f"{each.probability:.2g}" if each.values else "-"
        rows.append(
            (f"{each.name} {each.parameter}", each.unit, *values, SAID[each.verdict], chance)
        )
    lines = [changes.sentence]
    if changes.parameters:
        lines += [f"  {line}" for line in _aligned(rows)]
        lines.append("  each with its 95 % interval; p: of such differences if nothing changed")
    for name, zeros in changes.zeros.items():
        values = ", ".join(f"{value:+.3g}" for value in zeros)
        lines.append(f"  zero of {name}: {values} off the mean, which is no change of the machine")
    for each in changes.changed:
        for trend in each.trends:
            lines.append(
                f"  {each.name} with {trend.name}: explains {100 * trend.explains:.0f} % of the "
                f"differences, {trend.slope:.3g} per unit"
            )
    if changes.unseen:
        names = ", ".join(map(str, changes.unseen))
        lines.append(f"  cannot tell from these whether it changed: {names}")
    lines.append(f"  {changes.tested} parameters tested, {changes.seconds:.1f} s")
    return "\n".join(lines)


def _value(own: Interval) -> str:
    return f"{own.value:.4g} ± {0.5 * (own.high - own.low):.2g}"


def _aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def change_sentence(parameters: Sequence[Parameter]) -> str:
    """What changed, in one sentence."""
    changed = [each for each in parameters if each.verdict == "changed"]
    if not changed:
        untold = [each for each in parameters if each.verdict == "cannot tell"]
        but = f"; of {len(untold)} that are named these cannot tell" if untold else ""
        return f"No change: one value of every parameter does for all recordings{but}."
    parts = []
    for each in changed:
        values = " to ".join(
            f"{value:.4g}" for value in (each.values[0].value, each.values[-1].value)
        )
        unit = "" if each.unit == "1" else f" {each.unit}"
        others = f", or else {', '.join(map(str, each.instead))}" if each.instead else ""
        parts.append(f"{each.name} ({each.parameter} {values}{unit}{others}){_goes_with(each)}")
    return f"Not the same in all recordings: {'; '.join(parts)}."


def _goes_with(each: Parameter) -> str:
    if not each.trends:
        return ", with nothing that was recorded" if len(each.values) > 2 else ""
    if each.named:
        return f", it goes with {each.trends[0].name}"
    return f", with {' or '.join(trend.name for trend in each.trends)}: these cannot tell which"
