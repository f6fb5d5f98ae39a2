"""Appendix A1 as data: suspension MIL, every case of Tables A1.1 to A1.5, its figures and what the
thesis says of them."""

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
    case,
    instead,
    misprint,
    says,
)
from experiments.thesis.loci import Case, locus
from rigtwin.studies.stability.locus import BODY, WHEEL


def _a1_1() -> tuple[Case, ...]:
    return (
        case(
            "suspension",
            1,
            "ζ = 1",
            LAGS[1.0],
            {"A1.1": None, "A1.2": (-40.0, 5.0, 20.0), "A1.3": (-3.0, 1.0, 8.0)},
            says(
                "A1.1",
                "small lags",
                "all poles closely resemble the ideal system",
                resemblance.resembles("start"),
            ),
            says(
                "A1.2",
                "breakaway",
                "filter pole and a wheel hop pole coincide and break away",
                shapes.breaks_away,
            ),
            says(
                "A1.3",
                "stability",
                "both wheel and body hop become unstable",
                judges.becomes_unstable(BODY, WHEEL),
            ),
            says(
                "A1.3",
                "boundary",
                "behaves like itself without suspension damping",
                resemblance.undamped_at_boundary,
            ),
            says(
                "A1.1",
                "end of the sweep",
                "wheel hop overdamped ideally, not with the lag",
                shapes.pairs_at_end(1, 2),
            ),
        ),
        case(
            "suspension",
            2,
            "ζ = 0.5",
            LAGS[0.5],
            {"A1.4": None, "A1.5": (-6.0, 1.5, 8.0)},
            says(
                "A1.4", "small lags", "resembles the ideal system", resemblance.resembles("start")
            ),
            says(
                "A1.5",
                "stability",
                "both become unstable together",
                judges.both(judges.becomes_unstable(BODY, WHEEL), judges.together),
            ),
        ),
    )


def _a1_2() -> tuple[Case, ...]:
    cases = []
    for number, ratio, figures in ((1, 1.0, (6, 7)), (2, 1.5, (8, 9)), (3, 0.5, (10, 11))):
        whole, part = (f"A1.{figure}" for figure in figures)
        claims = [
            says(
                whole,
                "resemblance",
                "greatest when the natural frequency is low",
                resemblance.closest_at("start"),
            ),
            says(
                whole,
                "stability",
                "both modes move right and become unstable",
                judges.becomes_unstable(BODY, WHEEL),
            ),
            says(whole, "stability", "they become unstable together", judges.together),
            says(
                part,
                "body hop",
                "has a positive real part at 44.72 rad/s",
                resemblance.body_unstable_at_end,
            ),
        ]
        if ratio >= 1.0:
            claims.append(
                says(
                    whole,
                    "wheel hop",
                    "ideally overdamped, with the lag not",
                    shapes.pairs_at_end(1, 2),
                )
            )
            claims.append(
                says(
                    whole,
                    "breakaway",
                    "a conjugate pair develops at a breakaway point",
                    shapes.breaks_away,
                )
            )
        views = {whole: None, part: (-6.0, 2.0, 6.0)}
        cases.append(
            case("suspension", number, f"ζ = {ratio:g}, τ = 0.2 s", SLOW[ratio], views, *claims)
        )
    for number, ratio, figure in ((4, 1.0, 12), (5, 1.5, 13), (6, 0.5, 14)):
        name, slow = f"A1.{figure}", locus("suspension", SLOW[ratio])
        claims = [
            says(
                name,
                "smaller lag",
                "a higher natural frequency is required",
                judges.later_than(slow, "τ = 0.2 s"),
            ),
            says(
                name,
                "resemblance",
                "greatest when the natural frequency is low",
                resemblance.closest_at("start"),
            ),
        ]
        if ratio >= 1.0:
            claims.append(
                says(
                    name,
                    "breakaway",
                    "further left with less lag",
                    shapes.breaks_away_left_of(slow, "τ = 0.2 s"),
                )
            )
        if ratio > 0.5:
            light = locus("suspension", QUICK[0.5])
            claims.append(
                says(
                    name,
                    "damping",
                    "more stable with a higher ratio",
                    judges.later_than(light, "ζ = 0.5"),
                )
            )
        cases.append(
            case(
                "suspension",
                number,
                f"ζ = {ratio:g}, τ = 0.01 s",
                QUICK[ratio],
                {name: None},
                *claims,
            )
        )
    return tuple(cases)


