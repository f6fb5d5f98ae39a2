"""What can be asked of a root locus's course: asymptotes, and where poles leave the real axis and
come back to it."""

from __future__ import annotations

import numpy as np

from experiments.thesis.judges import BEYOND, OSCILLATES, Judge, listed
from rigtwin.studies.stability.locus import Locus


def asymptote(end: str) -> Judge:
    """Towards that end, `start` or `end`, a pair's frequency grows without bound while its real
    part comes to rest."""

    def judge(locus: Locus) -> tuple[bool, str]:
        near, far = _beyond(locus, end)
        holds = (
            far.imag > 5.0 * near.imag
            and abs(far.real - near.real) < 0.05 * abs(far.real)
            and far.real < 0.0
        )
        return bool(
            holds
        ), f"real part → {far.real:.4g} 1/s, frequency {near.imag:.3g} → {far.imag:.3g} rad/s"

    return judge


def asymptote_at_zero(locus: Locus) -> tuple[bool, str]:
    """Towards the end of the sweep a pair's frequency grows without bound while its real part
    vanishes from the left."""
    near, far = _beyond(locus, "end")
    holds = (
        far.imag > 5.0 * near.imag
        and near.real < far.real < 0.0
        and abs(far.real) < 0.05 * abs(near.real)
    )
    return (
        bool(holds),
        f"real part {near.real:.3g} → {far.real:.3g} 1/s, frequency "
        f"{near.imag:.3g} → {far.imag:.3g} rad/s",
    )


def no_asymptote_at_zero(locus: Locus) -> tuple[bool, str]:
    holds, words = asymptote_at_zero(locus)
    return not holds, words


def asymptote_left_of(other: Locus, name: str) -> Judge:
    """Both have an asymptote at the start of the sweep; this one is further left and has a higher
    frequency there."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, others = _beyond(locus, "start"), _beyond(other, "start")
        holds = ours[1].real < others[1].real and _highest(locus, 0).imag > _highest(other, 0).imag
        words = (
            f"{ours[1].real:.4g} 1/s, {_highest(locus, 0).imag:.3g} rad/s "
            f"at the start; {name} {others[1].real:.4g} 1/s, "
        )
        return bool(holds), words + f"{_highest(other, 0).imag:.3g} rad/s"

    return judge


def breaks_away(locus: Locus) -> tuple[bool, str]:
    """Somewhere in the sweep two real poles meet and leave the real axis."""
    pairs = [oscillating_pairs(row) for row in locus.poles]
    rises = np.flatnonzero(np.diff(pairs) > 0)
    if not len(rises):
        return False, f"{pairs[0]} oscillating pairs throughout"
    return True, f"at {locus.values[rises[0] + 1]:.3g}, real part {_newborn(locus).real:.3g} 1/s"


def stays_away(locus: Locus) -> tuple[bool, str]:
    """A pair leaves the real axis and does not come back to it."""
    holds = breaks_away(locus)[0] and not breaks_in(locus)[0]
    return holds, breaks_in(locus)[1]


def breaks_in(locus: Locus) -> tuple[bool, str]:
    """Somewhere in the sweep a pair leaves the real axis and later comes back to it."""
    pairs = [oscillating_pairs(row) for row in locus.poles]
    changes = np.diff(pairs)
    away, back = np.flatnonzero(changes > 0), np.flatnonzero(changes < 0)
    if not len(away):
        return False, "never leaves the real axis"
    words = f"leaves at {locus.values[away[0] + 1]:.3g}"
    if len(back) and back[-1] > away[0]:
        return True, f"{words}, back at {locus.values[back[-1] + 1]:.3g}"
    for value in float(locus.values[-1]) * np.logspace(0.0, np.log10(BEYOND), 300):
        if oscillating_pairs(locus.poles_at(float(value))) < pairs[-1]:
            return False, f"{words}, back only past the end of the sweep, at {value:.3g}"
    return False, f"{words}, does not come back"


def breaks_away_left_of(other: Locus, name: str) -> Judge:
    """Its first pair leaves the real axis further left than another's."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, others = _newborn(locus).real, _newborn(other).real
        return ours < others, f"real part {ours:.3g} 1/s; {name} {others:.3g}"

    return judge


