"""Changes between recordings in words: one sentence, and a compact table for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rigtwin.diagnosis.change import Changes, ComparedParameter
from rigtwin.diagnosis.units import shorten, spell

ANSWERS = {"same": "the same", "changed": "changed", "cannot tell": "not determined"}
TABLE_NOTE = (
    "each value ± 2.5 standard errors (docs/confidence.md); "
    "p: probability of such differences if nothing changed"
)


def describe_changes(changes: Changes) -> str:
    """Write the sentence, a row for each parameter, and what the recordings do not determine.

    Parameters
    ----------
    changes
        Result of the comparison.

    Returns
    -------
    str
        Lines for a terminal. All values of a row have the unit of that row.
    """
    names = [Path(recording).name for recording in changes.recordings]
    rows = [("parameter", "unit", *names, "", "p")]
    rows += [_row(parameter, len(names)) for parameter in changes.parameters]
    lines = [changes.sentence]
    if changes.parameters:
        lines += [f"  {line}" for line in _align(rows)]
        lines.append(f"  {TABLE_NOTE}")
    for name, zeros in changes.zeros.items():
        values = ", ".join(f"{value:+.3g}" for value in zeros)
        lines.append(
            f"  zero of {name}, deviation from the mean: {values}; no change of the machine"
        )
    for parameter in changes.changed:
        for trend in parameter.trends:
            lines.append(
                f"  {parameter.name} against {trend.name}: a straight line explains "
                f"{100 * trend.explains:.0f} % of the differences, {trend.slope:.3g} per unit"
            )
    if changes.undetermined:
        listed = ", ".join(map(str, changes.undetermined))
        lines.append(f"  a change of these would not show in the recordings: {listed}")
    lines.append(f"  {changes.tested} parameters tested, {changes.seconds:.1f} s")
    return "\n".join(lines)


def _row(parameter: ComparedParameter, recordings: int) -> tuple[str, ...]:
    factor, unit = shorten(parameter.unit, *(interval.value for interval in parameter.values))
    # All values of a row share the unit of its largest one.
    values = [
        f"{spell(factor * interval.value, 4)} ± "
        f"{spell(factor * 0.5 * (interval.high - interval.low), 2)}"
        for interval in parameter.values
    ] or ["-"] * recordings
    probability = f"{parameter.probability:.2g}" if parameter.values else "-"
    title = f"{parameter.name} {parameter.parameter}"
    return (title, unit or "1", *values, ANSWERS[parameter.verdict], probability)


def _align(rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def change_sentence(parameters: Sequence[ComparedParameter]) -> str:
    """Write what changed in one sentence.

    Parameters
    ----------
    parameters
        Parameters of the comparison.

    Returns
    -------
    str
        One line that ends with a full stop.
    """
    changed = [parameter for parameter in parameters if parameter.verdict == "changed"]
    if not changed:
        undetermined = sum(parameter.verdict == "cannot tell" for parameter in parameters)
        but = (
            f"; the recordings do not determine {undetermined} of the named parameters"
            if undetermined
            else ""
        )
        return f"No change: one value of every parameter fits all recordings{but}."
    parts = []
    for parameter in changed:
        first, last = parameter.values[0].value, parameter.values[-1].value
        factor, shown = shorten(parameter.unit, first, last)
        values = f"{spell(factor * first, 4)} to {spell(factor * last, 4)}"
        unit = f" {shown}" if shown else ""
        alternatives = ", ".join(map(str, parameter.alternatives))
        rivals = f", or instead {alternatives}" if alternatives else ""
        parts.append(
            f"{parameter.name} ({parameter.parameter} {values}{unit}{rivals})"
            f"{_describe_trend(parameter)}"
        )
    return f"Not the same in all recordings: {'; '.join(parts)}."


def _describe_trend(parameter: ComparedParameter) -> str:
    if not parameter.trends:
        # Two recordings differ in every quantity, so only more of them can exclude all.
        return ", following no recorded quantity" if len(parameter.values) > 2 else ""
    if parameter.named:
        return f", following the {parameter.trends[0].name}"
    names = " or ".join(trend.name for trend in parameter.trends)
    return f", following {names}: the recordings cannot distinguish these"
