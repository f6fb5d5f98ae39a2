"""Prices of effects: the prior of a hypothesis, in nats.

Let d be the discrepancy, the share of the n independent samples that nothing explains, and m the
number of signals. An effect with p parameters costs

    (1 - d) (occam_quiet + materiality n) + d occam_discrepant + ln(candidates)
    + p d discrepancy_price n / m + (p - 1) shape_price,

an Occam factor that grows with the residual that nothing explains, as a parameter absorbs some of
any such residual. The logarithm accounts for the number of effects that were tried. Rare effects,
values that are poorly determined or cancel each other, and changes within a declared tolerance or
model error cost more. All prices are continuous in the values.
"""

from __future__ import annotations

import math

import numpy as np

from rigtwin.components import Effect, ForceActuator, Warming, measures
from rigtwin.components.quantity import fields
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.scoring import Scored
from rigtwin.diagnosis.thresholds import Thresholds

RARE = (
    "backlash",
    "compliance",
    "mount",
    "cogging",
    "position_force",
    "cubic_stiffness",
    "end_stops",
    "relaxation",
    "drag",
    "load_friction",
    "deadband_asymmetry",
)
"""Kinds that few machines have. The residual that dry friction leaves at the same component
resembles them."""
ELUSIVE = ("payload",)
"""Kinds of a rigid body that are rare. A payload has a place besides its mass, so that it resembles
the zero or the friction of several joints."""
RARE_AT: dict[type, tuple[str, ...]] = {
    ForceActuator: ("backlash", "curvature"),
    Warming: ("coulomb", "viscous"),
}
"""Type of component without dry friction → kinds that are rare at it. Of a pushed joint, play takes
four times the steps of any other effect."""
CONTAINS_SIMPLER = ("two_lags", "mount", "deadband_asymmetry", "curvature")
"""Kinds that become a simpler kind at an end of their range."""
LATE = ("delay", "lag")
"""Kinds that make a signal late, or early where negative."""
SETTINGS = ("damping_gain",)
"""Kinds that change a number which somebody set, and resemble friction."""
WEIGHED = ("mass",)
"""Kinds that change a mass by a factor."""
SIMPLER_PARAMETERS = 0.5
"""Number of parameters that a kind containing a simpler one costs in addition."""
NOMINAL_DISTANCE = 0.25
"""Shortfall in standard errors at which the price of a value doubles once its interval contains the
nominal value."""


def is_rare(effect: Effect) -> bool:
    """Return whether few machines have an effect.

    The gain of a sensor is rare and its zero is not. Most kinds of components without dry friction
    are not rare.
    """
    if measures(effect.of()):
        return effect.kind.name != "offset"
    if effect.kind.name in (*ELUSIVE, *RARE_AT.get(effect.of, ())):
        return True
    return effect.kind.name in RARE and "coulomb" in fields(effect.of)


