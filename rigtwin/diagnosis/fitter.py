"""Fits of effects to evidence: Gauss-Newton on the effects' parameters, with all tolerances free
within their priors.

An effect is first screened: it is simulated at several values, and its promise is the chi-square
that the best strength of any of these responses would explain to first order. With the response d,
the residual r and the tolerances eliminated (`Space.strengths`), that is (d'r)^2 / d'd.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigtwin.components import Effect, Guide, Starts
from rigtwin.components.guide import resists
from rigtwin.components.plant import Plant, component_of
from rigtwin.diagnosis.effect_starts import EffectStarts
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Fit, Values, is_possible, split_values, with_values
from rigtwin.diagnosis.gauss_newton import minimise
from rigtwin.diagnosis.space import Space
from rigtwin.diagnosis.waves import blend_waves
from rigtwin.numerics.arrays import Array

BOUND_SHARE = 1e-3
"""Distance from a bound, as a share of it, within which a value stands at the bound."""
REFINED_STARTS = 3
"""Largest number of starts of a single effect that are refined."""
START_SHORTFALL = 0.5
"""A start is refined if it gains at most this share less than the best start."""
CACHED_RESPONSES = 256
"""Number of cached responses beside a fit."""
SMALL_START = 0.05
"""Share of the smallest start at which an effect is simulated as well."""
NO_RESPONSE = 1e-3
"""Chi-square below which an effect has no response."""
Responses = list[tuple[tuple[float, ...], Array]]
"""Simulated values of one effect, and the whitened response to each."""


@dataclass(frozen=True)
class Screened:
    """An effect before it is fitted.

    Attributes
    ----------
    effect
        Screened effect.
    starts
        Misfit and values of all simulated starts, the best first.
    promise
        Chi-square that the effect may explain, to first order.
    """

    effect: Effect
    starts: tuple[tuple[float, tuple[float, ...]], ...]
    promise: float


class Fitter:
    """Screens and fits effects on one body of evidence.

    Attributes
    ----------
    evidence
        Recordings that are explained.
    plant
        Nominal plant.
    """

    def __init__(self, evidence: Evidence) -> None:
        self.evidence, self.plant = evidence, evidence.plant
        self._starts = EffectStarts(evidence)
        self._nominal_residual = evidence.residual(evidence.plant)
        self._responses: dict[Effect, Responses] = {}
        self._beside: dict[tuple[object, ...], Responses] = {}
        self._residual: tuple[tuple[tuple[Effect, ...], Values], Array]
        self._residual = ((), ()), self._nominal_residual

    @cached_property
    def space(self) -> Space:
        """Tolerances about the nominal plant."""
        return Space(self.evidence, self.plant)

    @cached_property
    def nominal_fit(self) -> Fit:
        """Fit without effects: the nominal plant."""
        return Fit((), (), self.space.misfit(self._nominal_residual), (), self.plant)

    def starts(self, effect: Effect) -> Starts:
        """Return the values from which a search for an effect starts."""
        return self._starts.nominal(effect)

    def scale_start(self, effect: Effect, start: tuple[float, ...], share: float) -> Values:
        """Scale the magnitude of a start about its nominal value, see `EffectStarts.scale`."""
        return self._starts.scale(effect, start, share)

    def screen(self, effect: Effect) -> Screened:
        """Simulate one effect at every value from which a search for it starts.

        Parameters
        ----------
        effect
            Candidate effect.

        Returns
        -------
        Screened
            Starts of the effect, and its promise.
        """
        starts = self.starts(effect)
        if not is_possible((effect,), self.plant):
            # Without dry friction at its guide the effect has no response at any size.
            self._responses[effect] = [
                (values, np.zeros_like(self._nominal_residual, np.float32))
                for values in starts.values
            ]
            return Screened(effect, ((self.nominal_fit.misfit, starts.values[0]),), 0.0)
        scored: list[tuple[float, tuple[float, ...]]] = []
        responses = []
        for start in starts.values:
            residual = self.evidence.residual(with_values(self.plant, (effect,), (start,)))
            scored.append((self.space.misfit(residual), start))
            # Single precision halves the memory of some hundred responses, and suffices to choose.
            responses.append((start, (self._nominal_residual - residual).astype(np.float32)))
        self._responses[effect] = responses
        if starts.quadrature:
            scored += self._blend(effect, responses)
        elif starts.is_linear:
            scored += self._combine(effect, responses)
        # Tuples sort by misfit and then by values, so equal misfits have a reproducible order.
        scored.sort()
        promise = max(self.nominal_fit.misfit - scored[0][0], self._promise(effect, responses))
        return Screened(effect, tuple(scored), promise)

    def _promise(self, effect: Effect, responses: Responses) -> float:
        """Return the chi-square that the best strength of any response explains.

        A further small magnitude is simulated, since its response may differ from those of large
        ones.
        """
        # Tuples compare by their first element, the magnitude: this is the lowest start, which may
        # be the most negative one. Scaled by `SMALL_START` it is small either way.
        small = self.scale_start(effect, min(start for start, _ in responses), SMALL_START)
        residual = self.evidence.residual(with_values(self.plant, (effect,), small))
        shapes = [response for _, response in responses] + [self._nominal_residual - residual]
        # An effect that replaces a tolerance must not be judged beside that tolerance.
        space = self.space.without_replaced((effect,))
        power, along = space.strengths(
            np.stack(shapes, axis=1).astype(np.float64), self._nominal_residual
        )
        observable = power > NO_RESPONSE
        explained = float(np.max(along[observable] ** 2 / power[observable], initial=0.0))
        # Fixing the tolerance that the effect replaces raises the misfit without it. The effect has
        # to make up for that before it explains anything.
        return explained - (space.misfit(self._nominal_residual) - self.nominal_fit.misfit)

    def fit_one(self, screened: Screened) -> Fit:
        """Fit one effect.

        Parameters
        ----------
        screened
            Screened effect.

        Returns
        -------
        Fit
            Best fit over the refined starts.
        """
        # Several starts are refined where they come near the best one, as the misfit may have more
        # than one minimum. If none improves on the nominal plant, only the best is refined.
        scored = screened.starts
        enough = scored[0][0] + START_SHORTFALL * max(self.nominal_fit.misfit - scored[0][0], 0.0)
        refined = [
            start
            for number, (misfit, start) in enumerate(scored[:REFINED_STARTS])
            if number == 0 or misfit < enough
        ]
        return min(
            (self.refine((screened.effect,), (start,)) for start in refined),
            key=lambda fit: fit.misfit,
        )

    def _blend(self, effect: Effect, responses: Responses) -> list[tuple[float, tuple[float, ...]]]:
        """Return the blends of a wave's sine and cosine that explain most, with their misfits."""
        blends = blend_waves(self.space, responses, self._nominal_residual)
        ranked = sorted(((gain, start) for gain, start, _ in blends), reverse=True)
        return [
            (
                self.space.misfit(
                    self.evidence.residual(with_values(self.plant, (effect,), (start,)))
                ),
                start,
            )
            for _, start in ranked[:REFINED_STARTS]
        ]

    def _combine(
        self, effect: Effect, responses: Responses
    ) -> list[tuple[float, tuple[float, ...]]]:
        """Return the linear combination of all starts that explains most, with its misfit."""
        remainder = self.space.subtract_tolerances(self._nominal_residual)
        columns = np.stack([response for _, response in responses], axis=1).astype(np.float64)
        shapes = self.space.project_out(columns)
        strengths = np.linalg.lstsq(shapes, remainder, rcond=None)[0]
        count, nominal = effect.kind.magnitudes, tuple(effect.nominal(self.plant).values())
        starts = np.array([start[:count] for start, _ in responses])
        # The law is linear in its magnitudes, so the same combination of starts has the combined
        # response.
        combined = np.array(nominal[:count]) + strengths @ (starts - np.array(nominal[:count]))
        start = (*combined.tolist(), *responses[0][0][count:])
        residual = self.evidence.residual(with_values(self.plant, (effect,), (start,)))
        return [(self.space.misfit(residual), start)]

    def largest_response(self, effect: Effect) -> float:
        """Return the largest response of a screened effect that the tolerances cannot absorb.

        Parameters
        ----------
        effect
            Screened effect.

        Returns
        -------
        float
            Chi-square.
        """
        return max(
            self.space.misfit(response.astype(np.float64))
            for _, response in self._responses[effect]
        )

    def responses_beside(self, effect: Effect, first: Fit) -> Responses:
        """Return the responses of an effect beside those of a fit.

        Parameters
        ----------
        effect
            Screened effect.
        first
            Fit of other effects.

        Returns
        -------
        list of tuples
            Values of the effect, and the whitened response to each beside `first`.
        """
        if not first.effects:
            return self._responses[effect]
        # The response to a wave along the stroke depends little on the other effects, so that one
        # fit's responses serve for all.
        wave = self.starts(effect).quadrature
        key = (effect, len(first.effects) > 0) if wave else (effect, first.effects, first.values)
        responses = self._beside.get(key)
        if responses is None:
            responses = []
            without = self.residual_at(first)
            for start in self._starts.few(effect, first.plant):
                with_effect = self.evidence.residual(with_values(first.plant, (effect,), (start,)))
                responses.append((start, (without - with_effect).astype(np.float32)))
            # A new dictionary replaces the old one in a single assignment: threads that read the
            # cache meanwhile never see it change under them.
            latest = list(self._beside.items())[-CACHED_RESPONSES:]
            self._beside = {**dict(latest), key: responses}
        return responses

    def residual_at(self, fit: Fit) -> Array:
        """Return the whitened residual of a fit. The latest one is cached."""
        key, residual = self._residual
        if key != (fit.effects, fit.values):
            key, residual = (fit.effects, fit.values), self.evidence.residual(fit.plant)
            # Key and residual are stored as one tuple, so that no thread sees an unmatched pair.
            self._residual = key, residual
        return residual

    def bounds(self, effects: Sequence[Effect]) -> tuple[Array, Array]:
        """Return the range in which the values of effects are searched.

        Parameters
        ----------
        effects
            Effects that are fitted together.

        Returns
        -------
        tuple of arrays
            Lowest and highest values, shape (parameters,) each: the bounds of the parameters'
            quantities, narrowed to what the recordings can show.
        """
        low: list[float] = []
        high: list[float] = []
        for effect in effects:
            allowed = [(quantity.low, quantity.high) for quantity in effect.quantities().values()]
            # Some starts narrow the bounds to what the recording can show, such as a pitch within
            # the stroke.
            observable = self.starts(effect).bounds or allowed
            low += [max(a[0], b[0]) for a, b in zip(allowed, observable, strict=True)]
            high += [min(a[1], b[1]) for a, b in zip(allowed, observable, strict=True)]
        return np.array(low), np.array(high)

    def is_bounded(self, fit: Fit) -> bool:
        """Return whether a fit is held by a bound and not by the data.

        A value at the end of its range counts, unless that end is 0, where the effect is absent.
        So does a guide whose fitted friction would drive the motion.
        """
        guides = {effect.group for effect in fit.effects if effect.of is Guide}
        if not all(resists(component_of(fit.plant, name, Guide)) for name in guides):
            return True
        low, high = self.bounds(fit.effects)
        values = np.concatenate([np.asarray(numbers) for numbers in fit.values])
        return bool(
            any(
                np.any((end != 0.0) & (np.abs(values - end) <= BOUND_SHARE * np.abs(end)))
                for end in (low, high)
            )
        )

    def refine(
        self,
        effects: tuple[Effect, ...],
        start: Sequence[Sequence[float]],
        space: Space | None = None,
        base: Plant | None = None,
    ) -> Fit:
        """Fit effects by Gauss-Newton from one start.

        Parameters
        ----------
        effects
            Effects that are fitted together.
        start
            Starting values of each effect.
        space
            Tolerances that are free beside the effects. Defaults to those about the nominal plant.
        base
            Plant without the effects. Defaults to the nominal plant.

        Returns
        -------
        Fit
            Fit from which no further step gains enough.
        """
        space, base = space or self.space, base or self.plant
        if not effects:
            return Fit((), (), space.misfit(self.evidence.residual(base)), (), self.plant)
        steps = np.concatenate([self.starts(effect).steps for effect in effects])

        def residual(vector: Array) -> Array:
            return self.evidence.residual(with_values(base, effects, split_values(effects, vector)))

        # The plant of the result is the nominal one with the effects, even where `base` has its
        # tolerances moved: a finding is about effects alone.
        minimum = minimise(
            residual,
            space,
            np.concatenate([np.asarray(values, float) for values in start]),
            steps,
            self.bounds(effects),
            self.evidence.expected,
        )
        values = split_values(effects, minimum.values)
        return Fit(
            effects,
            values,
            minimum.misfit,
            split_values(effects, minimum.widths),
            with_values(self.plant, effects, values),
        )
