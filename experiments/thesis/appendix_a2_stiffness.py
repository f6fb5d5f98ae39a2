"""Cases of Table A2.2 of the thesis: the sprung natural frequency is swept."""

from __future__ import annotations

from experiments.thesis import judges, resemblance, shapes
from experiments.thesis.appendix_a import (
    OF_STIFFNESS,
    QUICK,
    SLOW,
    claim,
    locus_case,
)
from experiments.thesis.loci import Claim, LocusCase, locus
from rigtwin.studies.stability.locus import BODY


def cases_of_stiffness() -> tuple[LocusCase, ...]:
    """Return the cases of Table A2.2: the sprung natural frequency is swept."""
    cases = []
    # In structure MIL only the body moves with a lag, so the wheel hop follows its ideal longer.
    for number, ratio, lag, figure in OF_STIFFNESS:
        name, variations = f"A2.{figure}", SLOW if lag == 0.2 else QUICK
        # The thesis compares structure MIL with suspension MIL over the same sweep.
        beside = locus("suspension", variations[ratio])
        note = (
            "the caption of Figure A2.8 says ζ = 1.5, Table A2.2 0.5: the table is right"
            if figure == 8
            else ""
        )
        claims = [
            claim(
                name,
                "stability",
                "body hop unstable at high frequencies, wheel hop not",
                judges.becomes_unstable(BODY),
                note,
            ),
            claim(name, "resemblance", "at low frequencies", resemblance.closest_at("start")),
        ]
        if ratio != 1.5:
            claims.append(claim(name, "wheel hop", "moves left, not right", shapes.wheel_goes_left))
        if lag == 0.2 and ratio >= 1.0:
            on_curve = resemblance.body_on_ideal_trajectory(beside, "suspension MIL")
            note = (
                "it cannot: it becomes unstable, which no ideal pole "
                "is; it stays nearer than with suspension MIL"
            )
            claims.append(
                claim(
                    name,
                    "body hop",
                    "stays on the ideal trajectory, unlike suspension MIL",
                    on_curve,
                    note,
                )
            )
        claims += _breakaway(name, ratio, lag)
        if lag == 0.2 and ratio == 0.5:
            closer = resemblance.wheel_closer_than(beside, "suspension MIL")
            claims.append(
                claim(name, "wheel hop", "diverges less than with suspension MIL", closer)
            )
        cases.append(
            locus_case(
                "structure",
                number,
                f"ζ = {ratio:g}, τ = {lag:g} s",
                variations[ratio],
                {name: None},
                *claims,
            )
        )
    return tuple(cases)


def _breakaway(name: str, ratio: float, lag: float) -> list[Claim]:
    """Return the statements of §A2.2 about poles that leave the real axis or return to it."""
    claims = []
    if lag == 0.2 and ratio == 1.0:
        words = "wheel hop breaks away from the real axis"
        claims.append(claim(name, "breakaway", words, shapes.breaks_away))
    if ratio == 1.5:
        words = "wheel hop forms a loop and breaks in again"
        claims.append(claim(name, "breakaway", words, shapes.breaks_in))
    if lag == 0.01 and ratio >= 1.0:
        further_left = shapes.breaks_away_left_of(locus("structure", SLOW[ratio]), "τ = 0.2 s")
        claims.append(claim(name, "breakaway", "further left with less lag", further_left))
    return claims
