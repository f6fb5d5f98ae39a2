"""Appendix A2 as data: vehicle structure MIL, every case of Tables A2.1 to A2.5, its figures and
what is said of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from experiments.thesis import judges, resemblance, shapes
from experiments.thesis.appendix_a import (
    LAGS,
    OF_STIFFNESS,
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

A2_9 = (
    "at low ratios every pole is near its ideal one, as the thesis goes "
    "on to say of the wheel hop; the body hop's damping has "
    "the wrong sign all the same"
)


def _a2_1() -> tuple[Case, ...]:
    cases = []
    for number, ratio, figure in ((1, 1.0, 1), (2, 0.5, 2)):
        name = f"A2.{figure}"
        claims = [
            says(name, "smallest lag", "two real poles on the far left", shapes.far_left(2)),
            says(
                name,
                "small lags",
                "closely resembles the ideal system",
                resemblance.resembles("start"),
            ),
            says(
                name,
                "stability",
                "only the body hop becomes unstable",
                judges.becomes_unstable(BODY),
            ),
        ]
        if number == 1:
            claims.append(
                says(
                    name,
                    "breakaway",
                    "wheel hop from overdamped to underdamped",
                    shapes.breaks_away,
                )
            )
        cases.append(
            case(
                "structure",
                number,
                f"ζ = {ratio:g}",
                LAGS[ratio],
                {name: (-40.0, 3.0, 14.0)},
                *claims,
            )
        )
    return tuple(cases)


def _a2_2() -> tuple[Case, ...]:
    cases = []
    for number, ratio, lag, figure in OF_STIFFNESS:
        name, variations = f"A2.{figure}", SLOW if lag == 0.2 else QUICK
        beside = locus("suspension", variations[ratio])
        note = (
            "the caption of Figure A2.8 says ζ = 1.5, Table A2.2 0.5: the table is right"
            if figure == 8
            else ""
        )
        claims = [
            says(
                name,
                "stability",
                "body hop unstable at high frequencies, wheel hop not",
                judges.becomes_unstable(BODY),
                note,
            ),
            says(name, "resemblance", "at low frequencies", resemblance.closest_at("start")),
        ]
        if ratio != 1.5:
            claims.append(says(name, "wheel hop", "moves left, not right", shapes.wheel_goes_left))
        if lag == 0.2 and ratio >= 1.0:
            on_curve = resemblance.body_on_ideal_trajectory(beside, "suspension MIL")
            note = (
                "it cannot: it becomes unstable, which no ideal pole "
                "is; it stays nearer than with suspension MIL"
            )
            claims.append(
                says(
                    name,
                    "body hop",
                    "stays on the ideal trajectory, unlike suspension MIL",
                    on_curve,
                    note,
                )
            )
        if lag == 0.2 and ratio == 1.0:
            claims.append(
                says(
                    name,
                    "breakaway",
                    "wheel hop breaks away from the real axis",
                    shapes.breaks_away,
                )
            )
        if ratio == 1.5:
            claims.append(
                says(
                    name,
                    "breakaway",
                    "wheel hop forms a loop and breaks in again",
                    shapes.breaks_in,
                )
            )
        if lag == 0.2 and ratio == 0.5:
            closer = resemblance.wheel_closer_than(beside, "suspension MIL")
            claims.append(says(name, "wheel hop", "diverges less than with suspension MIL", closer))
        if lag == 0.01 and ratio >= 1.0:
            left = shapes.breaks_away_left_of(locus("structure", SLOW[ratio]), "τ = 0.2 s")
            claims.append(says(name, "breakaway", "further left with less lag", left))
        cases.append(
            case(
                "structure",
                number,
                f"ζ = {ratio:g}, τ = {lag:g} s",
                variations[ratio],
                {name: None},
                *claims,
            )
        )
    return tuple(cases)


def _a2_3() -> tuple[Case, ...]:
    low, never = judges.unstable_at_end(BODY), judges.never(WHEEL)
    quick = shapes.asymptote_left_of(locus("structure", RATIOS[0.2]), "τ = 0.2 s")
    return (
        case(
            "structure",
            1,
            "τ = 0.2 s",
            RATIOS[0.2],
            {"A2.9": None, "A2.10": (-1.0, 0.2, 4.0)},
            says(
                "A2.9",
                "low ratios",
                "body hop unstable, wheel hop always stable",
                judges.both(low, never),
            ),
            says("A2.9", "high ratios", "asymptote of the wheel hop", shapes.asymptote("start")),
            says(
                "A2.9",
                "low ratios",
                "wheel hop approaches the ideal",
                resemblance.wheel_resembles("end"),
            ),
            says(
                "A2.9", "resemblance", "not at any damping ratio", resemblance.never_resembles, A2_9
            ),
            says(
                "A2.10", "high ratios", "body hop unstable as well", judges.unstable_at_start(BODY)
            ),
        ),
        case(
            "structure",
            2,
            "τ = 0.01 s",
            RATIOS[0.01],
            {"A2.11": None},
            says(
                "A2.11",
                "low ratios",
                "body hop unstable, wheel hop always stable",
                judges.both(low, never),
            ),
            says("A2.11", "high ratios", "asymptote further left, frequency higher", quick),
            says(
                "A2.11",
                "low ratios",
                "wheel hop resembles the ideal closely",
                resemblance.wheel_resembles("end"),
            ),
        ),
        case(
            "structure",
            3,
            "τ = 0.001 s",
            RATIOS[0.001],
            {"A2.12": (-10.0, 1.0, 50.0)},
            says(
                "A2.12",
                "low ratios",
                "body hop unstable, wheel hop always stable",
                judges.both(low, never),
            ),
            says(
                "A2.12", "high ratios", "no asymptote of the wheel hop", shapes.pairs_at_start(1, 1)
            ),
            says(
                "A2.12",
                "low ratios",
                "wheel hop matches the ideal",
                resemblance.wheel_resembles("end"),
            ),
        ),
    )


def _a2_4() -> tuple[Case, ...]:
    cases = []
    for number, lag, figures in ((1, 0.333, (13, 14)), (1, 0.0333, (13, 14)), (2, 0.01, (15,))):
        name, last = f"A2.{figures[0]}", f"A2.{figures[-1]}"
        views = {
            f"A2.{figure}" + instead(lag): view
            for figure, view in zip(figures, (STIFF, (-0.3, 0.1, 3.0)), strict=False)
        }
        note = misprint(lag) or (
            "the caption of Figure A2.15 says 0.001 s, Table A2.4 0.01 s" if number == 2 else ""
        )
        soft = judges.both(judges.unstable_at_start(BODY), judges.unstable_at_end())
        claims = [
            says(
                last,
                "soft tyre",
                "body hop unstable at low tyre stiffness, stable at high",
                soft,
                note,
            ),
            says(
                name,
                "soft tyre",
                "the error is greatest for the wheel hop",
                resemblance.worst(WHEEL, "start"),
            ),
            says(
                name,
                "stiff tyre",
                "the error is greatest for the body hop",
                resemblance.worst(BODY, "end"),
            ),
            says(
                name,
                "stiff tyre",
                "no asymptote at zero, unlike suspension MIL",
                shapes.no_asymptote_at_zero,
            ),
        ]
        cases.append(case("structure", number, f"τ = {lag:g} s", TYRES[lag], views, *claims))
    return tuple(cases)


def _a2_5() -> tuple[Case, ...]:
    cases = []
    for number, lag, figures in ((1, 0.333, (16, 17)), (1, 0.0333, (16, 17)), (2, 0.01, (18,))):
        name, last = f"A2.{figures[0]}", f"A2.{figures[-1]}"
        zoomed = (-40.0, 5.0, 12.0)
        views = {
            f"A2.{figure}" + instead(lag): view
            for figure, view in zip(figures, (zoomed, (-0.3, 0.1, 3.0)), strict=False)
        }
        claims = [
            says(
                last,
                "stability",
                "unstable at high wheel mass only",
                judges.becomes_unstable(BODY),
                misprint(lag),
            ),
            says(
                name,
                "resemblance",
                "close where the wheel mass is 0.01 kg",
                resemblance.resembles("start"),
                misprint(lag),
            ),
        ]
        if number == 1:
            claims.append(
                says(
                    name,
                    "breakaway",
                    "wheel hop leaves the real axis and stays off it",
                    shapes.stays_away,
                )
            )
        else:
            claims.append(
                says(
                    name,
                    "breakaway",
                    "wheel hop leaves the real axis and breaks in again",
                    shapes.breaks_in,
                )
            )
        cases.append(case("structure", number, f"τ = {lag:g} s", WHEELS[lag], views, *claims))
    return tuple(cases)


CASES: Mapping[str, Callable[[], tuple[Case, ...]]] = {
    "A2.1": _a2_1,
    "A2.2": _a2_2,
    "A2.3": _a2_3,
    "A2.4": _a2_4,
    "A2.5": _a2_5,
}
"""Table → its cases."""
