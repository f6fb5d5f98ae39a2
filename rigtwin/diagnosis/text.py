"""A diagnosis in words: one sentence, and a few lines for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.diagnosis.advice import advise
from rigtwin.diagnosis.finding import Answer, Estimate, Finding, Gap, Place, Verdict
from rigtwin.diagnosis.units import shorten, spell, write
from rigtwin.diagnosis.words import enumerate_words, name_part

UNMOVING = ("noise", "hum", "quantisation", "setting", "missed_ticks")
"""Kinds that are read off signals or commands, and change no replay."""
MOST_TOLD = 5
"""Effects in one sentence."""


def tell_apart(one: float, other: float) -> tuple[str, str]:
    """Two numbers with four digits, or with as many more as it takes to tell them apart."""
    texts = "", ""
    for digits in range(4, 17):
        texts = f"{one:.{digits}g}", f"{other:.{digits}g}"
        if texts[0] != texts[1]:
            break
    return texts


def number(estimate: Estimate) -> str:
    """A parameter's value with its interval."""
    value, nominal, factor, unit = against_nominal(estimate)
    low, high = (spell(factor * end, 4) for end in (estimate.low, estimate.high))
    return f"{value}{unit} (95 %: {low} to {high}), nominal {nominal}"


def against_nominal(estimate: Estimate) -> tuple[str, str, float, str]:
    """A parameter's value and its nominal one in the same unit, what values in SI are multiplied by
    for that, and the unit after its space."""
    none = abs(estimate.nominal) >= 1e9
    factor, unit = shorten(estimate.unit, estimate.value, 0.0 if none else estimate.nominal)
    value, nominal = tell_apart(factor * estimate.value, factor * estimate.nominal)
    return value, "none" if none else nominal, factor, f" {unit}" if unit else ""


def describe(diagnosis: Answer) -> str:
    """The answer, what it rests on, and what to do next."""
    lines = [f"{diagnosis.verdict}: {diagnosis.sentence}"]
    for fault in diagnosis.faults:
        lines.append(f"  fault: {fault}")
    for effect in diagnosis.effects:
        sure, share = 100 * effect.confidence, 100 * effect.share
        lines.append(f"  {effect.name}, confidence {sure:.0f} %, share of the gap {share:.0f} %")
        for name, estimate in effect.parameters.items():
            lines.append(f"    {name} = {number(estimate)}")
        if effect.rivals:
            lines.append(f"    these data cannot tell it from {_list_rivals(effect)}")
    if (nearest := diagnosis.nearest) is not None:
        names = " + ".join(str(name) for name in nearest.names)
        left = f"{100 * nearest.left:.2g} % of the signals, {100 * nearest.without:.2g} without"
        lines.append(f"  nearest: {names}, not enough to be named; it leaves {left}")
    for effect in diagnosis.traces:
        values = ", ".join(
            f"{name} {write(estimate.value, estimate.unit)}"
            for name, estimate in effect.parameters.items()
        )
        lines.append(
            f"  trace: {effect.name} ({values}) would close {100 * effect.share:.2g} "
            "% of what is left: too little to be claimed"
        )
    if diagnosis.steps:
        lines.append("  what is left, rms, as effects are found one after another:")
        largest = largest_left(diagnosis)
        for step in diagnosis.steps:
            amounts = ", ".join(
                f"{name} {write(value, diagnosis.units[name], largest[name])}"
                for name, value in step.left.items()
            )
            values = ", ".join(
                f"{name} {write(each.value, each.unit)}" for name, each in step.values.items()
            )
            lines.append(f"    {step.added}{f' ({values})' if values else ''}: {amounts}")
    for place in diagnosis.where:
        low, high = place.band_hz
        lines.append(
            f"  where: {place.component}, {place.region}, {low:.3g} "
            f"to {high:.3g} Hz; {place.evidence}"
        )
    if (gap := diagnosis.gap) is not None:
        lines.append(
            f"  gap of all sensors: {gap.before:.3g} noise floors "
            f"before, {gap.after:.3g} after; 1 is noise alone"
        )
        if diagnosis.effects and gap.before > 1.05:
            held = gap.shrinkage_held_out
            lines.append(
                f"  closes {100 * held.value:.1f} % ({100 * held.low:.1f} "
                f"to {100 * held.high:.1f}) on {gap.held_out}; "
                f"predicted {100 * gap.shrinkage_predicted:.1f} %"
            )
    for place in diagnosis.leftovers:
        low, high = place.band_hz
        lines.append(
            f"  left over: {place.component}, {place.region}, "
            f"{low:.3g} to {high:.3g} Hz; {place.evidence}"
        )
    lines += [f"  next: {each.replace('`', '')}" for each in advise(diagnosis)]
    if diagnosis.not_observable:
        names = ", ".join(f"{each.kind}@{each.component}" for each in diagnosis.not_observable)
        lines.append(f"  could not be seen with these data: {names}")
    lines += [f"  energy error of {name}: {each}" for name, each in diagnosis.energy.items()]
    lines += [f"  note: {note}" for note in diagnosis.notes]
    lines.append(f"  {diagnosis.seconds:.1f} s")
    return "\n".join(lines)


