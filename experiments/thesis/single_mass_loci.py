"""§5.2 as data: the root loci of the single mass.

Every case of Tables 5.3 to 5.5 stands here with its figures and the thesis' statements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from experiments.thesis import judges, resemblance, shapes
from experiments.thesis.appendix_a import claim, locus_case
from experiments.thesis.loci import LocusCase, locus, of_damping_ratio, of_lag, of_natural_frequency
from rigtwin.studies.stability.locus import BODY

MODEL = "single-mass"
# Sweeps by damping ratio or by lag, s. For a single mass the tables write k and m without index.
LAGS = {ratio: of_lag(ratio) for ratio in (1.0, 0.5)}
SLOW = {
    ratio: replace(of_natural_frequency(ratio, 0.2, 1e5), symbol="k") for ratio in (1.0, 1.5, 0.5)
}
QUICK = {
    ratio: replace(of_natural_frequency(ratio, 0.01, 1e5), symbol="k") for ratio in (1.0, 1.5, 0.5)
}
RATIOS = {lag: replace(of_damping_ratio(lag), symbol="k = m") for lag in (0.2, 0.01, 0.001)}


def _table_5_3() -> tuple[LocusCase, ...]:
    """Return the cases of Table 5.3: the lag is swept at two damping ratios."""
    # At the critical lag τ = b/k the damping vanishes, and the mass swings at √(k/m).
    cases = []
    for number, ratio in ((1, 1.0), (2, 0.5)):
        claims = [
            claim(
                "5.7", "smallest lag", "the filter's pole is on the far left", shapes.far_left(1)
            ),
            claim(
                "5.7", "stability", "unstable as the lag increases", judges.becomes_unstable(BODY)
            ),
            claim(
                "5.8",
                "small lags",
                "the poles match the ideal ones",
                resemblance.resembles("start"),
            ),
            claim(
                "5.8",
                "boundary",
                "resembles an undamped mass on a spring",
                resemblance.undamped_at_boundary,
            ),
        ]
        if number == 1:
            claims.append(
                claim(
                    "5.8", "critically damped", "moves away from the real axis", shapes.breaks_away
                )
            )
        panels = {"5.7": None, "5.8": (-12.0, 2.0, 6.0)}
        cases.append(locus_case(MODEL, number, f"ζ = {ratio:g}", LAGS[ratio], panels, *claims))
    return tuple(cases)


def _table_5_4() -> tuple[LocusCase, ...]:
    """Return the cases of Table 5.4: the natural frequency is swept by the stiffness."""
    # At a constant ζ, b/k ∝ 1/√k: 0.2 s becomes unstable within the sweep, 0.01 s does not.
    cases = []
    for number, ratio, figure in ((1, 1.0, "5.9"), (2, 1.5, "5.10"), (3, 0.5, "5.11")):
        claims = [
            claim(
                figure,
                "stability",
                "unstable as the natural frequency increases",
                judges.becomes_unstable(BODY),
            )
        ]
        if ratio > 0.5:
            further_left = shapes.ends_left_of(locus(MODEL, SLOW[0.5]), "ζ = 0.5")
            claims.append(
                claim(
                    figure,
                    "end of the sweep",
                    "further right for lower damping ratios",
                    further_left,
                )
            )
        cases.append(
            locus_case(
                MODEL, number, f"ζ = {ratio:g}, τ = 0.2 s", SLOW[ratio], {figure: None}, *claims
            )
        )
    for number, ratio, figure in ((4, 1.0, "5.12"), (5, 1.5, "5.13"), (6, 0.5, "5.14")):
        slow = locus(MODEL, SLOW[ratio])
        claims = [
            claim(figure, "stability", "no instability at 44.72 rad/s", judges.stable_throughout),
            claim(
                figure,
                "end of the sweep",
                "a much higher frequency",
                shapes.ends_faster_than(slow, "τ = 0.2 s"),
            ),
        ]
        if ratio >= 1.0:
            further_left = shapes.breaks_away_left_of(slow, "τ = 0.2 s")
            claims.append(claim(figure, "breakaway", "further left with less lag", further_left))
        cases.append(
            locus_case(
                MODEL, number, f"ζ = {ratio:g}, τ = 0.01 s", QUICK[ratio], {figure: None}, *claims
            )
        )
    return tuple(cases)


def _table_5_5() -> tuple[LocusCase, ...]:
    """Return the cases of Table 5.5: the damping ratio falls from 50 to 0.0005."""
    # The sweep starts at the high ratio, so `start` of a judge means strong damping.
    slow, quick = (locus(MODEL, RATIOS[lag]) for lag in (0.2, 0.01))
    further = shapes.asymptote_left_of(slow, "τ = 0.2 s")
    # ζ = b/(2 √(k m)) = b/(2 k) with b = 100 Ns/m and k = m.
    at_ratio_0_005 = 1e4  # k = m, in N/m and kg
    note = "at 0.005 it is on the boundary, b/k = τ, and below it, in the printed range, unstable"
    low = (-0.6, 0.2, 1.6)
    return (
        locus_case(
            MODEL,
            1,
            "τ = 0.2 s",
            RATIOS[0.2],
            {"5.15": None, "5.16": low},
            claim("5.15", "high ratios", "vertical asymptote", shapes.asymptote("start")),
            claim("5.16", "low ratios", "unstable", judges.becomes_unstable(BODY)),
        ),
        locus_case(
            MODEL,
            2,
            "τ = 0.01 s",
            RATIOS[0.01],
            {"5.17": None, "5.18": low},
            claim("5.17", "high ratios", "asymptote further left, frequencies higher", further),
            claim(
                "5.18",
                "damping ratio 0.005",
                "does not cause instability",
                judges.not_unstable_at(at_ratio_0_005),
                note,
            ),
        ),
        locus_case(
            MODEL,
            3,
            "τ = 0.001 s",
            RATIOS[0.001],
            {"5.19": None, "5.20": low},
            claim("5.19", "high ratios", "no asymptote", shapes.pairs_at_start(0, 0)),
            claim(
                "5.19",
                "resemblance",
                "far better than with more lag",
                resemblance.closer_than(quick, "τ = 0.01 s"),
            ),
            claim(
                "5.20",
                "damping ratio 0.005",
                "does not cause instability",
                judges.not_unstable_at(at_ratio_0_005),
            ),
        ),
    )


CASES: Mapping[str, Callable[[], tuple[LocusCase, ...]]] = {
    "5.3": _table_5_3,
    "5.4": _table_5_4,
    "5.5": _table_5_5,
}
"""Functions that return the cases of a table, by its number."""
