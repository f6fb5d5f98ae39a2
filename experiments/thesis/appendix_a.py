"""What the cases of appendix A share: the parameters of Tables A1.1 to A3.5, which are the same for
every model."""

from __future__ import annotations

from collections.abc import Mapping

from experiments.thesis.judges import Judge
from experiments.thesis.loci import (
    Case,
    Claim,
    Panel,
    Variation,
    of_damping_ratio,
    of_lag,
    of_natural_frequency,
    of_tyre_stiffness,
    of_wheel_mass,
)

PRINTED_LAG, MEANT_LAG, FILTER_LAG = 0.333, 0.0333, 0.01
"""s, of Tables A1.4 to A3.5: of case 1, what it must have been, and of case 2."""
MISPRINT = (
    "with the printed τ = 0.333 s the loop is unstable for every "
    "value of the sweep; with 0.0333 s it is so"
)
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
"""Case, damping ratio, lag in s and figure, of Tables A2.2 and A3.2."""
View = tuple[float, float, float] | None
STIFF = (-4.5, 0.8, 50.0)
"""Without the poles of the filters, which are far to the left."""
LIGHT = (-60.0, 5.0, 60.0)
"""Without an ideal pole that a light wheel sends far to the left."""


def case(
    model: str,
    number: int,
    title: str,
    variation: Variation,
    panels: Mapping[str, View],
    *claims: Claim,
) -> Case:
    """panels: figure, such as `A1.3` → the part of the plane that it shows."""
    shown = tuple(Panel(name, view) for name, view in panels.items())
    return Case(model, f"case {number}, {title}", variation, shown, claims)


def says(figure: str, what: str, says: str, judge: Judge, note: str = "") -> Claim:
    """A claim about `Figure A1.3`."""
    return Claim(f"Figure {figure}", what, says, judge, note)


def instead(lag: float) -> str:
    """What is added to a figure's name where it is drawn with the lag that the thesis must have
    used."""
    return ", another lag" if lag == MEANT_LAG else ""


def misprint(lag: float) -> str:
    """The note for what is false with the printed lag."""
    return MISPRINT if lag == PRINTED_LAG else ""
