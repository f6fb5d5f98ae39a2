"""What to do next, by what was found."""

from __future__ import annotations

from rigtwin.diagnosis.finding import Answer, Finding, Place
from rigtwin.diagnosis.words import name_part

SURE = 0.9
"""Confidence from which an effect is corrected without another look."""


def advise(answer: Answer) -> tuple[str, ...]:
    """What an engineer who has this answer does next, the most useful first.

    Parameters
    ----------
    answer
        Of a diagnosis.

    Returns
    -------
    tuple of str
        Sentences. One at least.
    """
    if answer.verdict == "unusable":
        return ("Mend what is said above in the recording, and diagnose it again.",)
    if answer.verdict == "no gap":
        missed = len(answer.not_observable)
        unseen = "; what these data could not have shown is listed below" if missed else ""
        return (f"Nothing needs to be corrected: use the twin as it is{unseen}.",)
    keep = (
        "Write the corrected twin with `rigtwin diagnose ... --save-twin twin.toml`, and use it "
        "with `--config twin.toml`."
    )
    said = [keep] if answer.verdict == "explained" else []
    said += _tell_apart(answer)
    if unsure := [each for each in answer.effects if each.confidence < SURE]:
        names = ", ".join(f"{each.name} ({100 * each.confidence:.0f} %)" for each in unsure)
        said.append(
            f"The names of the less sure ones, {names}, may be wrong where their sizes are right: "
            "use the values, and look at the part before you repair anything."
        )
    if answer.verdict != "explained":
        said += _look_further(answer)
    elif answer.gap is not None and "held-out" not in answer.gap.held_out:
        said.append(
            "Give another recording of the machine with `--held-out` to see whether the correction "
            "holds there."
        )
    if answer.verdict == "partly explained":
        said.append(f"{keep} What is left, it leaves too.")
    return tuple(said)


def _tell_apart(answer: Answer) -> list[str]:
    """How explanations that fit alike would be separated."""
    if (test := answer.next_test) is not None:
        between = " from ".join(test.between[:2])
        return [f"Record `{test.command}`: that test separates {between}."]
    alike = [
        " from ".join(str(each) for each in effect.alternatives)
        for effect in answer.effects
        if len(effect.alternatives) > 1
    ]
    if not alike:
        return []
    return [
        f"These data cannot tell {', nor '.join(alike)}; the twin is as good with either. A look "
        "at the part tells, or a test in which they differ."
    ]


def _look_further(answer: Answer) -> list[str]:
    """Where to look for what has no name."""
    named: list[Finding] = list(answer.effects)
    places: list[Place] = list(answer.leftovers) or [
        place
        for place in answer.where
        if all(place.component != each.name.component for each in named)
    ]
    if not places:
        return [
            "Something is left that no component explains; see where measured and predicted part."
        ]
    place = places[0]
    return [
        f"What has no name here shows at the {name_part(place.component)}, {place.region}: "
        f"{place.evidence}."
    ]