class Prices:
    """Prices of effects at a given discrepancy.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    thresholds
        Thresholds that the prices are made of.
    candidates
        Number of effects that are searched.
    samples
        Number of independent samples of all signals.
    signals
        Number of signals.
    discrepancy
        Share of the independent samples that noise and declared error do not explain, 0 to 1.
    """

    def __init__(
        self,
        fitter: Fitter,
        thresholds: Thresholds,
        candidates: int,
        samples: float,
        signals: int,
        discrepancy: float,
    ) -> None:
        self._fitter, self._thresholds = fitter, thresholds
        self._signal_samples, self._discrepancy = samples / signals, discrepancy
        t = thresholds
        self._effect_price = (
            (1.0 - discrepancy) * (t.occam_quiet + t.materiality * samples)
            + discrepancy * t.occam_discrepant
            + math.log(max(candidates, 1))
        )
        self._parameter_price = discrepancy * t.discrepancy_price * self._signal_samples
        machine = fitter.evidence.machine
        self._form = float(np.mean([machine.form_of(row) for row in machine.rows]))

    @property
    def ordinary(self) -> float:
        """Price of an ordinary effect of one parameter, nats."""
        return self._effect_price + self._parameter_price

    def price_effect(self, effect: Effect) -> float:
        """Return the gain that an effect must bring to be worth its parameters, nats."""
        t = self._thresholds
        count = float(len(effect.kind.fitted))
        starts = self._fitter.starts(effect)
        if starts.quadrature:
            # Each pitch of a wave is a hypothesis of its own.
            count += math.log2(starts.shapes)
        elif count == 1.0 and effect.kind.name in CONTAINS_SIMPLER:
            count += SIMPLER_PARAMETERS
        price = self._effect_price + count * self._parameter_price + (count - 1.0) * t.shape_price
        if effect.kind.name in SETTINGS:
            price += t.setting_odds
        if is_rare(effect):
            price += t.rare_odds + self._discrepancy * t.rare_price * self._signal_samples
        return price

    def price_values(self, scored: Scored) -> float:
        """Return the price of a hypothesis' values beyond the prices of its effects, nats."""
        return (
            self._price_cancelling(scored)
            + self._price_immaterial(scored)
            + self._price_unsteady(scored)
            + self._price_masses(scored)
        )

    def _price_cancelling(self, scored: Scored) -> float:
        """Return the price of pairs of effects that cancel each other.

        Only pairs of effects that the nominal machine lacks count: a correction of a nominal value
        may rightly oppose another effect. A negative delay beside a lag, or the reverse, is such a
        pair whatever its response: no sensor is early and late at once, and both together resemble
        an inertia or an elastic part that is not modelled.
        """
        t, price = self._thresholds, 0.0
        late = {
            (effect.component, effect.kind.name): values[0]
            for effect, values in zip(scored.fit.effects, scored.fit.values, strict=True)
            if effect.kind.name in LATE
        }
        for component in {component for component, _ in late}:
            delay, lag = (late.get((component, kind), 0.0) for kind in LATE)
            if delay * lag < 0.0:
                # A value near zero must not decide by its sign.
                smaller, larger = sorted((abs(delay), abs(lag)))
                price += t.prohibitive_price * min(2.0 * smaller / larger, 1.0)
        absent = [self._nominal(effect) == 0.0 for effect in scored.fit.effects]
        for first in range(len(absent)):
            for second in range(first):
                if absent[first] and absent[second]:
                    # 1 for effects that do not oppose each other, and 0 for two that cancel.
                    joint = scored.together[first, second]
                    # The price rises linearly from the threshold to its half.
                    lacking = (t.cancelling_share - joint) / (0.5 * t.cancelling_share)
                    price += t.prohibitive_price * float(np.clip(lacking, 0.0, 1.0))
        return price

    def _price_immaterial(self, scored: Scored) -> float:
        """Return the price of effects that account for too little of the signals.

        Every effect should exceed the declared error where that is spread evenly; a rare effect
        should account for a larger share.
        """
        t, price = self._thresholds, 0.0
        even = self._fitter.evidence.machine.prior.even
        for effect, share in zip(scored.fit.effects, scored.accounts, strict=True):
            immaterial = float(np.clip(t.material_model_errors - share / self._form, 0.0, 1.0))
            price += even * t.prohibitive_price * immaterial
            if is_rare(effect):
                lacking = float(np.clip(1.0 - share / t.rare_amplitude_share, 0.0, 1.0))
                doubt = self._discrepancy * lacking
                price += doubt * t.rare_immaterial_price * self._signal_samples
        return price

    def _price_unsteady(self, scored: Scored) -> float:
        """Return the price of values that are poorly determined or within a declared tolerance.

        With z the standard errors between a magnitude and its nominal value, the price is
        unsteady_price (4 - z)^2 for z < 4. It is steeper once the interval of 2.5 standard errors
        contains the nominal value.
        """
        # The price is continuous in the standard errors: with a threshold, a small change of the
        # data could exchange the best hypothesis.
        t, evidence, price = self._thresholds, self._fitter.evidence, 0.0
        for effect, values, widths in zip(
            scored.fit.effects, scored.fit.values, scored.widths, strict=True
        ):
            steadiness = effect.steadiness(values, widths, self._fitter.plant)
            shortfall = max(t.interval_half_width - steadiness, 0.0)
            steep = 1.0 + (shortfall / NOMINAL_DISTANCE) ** 2
            unsteady = max(t.steady_standard_errors - steadiness, 0.0)
            price += t.unsteady_price * unsteady**2 * steep
            tolerance = evidence.machine.tolerance_of(effect.group, effect.kind.parameters[0])
            if tolerance is not None:
                width = evidence.width(tolerance)
                if tolerance.relative:
                    width = tolerance.half_width * abs(self._nominal(effect))
                change = effect.distances(values, self._fitter.plant)[0]
                within = t.tolerance_half_widths - change / max(width, 1e-300)
                price += t.prohibitive_price * float(np.clip(within, 0.0, 1.0))
        return price

    def _price_masses(self, scored: Scored) -> float:
        """Return the price of changed masses, ½ (ln(m / m_0) / mass_log_error)², summed.

        Where the data determine only the ratio of a gain to a mass, this makes the gain likelier.
        """
        price = 0.0
        for effect, values in zip(scored.fit.effects, scored.fit.values, strict=True):
            nominal = self._nominal(effect)
            if effect.kind.name in WEIGHED and nominal > 0.0 and values[0] > 0.0:
                deviation = math.log(values[0] / nominal) / self._thresholds.mass_log_error
                price += 0.5 * deviation**2
        return price

    def _nominal(self, effect: Effect) -> float:
        """Return the nominal magnitude of an effect, in the unit of its first parameter."""
        return effect.nominal(self._fitter.plant)[effect.kind.parameters[0]]
