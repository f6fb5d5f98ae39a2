"""Shared parameters of the root loci of appendix A.

Tables A1.1 to A3.5 use the same parameters for all three models.
"""

from __future__ import annotations

from collections.abc import Mapping

from experiments.thesis.judges import Judge
from experiments.thesis.loci import (
    Claim,
    LocusCase,
    LocusFigure,
    LocusVariation,
    of_damping_ratio,
    of_lag,
    of_natural_frequency,
    of_tyre_stiffness,
    of_wheel_mass,
)

PRINTED_LAG, MEANT_LAG, FILTER_LAG = 0.333, 0.0333, 0.01
"""Lags of Tables A1.4 to A3.5, s: case 1 as printed, case 1 as meant, and case 2."""
MISPRINT = (
    "with the printed τ = 0.333 s the loop is unstable for every "
    "value of the sweep; with 0.0333 s it is so"
)
# Sweeps, by damping ratio or by lag in s. They are made once, so loci are cached by identity.
LAGS = {ratio: of_lag(ratio) for ratio in (1.0, 0.5)}
SLOW = {ratio: of_natural_frequency(ratio, 0.2, 1e5) for ratio in (1.0, 1.5, 0.5)}
QUICK = {ratio: of_natural_frequency(ratio, 0.01, 1e6) for ratio in (1.0, 1.5, 0.5)}
RATIOS = {lag: of_damping_ratio(lag) for lag in (0.2, 0.01, 0.001)}
TYRES = {lag: of_tyre_stiffness(lag) for lag in (PRINTED_LAG, MEANT_LAG, FILTER_LAG)}
WHEELS = {lag: of_wheel_mass(lag) for lag in (PRINTED_LAG, MEANT_LAG, FILTER_LAG)}
OF_STIFFNESS = (
    (1, 1.0, 0.2, 3),
    (2, 1.5, 0.2, 4),
    (3, 0.5, 0.2, 5),
    (4, 1.0, 0.01, 6),
    (5, 1.5, 0.01, 7),
    (6, 0.5, 0.01, 8),
)
"""Case, damping ratio, lag, s, and figure number of Tables A2.2 and A3.2."""
View = tuple[float, float, float] | None
"""Shown part of the complex plane: left, right, 1/s, and height, rad/s. None shows all poles."""
STIFF = (-4.5, 0.8, 50.0)
"""View without the poles of the filters, which lie far to the left."""
LIGHT = (-60.0, 5.0, 60.0)
"""View without the ideal pole that a light wheel moves far to the left."""


def locus_case(
    model: str,
    number: int,
    title: str,
    variation: LocusVariation,
    panels: Mapping[str, View],
    *claims: Claim,
) -> LocusCase:
    """Return a case of a table.

    Parameters
    ----------
    model : str
        Model: suspension, structure or combined.
    number : int
        Number of the case in its table.
    title : str
        Values that tell the case from others.
    variation : Variation
        Swept parameter.
    panels : mapping
        Figure, such as `A1.3` → part of the plane that it shows.
    *claims : Claim
        Statements of the thesis about the case.
    """
    shown = tuple(LocusFigure(name, view) for name, view in panels.items())
    return LocusCase(model, f"case {number}, {title}", variation, shown, claims)


def claim(figure: str, topic: str, words: str, judge: Judge, note: str = "") -> Claim:
    """Return a claim about a figure, such as `A1.3`."""
    return Claim(f"Figure {figure}", topic, words, judge, note)


def corrected_lag_suffix(lag: float) -> str:
    """Return the suffix of a figure that is drawn with the meant lag instead of the printed one."""
    return ", another lag" if lag == MEANT_LAG else ""


def misprint_note(lag: float) -> str:
    """Return the note of a statement that is false with the printed lag."""
    return MISPRINT if lag == PRINTED_LAG else ""
