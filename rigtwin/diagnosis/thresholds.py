"""The thresholds that decide what a diagnosis says.

They were set on cases of the withheld-effect check with seeds other than those reported
(docs/diagnosis.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class NamingRules:
    """When effects are named."""

    most: int
    """Effects that are named at once."""
    more: float
    """Share of what is left that each further effect must explain."""
    enough: float
    """Share of the gap that they must explain to be named at all if something is left."""
    too_much: float
    """χ² per degree of freedom above 1 from which what is left forbids to name anything,"""
    nearly_all: float = 1.0
    """unless that share of what is off, in amplitude, is gone in every recording."""


@dataclass(frozen=True)
class SelectionRules:
    """When an explanation of a rough model does as well as another on data held out of its fit.

    Differences are of the logarithm of the error: 0.1 is 10 %.
    """

    price: float = 0.06
    """That each parameter must gain, besides what its freedom gains by chance: ln N / N, with N
    independent pieces of what is left."""
    slack: float = 0.10
    """The largest difference that is none."""
    alike: float = 0.07
    """Difference from the chosen one within which others are named beside it, or its standard
    error, up to `slack`."""
    steady: float = 4.0
    """Standard errors by which a magnitude must be off nominal."""
    undone: float = 0.5
    """Share of either effect's own amplitude that two must leave together."""
    collinear: float = 0.95
    """Cosine of two responses from which only one of them is claimed,"""
    surely: float = 100.0
    """unless both magnitudes are off nominal by that many standard errors,"""
    apart: float = 0.5
    """or the explanation does so much worse without either, price included."""
    necessary: float = 0.05
    """Price included, by how much every explanation without an effect must do worse,"""
    rarely: float = 0.11
    """and what one of those that few machines have must account for, as a share of the signals,"""
    far: float = 1.4
    """unless it does that much better."""
    far_and_complete: float = 1.0
    """The same where it leaves nothing but noise,"""
    complete: float = 0.05
    """or by such a share more."""
    calibration: tuple[tuple[float, float], ...] = (
        (0.05, 0.75),
        (0.25, 0.85),
        (0.5, 0.95),
        (1.0, 0.97),
    )
    """Margin of an effect, and how often one of such a margin was right, or one of its class, on
    machines of other physics than the library's (docs/confidence.md)."""
    measured: float = 0.3
    """Share of the signals that is left at most where that was measured,"""
    beyond: float = 0.85
    """and what it was on real machines of which more is left."""
    jackknifed: float = 4.0
    """Standard errors by the jackknife to either side that an interval has at least."""
    needed: float = 0.03
    """Difference on held-out recordings that an effect must bring to stay."""
    least: float = 0.35
    """Difference from the nominal machine that an explanation must bring to be named at all,"""
    several: int = 3
    """unless each of so many recordings is predicted better with it,"""
    certain: float = 10.0
    """and its magnitudes, from recording to recording, are off nominal by that many standard
    errors."""

    def confidence(self, margin: float, left: float) -> float:
        """Of an effect without which everything does worse by a margin, where an explanation leaves
        that much of the signals."""
        margins, shares = zip(*self.calibration, strict=True)
        most = self.beyond if left > self.measured else 1.0
        return min(float(np.interp(margin, margins, shares)), most)

    def price_of(self, pieces: float) -> float:
        """Of a parameter, where what is left consists of so many independent pieces."""
        return self.price + math.log(pieces) / pieces


@dataclass(frozen=True)
class Thresholds:
    """What the stages of a diagnosis hold their figures against."""

    detected: float = 60.0
    """χ² that an effect must explain to be a finding,"""
    noticeable: float = 0.015
    """and share of what noise alone leaves: less is a trace that no closed loop shows."""
    unexplained: float = 0.10
    """χ² per degree of freedom above 1 from which what is left counts as a gap."""
    promising: float = 0.1
    """Share of what the effect that promises most would explain, to first order, from which another
    is fitted."""
    much: float = 0.03
    """Share of what noise leaves from which what one effect leaves is worth a search among many
    pairs."""
    far_behind: float = 0.7
    """Share of what the best effect explains that a first of two may lack."""
    temper: float = 4.0
    """χ² by which explanations must differ for the better one to be e^½ times as likely."""
    form_temper: float = 0.05
    """How much of what is left widens that."""
    member: float = 0.05
    """Probability from which an effect belongs to the class that is reported."""
    known: NamingRules = field(
        default=NamingRules(most=2, more=0.5, enough=0.97, too_much=0.4, nearly_all=0.9)
    )
    """Of a machine whose nominal values are well known: what is left is something else."""
    rough: NamingRules = field(
        default=NamingRules(most=6, more=0.08, enough=0.75, too_much=math.inf)
    )
    """Of one whose nominal values are only a start: something is always left; half the gap, in
    amplitude, must be explained."""
    selection: SelectionRules = field(default=SelectionRules())
    """Between explanations of a rough model."""
    price: float = 8.0
    """Of each parameter, in χ²: a simpler explanation is preferred."""
    within_tolerance: float = 1.5
    """Tolerances below which a deviation is no finding."""
    slight: float = 1e-3
    """Share of what is explained by which an explanation must do better than a simpler one."""
    second: float = 2.0
    """Times what a first effect must explain that each further one must."""
    near: float = 0.2
    """Share of what is explained that an explanation with one effect replaced may lack."""
    worse: float = 1.05
    """Times the gap without it from which held-out data reject a correction."""
    consequence: float = 1e-3
    """Share of how far commands move below which what a controller did other than told is a note,
    and no gap."""
    sure: float = 0.98
    """Confidence in what is read off a signal or reproduced exactly; nothing is ever surer."""
    less_sure: float = 0.88
    """The same in one of two effects, or beside something that has no name: so often such names
    were right."""
    unsure: float = 0.9
    """Confidence below which another test is proposed."""
    wider: float = 2.5
    """Times the statistical interval that is reported: a model's form is never exact."""
    possible: float = 0.01
    """Probability from which on another explanation is kept beside the one named."""
    something: float = 0.03
    """Share of what noise leaves that a free disturbance of one component must explain for
    something unnamed to be there."""
    changed: float = 0.01
    """Probability, corrected for the number of parameters, below which estimates of recordings
    differ."""
    instead: float = 24.0
    """χ², in units of what is left, by which another parameter's change may do worse and be named
    beside the best."""
    seen: float = 1e-3
    """Share of an effect's response that zeros, tolerances and what else is named must not be able
    to take up for a recording to tell of it."""
    trend_explains: float = 0.8
    """Share of the differences between recordings that a quantity they go with explains,"""
    trend_clear: float = 3.0
    """and times what it leaves that every other must leave."""
    left_over: float = 1.3
    """Times its noise from which a signal has something left, if that is more than no model is
    held to."""


STANDARD = Thresholds()
"""Those that every published figure was made with."""
