"""Appendix A2 as data: vehicle structure MIL.

Every case of Tables A2.1 to A2.5 stands here with its figures and the thesis' statements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from experiments.thesis import judges, resemblance, shapes
from experiments.thesis.appendix_a import (
    LAGS,
    RATIOS,
    STIFF,
    TYRES,
    WHEELS,
    claim,
    corrected_lag_suffix,
    locus_case,
    misprint_note,
)
from experiments.thesis.appendix_a2_stiffness import cases_of_stiffness
from experiments.thesis.loci import LocusCase, locus
from rigtwin.studies.stability.locus import BODY, WHEEL

A2_9 = (
    "at low ratios every pole is near its ideal one, as the thesis goes on to say of the wheel "
    "hop; the body hop's damping has the wrong sign all the same"
)


def _a2_1() -> tuple[LocusCase, ...]:
    """Return the cases of Table A2.1: the lag is swept at two damping ratios."""
    # Two filters, of position and velocity, add two real poles near −1/τ.
    cases = []
    for number, ratio, figure in ((1, 1.0, 1), (2, 0.5, 2)):
        name = f"A2.{figure}"
        claims = [
            claim(name, "smallest lag", "two real poles on the far left", shapes.far_left(2)),
            claim(
                name,
                "small lags",
                "closely resembles the ideal system",
                resemblance.resembles("start"),
            ),
            claim(
                name,
                "stability",
                "only the body hop becomes unstable",
                judges.becomes_unstable(BODY),
            ),
        ]
        if number == 1:
            claims.append(
                claim(
                    name,
                    "breakaway",
                    "wheel hop from overdamped to underdamped",
                    shapes.breaks_away,
                )
            )
        cases.append(
            locus_case(
                "structure",
                number,
                f"ζ = {ratio:g}",
                LAGS[ratio],
                {name: (-40.0, 3.0, 14.0)},
                *claims,
            )
        )
    return tuple(cases)


def _a2_3_quick() -> LocusCase:
    """Return case 3 of Table A2.3, with a lag of 1 ms."""
    low_ratio, never = judges.unstable_at_end(BODY), judges.never(WHEEL)
    return locus_case(
        "structure",
        3,
        "τ = 0.001 s",
        RATIOS[0.001],
        {"A2.12": (-10.0, 1.0, 50.0)},
        claim(
            "A2.12",
            "low ratios",
            "body hop unstable, wheel hop always stable",
            judges.all_hold(low_ratio, never),
        ),
        claim("A2.12", "high ratios", "no asymptote of the wheel hop", shapes.pairs_at_start(1, 1)),
        claim(
            "A2.12", "low ratios", "wheel hop matches the ideal", resemblance.wheel_resembles("end")
        ),
    )


def _a2_3() -> tuple[LocusCase, ...]:
    """Return the cases of Table A2.3: the damping ratio falls from 50 to 0.0005."""
    # The sweep starts at the high ratio, so `start` of a judge means strong damping.
    low_ratio, never = judges.unstable_at_end(BODY), judges.never(WHEEL)
    quick = shapes.asymptote_left_of(locus("structure", RATIOS[0.2]), "τ = 0.2 s")
    return (
        locus_case(
            "structure",
            1,
            "τ = 0.2 s",
            RATIOS[0.2],
            {"A2.9": None, "A2.10": (-1.0, 0.2, 4.0)},
            claim(
                "A2.9",
                "low ratios",
                "body hop unstable, wheel hop always stable",
                judges.all_hold(low_ratio, never),
            ),
            claim("A2.9", "high ratios", "asymptote of the wheel hop", shapes.asymptote("start")),
            claim(
                "A2.9",
                "low ratios",
                "wheel hop approaches the ideal",
                resemblance.wheel_resembles("end"),
            ),
            claim(
                "A2.9", "resemblance", "not at any damping ratio", resemblance.never_resembles, A2_9
            ),
            claim(
                "A2.10", "high ratios", "body hop unstable as well", judges.unstable_at_start(BODY)
            ),
        ),
        locus_case(
            "structure",
            2,
            "τ = 0.01 s",
            RATIOS[0.01],
            {"A2.11": None},
            claim(
                "A2.11",
                "low ratios",
                "body hop unstable, wheel hop always stable",
                judges.all_hold(low_ratio, never),
            ),
            claim("A2.11", "high ratios", "asymptote further left, frequency higher", quick),
            claim(
                "A2.11",
                "low ratios",
                "wheel hop resembles the ideal closely",
                resemblance.wheel_resembles("end"),
            ),
        ),
        _a2_3_quick(),
    )


def _a2_4() -> tuple[LocusCase, ...]:
    """Return the cases of Table A2.4: the stiffness of the tyre is swept."""
    # Case 1 is judged with the printed lag and with the meant one, see REMARKS of `root_loci`.
    cases = []
    for number, lag, figures in ((1, 0.333, (13, 14)), (1, 0.0333, (13, 14)), (2, 0.01, (15,))):
        name, last = f"A2.{figures[0]}", f"A2.{figures[-1]}"
        views = {
            f"A2.{figure}" + corrected_lag_suffix(lag): view
            for figure, view in zip(figures, (STIFF, (-0.3, 0.1, 3.0)), strict=False)
        }
        note = misprint_note(lag) or (
            "the caption of Figure A2.15 says 0.001 s, Table A2.4 0.01 s" if number == 2 else ""
        )
        soft = judges.all_hold(judges.unstable_at_start(BODY), judges.unstable_at_end())
        claims = [
            claim(
                last,
                "soft tyre",
                "body hop unstable at low tyre stiffness, stable at high",
                soft,
                note,
            ),
            claim(
                name,
                "soft tyre",
                "the error is greatest for the wheel hop",
                resemblance.worst(WHEEL, "start"),
            ),
            claim(
                name,
                "stiff tyre",
                "the error is greatest for the body hop",
                resemblance.worst(BODY, "end"),
            ),
            claim(
                name,
                "stiff tyre",
                "no asymptote at zero, unlike suspension MIL",
                shapes.no_asymptote_at_zero,
            ),
        ]
        cases.append(locus_case("structure", number, f"τ = {lag:g} s", TYRES[lag], views, *claims))
    return tuple(cases)


def _a2_5() -> tuple[LocusCase, ...]:
    """Return the cases of Table A2.5: the mass of the wheel is swept."""
    # Case 1 is judged with the printed lag and with the meant one, see REMARKS of `root_loci`.
    cases = []
    for number, lag, figures in ((1, 0.333, (16, 17)), (1, 0.0333, (16, 17)), (2, 0.01, (18,))):
        name, last = f"A2.{figures[0]}", f"A2.{figures[-1]}"
        zoomed = (-40.0, 5.0, 12.0)
        views = {
            f"A2.{figure}" + corrected_lag_suffix(lag): view
            for figure, view in zip(figures, (zoomed, (-0.3, 0.1, 3.0)), strict=False)
        }
        claims = [
            claim(
                last,
                "stability",
                "unstable at high wheel mass only",
                judges.becomes_unstable(BODY),
                misprint_note(lag),
            ),
            claim(
                name,
                "resemblance",
                "close where the wheel mass is 0.01 kg",
                resemblance.resembles("start"),
                misprint_note(lag),
            ),
        ]
        if number == 1:
            claims.append(
                claim(
                    name,
                    "breakaway",
                    "wheel hop leaves the real axis and stays off it",
                    shapes.stays_away,
                )
            )
        else:
            claims.append(
                claim(
                    name,
                    "breakaway",
                    "wheel hop leaves the real axis and breaks in again",
                    shapes.breaks_in,
                )
            )
        cases.append(locus_case("structure", number, f"τ = {lag:g} s", WHEELS[lag], views, *claims))
    return tuple(cases)


CASES: Mapping[str, Callable[[], tuple[LocusCase, ...]]] = {
    "A2.1": _a2_1,
    "A2.2": cases_of_stiffness,
    "A2.3": _a2_3,
    "A2.4": _a2_4,
    "A2.5": _a2_5,
}
"""Functions that return the cases of a table, by its name."""