def largest_left(diagnosis: Answer) -> dict[str, float]:
    """Signal → greatest rms that any step leaves of it, by which all steps are written in one
    unit."""
    names = {name for step in diagnosis.steps for name in step.left}
    return {
        name: max(step.left[name] for step in diagnosis.steps if name in step.left)
        for name in names
    }


def _list_rivals(effect: Finding) -> str:
    """The effects that the data cannot tell from one, with the values that they would have."""
    rivals = []
    for rival in effect.rivals:
        values = ", ".join(
            f"{name} {write(each.value, each.unit)}" for name, each in rival.parameters.items()
        )
        rivals.append(f"{rival.name} ({values})" if values else str(rival.name))
    return enumerate_words(rivals)


def sentence(verdict: Verdict, effects: Sequence[Finding], where: Sequence[Place], gap: Gap) -> str:
    """The answer in one sentence."""
    if verdict == "no gap":
        return (
            "No gap: the twin predicts this rig to within its "
            "sensors' noise and declared tolerances."
        )
    if verdict == "unknown":
        place = where[0] if where else None
        at = f" at the {name_part(place.component)}; {place.evidence}" if place else ""
        return f"Something that this library has no name for acts{at}."
    shown = list(effects)
    more = ""
    if len(effects) > MOST_TOLD:
        shown = sorted(effects, key=lambda effect: -effect.share)[:MOST_TOLD]
        more = f"; and {len(effects) - MOST_TOLD} more effects that are smaller"
    parts: dict[str, list[str]] = {}
    for effect in shown:
        parts.setdefault(effect.name.component, []).append(_tell(effect))
    said = "; ".join(
        f"{_with_article(component)} has {enumerate_words(told)}"
        for component, told in parts.items()
    )
    closes = (
        f"; correcting that closes {100 * gap.shrinkage_held_out.value:.0f} "
        "% of the gap on data held out of the fit"
    )
    moves = any(effect.name.kind not in UNMOVING for effect in effects)
    closed = closes if gap.before > 1.05 and moves else ""
    left = "; something that has no name here is left" if verdict == "partly explained" else ""
    text = said + more + closed + left + "."
    return text[0].upper() + text[1:]


def _with_article(component: str) -> str:
    """joint 2, but the motor."""
    name = name_part(component)
    return name if name[-1].isdigit() else f"the {name}"


def _tell(effect: Finding) -> str:
    """An effect with its value."""
    name, estimate = next(iter(effect.parameters.items()))
    value, nominal, _, unit = against_nominal(estimate)
    was = nominal if nominal == "none" else f"{nominal}{unit}"
    title = f"setting {name}" if effect.name.kind == "setting" else effect.title
    article = "an" if title[0] in "aeiou" else "a"
    likely = f"{100 * effect.confidence:.0f} %"
    return f"{article} {title} of {value}{unit} instead of {was} (confidence {likely})"