def wheel_goes_left(locus: Locus) -> tuple[bool, str]:
    """In the last third of the sweep the fastest oscillation's real part falls."""
    third = locus.poles[2 * len(locus.poles) // 3 :]
    real = [max(row.tolist(), key=lambda pole: pole.imag).real for row in third]
    return bool(
        np.all(np.diff(real) < 0.0)
    ), f"real part {real[0]:.3g} → {real[-1]:.3g} 1/s in the last third of the sweep"


def ends_left_of(other: Locus, name: str) -> Judge:
    """At the end of the sweep the rightmost pole is further left than another locus's."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, others = locus.poles[-1].real.max(), other.poles[-1].real.max()
        return bool(ours < others), f"real part {ours:.3g} 1/s at the end; {name} {others:.3g}"

    return judge


def ends_faster_than(other: Locus, name: str) -> Judge:
    """At the end of the sweep its highest frequency is above another locus's."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, others = _highest(locus, -1).imag, _highest(other, -1).imag
        return ours > others, f"{ours:.3g} rad/s at the end; {name} {others:.3g}"

    return judge


def far_left(count: int) -> Judge:
    """That many poles start ten times as far from the origin as any ideal one."""

    def judge(locus: Locus) -> tuple[bool, str]:
        limit = -10.0 * np.abs(locus.ideal[0]).max()
        left = np.sort(locus.poles[0].real[locus.poles[0].real < limit])
        return len(left) == count, f"{len(left)}: {listed(left)} 1/s"

    return judge


def pairs_at_start(ideal: int, ours: int) -> Judge:
    """How many oscillating pairs there are at the start of the sweep."""
    return _pairs_at(0, "start", ideal, ours)


def pairs_at_end(ideal: int, ours: int) -> Judge:
    """How many oscillating pairs there are at the end of the sweep."""
    return _pairs_at(-1, "end", ideal, ours)


def _pairs_at(row: int, end: str, ideal: int, ours: int) -> Judge:
    def judge(locus: Locus) -> tuple[bool, str]:
        found = oscillating_pairs(locus.ideal[row]), oscillating_pairs(locus.poles[row])
        return found == (
            ideal,
            ours,
        ), f"{found[0]} ideal and {found[1]} MIL pairs oscillate at the {end}"

    return judge


def oscillating_pairs(row: np.ndarray) -> int:
    return int(np.sum(row.imag > OSCILLATES * np.abs(row)))


def _newborn(locus: Locus) -> complex:
    """Of the pair that first leaves the real axis."""
    pairs = [oscillating_pairs(row) for row in locus.poles]
    row = int(np.flatnonzero(np.diff(pairs) > 0)[0]) + 1
    oscillating = [pole for pole in locus.poles[row].tolist() if pole.imag > OSCILLATES * abs(pole)]
    return min(oscillating, key=lambda pole: pole.imag / abs(pole))


def _highest(locus: Locus, row: int) -> complex:
    """The pole of the highest frequency at a value of the sweep."""
    return max(locus.poles[row].tolist(), key=lambda pole: pole.imag)


def _beyond(locus: Locus, end: str) -> tuple[complex, complex]:
    """The pole of the highest frequency at that end of the sweep and far past it."""
    value = float(locus.values[0] if end == "start" else locus.values[-1])
    factors = (1.0 / BEYOND, BEYOND**-2) if end == "start" else (BEYOND, BEYOND**2)
    near, far = (
        max(locus.poles_at(value * factor).tolist(), key=lambda pole: pole.imag)
        for factor in factors
    )
    return near, far
