"""Judges of the distance between the poles of a locus and the ideal ones."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from experiments.thesis.judges import OSCILLATES, TOGETHER, Judge, format_numbers
from rigtwin.studies.stability.locus import BODY, WHEEL, Locus
from rigtwin.studies.stability.models import ideal_quarter_car, ideal_single_mass, poles

RESEMBLANCE = 0.1
"""Largest distance of a pole that resembles an ideal one, relative to the ideal one's magnitude."""


def closest_at(end: str) -> Judge:
    """Return a judge: the poles are nearer to the ideal ones at one end than at the other."""

    def judge(locus: Locus) -> tuple[bool, str]:
        start, last = (_relative_distances(locus, float(value)) for value in locus.values[[0, -1]])
        first, second = max(start.values()), max(last.values())
        words = f"{format_percent(first)} off at the start, {format_percent(second)} at the end"
        return bool((first < second) == (end == "start")), words

    return judge


def resembles(end: str) -> Judge:
    """Return a judge: at an end, all poles lie within a tenth of the ideal ones' magnitude."""

    def judge(locus: Locus) -> tuple[bool, str]:
        off = max(
            _relative_distances(locus, float(locus.values[0 if end == "start" else -1])).values()
        )
        return off < RESEMBLANCE, f"{format_percent(off)} off at the {end}"

    return judge


def never_resembles(locus: Locus) -> tuple[bool, str]:
    """Judge whether some ideal pole has no pole within a tenth of its magnitude, at every value."""
    # Every tenth value of the sweep: the distances change slowly along it.
    off = [max(_relative_distances(locus, float(value)).values()) for value in locus.values[::10]]
    return min(off) > RESEMBLANCE, f"{format_percent(min(off))} off at least"


def closer_than(reference: Locus, name: str) -> Judge:
    """Return a judge: the largest distance from the ideal is smaller than that of a reference."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, theirs = (
            max(
                max(_relative_distances(each, float(value)).values()) for value in each.values[::10]
            )
            for each in (locus, reference)
        )
        return ours < theirs, f"{format_percent(ours)} off at most; {name} {format_percent(theirs)}"

    return judge


def wheel_closer_than(reference: Locus, name: str) -> Judge:
    """Return a judge: the wheel hop stays closer to its ideal than that of a reference."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, theirs = (
            max(_relative_distances(each, float(value))[WHEEL] for value in each.values[::10])
            for each in (locus, reference)
        )
        return (
            ours < theirs,
            f"wheel hop {format_percent(ours)} off at most; {name} {format_percent(theirs)}",
        )

    return judge


def wheel_resembles(end: str) -> Judge:
    """Return a judge: at an end, the wheel hop lies within a tenth of its ideal's magnitude."""

    def judge(locus: Locus) -> tuple[bool, str]:
        off = _relative_distances(locus, float(locus.values[0 if end == "start" else -1]))[WHEEL]
        return off < RESEMBLANCE, f"wheel hop {format_percent(off)} off at the {end}"

    return judge


def wheel_damping_closest_at(end: str) -> Judge:
    """Return a judge: the decay rate of the wheel hop is nearer to its ideal at one end."""

    def judge(locus: Locus) -> tuple[bool, str]:
        off = []
        for value in map(float, locus.values[[0, -1]]):
            ideal, ours = (
                slowest(locus, value, each, WHEEL)
                for each in (locus.ideal_at(value), locus.poles_at(value))
            )
            off.append(abs(ours / ideal - 1.0))
        words = (
            f"decay rate of the wheel hop {format_percent(off[0])} off "
            f"at the start, {format_percent(off[1])} at the end"
        )
        return (off[0] < off[1]) == (end == "start"), words

    return judge


def worst(mode: str, end: str) -> Judge:
    """Return a judge: at an end, this mode is further from its ideal than the other one."""

    def judge(locus: Locus) -> tuple[bool, str]:
        distances = _relative_distances(locus, float(locus.values[0 if end == "start" else -1]))
        body, wheel = format_percent(distances[BODY]), format_percent(distances[WHEEL])
        words = f"body hop {body}, wheel hop {wheel} off at the {end}"
        return distances[mode] == max(distances.values()), words

    return judge


