"""Judges of the shape of a root locus: asymptotes, breakaway and break-in points."""

from __future__ import annotations

import numpy as np

from experiments.thesis.judges import BEYOND, OSCILLATES, Judge, format_numbers
from rigtwin.studies.stability.locus import Locus


def asymptote(end: str) -> Judge:
    """Return a judge: towards an end, `start` or `end`, a pair approaches a vertical asymptote.

    Its frequency grows without bound while its real part converges to a negative value.
    """

    def judge(locus: Locus) -> tuple[bool, str]:
        near, far = _beyond(locus, end)
        # Between 10³ and 10⁶ times past the end, a vertical asymptote multiplies the frequency
        # by 10^1.5 or more and moves the real part by less than 5 %.
        holds = (
            far.imag > 5.0 * near.imag
            and abs(far.real - near.real) < 0.05 * abs(far.real)
            and far.real < 0.0
        )
        words = f"real part → {far.real:.4g} 1/s, frequency {near.imag:.3g} → {far.imag:.3g} rad/s"
        return bool(holds), words

    return judge


def asymptote_at_zero(locus: Locus) -> tuple[bool, str]:
    """Judge whether a pair approaches the imaginary axis from the left at a growing frequency."""
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
    """Judge whether `asymptote_at_zero` does not hold."""
    holds, words = asymptote_at_zero(locus)
    return not holds, words


def asymptote_left_of(reference: Locus, name: str) -> Judge:
    """Return a judge: the asymptote at the start is further left than that of a reference.

    Its frequency there is higher, too.
    """

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, theirs = _beyond(locus, "start"), _beyond(reference, "start")
        holds = (
            ours[1].real < theirs[1].real and _highest(locus, 0).imag > _highest(reference, 0).imag
        )
        words = (
            f"{ours[1].real:.4g} 1/s, {_highest(locus, 0).imag:.3g} rad/s "
            f"at the start; {name} {theirs[1].real:.4g} 1/s, "
        )
        return bool(holds), words + f"{_highest(reference, 0).imag:.3g} rad/s"

    return judge


def breaks_away(locus: Locus) -> tuple[bool, str]:
    """Judge whether two real poles meet and leave the real axis: a breakaway point."""
    pairs = [oscillating_pairs(row) for row in locus.poles]
    # Pairs are counted, not tracked: two real poles that merge add one pair.
    rises = np.flatnonzero(np.diff(pairs) > 0)
    if not len(rises):
        return False, f"{pairs[0]} oscillating pairs throughout"
    return (
        True,
        f"at {locus.values[rises[0] + 1]:.3g}, real part {_breakaway_pole(locus).real:.3g} 1/s",
    )


def stays_away(locus: Locus) -> tuple[bool, str]:
    """Judge whether a pair leaves the real axis and does not return to it."""
    holds = breaks_away(locus)[0] and not breaks_in(locus)[0]
    return holds, breaks_in(locus)[1]


def breaks_in(locus: Locus) -> tuple[bool, str]:
    """Judge whether a pair leaves the real axis and returns to it: a break-in point."""
    pairs = [oscillating_pairs(row) for row in locus.poles]
    changes = np.diff(pairs)
    away, back = np.flatnonzero(changes > 0), np.flatnonzero(changes < 0)
    if not len(away):
        return False, "never leaves the real axis"
    words = f"leaves at {locus.values[away[0] + 1]:.3g}"
    if len(back) and back[-1] > away[0]:
        return True, f"{words}, back at {locus.values[back[-1] + 1]:.3g}"
    # A break-in past the printed range explains a statement that fails within it.
    for value in float(locus.values[-1]) * np.logspace(0.0, np.log10(BEYOND), 300):
        if oscillating_pairs(locus.poles_at(float(value))) < pairs[-1]:
            return False, f"{words}, back only past the end of the sweep, at {value:.3g}"
    return False, f"{words}, does not come back"


