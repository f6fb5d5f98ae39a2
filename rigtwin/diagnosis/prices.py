"""What a hypothesis costs besides its residual: the prior of its effects, in nats.

Every effect has a price, an Occam factor that grows with the rest that nothing explains: a
parameter absorbs some of any rest, also where it means nothing. Values that are badly known, that
undo each other, or that are no more than a declared tolerance or model error cost more. All prices
are continuous in the values.
"""

from __future__ import annotations

import math

import numpy as np

from rigtwin.components import Effect, measures
from rigtwin.components.quantity import fields
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.scoring import Scored
from rigtwin.diagnosis.thresholds import Thresholds

RARE = (
    "backlash",
    "compliance",
    "mount",
    "cogging",
    "relaxation",
    "drag",
    "load_friction",
    "deadband_asymmetry",
)
"""Kinds that few machines have; the rest that dry friction at the same component leaves resembles
them."""
CONTAINS_SIMPLER = ("two_lags", "mount", "deadband_asymmetry")
"""Kinds that become a simpler one at the end of their range."""
DOUBT = 0.5
"""Parameters that such a kind costs besides its own."""
NEAR = 0.25
"""Standard errors within which the price of an unsteady value doubles where its interval holds the
nominal value."""


def is_rare(effect: Effect) -> bool:
    """Whether few machines have it; the gain of a sensor is one such effect, its zero is not."""
    if measures(effect.of()):
        return effect.kind.name != "offset"
    return effect.kind.name in RARE and "coulomb" in fields(effect.of)


class Prices:
    """Prices where a certain rest is left.

    Parameters
    ----------
    fitter
        Fitter of the evidence.
    thresholds
        Numbers that the prices are made of.
    candidates
        Number of effects that were searched.
    samples
        Number of independent samples of all signals.
    signals
        Number of signals.
    discrepancy
        Share of the residual's samples that noise and declared error do not explain, 0 to 1.
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
        self._first = (
            (1.0 - discrepancy) * (t.occam_quiet + t.materiality * samples)
            + discrepancy * t.occam_discrepant
            + math.log(max(candidates, 1))
        )
        self._each = discrepancy * t.discrepancy_price * self._signal_samples
        machine = fitter.evidence.machine
        self._form = float(np.mean([machine.form_of(row) for row in machine.rows]))

    @property
    def ordinary(self) -> float:
        """Nats that an ordinary effect of one parameter must gain."""
        return self._first + self._each

    def of(self, effect: Effect) -> float:
        """Nats that an effect must gain to be worth its parameters."""
        t = self._thresholds
        count = float(len(effect.kind.parameters) - len(effect.kind.nuisances))
        starts = self._fitter.starts(effect)
        if starts.quadrature:
            # Each pitch of a wave is a place of its own, and was looked at in two phases.
            count += math.log2(len(starts.values) / 2)
        elif count == 1.0 and effect.kind.name in CONTAINS_SIMPLER:
            count += DOUBT
        price = self._first + count * self._each + (count - 1.0) * t.shape_price
        if is_rare(effect):
            price += t.rare_odds + self._discrepancy * t.rare_price * self._signal_samples
        return price

    def of_values(self, scored: Scored) -> float:
        """Nats that the values of a hypothesis cost beyond the prices of its effects."""
        return self._undone(scored) + self._slight(scored) + self._uncertain(scored)

    def _undone(self, scored: Scored) -> float:
        """Cost of pairs of effects that undo each other.

        What corrects a nominal value that is too high undoes nothing, so that only pairs count
        which the nominal machine does not have.
        """
        t, cost = self._thresholds, 0.0
        new = [self._nominal(effect) == 0.0 for effect in scored.fit.effects]
        for one in range(len(new)):
            for other in range(one):
                if new[one] and new[other]:
                    lacking = (t.cancelling_share - scored.together[one, other]) / (
                        0.5 * t.cancelling_share
                    )
                    cost += t.prohibitive_price * float(np.clip(lacking, 0.0, 1.0))
        return cost

    def _slight(self, scored: Scored) -> float:
        """Cost of effects that account for less than the declared error, or for little though they
        are rare."""
        t, cost = self._thresholds, 0.0
        even = self._fitter.evidence.machine.prior.even
        for effect, share in zip(scored.fit.effects, scored.accounts, strict=True):
            immaterial = float(np.clip(t.material_model_errors - share / self._form, 0.0, 1.0))
            cost += even * t.prohibitive_price * immaterial
            if is_rare(effect):
                lacking = float(np.clip(1.0 - share / t.rare_amplitude_share, 0.0, 1.0))
                cost += self._discrepancy * lacking * t.rare_immaterial_price * self._signal_samples
        return cost

    def _uncertain(self, scored: Scored) -> float:
        """Cost of values that are badly known, or no more than a declared tolerance."""
        t, evidence, cost = self._thresholds, self._fitter.evidence, 0.0
        for effect, values, widths in zip(
            scored.fit.effects, scored.fit.values, scored.widths, strict=True
        ):
            off = abs(values[0] - self._nominal(effect))
            sure = off / max(widths[0], 1e-300)
            steep = 1.0 + (max(t.interval_half_width - sure, 0.0) / NEAR) ** 2
            cost += t.unsteady_price * max(t.steady_standard_errors - sure, 0.0) ** 2 * steep
            tolerance = evidence.machine.tolerance_of(effect.group, effect.kind.parameters[0])
            if tolerance is not None:
                width = evidence.width(tolerance)
                if tolerance.relative:
                    width = tolerance.half_width * abs(self._nominal(effect))
                beyond = t.tolerance_half_widths - off / max(width, 1e-300)
                cost += t.prohibitive_price * float(np.clip(beyond, 0.0, 1.0))
        return cost

    def _nominal(self, effect: Effect) -> float:
        """The nominal magnitude of an effect."""
        return effect.nominal(self._fitter.plant)[effect.kind.parameters[0]]
