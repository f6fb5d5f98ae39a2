"""Appendix A3 as data: suspension and vehicle structure MIL combined.

Every case of Tables A3.1 to A3.5 stands here with its figures and the thesis' statements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from experiments.thesis import judges, shapes
from experiments.thesis.appendix_a import (
    LAGS,
    LIGHT,
    OF_STIFFNESS,
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


def _a3_1() -> tuple[LocusCase, ...]:
    """Return the cases of Table A3.1: the lag is swept at two damping ratios."""
    # Three filters, of force, position and velocity, add three real poles near −1/τ.
    cases = []
    for number, ratio, figure in ((1, 1.0, 1), (2, 0.5, 2)):
        name = f"A3.{figure}"
        claims = [
            claim(name, "smallest lag", "three poles on the far left", shapes.far_left(3)),
            claim(name, "stability", "body hop unstable before the wheel hop", judges.body_first),
        ]
        if number == 2:
            claims.append(
                claim(
                    name,
                    "large lags",
                    "a conjugate pair breaks off from the real axis",
                    shapes.breaks_away,
                )
            )
        cases.append(
            locus_case(
                "combined",
                number,
                f"ζ = {ratio:g}",
                LAGS[ratio],
                {name: (-16.0, 2.0, 8.0)},
                *claims,
            )
        )
    return tuple(cases)


def _a3_2() -> tuple[LocusCase, ...]:
    """Return the cases of Table A3.2: the sprung natural frequency is swept."""
    # Every locus is compared with that of suspension MIL alone over the same sweep.
    cases = []
    for number, ratio, lag, figure in OF_STIFFNESS:
        name, variations = f"A3.{figure}", SLOW if lag == 0.2 else QUICK
        note = (
            "the caption of Figure A3.8 says ζ = 1.5, Table A3.2 0.5: the table is right"
            if figure == 8
            else ""
        )
        earlier = judges.earlier_than(locus("suspension", variations[ratio]), "suspension MIL")
        claims = [
            claim(
                name, "stability", "body hop unstable before the wheel hop", judges.body_first, note
            ),
            claim(name, "stability", "less stable than suspension MIL alone", earlier),
        ]
        if lag == 0.2:
            claims.append(
                claim(
                    name,
                    "further poles",
                    "leave the real axis and come back to it",
                    shapes.breaks_in,
                )
            )
        cases.append(
            locus_case(
                "combined",
                number,
                f"ζ = {ratio:g}, τ = {lag:g} s",
                variations[ratio],
                {name: None},
                *claims,
            )
        )
    return tuple(cases)


def _a3_3_slow() -> LocusCase:
    """Return case 1 of Table A3.3, with a lag of 0.2 s."""
    ends = judges.all_hold(
        judges.unstable_at_start(BODY, WHEEL), judges.unstable_at_end(BODY, WHEEL)
    )
    return locus_case(
        "combined",
        1,
        "τ = 0.2 s",
        RATIOS[0.2],
        {"A3.9": None, "A3.10": (-6.0, 5.0, 16.0), "A3.11": (-0.6, 0.2, 4.0)},
        claim(
            "A3.9",
            "resemblance",
            "body hop as in the other two loops: unstable at low ratios",
            judges.body_first,
        ),
        claim("A3.10", "wheel hop", "unstable at high and at low damping ratios", ends),
        claim("A3.11", "body hop", "unstable at low and at high damping ratios", ends),
    )


def _a3_3() -> tuple[LocusCase, ...]:
    """Return the cases of Table A3.3: the damping ratio falls from 50 to 0.0005."""
    # The sweep starts at the high ratio, so `start` of a judge means strong damping.
    return (
        _a3_3_slow(),
        locus_case(
            "combined",
            2,
            "τ = 0.01 s",
            RATIOS[0.01],
            {"A3.12": None},
            claim(
                "A3.12",
                "low ratios",
                "both modes move towards instability",
                judges.becomes_unstable(BODY, WHEEL),
            ),
            claim(
                "A3.12",
                "high ratios",
                "instability could occur as well",
                judges.unstable_before_start(WHEEL),
            ),
            claim(
                "A3.12", "low ratios", "body hop unstable before the wheel hop", judges.body_first
            ),
        ),
        locus_case(
            "combined",
            3,
            "τ = 0.001 s",
            RATIOS[0.001],
            {"A3.13": (-10.0, 1.0, 50.0)},
            claim(
                "A3.13",
                "high ratios",
                "no further dynamics of the filter poles",
                shapes.pairs_at_start(1, 1),
            ),
            claim(
                "A3.13",
                "low ratios",
                "both modes move towards instability",
                judges.becomes_unstable(BODY, WHEEL),
            ),
        ),
    )


def _a3_4() -> tuple[LocusCase, ...]:
    """Return the cases of Table A3.4: the stiffness of the tyre is swept."""
    # Case 1 is judged with the printed lag and with the meant one, see REMARKS of `root_loci`.
    cases = []
    for number, lag, figure in ((1, 0.333, 14), (1, 0.0333, 14), (2, 0.01, 15)):
        name, shown = f"A3.{figure}", f"A3.{figure}" + corrected_lag_suffix(lag)
        soft = judges.all_hold(judges.unstable_at_start(BODY), judges.unstable_at_end())
        claims = [
            claim(
                name,
                "soft tyre",
                "body hop unstable at low tyre stiffness, stable at high",
                soft,
                misprint_note(lag),
            ),
            claim(
                name,
                "stiff tyre",
                "wheel hop approaches zero real part",
                shapes.asymptote_at_zero,
                misprint_note(lag),
            ),
        ]
        cases.append(
            locus_case("combined", number, f"τ = {lag:g} s", TYRES[lag], {shown: STIFF}, *claims)
        )
    return tuple(cases)


def _a3_5() -> tuple[LocusCase, ...]:
    """Return the cases of Table A3.5: the mass of the wheel is swept."""
    # Case 1 is judged with the printed lag and with the meant one, see REMARKS of `root_loci`.
    cases = []
    for number, lag, figure in ((1, 0.333, 16), (1, 0.0333, 16), (2, 0.01, 17)):
        name, shown = f"A3.{figure}", f"A3.{figure}" + corrected_lag_suffix(lag)
        note = misprint_note(lag) or (
            "the caption of Figure A3.17 says 0.001 s, Table A3.5 0.01 s" if number == 2 else ""
        )
        claims = [
            claim(
                name, "light wheel", "stable vertical asymptote", shapes.asymptote("start"), note
            ),
            claim(
                name,
                "heavy wheel",
                "body hop unstable at high wheel mass only",
                judges.becomes_unstable(BODY),
                note,
            ),
        ]
        cases.append(
            locus_case("combined", number, f"τ = {lag:g} s", WHEELS[lag], {shown: LIGHT}, *claims)
        )
    return tuple(cases)


CASES: Mapping[str, Callable[[], tuple[LocusCase, ...]]] = {
    "A3.1": _a3_1,
    "A3.2": _a3_2,
    "A3.3": _a3_3,
    "A3.4": _a3_4,
    "A3.5": _a3_5,
}
"""Functions that return the cases of a table, by its name."""
