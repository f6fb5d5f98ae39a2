"""Judges of the stability of a root locus.

A judge is a function of a locus. It returns whether a statement of the thesis holds, and the
computed finding in words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from rigtwin.studies.stability.locus import BODY, WHEEL, Crossing, Locus

Judge = Callable[[Locus], tuple[bool, str]]
"""Function that returns whether a statement holds for a locus, and the finding in words."""
TOGETHER = 1e-6
"""Relative distance below which two crossings count as simultaneous."""
BEYOND = 1e3
"""Factor by which a sweep is extended to find the asymptotes of its poles."""
OSCILLATES = 1e-6
"""Smallest imaginary part of an oscillating pole, relative to its magnitude.

A smaller one is the rounding error of a real pole.
"""


def all_hold(*judges: Judge) -> Judge:
    """Return a judge that holds if all judges hold."""

    def judge(locus: Locus) -> tuple[bool, str]:
        # Every judge is called, also after one has failed, so that the finding is complete.
        findings = [each(locus) for each in judges]
        return all(holds for holds, _ in findings), "; ".join(
            dict.fromkeys(words for _, words in findings)
        )

    return judge


def stable_throughout(locus: Locus) -> tuple[bool, str]:
    """Judge whether no pole is unstable at any value of the sweep."""
    start, end = unstable_at_ends(locus)
    return not (start or end or locus.crossings), describe_crossings(locus)


def becomes_unstable(*modes: str) -> Judge:
    """Return a judge: stable at the start, unstable at the end, and exactly these modes crossed."""

    def judge(locus: Locus) -> tuple[bool, str]:
        start, end = unstable_at_ends(locus)
        crossed = {crossing.mode for crossing in locus.crossings}
        # All three: a mode that was unstable at the start has not become so, and one that is
        # stable again at the end is not unstable.
        return bool(not start and end and crossed == set(modes)), describe_crossings(locus)

    return judge


def unstable_at_start(*modes: str) -> Judge:
    """Return a judge: exactly these modes are unstable at the start of the sweep."""
    return lambda locus: (set(unstable_at_ends(locus)[0]) == set(modes), describe_crossings(locus))


def unstable_at_end(*modes: str) -> Judge:
    """Return a judge: exactly these modes are unstable at the end of the sweep."""
    return lambda locus: (set(unstable_at_ends(locus)[1]) == set(modes), describe_crossings(locus))


def not_unstable_at(value: float) -> Judge:
    """Return a judge: no pole is right of the imaginary axis at a value; one on the axis passes."""

    def judge(locus: Locus) -> tuple[bool, str]:
        # On the boundary the real part is zero up to rounding.
        rightmost = locus.poles_at(value).real.max()
        words = f"real part {rightmost:.2g} 1/s at {value:g}; {describe_crossings(locus)}"
        return bool(rightmost <= TOGETHER), words

    return judge


def unstable_before_start(*modes: str) -> Judge:
    """Return a judge: extended before its start, the sweep becomes unstable in these modes."""

    def judge(locus: Locus) -> tuple[bool, str]:
        unstable = locus.unstable_modes(float(locus.values[0]) / BEYOND)
        words = f"{' and '.join(unstable) or 'nothing'} unstable {BEYOND:g} times before the start"
        return set(modes) <= set(unstable), words

    return judge


def never(mode: str) -> Judge:
    """Return a judge: the mode is stable at every value of the sweep."""

    def judge(locus: Locus) -> tuple[bool, str]:
        holds = mode not in (*unstable_at_ends(locus)[0], *unstable_at_ends(locus)[1]) and all(
            each.mode != mode for each in locus.crossings
        )
        return holds, describe_crossings(locus)

    return judge


def cross_together(locus: Locus) -> tuple[bool, str]:
    """Judge whether body hop and wheel hop cross the imaginary axis at the same value."""
    values = [crossing.value for crossing in locus.crossings]
    modes = {crossing.mode for crossing in locus.crossings}
    holds = modes == {BODY, WHEEL} and max(values) - min(values) <= TOGETHER * max(values)
    return holds, describe_crossings(locus)


def body_first(locus: Locus) -> tuple[bool, str]:
    """Judge whether both modes become unstable, the body hop first."""
    # A mode may cross back; only crossings into the right half-plane count here.
    first = {
        mode: [each.value for each in locus.crossings if each.mode == mode and each.unstable]
        for mode in (BODY, WHEEL)
    }
    holds = bool(first[BODY] and first[WHEEL]) and min(first[BODY]) < min(first[WHEEL]) * (
        1.0 - TOGETHER
    )
    return holds, describe_crossings(locus)


def earlier_than(reference: Locus, name: str) -> Judge:
    """Return a judge: the locus becomes unstable before a reference, or it alone does."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, theirs = _first(locus), _first(reference)
        words = f"first at {_at(ours)}; {name} at {_at(theirs)}"
        return bool(ours and (not theirs or ours.value < theirs.value)), words

    return judge


def later_than(reference: Locus, name: str) -> Judge:
    """Return a judge: the locus becomes unstable after a reference, or never."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, theirs = _first(locus), _first(reference)
        words = f"first at {_at(ours)}; {name} at {_at(theirs)}"
        return bool(theirs and (not ours or ours.value > theirs.value)), words

    return judge


def _first(locus: Locus) -> Crossing | None:
    """Return the first crossing into the right half-plane."""
    return next((crossing for crossing in locus.crossings if crossing.unstable), None)


def _at(crossing: Crossing | None) -> str:
    return f"{crossing.value:.4g}" if crossing else "no value"


def unstable_at_ends(locus: Locus) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the unstable modes at the start and at the end of the sweep."""
    return locus.unstable_modes(float(locus.values[0])), locus.unstable_modes(
        float(locus.values[-1])
    )


def describe_crossings(locus: Locus) -> str:
    """Describe the stability along the sweep, with the value and frequency of every crossing."""
    start = unstable_at_ends(locus)[0]
    words = [f"{' and '.join(start)} unstable at the start" if start else "stable at the start"]
    for crossing in locus.crossings:
        verb = "unstable" if crossing.unstable else "stable again"
        words.append(
            f"{crossing.mode} {verb} at {crossing.value:.4g} ({crossing.frequency:.4g} rad/s)"
        )
    if not locus.crossings:
        words.append("and throughout")
    return ", ".join(words)


def format_numbers(numbers: Iterable[float]) -> str:
    """Format numbers with four digits, separated by commas."""
    return ", ".join(f"{number:.4g}" for number in numbers)
