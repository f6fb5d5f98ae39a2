"""A diagnosis in words: one sentence, and a few lines for a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rigtwin.diagnosis.advice import advise
from rigtwin.diagnosis.answer import Answer, Verdict
from rigtwin.diagnosis.confounded_text import describe_confounded
from rigtwin.diagnosis.finding import Estimate, Finding, Place, Rival
from rigtwin.diagnosis.gap import Gap
from rigtwin.diagnosis.units import shorten, spell, write
from rigtwin.diagnosis.words import enumerate_words, indefinite_article, name_part

STATIC = ("noise", "hum", "quantisation", "setting", "missed_ticks")
"""Kinds that are read off signals or commands; correcting them changes no prediction."""
MOST_EFFECTS = 5
"""Effects that one sentence lists at most."""
VERBS = ((0.8, "has"), (0.5, "probably has"), (0.0, "may have"))
"""Least confidence of an effect, and the verb with which a sentence states it."""
UNBOUNDED = 1e9
"""Nominal values from this magnitude on mean that the twin has no such limit."""
GAP_TO_CLOSE = 1.05
"""Gap, in noise floors, from which the closed share of it is worth a sentence."""
INTERVAL_NOTE = (
    "intervals: 2.5 standard errors to either side; "
    "docs/confidence.md says how often they hold the true value"
)


def format_distinct(first: float, second: float) -> tuple[str, str]:
    """Write two numbers to four digits, or to as many more as make the texts differ."""
    texts = "", ""
    # A double has at most 17 significant digits, so 16 tell nearly any two apart.
    for digits in range(4, 17):
        texts = f"{first:.{digits}g}", f"{second:.{digits}g}"
        if texts[0] != texts[1]:
            break
    return texts


def format_estimate(estimate: Estimate) -> str:
    """Write a parameter's value with its interval and its nominal value, all in one unit."""
    value, nominal, factor, unit = against_nominal(estimate)
    low, high = (spell(factor * end, 4) for end in (estimate.low, estimate.high))
    return f"{value}{unit} (interval {low} to {high}), nominal {nominal}"


def against_nominal(estimate: Estimate) -> tuple[str, str, float, str]:
    """Write a parameter's value and its nominal value in one unit.

    Parameters
    ----------
    estimate
        Value and nominal value, SI.

    Returns
    -------
    tuple
        Text of the value, text of the nominal value ("none" for a limit that the twin lacks),
        factor from SI to the unit, and the unit with a space before it.
    """
    unlimited = abs(estimate.nominal) >= UNBOUNDED
    factor, unit = shorten(estimate.unit, estimate.value, 0.0 if unlimited else estimate.nominal)
    value, nominal = format_distinct(factor * estimate.value, factor * estimate.nominal)
    return value, "none" if unlimited else nominal, factor, f" {unit}" if unit else ""


def describe(diagnosis: Answer) -> str:
    """Write the answer, the evidence for it and the next step, for a terminal."""
    lines = [
        f"{diagnosis.verdict}: {diagnosis.sentence}",
        *(f"  fault: {fault}" for fault in diagnosis.faults),
        *_effect_lines(diagnosis),
        *_step_lines(diagnosis),
        *(f"  where: {_describe_place(place)}" for place in diagnosis.where),
        *_gap_lines(diagnosis),
        *(f"  residual: {_describe_place(place)}" for place in diagnosis.leftovers),
        *(f"  next: {step.replace('`', '')}" for step in advise(diagnosis)),
    ]
    if diagnosis.not_observable:
        names = ", ".join(f"{each.kind}@{each.component}" for each in diagnosis.not_observable)
        lines.append(f"  not observable with these data: {names}")
    lines += [f"  energy error of {name}: {error}" for name, error in diagnosis.energy.items()]
    lines += [f"  note: {note}" for note in diagnosis.notes]
    if diagnosis.effects:
        lines.append(f"  {INTERVAL_NOTE}")
    lines.append(f"  {diagnosis.seconds:.1f} s")
    return "\n".join(lines)


