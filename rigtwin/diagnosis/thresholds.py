"""Every number that decides what a diagnosis says.

They were set by hand on the recordings that docs/diagnosis.md lists, and are not calibrated on the
referees yet (docs/confidence.md). "Nats" are units of log likelihood: a hypothesis that is better
by one nat is e times as likely.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Thresholds:
    """Numbers of the search, of the score of a hypothesis, and of the words of the answer."""

    # The search.
    promising: float = 0.1
    """Share of the best effect's promise that another must reach to be fitted alone."""
    near: float = 0.2
    """Share of what the best effect explains that another may lack to be fitted precisely."""
    leaders: int = 3
    """Hypotheses of each round that are extended by one more effect."""
    additions: int = 6
    """Further effects that are fitted beside each leader."""

    # The score of a hypothesis.
    occam_quiet: float = 15.0
    """Nats that an effect must gain where noise alone is left."""
    occam_discrepant: float = 5.0
    """Nats that an effect must gain where an unexplained rest dominates."""
    materiality: float = 0.0075
    """Nats per independent sample that an effect must gain where noise alone is left: a smaller
    effect would not be noticed in any test."""
    discrepancy_price: float = 0.06
    """Nats per independent sample of one signal that each parameter must gain where an unexplained
    rest dominates. A parameter absorbs some of any rest, also where it means nothing."""
    shape_price: float = 4.0
    """Nats that each parameter of an effect costs besides the first."""
    rare_odds: float = 5.0
    """Nats that a rare effect must gain in addition."""
    rare_price: float = 0.06
    """Nats per independent sample of one signal that a rare effect must gain in addition where an
    unexplained rest dominates."""
    rare_share: float = 0.11
    """Share of the signals' amplitude that a rare effect should account for."""
    rare_doubt: float = 0.3
    """Nats per independent sample of one signal that a rare effect costs which accounts for none of
    it, where an unexplained rest dominates."""
    material: float = 2.0
    """Declared model errors that an effect should account for where that error is spread evenly;
    below it the price rises over one such error."""
    steady: float = 4.0
    """Standard errors by which a magnitude should differ from its nominal value."""
    unsteady: float = 20.0
    """Nats that the first standard error costs which a magnitude lacks; the price grows with the
    square, and steeply once the interval holds the nominal value."""
    forbidding: float = 50.0
    """Nats that an effect costs at most which is immaterial, undone by another, or no more than its
    declared tolerance."""
    within: float = 0.3
    """Share of its weight that the likelihood has within noise and declared error. The noise is
    estimated from above, and what is gained within the declared error is little evidence."""
    chance: float = 2.0
    """Standard deviations of the power of noise in a band that are no rest."""
    undone: float = 0.3
    """Share of the smaller response that two effects must have together; with less they undo each
    other, which costs nats linearly."""
    within_tolerance: float = 2.0
    """Declared tolerances that a change must exceed to be an effect rather than a tolerance."""
    temper: float = 4.0
    """Factor by which differences of log likelihood are divided where noise alone is left, because
    no model of the noise is exact."""
    discrepancy_temper: float = 0.02
    """Share of the independent samples of a signal that is added to `temper` where an unexplained
    rest dominates."""

    # The words of the answer.
    member: float = 0.05
    """Weight, relative to the chosen hypothesis, from which another effect is named as one that the
    data cannot tell from it."""
    members: float = 3.5
    """Effective number of effects up to which those that the data cannot tell from each other are
    named together."""
    nameable: float = 0.5
    """Confidence from which an effect is named."""
    rest: float = 0.15
    """Excess of the residual's power over noise and declared error from which something is left."""
    explained: float = 0.8
    """Share of the gap that "explained" must close on held-out data."""
    removes: float = 0.106
    """Share of the amplitude of one signal's gap that named effects must close on held-out data to
    be named at all: a fifth of its power."""
    mimicry: float = 0.17
    """Share of the gap's amplitude that may be left beside an unnamed effect; with more, the named
    effect is as likely a mere likeness of the unnamed one."""
    worse: float = 1.05
    """Factor of the residual's power from which held-out data reject a correction."""
    consequence: float = 1e-3
    """Share of the commands' amplitude below which a deviating controller setting is a note."""
    sure: float = 0.98
    """Upper bound on every confidence."""
    unsure: float = 0.9
    """Confidence below which another test is proposed."""
    wider: float = 2.5
    """Standard errors in half an interval; the form of a model is never exact."""
    aligned: float = 0.3
    """Usual correlation of an unexplained rest with the response to an effect; it widens
    intervals."""
    possible: float = 0.01
    """Weight from which another explanation is kept beside the chosen one."""
    left_over: float = 1.3
    """Ratio of a signal's residual to its noise from which the residual is located."""

    # What changed between recordings.
    changed: float = 0.01
    """Probability, corrected for the number of parameters, below which estimates differ."""
    instead: float = 24.0
    """Chi-square, in units of the residual, by which the change of another parameter may be worse
    and still be named beside the best."""
    seen: float = 1e-3
    """Share of a response that nuisances must leave for a recording to tell of it."""
    trend_explains: float = 0.8
    """Share of the differences between recordings that a covariate must explain."""
    trend_clear: float = 3.0
    """Ratio of what every other covariate leaves to what the best one leaves."""
    changes: int = 6
    """Parameters that may differ between recordings at most."""
    changed_share: float = 0.03
    """Difference of the logarithm of the error that a change must make."""


STANDARD = Thresholds()
"""The thresholds that a diagnosis uses unless it is given others."""
