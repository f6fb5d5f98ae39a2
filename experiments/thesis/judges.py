"""What can be asked of a root locus's stability: each judge says whether it holds, and what was
found."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from rigtwin.studies.stability.locus import BODY, WHEEL, Crossing, Locus

Judge = Callable[[Locus], tuple[bool, str]]
TOGETHER = 1e-6
"""Of the swept value: crossings closer than this are one."""
BEYOND = 1e3
"""How far past its end a sweep is followed to see where poles go."""
OSCILLATES = 1e-6
"""Of a pole's distance from the origin: a frequency above this is one."""


def both(*judges: Judge) -> Judge:
    """Holds if all do."""

    def judge(locus: Locus) -> tuple[bool, str]:
        found = [each(locus) for each in judges]
        return all(holds for holds, _ in found), "; ".join(
            dict.fromkeys(words for _, words in found)
        )

    return judge


def stable_throughout(locus: Locus) -> tuple[bool, str]:
    start, end = ends(locus)
    return not (start or end or locus.crossings), story(locus)


def becomes_unstable(*modes: str) -> Judge:
    """Stable at the start, unstable at the end, where exactly these modes have crossed."""

    def judge(locus: Locus) -> tuple[bool, str]:
        start, end = ends(locus)
        crossed = {crossing.mode for crossing in locus.crossings}
        return bool(not start and end and crossed == set(modes)), story(locus)

    return judge


def unstable_at_start(*modes: str) -> Judge:
    """These modes, and no other."""
    return lambda locus: (set(ends(locus)[0]) == set(modes), story(locus))


def unstable_at_end(*modes: str) -> Judge:
    """These modes, and no other."""
    return lambda locus: (set(ends(locus)[1]) == set(modes), story(locus))


def not_unstable_at(value: float) -> Judge:
    """No pole to the right of the imaginary axis at that value; one on it will do."""

    def judge(locus: Locus) -> tuple[bool, str]:
        rightmost = locus.poles_at(value).real.max()
        return bool(
            rightmost <= TOGETHER
        ), f"real part {rightmost:.2g} 1/s at {value:g}; {story(locus)}"

    return judge


def unstable_before_start(*modes: str) -> Judge:
    """Followed past its start, the sweep becomes unstable in these modes."""

    def judge(locus: Locus) -> tuple[bool, str]:
        found = locus.unstable_modes(float(locus.values[0]) / BEYOND)
        return set(modes) <= set(
            found
        ), f"{' and '.join(found) or 'nothing'} unstable {BEYOND:g} times before the start"

    return judge


def never(mode: str) -> Judge:
    """No pole of that mode to the right of the imaginary axis at any value."""

    def judge(locus: Locus) -> tuple[bool, str]:
        holds = mode not in (*ends(locus)[0], *ends(locus)[1]) and all(
            each.mode != mode for each in locus.crossings
        )
        return holds, story(locus)

    return judge


def together(locus: Locus) -> tuple[bool, str]:
    """Body hop and wheel hop cross at one value."""
    values = [crossing.value for crossing in locus.crossings]
    modes = {crossing.mode for crossing in locus.crossings}
    holds = modes == {BODY, WHEEL} and max(values) - min(values) <= TOGETHER * max(values)
    return holds, story(locus)


def body_first(locus: Locus) -> tuple[bool, str]:
    """The body hop becomes unstable before the wheel hop does, and both do."""
    first = {
        mode: [each.value for each in locus.crossings if each.mode == mode and each.unstable]
        for mode in (BODY, WHEEL)
    }
    holds = bool(first[BODY] and first[WHEEL]) and min(first[BODY]) < min(first[WHEEL]) * (
        1.0 - TOGETHER
    )
    return holds, story(locus)


def earlier_than(other: Locus, name: str) -> Judge:
    """It becomes unstable at a smaller value than another locus does, or the other never."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, others = _first(locus), _first(other)
        words = f"first at {_at(ours)}; {name} at {_at(others)}"
        return bool(ours and (not others or ours.value < others.value)), words

    return judge


def later_than(other: Locus, name: str) -> Judge:
    """It becomes unstable at a larger value than another locus does, or never."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, others = _first(locus), _first(other)
        words = f"first at {_at(ours)}; {name} at {_at(others)}"
        return bool(others and (not ours or ours.value > others.value)), words

    return judge


def _first(locus: Locus) -> Crossing | None:
    return next((crossing for crossing in locus.crossings if crossing.unstable), None)


def _at(crossing: Crossing | None) -> str:
    return f"{crossing.value:.4g}" if crossing else "no value"


def ends(locus: Locus) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return locus.unstable_modes(float(locus.values[0])), locus.unstable_modes(
        float(locus.values[-1])
    )


def story(locus: Locus) -> str:
    start = ends(locus)[0]
    words = [f"{' and '.join(start)} unstable at the start" if start else "stable at the start"]
    for crossing in locus.crossings:
        verb = "unstable" if crossing.unstable else "stable again"
        words.append(
            f"{crossing.mode} {verb} at {crossing.value:.4g} ({crossing.frequency:.4g} rad/s)"
        )
    if not locus.crossings:
        words.append("and throughout")
    return ", ".join(words)


def listed(numbers: Iterable[float]) -> str:
    """Four digits each."""
    return ", ".join(f"{number:.4g}" for number in numbers)