def _effect_lines(diagnosis: Answer) -> Iterator[str]:
    """Named effects, then the nearest explanation and the traces, which are not named."""
    for effect in diagnosis.effects:
        confidence, share = 100 * effect.confidence, 100 * effect.share
        yield f"  {effect.name}, confidence {confidence:.0f} %, share of the gap {share:.0f} %"
        for name, estimate in effect.parameters.items():
            yield f"    {name} = {format_estimate(estimate)}"
        if effect.curve:
            yield f"    force at a position: {_list_curve(effect)}"
        if effect.rivals:
            yield f"    these data cannot distinguish it from {list_rivals(effect)}"
    for entry in diagnosis.confounded:
        yield f"  {describe_confounded(entry)}"
    if (nearest := diagnosis.nearest) is not None:
        names = " + ".join(str(name) for name in nearest.names)
        yield (
            f"  nearest explanation, not good enough to be named: {names}; it leaves a residual "
            f"of {100 * nearest.residual:.2g} % of the signals' standard deviation, "
            f"the nominal twin {100 * nearest.without:.2g} %"
        )
    for effect in diagnosis.traces:
        yield (
            f"  trace, too small to be named: {effect.name} ({_list_values(effect.parameters)}) "
            f"would close another {100 * effect.share:.2g} % of the gap"
        )


def _step_lines(diagnosis: Answer) -> Iterator[str]:
    """Table of residuals; a signal has the same unit in every row."""
    if not diagnosis.steps:
        return
    yield "  rms residual as effects are added one after another:"
    units = {
        name: shorten(unit, *(step.residual[name] for step in diagnosis.steps))
        for name, unit in diagnosis.units.items()
    }
    for step in diagnosis.steps:
        amounts = ", ".join(
            f"{name} {spell(units[name][0] * value, 4)} {units[name][1]}".rstrip()
            for name, value in step.residual.items()
        )
        values = f" ({_list_values(step.values)})" if step.values else ""
        yield f"    {step.added}{values}: {amounts}"


def _gap_lines(diagnosis: Answer) -> Iterator[str]:
    gap = diagnosis.gap
    if gap is None:
        return
    yield (
        f"  gap of all sensors: {gap.before:.3g} noise floors before, {gap.after:.3g} after "
        "the correction; 1 is noise alone"
    )
    if diagnosis.effects and gap.before > GAP_TO_CLOSE:
        closed = gap.shrinkage_held_out
        yield (
            f"  the correction closes {100 * closed.value:.1f} % of the gap "
            f"({100 * closed.low:.1f} to {100 * closed.high:.1f} %) on {gap.held_out}, "
            f"and {100 * gap.shrinkage_predicted:.1f} % on the data of the fit"
        )


def _describe_place(place: Place) -> str:
    low, high = place.band_hz
    return f"{place.component}, {place.region}, {low:.3g} to {high:.3g} Hz; {place.evidence}"


def _list_values(parameters: dict[str, Estimate]) -> str:
    return ", ".join(
        f"{name} {write(estimate.value, estimate.unit)}" for name, estimate in parameters.items()
    )


def _list_curve(effect: Finding) -> str:
    """List positions and forces of an effect that is a curve over the stroke."""
    force, length = _curve_units(effect)
    return ", ".join(
        f"{write(height, force)} at {write(place, length)}" for place, height in effect.curve
    )


def _curve_units(effect: Finding) -> tuple[str, str]:
    """Return the units of a curve's force and position: those of its first and last parameter."""
    units = [estimate.unit for estimate in effect.parameters.values()]
    return units[0], units[-1]


def list_rivals(effect: Finding) -> str:
    """List the rivals of an effect, with the values that they and others would have.

    Parameters
    ----------
    effect
        Finding with at least one rival.

    Returns
    -------
    str
        Rivals, joined as in a sentence.
    """
    return enumerate_words([_describe_rival(rival) for rival in effect.rivals])