def _a1_3() -> tuple[Case, ...]:
    slow, quick = (locus("suspension", RATIOS[lag]) for lag in (0.2, 0.01))
    return (
        case(
            "suspension",
            1,
            "τ = 0.2 s",
            RATIOS[0.2],
            {"A1.15": None, "A1.16": (-5.0, 1.0, 8.0)},
            says(
                "A1.15",
                "low ratios",
                "both modes become unstable",
                judges.becomes_unstable(BODY, WHEEL),
            ),
            says(
                "A1.15",
                "high ratios",
                "vertical asymptote of the wheel hop",
                shapes.asymptote("start"),
            ),
            says(
                "A1.16", "resemblance", "not well at any damping ratio", resemblance.never_resembles
            ),
        ),
        case(
            "suspension",
            2,
            "τ = 0.01 s",
            RATIOS[0.01],
            {"A1.17": None},
            says(
                "A1.17",
                "high ratios",
                "asymptote further left with less lag",
                shapes.asymptote_left_of(slow, "τ = 0.2 s"),
            ),
            says(
                "A1.17",
                "low ratios",
                "both approach instability",
                judges.becomes_unstable(BODY, WHEEL),
            ),
            says(
                "A1.17",
                "smaller lag",
                "improves the resemblance",
                resemblance.closer_than(slow, "τ = 0.2 s"),
            ),
        ),
        case(
            "suspension",
            3,
            "τ = 0.001 s",
            RATIOS[0.001],
            {"A1.18": (-10.0, 1.0, 50.0)},
            says(
                "A1.18",
                "smallest lag",
                "all poles match to a higher degree",
                resemblance.closer_than(quick, "τ = 0.01 s"),
            ),
            says(
                "A1.18",
                "low ratios",
                "wheel hop loses its damping, no instability",
                resemblance.undamped_at_end(WHEEL),
            ),
        ),
    )


def _a1_4() -> tuple[Case, ...]:
    cases = []
    for number, lag, figure in ((1, 0.333, 19), (1, 0.0333, 19), (2, 0.01, 20)):
        name, shown = f"A1.{figure}", f"A1.{figure}" + instead(lag)
        cases.append(
            case(
                "suspension",
                number,
                f"τ = {lag:g} s",
                TYRES[lag],
                {shown: STIFF},
                says(
                    name,
                    "stability",
                    "no tyre stiffness makes it unstable",
                    judges.stable_throughout,
                    misprint(lag),
                ),
                says(
                    name,
                    "resemblance",
                    "greatest if the tyre is soft",
                    resemblance.wheel_damping_closest_at("start"),
                    misprint(lag),
                ),
                says(
                    name,
                    "stiff tyre",
                    "wheel hop approaches zero real part",
                    shapes.asymptote_at_zero,
                    misprint(lag),
                ),
            )
        )
    return tuple(cases)


def _a1_5() -> tuple[Case, ...]:
    cases = []
    for number, lag, figure in ((1, 0.333, 21), (1, 0.0333, 21), (2, 0.01, 22)):
        name, shown = f"A1.{figure}", f"A1.{figure}" + instead(lag)
        claims = [
            says(
                name,
                "stability",
                "stable for the range of masses",
                judges.stable_throughout,
                misprint(lag),
            ),
            says(
                name,
                "resemblance",
                "close at large masses",
                judges.both(resemblance.closest_at("end"), resemblance.resembles("end")),
                misprint(lag),
            ),
            says(
                name,
                "small masses",
                "asymptote towards infinite frequency",
                shapes.asymptote("start"),
                misprint(lag),
            ),
        ]
        if number == 1:
            other = shapes.asymptote_left_of(locus("suspension", WHEELS[0.01]), "τ = 0.01 s")
            note = "the other way round: less lag shifts it left, here as in A1.3"
            claims.append(
                says(name, "larger lag", "asymptote further left, frequency higher", other, note)
            )
        cases.append(
            case("suspension", number, f"τ = {lag:g} s", WHEELS[lag], {shown: LIGHT}, *claims)
        )
    return tuple(cases)


CASES: Mapping[str, Callable[[], tuple[Case, ...]]] = {
    "A1.1": _a1_1,
    "A1.2": _a1_2,
    "A1.3": _a1_3,
    "A1.4": _a1_4,
    "A1.5": _a1_5,
}
"""Table → its cases."""
