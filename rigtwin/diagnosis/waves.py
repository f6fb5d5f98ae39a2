"""Waves of a force along the stroke: the pitches in the data, and the blend of sine and cosine."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.fft import rfft
from numpy.typing import NDArray

from rigtwin.components.guide_effects import FEWEST_WAVES, MOST_WAVES
from rigtwin.diagnosis.space import Space
from rigtwin.numerics.arrays import Array

Responses = Sequence[tuple[tuple[float, ...], NDArray[np.float32]]]
"""Values of an effect, and the whitened response to each."""
PLACES = 4096
"""Number of intervals into which the stroke is divided: eight for each of the shortest waves."""
SMOOTH = 5
"""Degree of the polynomial in the position that is taken for another force."""


def repeating_pitches(force: Array, position: Array, count: int) -> tuple[float, ...]:
    """Return the pitches at which a force repeats most along the position.

    Of the force are subtracted dry and viscous friction, and a polynomial in the position. The
    pitches are those of the highest peaks of the periodogram of the remaining force over the
    position [Scargle, Astrophys. J. 263 (1982) 835].

    Parameters
    ----------
    force
        Unexplained force, N, shape (ticks,).
    position
        Position, m, shape (ticks,).
    count
        Number of pitches.

    Returns
    -------
    tuple of float
        Pitches, m, that of the highest peak first. Empty where nothing moved.
    """
    stroke = float(np.ptp(position))
    if stroke == 0.0:
        return ()
    share = (position - position.min()) / stroke
    velocity = np.gradient(share)
    others = np.stack([np.sign(velocity), velocity, *(share**n for n in range(SMOOTH + 1))])
    remaining = force - others.T @ np.linalg.lstsq(others.T, force, rcond=None)[0]
    places = np.minimum((share * PLACES).astype(int), PLACES - 1)
    along = np.bincount(places, remaining, PLACES)
    # Zeros as long as the stroke resolve the peaks to half a wave.
    power = np.abs(rfft(along, 2 * PLACES)) ** 2
    waves = np.arange(len(power)) / 2.0
    inner = power[1:-1]
    is_peak = (inner >= power[:-2]) & (inner > power[2:])
    is_peak &= (waves[1:-1] >= FEWEST_WAVES) & (waves[1:-1] <= MOST_WAVES)
    peaks = 1 + np.nonzero(is_peak)[0]
    highest = peaks[np.argsort(-power[peaks], kind="stable")][:count]
    return tuple((stroke / waves[highest]).tolist())


def blend_waves(
    space: Space, responses: Responses, residual: Array
) -> list[tuple[float, tuple[float, ...], Array]]:
    """Return the blend of sine and cosine of each pitch that explains most of a residual.

    The response to the amplitude a at the phase p is a cos(p) times the first plus a sin(p) times
    the second response of a pair, so that amplitude and phase follow from two linear strengths.

    Parameters
    ----------
    space
        Tolerances, which are projected out.
    responses
        Responses in pairs of one pitch, a quarter of a wave apart.
    residual
        Whitened residual, shape (size,).

    Returns
    -------
    list of tuples
        Chi-square explained, values of the effect and its whitened response, shape (size,), for
        each pitch.
    """
    remainder = space.subtract_tolerances(residual)
    blends = []
    for (start, cosine), (_, sine) in zip(responses[::2], responses[1::2], strict=True):
        pair = np.stack([cosine, sine], axis=1).astype(np.float64)
        # Project the tolerances out of both sides, or the strengths would contain what a tolerance
        # explains as well.
        projected = space.project_out(pair)
        strengths = np.linalg.lstsq(projected, remainder, rcond=None)[0]
        gain = float(np.sum((projected @ strengths) ** 2))
        amplitude = start[0] * float(np.hypot(*strengths))
        phase = float(np.arctan2(strengths[1], strengths[0]))
        blends.append((gain, (amplitude, start[1], phase), pair @ strengths))
    return blends
