"""What can be asked of how near the poles of a locus are to the ideal ones."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from experiments.thesis.judges import OSCILLATES, TOGETHER, Judge, listed
from rigtwin.studies.stability.locus import BODY, WHEEL, Locus
from rigtwin.studies.stability.models import ideal_quarter_car, ideal_single_mass, poles

ALIKE = 0.1
"""Of an ideal pole's distance from the origin: how far a pole may be from it and still resemble
it."""


def closest_at(end: str) -> Judge:
    """The poles are nearer to the ideal ones at that end of the sweep than at the other."""

    def judge(locus: Locus) -> tuple[bool, str]:
        start, last = (_apart(locus, float(value)) for value in locus.values[[0, -1]])
        first, second = max(start.values()), max(last.values())
        return bool(
            (first < second) == (end == "start")
        ), f"{percent(first)} off at the start, {percent(second)} at the end"

    return judge


def resembles(end: str) -> Judge:
    """Every ideal pole has one within a tenth of its size at that end of the sweep."""

    def judge(locus: Locus) -> tuple[bool, str]:
        off = max(_apart(locus, float(locus.values[0 if end == "start" else -1])).values())
        return off < ALIKE, f"{percent(off)} off at the {end}"

    return judge


def never_resembles(locus: Locus) -> tuple[bool, str]:
    """At no value has every ideal pole one within a tenth of its size."""
    off = [max(_apart(locus, float(value)).values()) for value in locus.values[::10]]
    return min(off) > ALIKE, f"{percent(min(off))} off at least"


def closer_than(other: Locus, name: str) -> Judge:
    """The worst distance from the ideal over the sweep is smaller than another locus has."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, others = (
            max(max(_apart(each, float(value)).values()) for value in each.values[::10])
            for each in (locus, other)
        )
        return ours < others, f"{percent(ours)} off at most; {name} {percent(others)}"

    return judge


def wheel_closer_than(other: Locus, name: str) -> Judge:
    """The worst distance of the ideal wheel hop from a pole is smaller than another locus has."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, others = (
            max(_apart(each, float(value))[WHEEL] for value in each.values[::10])
            for each in (locus, other)
        )
        return ours < others, f"wheel hop {percent(ours)} off at most; {name} {percent(others)}"

    return judge


def wheel_resembles(end: str) -> Judge:
    """The ideal wheel hop has a pole within a tenth of its size at that end of the sweep."""

    def judge(locus: Locus) -> tuple[bool, str]:
        off = _apart(locus, float(locus.values[0 if end == "start" else -1]))[WHEEL]
        return off < ALIKE, f"wheel hop {percent(off)} off at the {end}"

    return judge


def wheel_damping_closest_at(end: str) -> Judge:
    """The decay rate of the wheel hop is nearer to the ideal one at that end of the sweep than at
    the other."""

    def judge(locus: Locus) -> tuple[bool, str]:
        off = []
        for value in map(float, locus.values[[0, -1]]):
            ideal, ours = (
                slowest(locus, value, each, WHEEL)
                for each in (locus.ideal_at(value), locus.poles_at(value))
            )
            off.append(abs(ours / ideal - 1.0))
        words = (
            f"decay rate of the wheel hop {percent(off[0])} off "
            f"at the start, {percent(off[1])} at the end"
        )
        return (off[0] < off[1]) == (end == "start"), words

    return judge


def worst(mode: str, end: str) -> Judge:
    """At that end of the sweep this mode is further from the ideal than the other."""

    def judge(locus: Locus) -> tuple[bool, str]:
        apart = _apart(locus, float(locus.values[0 if end == "start" else -1]))
        words = (
            f"body hop {percent(apart[BODY])}, wheel hop {percent(apart[WHEEL])} off at the {end}"
        )
        return apart[mode] == max(apart.values()), words

    return judge


def body_on_ideal_trajectory(other: Locus, name: str) -> Judge:
    """The oscillating body hop stays within a tenth of its size of the curve that the ideal one
    describes, unlike another."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, others = _off_trajectory(locus), _off_trajectory(other)
        return (
            ours < ALIKE < others,
            f"{percent(ours)} off the curve at most; {name} {percent(others)}",
        )

    return judge


def body_unstable_at_end(locus: Locus) -> tuple[bool, str]:
    """A body hop pole has a positive real part at the end of the sweep."""
    end = float(locus.values[-1])
    real = slowest(locus, end, locus.poles_at(end), BODY)
    return real > 0.0, f"{real:.3g} 1/s at {end:g}"


def undamped_at_boundary(locus: Locus) -> tuple[bool, str]:
    """The frequencies at the crossings are those of the vehicle without damping."""
    car = locus.at(locus.crossings[0].value).car._replace(suspension_damping=0.0, tyre_damping=0.0)
    undamped = (
        ideal_single_mass(car.sprung) if locus.model == "single-mass" else ideal_quarter_car(car)
    )
    expected = sorted(pole.imag for pole in poles(undamped) if pole.imag > 0.0)
    crossed = sorted(crossing.frequency for crossing in locus.crossings)
    holds = len(crossed) == len(expected) and bool(np.allclose(crossed, expected, rtol=1e-6))
    return holds, f"crosses at {listed(crossed)} rad/s; undamped {listed(expected)}"


def undamped_at_end(mode: str) -> Judge:
    """At the end of the sweep an ideally damped mode is not, nor is it unstable."""

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


def _apart(locus: Locus, value: float) -> dict[str, float]:
    """Mode → how far its ideal poles are from those that stand for them, of their distance from the
    origin."""
    ideal, poles, car = locus.ideal_at(value), locus.poles_at(value), locus.at(value).car
    distances = np.abs(ideal[:, None] - poles[None, :]) / np.abs(ideal)[:, None]
    rows, columns = linear_sum_assignment(distances)
    found: dict[str, float] = {}
    for row, column in zip(rows, columns, strict=True):
        mode = locus.mode(car, complex(ideal[row]))
        found[mode] = max(found.get(mode, 0.0), float(distances[row, column]))
    return found


def slowest(locus: Locus, value: float, found: np.ndarray, mode: str) -> float:
    """The largest real part of the oscillating poles of that mode, 1/s."""
    car = locus.at(value).car
    return max(
        pole.real
        for pole in found.tolist()
        if pole.imag > OSCILLATES * abs(pole) and locus.mode(car, pole) == mode
    )


def _off_trajectory(locus: Locus) -> float:
    """The largest distance of an oscillating body hop pole from the ideal poles of the sweep, of
    its own from the origin."""
    curve = locus.ideal.ravel()
    worst_of_all = 0.0
    for value, row in zip(locus.values[::10], locus.poles[::10], strict=True):
        car = locus.at(float(value)).car
        for pole in row:
            if pole.imag > OSCILLATES * abs(pole) and locus.mode(car, pole) == BODY:
                worst_of_all = max(worst_of_all, float(np.abs(curve - pole).min() / abs(pole)))
    return worst_of_all


def percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"
