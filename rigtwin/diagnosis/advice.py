"""Advice on the next step after a diagnosis."""

from __future__ import annotations

from rigtwin.diagnosis.answer import Answer
from rigtwin.diagnosis.finding import Place
from rigtwin.diagnosis.words import name_part

CONFIDENT = 0.9
"""Confidence from which an effect is corrected without inspecting the part first."""
SAVE_TWIN = (
    "Write the corrected twin with `rigtwin diagnose ... --save-twin twin.toml`, and use it "
    "with `--config twin.toml`."
)


def advise(answer: Answer) -> tuple[str, ...]:
    """Return what an engineer does next, the most useful step first.

    Parameters
    ----------
    answer
        Answer of a diagnosis.

    Returns
    -------
    tuple of str
        Sentences, at least one.
    """
    if answer.verdict == "unusable":
        return ("Repair the recording as the faults above say, and diagnose it again.",)
    if answer.verdict == "no gap":
        invisible = (
            "; the effects that these data could not have shown are listed below"
            if answer.not_observable
            else ""
        )
        return (f"Nothing needs to be corrected: use the twin as it is{invisible}.",)
    # This is the answer to a standstill (`_answer_standstill`): there was nothing to fit, so it has
    # neither a gap nor places.
    if answer.verdict == "unknown" and answer.gap is None and not answer.where:
        return (
            "Push harder, or look whether the joint is free: where nothing moves, nothing shows.",
        )
    # Saving the twin comes first only where nothing remains to be found. Otherwise it is a stopgap,
    # and the last step.
    steps = [SAVE_TWIN] if answer.verdict == "explained" else []
    steps += _separate_rivals(answer)
    if doubtful := [effect for effect in answer.effects if effect.confidence < CONFIDENT]:
        names = ", ".join(f"{each.name} ({100 * each.confidence:.0f} %)" for each in doubtful)
        steps.append(
            f"These effects have a confidence below {100 * CONFIDENT:.0f} %: {names}. Their "
            "values correct the twin even if another effect is the cause, so inspect the part "
            "before repairing it."
        )
    if answer.tolerated:
        parts = ", ".join(f"{part.parameter}@{part.component}" for part in answer.tolerated)
        steps.append(
            f"Measure {parts}: a declared tolerance is used up there, and a better nominal value "
            "would close more of the gap."
        )
    if answer.verdict == "unknown" or (answer.verdict != "explained" and not answer.tolerated):
        steps += _locate_residual(answer)
    # `Gap.held_out` is a description from `cross_validation`: "blocks left out of the fit in turn",
    # or "2 held-out recordings".
    elif answer.gap is not None and "held-out" not in answer.gap.held_out:
        steps.append(
            "Pass another recording of the machine with `--held-out` to test whether the "
            "correction holds there."
        )
    if answer.verdict == "partly explained":
        omitted = "tolerances" if answer.tolerated else "remaining residual"
        steps.append(f"{SAVE_TWIN} The corrected twin does not model the {omitted}.")
    return tuple(steps)


def _separate_rivals(answer: Answer) -> list[str]:
    """Return how to separate explanations that fit these data equally well."""
    if (test := answer.next_test) is not None:
        between = " from ".join(test.between[:2])
        return [f"Record `{test.command}`: that test separates {between}."]
    confounded = [
        " from ".join(str(name) for name in effect.alternatives)
        for effect in answer.effects
        if len(effect.alternatives) > 1
    ]
    if not confounded:
        return []
    return [
        f"These data cannot distinguish {', nor '.join(confounded)}; the twin is equally good with "
        "either. Inspect the part, or record a test in which they differ."
    ]


def _locate_residual(answer: Answer) -> list[str]:
    """Return where to look for an effect that the library does not have."""
    named = {effect.name.component for effect in answer.effects}
    # Without located residuals, the places that no named effect accounts for are the next best.
    places: list[Place] = list(answer.leftovers) or [
        place for place in answer.where if place.component not in named
    ]
    if not places:
        return [
            "A residual remains that no single component explains; compare the measured and "
            "predicted signals to see where they part."
        ]
    place = places[0]
    return [
        f"Look for an unmodelled effect at the {name_part(place.component)}, {place.region}: "
        f"{place.evidence}."
    ]