def body_on_ideal_trajectory(reference: Locus, name: str) -> Judge:
    """Return a judge: the body hop stays on the curve of the ideal one, unlike that of a reference.

    It stays on the curve if it lies within a tenth of its magnitude of it.
    """

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, theirs = _off_trajectory(locus), _off_trajectory(reference)
        return (
            ours < RESEMBLANCE < theirs,
            f"{format_percent(ours)} off the curve at most; {name} {format_percent(theirs)}",
        )

    return judge


def body_unstable_at_end(locus: Locus) -> tuple[bool, str]:
    """Judge whether the body hop has a positive real part at the end of the sweep."""
    end = float(locus.values[-1])
    real = slowest(locus, end, locus.poles_at(end), BODY)
    return real > 0.0, f"{real:.3g} 1/s at {end:g}"


def undamped_at_boundary(locus: Locus) -> tuple[bool, str]:
    """Judge whether the modes cross at the frequencies of the undamped vehicle."""
    # Both crossings belong to the same vehicle, unless the sweep changes it; then the first
    # counts.
    car = locus.at(locus.crossings[0].value).car._replace(suspension_damping=0.0, tyre_damping=0.0)
    undamped = (
        ideal_single_mass(car.sprung) if locus.model == "single-mass" else ideal_quarter_car(car)
    )
    expected = sorted(pole.imag for pole in poles(undamped) if pole.imag > 0.0)
    # Sorted on both sides, because the order of crossings along the sweep says nothing here.
    crossed = sorted(crossing.frequency for crossing in locus.crossings)
    # At the boundary the lag cancels the damping, so the vehicle swings as if undamped.
    holds = len(crossed) == len(expected) and bool(np.allclose(crossed, expected, rtol=1e-6))
    return holds, f"crosses at {format_numbers(crossed)} rad/s; undamped {format_numbers(expected)}"


def undamped_at_end(mode: str) -> Judge:
    """Return a judge: at the end, a mode that is damped in the ideal system is undamped."""

    def judge(locus: Locus) -> tuple[bool, str]:
        value = float(locus.values[-1])
        ideal, ours = (
            slowest(locus, value, each, mode)
            for each in (locus.ideal_at(value), locus.poles_at(value))
        )
        return ideal < 0.0 and abs(ours) < TOGETHER * abs(
            ideal
        ), f"real part {ours:.2g} 1/s, ideal {ideal:.4g}"

    return judge


def _relative_distances(locus: Locus, value: float) -> dict[str, float]:
    """Return for each mode the largest relative distance of an ideal pole from its counterpart."""
    ideal, poles, car = locus.ideal_at(value), locus.poles_at(value), locus.at(value).car
    # Relative to the ideal pole's magnitude, so that slow and fast modes count alike.
    distances = np.abs(ideal[:, None] - poles[None, :]) / np.abs(ideal)[:, None]
    # The lagged model has more poles than the ideal one; the assignment of the smallest total
    # distance picks each ideal pole's counterpart.
    rows, columns = linear_sum_assignment(distances)
    largest: dict[str, float] = {}
    for row, column in zip(rows, columns, strict=True):
        # The ideal pole decides on the mode, as the counterpart's shape may have changed.
        mode = locus.mode(car, complex(ideal[row]))
        largest[mode] = max(largest.get(mode, 0.0), float(distances[row, column]))
    return largest


def slowest(locus: Locus, value: float, candidates: np.ndarray, mode: str) -> float:
    """Return the largest real part of the oscillating poles of a mode, 1/s."""
    car = locus.at(value).car
    return max(
        pole.real
        for pole in candidates.tolist()
        if pole.imag > OSCILLATES * abs(pole) and locus.mode(car, pole) == mode
    )


def _off_trajectory(locus: Locus) -> float:
    """Return the largest relative distance of the body hop from the ideal poles of the sweep."""
    curve = locus.ideal.ravel()
    worst_of_all = 0.0
    for value, row in zip(locus.values[::10], locus.poles[::10], strict=True):
        car = locus.at(float(value)).car
        for pole in row:
            if pole.imag > OSCILLATES * abs(pole) and locus.mode(car, pole) == BODY:
                worst_of_all = max(worst_of_all, float(np.abs(curve - pole).min() / abs(pole)))
    return worst_of_all


def format_percent(share: float) -> str:
    """Format a share as a percentage."""
    return f"{100.0 * share:.3g} %"