def _describe_rival(rival: Rival) -> str:
    if not rival.parameters:
        return str(rival.name)
    changed = [f"{name} with {_list_values(values)}" for name, values in rival.beside]
    beside = f", beside {enumerate_words(changed)}" if changed else ""
    return f"{rival.name} ({_list_values(rival.parameters)}{beside})"


def sentence(
    verdict: Verdict,
    effects: Sequence[Finding],
    where: Sequence[Place],
    gap: Gap,
    is_tolerated: bool = False,
) -> str:
    """Write the answer in one sentence.

    Parameters
    ----------
    verdict
        Verdict of the diagnosis.
    effects
        Effects that are named.
    where
        Locations of the gap, the largest first.
    gap
        Gap before and after the correction.
    is_tolerated
        Whether what the correction leaves lies within declared tolerances.

    Returns
    -------
    str
        One line that begins with a capital and ends with a full stop.
    """
    if verdict == "no gap":
        return (
            "No gap: the twin predicts this machine to within its "
            "sensors' noise and declared tolerances."
        )
    if verdict == "unknown":
        place = where[0] if where else None
        at = f" at the {name_part(place.component)}; {place.evidence}" if place else ""
        return f"Unmodelled effect{at}."
    text = _list_effects(effects) + _say_closed(effects, gap)
    if verdict == "partly explained":
        text += (
            "; the remaining gap lies within the declared tolerances"
            if is_tolerated
            else "; an unmodelled residual remains"
        )
    return f"{text[0].upper()}{text[1:]}."


def _list_effects(effects: Sequence[Finding]) -> str:
    """List the largest effects, a clause for each component and verb, and count the others."""
    shown = list(effects)
    more = ""
    if len(effects) > MOST_EFFECTS:
        shown = sorted(effects, key=lambda effect: -effect.share)[:MOST_EFFECTS]
        more = f"; and {len(effects) - MOST_EFFECTS} more effects that are smaller"
    parts: dict[tuple[str, str], list[str]] = {}
    for effect in shown:
        verb = next(verb for least, verb in VERBS if effect.confidence >= least)
        parts.setdefault((effect.name.component, verb), []).append(_describe_effect(effect))
    listed = "; ".join(
        f"{_with_article(component)} {verb} {enumerate_words(descriptions)}"
        for (component, verb), descriptions in parts.items()
    )
    return listed + more


def _say_closed(effects: Sequence[Finding], gap: Gap) -> str:
    """Say which share of the gap is closed, in a clause; empty without a gap to close."""
    if gap.before <= GAP_TO_CLOSE or all(effect.name.kind in STATIC for effect in effects):
        return ""
    closed = 100 * gap.shrinkage_held_out.value
    return f"; the correction closes {closed:.0f} % of the gap on data held out of the fit"


def _with_article(component: str) -> str:
    """Return "joint 2" as it is, and "the motor" with its article."""
    name = name_part(component)
    return name if name[-1].isdigit() else f"the {name}"


def _describe_effect(effect: Finding) -> str:
    """Describe an effect by its first parameter, or its curve, and its confidence."""
    name, estimate = next(iter(effect.parameters.items()))
    value, nominal, _, unit = against_nominal(estimate)
    reference = nominal if nominal == "none" else f"{nominal}{unit}"
    likely = f"{100 * effect.confidence:.0f} %"
    if effect.curve:
        forces = [height for _, height in effect.curve]
        unit = _curve_units(effect)[0]
        ends = f"{write(min(forces), unit)} to {write(max(forces), unit)}"
        title = f"{indefinite_article(effect.title)} {effect.title}"
        return f"{title} from {ends} over the stroke (confidence {likely})"
    title = f"setting {name}" if effect.name.kind == "setting" else effect.title
    return (
        f"{indefinite_article(title)} {title} of {value}{unit} instead of {reference} "
        f"(confidence {likely})"
    )
