"""Appendix A1 as data: suspension MIL.

Every case of Tables A1.1 to A1.5 stands here with its figures and the thesis' statements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from experiments.thesis import judges, resemblance, shapes
from experiments.thesis.appendix_a import (
    LAGS,
    LIGHT,
    RATIOS,
    STIFF,
    TYRES,
    WHEELS,
    claim,
    corrected_lag_suffix,
    locus_case,
    misprint_note,
)
from experiments.thesis.appendix_a1_filters import quick_filter, slow_filter
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
    return (*slow_filter(), *quick_filter())


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
