"""Thresholds and prices that decide what a diagnosis says.

The values were set by hand on the recordings listed in docs/diagnosis.md. They are not calibrated
on the referees yet (docs/confidence.md).

A nat is the unit of log likelihood: a hypothesis that is better by one nat is e times as likely. A
price in nats is the gain in log predictive density that an effect must bring to be worth adding.
Where the model is rough, the residual left by all hypotheses is correlated, and a parameter absorbs
some of it by chance. Prices named "per independent sample" grow with the amount of such data.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of the search, of the score of a hypothesis, and of the wording of the answer."""

    # The search: which effects are fitted, and which fits are extended.
    promising_share: float = 0.1
    """An effect is fitted alone if its promise reaches this share of the largest promise."""
    precise_fit_shortfall: float = 0.2
    """Single effects are refitted precisely if they explain at most this share less than the best
    single effect."""
    leaders: int = 3
    """Number of hypotheses considered for extension in each round."""
    additions: int = 6
    """Number of further effects fitted beside each leader."""
    effort: float = 300.0
    """Estimated processor time after which no further hypothesis is tried, s."""
    last_effort_share: float = 0.3
    """Share of `effort` that is kept for rivals of the best hypothesis."""
    negligible_share: float = 0.02
    """Share of the amplitude of each signal's gap below which an approximate search looks for no
    further effect: its own error looks like one."""

    # The score of a hypothesis: the price of its effects.
    occam_quiet: float = 15.0
    """Price of an effect where only noise remains, nats."""
    occam_discrepant: float = 5.0
    """Price of an effect where an unexplained residual dominates, nats."""
    materiality: float = 0.0075
    """Further price of an effect where only noise remains, nats per independent sample. A smaller
    effect would not be noticed in any test."""
    discrepancy_price: float = 0.06
    """Price of each parameter where an unexplained residual dominates, nats per independent sample
    of one signal. A parameter absorbs some of any residual, also where it has no physical cause."""
    shape_price: float = 4.0
    """Price of each parameter of an effect after the first, nats."""
    rare_odds: float = 5.0
    """Further price of a rare effect, nats."""
    setting_odds: float = 1.0
    """Further price of a servo's damping, nats. Somebody set it, while the friction of a joint that
    it resembles is seldom known."""
    rare_price: float = 0.06
    """Further price of a rare effect where an unexplained residual dominates, nats per independent
    sample of one signal."""
    rare_amplitude_share: float = 0.11
    """Share of the signals' amplitude that a rare effect should account for."""
    rare_immaterial_price: float = 0.3
    """Price of a rare effect that accounts for none of the signals' amplitude, where an unexplained
    residual dominates, nats per independent sample of one signal."""
    material_model_errors: float = 2.0
    """Amplitude that an effect should account for, in declared model errors, where that error is
    spread evenly over the spectrum. Within one model error below it the price rises to
    `prohibitive_price`."""
    steady_standard_errors: float = 4.0
    """Standard errors by which a magnitude should differ from its nominal value."""
    unsteady_price: float = 20.0
    """Price of a magnitude that is one standard error short of `steady_standard_errors`, nats. The
    price grows with the square of the shortfall, and steeply once the interval contains the nominal
    value."""
    mass_log_error: float = 0.25
    """Standard deviation of the logarithm of a declared mass or moment of inertia. A mass is drawn
    or weighed, so that it is seldom wrong by a factor, as a gain may be."""
    prohibitive_price: float = 50.0
    """Highest price of an effect that is immaterial, cancelled by another effect, or smaller than
    its declared tolerance, nats."""

    # The score of a hypothesis: its log predictive density and its weight.
    within_noise_weight: float = 0.3
    """Weight of the log likelihood of residuals below noise and declared error. The noise estimate
    is an upper bound, and a gain within the declared error is weak evidence."""
    chance_deviations: float = 2.0
    """Power above that of noise counts as residual beyond this many standard deviations of the
    power of noise in a band."""
    cancelling_share: float = 0.3
    """Two effects cancel if their joint response is below this share of the smaller single
    response. The price grows linearly as the joint response shrinks."""
    tolerance_half_widths: float = 2.0
    """A change is an effect rather than a tolerance beyond this many declared half widths."""
    temper: float = 4.0
    """Divisor of differences of log likelihood where only noise remains, since no noise model is
    exact."""
    discrepancy_temper: float = 0.02
    """Share of the independent samples of a signal that is added to `temper` where an unexplained
    residual dominates."""

    # The wording of the answer.
    rival_weight: float = 0.05
    """An effect is a rival of a named effect if its hypothesis has at least this weight, relative
    to the chosen hypothesis."""
    rival_count: float = 3.5
    """Largest effective number of rivals that are named together."""
    naming_confidence: float = 0.5
    """Lowest confidence at which an effect is named."""
    residual_excess: float = 0.15
    """Excess of the residual's power over noise and declared error that counts as unexplained."""
    explained_share: float = 0.8
    """Share of the gap on held-out data that the verdict "explained" requires to be closed."""
    removed_share: float = 0.106
    """Share of the amplitude of one signal's gap that named effects must close on held-out data.
    It corresponds to a fifth of the power."""
    mimicry_share: float = 0.17
    """Share of the gap's amplitude that may remain beside an unnamed effect. Above it, the named
    effect is as likely to be a mimic of the unnamed effect."""
    clean_ratio: float = 8.0
    """Ratio of what an effect explains to what remains with it, from which it explains its part
    cleanly and corrects no form of another law."""
    worsening_factor: float = 1.05
    """Factor of the residual's power on held-out data above which a correction is rejected."""
    controller_consequence: float = 1e-3
    """Share of the commands' amplitude below which a deviating controller setting is only noted."""
    highest_confidence: float = 0.98
    """Upper bound on every confidence."""
    unfinished_confidence: float = 0.7
    """Upper bound on every confidence of a search that ended early: hypotheses that were not tried
    may be better."""
    retest_confidence: float = 0.9
    """Confidence below which another test is proposed."""
    interval_half_width: float = 2.5
    """Standard errors in half an interval. It exceeds 1.96 since the form of a model is never
    exact."""
    rest_correlation: float = 0.3
    """Typical correlation of an unexplained residual with the response to an effect. It widens
    intervals."""
    alternative_weight: float = 0.01
    """Lowest weight at which another explanation is reported beside the chosen one."""
    localisation_ratio: float = 1.3
    """Ratio of a signal's residual to its noise above which the residual is localised."""

    # Changes between recordings.
    change_probability: float = 0.01
    """Probability, corrected for the number of parameters, below which estimates differ."""
    rival_change_chi_square: float = 24.0
    """The change of another parameter is named beside the best one if its chi-square, in units of
    the residual, is larger by at most this."""
    observable_share: float = 1e-3
    """Share of a response that nuisance parameters must not absorb for a recording to count."""
    trend_share: float = 0.8
    """Share of the differences between recordings that a covariate must explain."""
    trend_margin: float = 3.0
    """Factor by which every other covariate must leave more than the best covariate."""
    most_changes: int = 6
    """Largest number of parameters that may differ between recordings."""
    change_log_error: float = 0.03
    """Difference of the logarithm of the error that a change must make."""


STANDARD = Thresholds()
"""Default thresholds of a diagnosis."""
