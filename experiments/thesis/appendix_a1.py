"""Appendix A1 as data: suspension MIL.

Every case of Tables A1.1 to A1.5 stands here with its figures and the thesis' statements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from experiments.thesis import judges, resemblance, shapes
from experiments.thesis.appendix_a import (
    LAGS,
    LIGHT,
    QUICK,
    RATIOS,
    SLOW,
    STIFF,
    TYRES,
    WHEELS,
    claim,
    corrected_lag_suffix,
    locus_case,
    misprint_note,
)
from experiments.thesis.loci import LocusCase, locus
from rigtwin.studies.stability.locus import BODY, WHEEL


def _a1_1() -> tuple[LocusCase, ...]:
    """Return the cases of Table A1.1: the lag is swept at two damping ratios."""
    # At ζ = 1 the ideal wheel hop is overdamped (two real poles); at ζ = 0.5 it oscillates.
    return (
        locus_case(
            "suspension",
            1,
            "ζ = 1",
            LAGS[1.0],
            {"A1.1": None, "A1.2": (-40.0, 5.0, 20.0), "A1.3": (-3.0, 1.0, 8.0)},
            claim(
                "A1.1",
                "small lags",
                "all poles closely resemble the ideal system",
                resemblance.resembles("start"),
            ),
            claim(
                "A1.2",
                "breakaway",
                "filter pole and a wheel hop pole coincide and break away",
                shapes.breaks_away,
            ),
            claim(
                "A1.3",
                "stability",
                "both wheel and body hop become unstable",
                judges.becomes_unstable(BODY, WHEEL),
            ),
            claim(
                "A1.3",
                "boundary",
                "behaves like itself without suspension damping",
                resemblance.undamped_at_boundary,
            ),
            claim(
                "A1.1",
                "end of the sweep",
                "wheel hop overdamped ideally, not with the lag",
                shapes.pairs_at_end(1, 2),
            ),
        ),
        locus_case(
            "suspension",
            2,
            "ζ = 0.5",
            LAGS[0.5],
            {"A1.4": None, "A1.5": (-6.0, 1.5, 8.0)},
            claim(
                "A1.4", "small lags", "resembles the ideal system", resemblance.resembles("start")
            ),
            claim(
                "A1.5",
                "stability",
                "both become unstable together",
                judges.all_hold(judges.becomes_unstable(BODY, WHEEL), judges.cross_together),
            ),
        ),
    )


def _a1_2() -> tuple[LocusCase, ...]:
    """Return the cases of Table A1.2: the sprung natural frequency is swept."""
    return (*_slow_filter(), *_quick_filter())


def _slow_filter() -> list[LocusCase]:
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


def _quick_filter() -> list[LocusCase]:
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


def _a1_3_slow() -> LocusCase:
    """Return case 1 of Table A1.3, with a lag of 0.2 s."""
    return locus_case(
        "suspension",
        1,
        "τ = 0.2 s",
        RATIOS[0.2],
        {"A1.15": None, "A1.16": (-5.0, 1.0, 8.0)},
        claim(
            "A1.15",
            "low ratios",
            "both modes become unstable",
            judges.becomes_unstable(BODY, WHEEL),
        ),
        claim(
            "A1.15", "high ratios", "vertical asymptote of the wheel hop", shapes.asymptote("start")
        ),
        claim("A1.16", "resemblance", "not well at any damping ratio", resemblance.never_resembles),
    )


def _a1_3() -> tuple[LocusCase, ...]:
    """Return the cases of Table A1.3: the damping ratio falls from 50 to 0.0005."""
    # The sweep starts at the high ratio, so `start` of a judge means strong damping.
    slow, quick = (locus("suspension", RATIOS[lag]) for lag in (0.2, 0.01))
    return (
        _a1_3_slow(),
        locus_case(
            "suspension",
            2,
            "τ = 0.01 s",
            RATIOS[0.01],
            {"A1.17": None},
            claim(
                "A1.17",
                "high ratios",
                "asymptote further left with less lag",
                shapes.asymptote_left_of(slow, "τ = 0.2 s"),
            ),
            claim(
                "A1.17",
                "low ratios",
                "both approach instability",
                judges.becomes_unstable(BODY, WHEEL),
            ),
            claim(
                "A1.17",
                "smaller lag",
                "improves the resemblance",
                resemblance.closer_than(slow, "τ = 0.2 s"),
            ),
        ),
        locus_case(
            "suspension",
            3,
            "τ = 0.001 s",
            RATIOS[0.001],
            {"A1.18": (-10.0, 1.0, 50.0)},
            claim(
                "A1.18",
                "smallest lag",
                "all poles match to a higher degree",
                resemblance.closer_than(quick, "τ = 0.01 s"),
            ),
            claim(
                "A1.18",
                "low ratios",
                "wheel hop loses its damping, no instability",
                resemblance.undamped_at_end(WHEEL),
            ),
        ),
    )


def _a1_4() -> tuple[LocusCase, ...]:
    """Return the cases of Table A1.4: the stiffness of the tyre is swept."""
    # Case 1 is judged with the printed lag and with the meant one, see REMARKS of `root_loci`.
    cases = []
    for number, lag, figure in ((1, 0.333, 19), (1, 0.0333, 19), (2, 0.01, 20)):
        name, shown = f"A1.{figure}", f"A1.{figure}" + corrected_lag_suffix(lag)
        cases.append(
            locus_case(
                "suspension",
                number,
                f"τ = {lag:g} s",
                TYRES[lag],
                {shown: STIFF},
                claim(
                    name,
                    "stability",
                    "no tyre stiffness makes it unstable",
                    judges.stable_throughout,
                    misprint_note(lag),
                ),
                claim(
                    name,
                    "resemblance",
                    "greatest if the tyre is soft",
                    resemblance.wheel_damping_closest_at("start"),
                    misprint_note(lag),
                ),
                claim(
                    name,
                    "stiff tyre",
                    "wheel hop approaches zero real part",
                    shapes.asymptote_at_zero,
                    misprint_note(lag),
                ),
            )
        )
    return tuple(cases)


def _a1_5() -> tuple[LocusCase, ...]:
    """Return the cases of Table A1.5: the mass of the wheel is swept."""
    # A wheel of 0.01 kg is nearly massless: its ideal hop is fast and strongly damped.
    cases = []
    for number, lag, figure in ((1, 0.333, 21), (1, 0.0333, 21), (2, 0.01, 22)):
        name, shown = f"A1.{figure}", f"A1.{figure}" + corrected_lag_suffix(lag)
        claims = [
            claim(
                name,
                "stability",
                "stable for the range of masses",
                judges.stable_throughout,
                misprint_note(lag),
            ),
            claim(
                name,
                "resemblance",
                "close at large masses",
                judges.all_hold(resemblance.closest_at("end"), resemblance.resembles("end")),
                misprint_note(lag),
            ),
            claim(
                name,
                "small masses",
                "asymptote towards infinite frequency",
                shapes.asymptote("start"),
                misprint_note(lag),
            ),
        ]
        if number == 1:
            further_left = shapes.asymptote_left_of(locus("suspension", WHEELS[0.01]), "τ = 0.01 s")
            note = "the other way round: less lag shifts it left, here as in A1.3"
            claims.append(
                claim(
                    name,
                    "larger lag",
                    "asymptote further left, frequency higher",
                    further_left,
                    note,
                )
            )
        cases.append(
            locus_case("suspension", number, f"τ = {lag:g} s", WHEELS[lag], {shown: LIGHT}, *claims)
        )
    return tuple(cases)


CASES: Mapping[str, Callable[[], tuple[LocusCase, ...]]] = {
    "A1.1": _a1_1,
    "A1.2": _a1_2,
    "A1.3": _a1_3,
    "A1.4": _a1_4,
    "A1.5": _a1_5,
}
"""Functions that return the cases of a table, by its name."""
