"""A diagnosis as a few lines for a terminal."""

from __future__ import annotations

from rigtwin.diagnosis.finding import Diagnosis, Estimate


def number(estimate: Estimate) -> str:
    """A parameter's value with its interval."""
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    nominal = "none" if abs(estimate.nominal) >= 1e9 else f"{estimate.nominal:.4g}"
    return f"{estimate.value:.4g}{unit} (95 %: {estimate.low:.4g} to {estimate.high:.4g}), nominal {nominal}"


def described(diagnosis: Diagnosis) -> str:
    """The answer, what it rests on, and what to do next."""
    lines = [f"{diagnosis.verdict}: {diagnosis.sentence}"]
    for fault in diagnosis.faults:
        lines.append(f"  fault: {fault}")
    for effect in diagnosis.effects:
        sure, share = 100 * effect.confidence, 100 * effect.share
        lines.append(f"  {effect.name}, confidence {sure:.0f} %, share of the gap {share:.0f} %")
        for name, estimate in effect.parameters.items():
            lines.append(f"    {name} = {number(estimate)}")
        if len(effect.alternatives) > 1:
            lines.append(f"    these data cannot tell it from {', '.join(str(name) for name in effect.alternatives[1:])}")
    for place in diagnosis.where:
        low, high = place.band_hz
        lines.append(f"  where: {place.component}, {place.region}, {low:.3g} to {high:.3g} Hz; {place.evidence}")
    if (gap := diagnosis.gap) is not None:
        lines.append(f"  gap of all sensors: {gap.before:.3g} noise floors before, {gap.after:.3g} after; 1 is noise alone")
        if diagnosis.effects and gap.before > 1.05:
            held = gap.shrinkage_held_out
            lines.append(
                f"  closes {100 * held.value:.1f} % ({100 * held.low:.1f} to {100 * held.high:.1f}) on {gap.held_out}; "
                f"predicted {100 * gap.shrinkage_predicted:.1f} %"
            )
    if diagnosis.next_test is not None:
        between = " from ".join(diagnosis.next_test.between[:2])
        lines.append(f"  next test: {diagnosis.next_test.command}  (separates {between})")
    if diagnosis.not_observable:
        names = ", ".join(f"{each.kind}@{each.component}" for each in diagnosis.not_observable)
        lines.append(f"  could not be seen with these data: {names}")
    lines += [f"  note: {note}" for note in diagnosis.notes]
    lines.append(f"  {diagnosis.seconds:.1f} s")
    return "\n".join(lines)