def breaks_away_left_of(reference: Locus, name: str) -> Judge:
    """Return a judge: the first breakaway point is further left than that of a reference."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, theirs = _breakaway_pole(locus).real, _breakaway_pole(reference).real
        return ours < theirs, f"real part {ours:.3g} 1/s; {name} {theirs:.3g}"

    return judge


def wheel_goes_left(locus: Locus) -> tuple[bool, str]:
    """Judge whether the real part of the fastest pair falls in the last third of the sweep."""
    third = locus.poles[2 * len(locus.poles) // 3 :]
    real = [max(row.tolist(), key=lambda pole: pole.imag).real for row in third]
    words = f"real part {real[0]:.3g} → {real[-1]:.3g} 1/s in the last third of the sweep"
    return bool(np.all(np.diff(real) < 0.0)), words


def ends_left_of(reference: Locus, name: str) -> Judge:
    """Return a judge: the rightmost pole at the end is further left than that of a reference."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, theirs = locus.poles[-1].real.max(), reference.poles[-1].real.max()
        return bool(ours < theirs), f"real part {ours:.3g} 1/s at the end; {name} {theirs:.3g}"

    return judge


def ends_faster_than(reference: Locus, name: str) -> Judge:
    """Return a judge: the highest frequency at the end exceeds that of a reference."""

    def judge(locus: Locus) -> tuple[bool, str]:
        ours, theirs = _highest(locus, -1).imag, _highest(reference, -1).imag
        return ours > theirs, f"{ours:.3g} rad/s at the end; {name} {theirs:.3g}"

    return judge


def far_left(count: int) -> Judge:
    """Return a judge: `count` poles start far left, at ten times the largest ideal magnitude."""

    def judge(locus: Locus) -> tuple[bool, str]:
        # Ten times the fastest ideal pole: the filter has decayed before the vehicle moves.
        limit = -10.0 * np.abs(locus.ideal[0]).max()
        far_poles = np.sort(locus.poles[0].real[locus.poles[0].real < limit])
        return len(far_poles) == count, f"{len(far_poles)}: {format_numbers(far_poles)} 1/s"

    return judge


def pairs_at_start(ideal: int, ours: int) -> Judge:
    """Return a judge of the number of oscillating pairs at the start, ideal and with the lag."""
    return _pairs_at(0, "start", ideal, ours)


def pairs_at_end(ideal: int, ours: int) -> Judge:
    """Return a judge of the number of oscillating pairs at the end, ideal and with the lag."""
    return _pairs_at(-1, "end", ideal, ours)


def _pairs_at(row: int, end: str, ideal: int, ours: int) -> Judge:
    def judge(locus: Locus) -> tuple[bool, str]:
        pairs = oscillating_pairs(locus.ideal[row]), oscillating_pairs(locus.poles[row])
        return pairs == (
            ideal,
            ours,
        ), f"{pairs[0]} ideal and {pairs[1]} MIL pairs oscillate at the {end}"

    return judge


def oscillating_pairs(row: np.ndarray) -> int:
    """Return the number of complex-conjugate pairs among some poles, shape (poles,)."""
    return int(np.sum(row.imag > OSCILLATES * np.abs(row)))


def _breakaway_pole(locus: Locus) -> complex:
    """Return the pole, above the real axis, of the pair that leaves the axis first."""
    pairs = [oscillating_pairs(row) for row in locus.poles]
    row = int(np.flatnonzero(np.diff(pairs) > 0)[0]) + 1
    oscillating = [pole for pole in locus.poles[row].tolist() if pole.imag > OSCILLATES * abs(pole)]
    # The pair has just left the axis: of all pairs it has the smallest angle to it.
    return min(oscillating, key=lambda pole: pole.imag / abs(pole))


def _highest(locus: Locus, row: int) -> complex:
    """Return the pole of the highest frequency at a row of the sweep."""
    return max(locus.poles[row].tolist(), key=lambda pole: pole.imag)


def _beyond(locus: Locus, end: str) -> tuple[complex, complex]:
    """Return the pole of the highest frequency past an end of the sweep, 10³ and 10⁶ times."""
    value = float(locus.values[0] if end == "start" else locus.values[-1])
    # Sweeps run over ratios, so both ends are extended by factors.
    factors = (1.0 / BEYOND, BEYOND**-2) if end == "start" else (BEYOND, BEYOND**2)
    near, far = (
        max(locus.poles_at(value * factor).tolist(), key=lambda pole: pole.imag)
        for factor in factors
    )
    return near, far
