"""Statements of the thesis about quarter-car tests, judged on simulated tests."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import butter, sosfiltfilt

from experiments import find
from experiments.thesis.entry import Entry, statement
from experiments.thesis.quarter_car_drawings import (
    lagged_drops,
)
from experiments.thesis.study import Result
from experiments.thesis.trial import over_seeds
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.ideal import simulate_ideal

HOP = 4.0
"""Frequency that separates body motion, at 1 Hz, from wheel hop, at 6.2 Hz."""


def hop(signal: Array, period: float) -> Array:
    """Return the wheel hop in a motion: its part above `HOP` Hz, without phase lag."""
    return sosfiltfilt(butter(2, HOP, "highpass", fs=1 / period, output="sos"), signal)


def judge_statements(results: Mapping[str, Result]) -> list[Entry]:
    """Return the entries of what §6.3 says about its figures."""
    return [
        *_swing_entries(results),
        *_lag_entries(),
        *_friction_entries(results),
        statement(
            "Figure 6.33", "1000 Ns/m at the wheel", "hop gone after one swing", *_damped_wheel()
        ),
    ]


def _median(results: Mapping[str, Result], name: str, value: str) -> float:
    """Return the median of a value over the seeds of a test."""
    return float(np.median(over_seeds(results, name, value)))


def _swing_entries(results: Mapping[str, Result]) -> list[Entry]:
    """Return the entries of the body's first swing after the drop (Fig. 6.25)."""
    overshoot, body, ideal = (
        _median(results, "drop", key)
        for key in ("overshoot", "body frequency", "ideal body frequency")
    )
    return [
        statement(
            "Figure 6.25",
            "first swing of the sprung mass",
            "beyond the ideal",
            overshoot > 0,
            f"by {1e3 * overshoot:.1f} mm",
        ),
        statement(
            "Figure 6.25",
            "body frequency",
            "slightly above the ideal",
            body > ideal,
            f"{body:.3f} Hz, ideal {ideal:.3f} Hz",
        ),
    ]


def _lag_entries() -> list[Entry]:
    """Return the entries of the ideal drop with lags (Fig. 6.26)."""
    lags = lagged_drops()
    # Both lags delay the force by the same time, so both take the same damping away.
    peaks = {name: float(-np.min(position[:1500])) for name, (_, position) in lags.items()}
    more = [peaks[name] - peaks["none"] for name in ("lag on force", "lag on position")]
    damping, force = (
        lags[name][0] / lags["none"][0] for name in ("lag on damping", "lag on force")
    )
    return [
        statement(
            "Figure 6.26",
            "lag of 20 ms on force, or on position",
            "alike: larger swing",
            abs(more[0] - more[1]) < 0.25 * more[0],
            f"{1e3 * more[0]:.1f} and {1e3 * more[1]:.1f} mm more",
        ),
        statement(
            "Figure 6.26",
            "lag of 50 ms on the damping force alone",
            "raises the body frequency more than a lag on all the force",
            damping > 1.005 and damping > force,
            f"x {damping:.3f}, with 20 ms on all the force x {force:.3f}",
        ),
    ]


def _friction_entries(results: Mapping[str, Result]) -> list[Entry]:
    """Return the entries of limit cycle, wheel and drift: the traces of friction in §6.3."""
    # Medians over the seeds, as single tests differ by their noise.
    swing, hop_rms, ideal_hop = (
        _median(results, "drop", key) for key in ("swing at rest", "hop", "ideal hop")
    )
    # Double integration turns a constant force error into a drift of the position.
    drift = over_seeds(results, "drop", "rest position") - over_seeds(
        results, "drop", "ideal rest position"
    )
    share, ideal_share = (_median(results, "road10", key) for key in ("moving", "ideal moving"))
    still, driven = (_median(results, name, "force_total") for name in ("drop", "road1.6"))
    return [
        statement(
            "Figure 6.30",
            "force at rest",
            "limit cycle by friction",
            # Friction of 14 N that changes its direction swings the force by 28 N.
            swing > 28.0,
            f"{swing:.0f} N peak to peak",
        ),
        statement(
            "Figure 6.29",
            "wheel hop after the drop",
            "absent on the rig",
            hop_rms < 0.25 * ideal_hop,
            f"{1e6 * hop_rms:.0f} um rms from 1.5 to 4 s, ideal {1e6 * ideal_hop:.0f} um",
        ),
        statement(
            "Figure 6.31",
            "drift at rest",
            "sprung mass drifts",
            bool(np.std(drift) > 1e-4),
            f"{1e3 * np.median(np.abs(drift)):.1f} mm off",
            "the nominal load cell has no offset for the double integration to add up",
        ),
        statement(
            "Figure 6.47",
            "wheel on the 10 Hz road",
            "held by friction",
            share < 0.6 * ideal_share,
            f"moves {100 * share:.0f} % of the time, ideal {100 * ideal_share:.0f} %",
        ),
        statement(
            "§6.3.2",
            "force error on the road",
            "below that of the drop",
            driven < still,
            f"{driven:.1f} N, drop {still:.1f} N",
        ),
    ]


def _damped_wheel() -> tuple[bool, str]:
    """Judge the remaining wheel hop with a tyre damping of 1000 Ns/m, against none (Fig. 6.33)."""
    configuration = find("drop").configuration
    remaining = []
    for damping in (0.0, 1000.0):
        plant = configuration.plant._replace(
            tyre=configuration.plant.tyre._replace(damping=damping)
        )
        # 4000 ticks of 1 ms; the hop is judged from 0.6 to 1.6 s, after its first swing.
        wheel = simulate_ideal(configuration._replace(plant=plant), np.zeros(4000)).wheel
        remaining.append(float(np.std(hop(wheel, 1e-3)[600:1600])))
    without, damped = remaining
    words = f"{1e6 * damped:.1f} um rms left after 0.6 s, without {1e6 * without:.0f} um"
    return damped < 0.1 * without, words
