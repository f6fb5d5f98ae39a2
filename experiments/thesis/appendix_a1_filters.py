"""Cases of Table A1.2 of the thesis: filters in the measured force."""

from __future__ import annotations

from experiments.thesis import judges, resemblance, shapes
from experiments.thesis.appendix_a import (
    QUICK,
    SLOW,
    claim,
    locus_case,
)
from experiments.thesis.loci import LocusCase, locus
from rigtwin.studies.stability.locus import BODY, WHEEL


def slow_filter() -> list[LocusCase]:
    """Return cases 1 to 3 of Table A1.2, with a lag of 0.2 s."""
    cases = []
    # The sweep with 0.2 s reaches instability; that with 0.01 s of the next cases does so only at
    # a much higher frequency.
    for number, ratio, figures in ((1, 1.0, (6, 7)), (2, 1.5, (8, 9)), (3, 0.5, (10, 11))):
        whole, part = (f"A1.{figure}" for figure in figures)
        claims = [
            claim(
                whole,
                "resemblance",
                "greatest when the natural frequency is low",
                resemblance.closest_at("start"),
            ),
            claim(
                whole,
                "stability",
                "both modes move right and become unstable",
                judges.becomes_unstable(BODY, WHEEL),
            ),
            claim(whole, "stability", "they become unstable together", judges.cross_together),
            claim(
                part,
                "body hop",
                "has a positive real part at 44.72 rad/s",
                resemblance.body_unstable_at_end,
            ),
        ]
        if ratio >= 1.0:
            claims.append(
                claim(
                    whole,
                    "wheel hop",
                    "ideally overdamped, with the lag not",
                    shapes.pairs_at_end(1, 2),
                )
            )
            claims.append(
                claim(
                    whole,
                    "breakaway",
                    "a conjugate pair develops at a breakaway point",
                    shapes.breaks_away,
                )
            )
        views = {whole: None, part: (-6.0, 2.0, 6.0)}
        cases.append(
            locus_case(
                "suspension", number, f"ζ = {ratio:g}, τ = 0.2 s", SLOW[ratio], views, *claims
            )
        )
    return cases


def quick_filter() -> list[LocusCase]:
    """Return cases 4 to 6 of Table A1.2, with a lag of 0.01 s."""
    cases = []
    for number, ratio, figure in ((4, 1.0, 12), (5, 1.5, 13), (6, 0.5, 14)):
        name, slow = f"A1.{figure}", locus("suspension", SLOW[ratio])
        claims = [
            claim(
                name,
                "smaller lag",
                "a higher natural frequency is required",
                judges.later_than(slow, "τ = 0.2 s"),
            ),
            claim(
                name,
                "resemblance",
                "greatest when the natural frequency is low",
                resemblance.closest_at("start"),
            ),
        ]
        if ratio >= 1.0:
            claims.append(
                claim(
                    name,
                    "breakaway",
                    "further left with less lag",
                    shapes.breaks_away_left_of(slow, "τ = 0.2 s"),
                )
            )
        if ratio > 0.5:
            light = locus("suspension", QUICK[0.5])
            claims.append(
                claim(
                    name,
                    "damping",
                    "more stable with a higher ratio",
                    judges.later_than(light, "ζ = 0.5"),
                )
            )
        cases.append(
            locus_case(
                "suspension",
                number,
                f"ζ = {ratio:g}, τ = 0.01 s",
                QUICK[ratio],
                {name: None},
                *claims,
            )
        )
    return cases
