"""Fits effects to evidence: Gauss-Newton on their parameters, all tolerances free within their
prior beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from rigtwin.components import Effect, Guide, Scales, Starts
from rigtwin.components.effect import Swing
from rigtwin.components.guide import resists
from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import JUMPS, Evidence
from rigtwin.diagnosis.fit import Fit, Values, is_possible, with_values
from rigtwin.diagnosis.gauss_newton import is_sufficient, minimise
from rigtwin.diagnosis.space import Space
from rigtwin.diagnosis.swing import swings
from rigtwin.numerics.arrays import Array

SHAKES = (0.88, 0.95, 1.05, 1.12)
"""Shares of a value at which a fit is tried to be better yet."""
SETTLING = 2
"""Times that the tolerances are taken anew at a fit."""
UNMOVED = 0.05
"""Half widths by which no tolerance may have moved for it not to be taken anew."""
AT_BOUND = 1e-3
"""Share of a bound within which a value stands at it."""
REFINED = 3
"""Starts that are followed to their end at most."""
WORTH = 0.5
"""Share of the best start's gain that another may lack and still be followed."""
LIMITS = ("saturation", "rate_limit", "resonance", "force_limit")
"""Kinds whose magnitude is no measure of what they do."""
KEPT = 64
"""Responses beside a fit that are kept."""
SMALL = 0.05
"""Share of the smallest start at which an effect is tried too."""
SUFFICIENT = 0.95
"""Share of what noise and declared error leave below which no better fit is looked for nearby."""
SMALLER = 0.2
"""Share of the smallest start at which an effect is tried beside others as well."""
NOTHING = 1e-3
"""χ² below which an effect does nothing at all."""
Responses = list[tuple[tuple[float, ...], Array]]
"""Of an effect: values that were tried, and what each changes, whitened."""


@dataclass(frozen=True)
class Screened:
    """An effect before it is fitted. starts: misfit and values of all that were tried, the best
    first; promise: χ² that it may explain, to first order."""

    effect: Effect
    starts: tuple[tuple[float, tuple[float, ...]], ...]
    promise: float


class Fitter:
    """Fits any effects to one body of evidence."""

    def __init__(self, evidence: Evidence) -> None:
        self.evidence, self.plant = evidence, evidence.plant
        self.swing = swings(evidence.machine, evidence.recordings)
        self._scales: dict[str, Scales] = {}
        self._nominal = evidence.residual(evidence.plant)
        self._responses: dict[Effect, Responses] = {}
        self._beside: dict[tuple[object, ...], Responses] = {}
        self._residual: tuple[tuple[tuple[Effect, ...], Values], Array] = ((), ()), self._nominal

    @cached_property
    def space(self) -> Space:
        """The tolerances about the nominal plant."""
        return Space(self.evidence, self.plant)

    @cached_property
    def nothing(self) -> Fit:
        """The nominal plant."""
        return Fit((), (), self.space.misfit(self._nominal), (), self.plant)

    def starts(self, effect: Effect) -> Starts:
        """Where a search for an effect starts."""
        return self._starts_at(effect, self.plant)

    def _starts_at(self, effect: Effect, plant: Plant) -> Starts:
        own = self.swing.get(effect.component, Swing())
        return effect.starts(plant, own, lambda: self._scale(effect.group))

    def _scale(self, component: str) -> Scales:
        """What a component goes through on these recordings, by the nominal plant and by what is
        measured of the force."""
        if component not in self._scales:
            longest = max(
                range(len(self.evidence.models)), key=lambda n: self.evidence.recordings[n].ticks
            )
            measured = self.evidence.lines[longest].measured
            forces = [
                measured[n] for n, row in enumerate(self.evidence.machine.rows) if row.kind in JUMPS
            ]
            force = max((float(np.sqrt(np.mean(each**2))) for each in forces), default=0.0)
            motion = self.evidence.models[longest].motion(component, self.plant)
            self._scales[component] = Scales.of(motion, force, self.evidence.lines[longest].period)
        return self._scales[component]

    def _few_starts(self, effect: Effect, plant: Plant) -> list[tuple[float, ...]]:
        """A small and a middle magnitude of each shape and sign: responses scale with their
        magnitude, but those of small ones need not resemble those of large ones."""
        starts = self._starts_at(effect, plant)
        nominal = effect.nominal(plant)[effect.kind.parameters[0]]
        shapes: dict[tuple[float, ...], list[tuple[float, ...]]] = {}
        for values in starts.values:
            sign = 1.0 if values[0] >= nominal else -1.0
            shapes.setdefault((sign, *values[1:]), []).append(values)
        found = []
        for values in shapes.values():
            values.sort(key=lambda each: abs(each[0] - nominal))
            found.append(values[len(values) // 2])
            if effect.kind.name not in LIMITS and not starts.quadrature:
                small = nominal + SMALLER * (values[0][0] - nominal)
                found.append((small, *values[0][1:]))
        return found

    def screen(self, effect: Effect) -> Screened:
        """What one effect does at every value that a search for it starts from.

        Parameters
        ----------
        effect
            One that is searched for.

        Returns
        -------
        Screened
            Its starts, and what it promises to explain.
        """
        found = self.starts(effect)
        if not is_possible((effect,), self.plant):
            self._responses[effect] = [
                (values, np.zeros_like(self._nominal, np.float32)) for values in found.values
            ]
            return Screened(effect, ((self.nothing.misfit, found.values[0]),), 0.0)
        scored: list[tuple[float, tuple[float, ...]]] = []
        responses = []
        for start in found.values:
            residual = self.evidence.residual(with_values(self.plant, (effect,), (start,)))
            scored.append((self.space.misfit(residual), start))
            responses.append((start, (self._nominal - residual).astype(np.float32)))
        self._responses[effect] = responses
        if found.quadrature:
            scored += self._blend(effect, responses)
        scored.sort()
        promise = max(self.nothing.misfit - scored[0][0], self._promise(effect, responses))
        return Screened(effect, tuple(scored), promise)

    def _promise(self, effect: Effect, responses: Responses) -> float:
        """χ² that the best strength of any response explains, or of a small one, which large ones
        need not resemble."""
        small = self.scale_start(effect, min(start for start, _ in responses), SMALL)
        residual = self.evidence.residual(with_values(self.plant, (effect,), small))
        shapes = [response for _, response in responses] + [self._nominal - residual]
        # An effect that takes a tolerance's place is not what that tolerance may take up.
        space = self.space.beside((effect,))
        power, along = space.strengths(np.stack(shapes, axis=1).astype(np.float64), self._nominal)
        felt = power > NOTHING
        explained = float(np.max(along[felt] ** 2 / power[felt], initial=0.0))
        return explained - (space.misfit(self._nominal) - self.nothing.misfit)

    def fit_one(self, screened: Screened) -> Fit:
        """The best fit of one effect.

        Parameters
        ----------
        screened
            What was tried of it.

        Returns
        -------
        Fit
            From the best of its starts.
        """
        # Another start is followed too where it comes near the best; where none helps, the best is
        # followed alone.
        scored = screened.starts
        enough = scored[0][0] + WORTH * max(self.nothing.misfit - scored[0][0], 0.0)
        followed = [
            start
            for number, (misfit, start) in enumerate(scored[:REFINED])
            if number == 0 or misfit < enough
        ]
        return min(
            (self.refine((screened.effect,), (start,)) for start in followed),
            key=lambda fit: fit.misfit,
        )

    def _blend(self, effect: Effect, responses: Responses) -> list[tuple[float, tuple[float, ...]]]:
        """The blends of neighbouring quadratures that promise most, with their misfits."""
        left = self.space.subtract_tolerances(self._nominal)
        blends = []
        for (start, one), (_, other) in zip(responses[::2], responses[1::2], strict=True):
            apart = self.space.project_out(np.stack([one, other], axis=1).astype(np.float64))
            strengths = np.linalg.lstsq(apart, left, rcond=None)[0]
            gain = float(np.sum((apart @ strengths) ** 2))
            amplitude = start[0] * float(np.hypot(*strengths))
            blends.append(
                (gain, (amplitude, start[1], float(np.arctan2(strengths[1], strengths[0]))))
            )
        blends.sort(reverse=True)
        return [
            (
                self.space.misfit(
                    self.evidence.residual(with_values(self.plant, (effect,), (start,)))
                ),
                start,
            )
            for _, start in blends[:REFINED]
        ]

    def largest_response(self, effect: Effect) -> float:
        """χ² of the most that any size tried of an effect changes, beyond what tolerances take up.

        Parameters
        ----------
        effect
            One that was fitted alone before.

        Returns
        -------
        float
            χ².
        """
        return max(
            self.space.misfit(response.astype(np.float64))
            for _, response in self._responses[effect]
        )

    def responses_beside(self, effect: Effect, first: Fit) -> Responses:
        """What an effect changes, for every value that a search for it starts from.

        Parameters
        ----------
        effect
            One that was fitted alone before.
        first
            A fit of others.

        Returns
        -------
        list of tuples
            Values, and the response beside `first`.
        """
        if not first.effects:
            return self._responses[effect]
        # A wave along the stroke changes much the same whatever else is there.
        wave = self.starts(effect).quadrature
        known = (effect, len(first.effects) > 0) if wave else (effect, first.effects, first.values)
        found = self._beside.get(known)
        if found is None:
            found = []
            here = self.residual_at(first)
            for start in self._few_starts(effect, first.plant):
                there = self.evidence.residual(with_values(first.plant, (effect,), (start,)))
                found.append((start, (here - there).astype(np.float32)))
            self._beside = {**dict(list(self._beside.items())[-KEPT:]), known: found}
        return found

    def residual_at(self, fit: Fit) -> Array:
        """The residual of a fit; that of the last one asked for is kept."""
        known, residual = self._residual
        if known != (fit.effects, fit.values):
            known, residual = (fit.effects, fit.values), self.evidence.residual(fit.plant)
            self._residual = known, residual
        return residual

    def scale_start(self, effect: Effect, start: tuple[float, ...], share: float) -> Values:
        """A start with that share of its magnitude; limits, which nothing can be scaled from, as
        they are. As the values of that one effect."""
        nominal = effect.nominal(self.plant)[effect.kind.parameters[0]]
        if effect.kind.name in LIMITS:
            return (start,)
        return ((nominal + share * (start[0] - nominal), *start[1:]),)

    def refit_with_tolerances(self, fit: Fit) -> Fit:
        """The fit again with the tolerances taken at it, and the mechanical ones used in the plant
        itself.

        Parameters
        ----------
        fit
            To start from.

        Returns
        -------
        Fit
            Of the same effects.
        """
        tolerances = self.evidence.machine.tolerances
        mechanical = np.array([tolerance.mechanical for tolerance in tolerances], bool)
        # A first guess of how much of them is used does not depend on where it is made.
        space = self.space.beside(fit.effects)
        used = np.zeros(len(tolerances))
        residual = self.evidence.residual(fit.plant)
        for number in range(SETTLING):
            found = np.where(mechanical, space.estimate_tolerances(residual), 0.0)
            if number and np.max(np.abs(found - used), initial=0.0) < UNMOVED:
                break
            used = found
            base = self.evidence.shift(self.plant, used.tolist())
            space = Space(
                self.evidence, with_values(base, fit.effects, fit.values), used, fit.effects
            )
            fit = self._perturb(self.refine(fit.effects, fit.values, space, base), space, base)
            residual = self.evidence.residual(with_values(base, fit.effects, fit.values))
            fit = replace(fit, base=base, used=tuple(used.tolist()))
        return fit

    def _perturb(self, fit: Fit, space: Space, base: Plant) -> Fit:
        """The fit, or a better one a little further away: where a stick begins or is missed, the
        misfit has a step, and Gauss-Newton does not climb it."""
        if is_sufficient(fit.misfit, self.evidence.expected, SUFFICIENT):
            return fit
        for number, effect in enumerate(fit.effects):
            for place, share in product(range(len(effect.kind.parameters)), SHAKES):
                own = list(fit.values[number])
                # A magnitude is off nominal by another share; what else there is, is another.
                about = place > 0 or effect.kind.name in LIMITS
                nominal = 0.0 if about else effect.nominal(self.plant)[effect.kind.parameters[0]]
                own[place] = nominal + share * (own[place] - nominal)
                values = (*fit.values[:number], tuple(own), *fit.values[number + 1 :])
                if (
                    space.misfit(self.evidence.residual(with_values(base, fit.effects, values)))
                    < fit.misfit
                ):
                    fit = min(
                        fit,
                        self.refine(fit.effects, values, space, base),
                        key=lambda each: each.misfit,
                    )
        return fit

    def bounds(self, effects: Sequence[Effect]) -> tuple[Array, Array]:
        """Between which the values of effects are searched, shape (parameters,) each: their own
        bounds, or narrower ones by what the recordings can show."""
        low: list[float] = []
        high: list[float] = []
        for effect in effects:
            own = [(quantity.low, quantity.high) for quantity in effect.quantities().values()]
            narrower = self.starts(effect).bounds or own
            low += [max(one[0], two[0]) for one, two in zip(own, narrower, strict=True)]
            high += [min(one[1], two[1]) for one, two in zip(own, narrower, strict=True)]
        return np.array(low), np.array(high)

    def is_bounded(self, fit: Fit) -> bool:
        """Whether a value stands at the end of the range that it is searched in, or a guide's
        friction would push. 0 is no end: what is not there is not there."""
        guides = {effect.group for effect in fit.effects if effect.of is Guide}
        if not all(resists(getattr(fit.plant, name)) for name in guides):
            return True
        low, high = self.bounds(fit.effects)
        values = np.concatenate([np.asarray(each) for each in fit.values])
        return bool(
            any(
                np.any((end != 0.0) & (np.abs(values - end) <= AT_BOUND * np.abs(end)))
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
        """Gauss-Newton with halved steps.

        Parameters
        ----------
        effects
            That are fitted together.
        start
            Values to start from, one tuple an effect.
        space
            The tolerances, by default those about the nominal plant.
        base
            The plant without the effects, by default the nominal one.

        Returns
        -------
        Fit
            Where no step gains any more.
        """
        space, base = space or self.space, base or self.plant
        if not effects:
            return Fit((), (), space.misfit(self.evidence.residual(base)), (), self.plant)
        sizes = [len(effect.kind.parameters) for effect in effects]
        steps = np.concatenate([self.starts(effect).steps for effect in effects])

        def split(vector: Array) -> Values:
            cuts = np.cumsum(sizes)[:-1]
            return tuple(tuple(part.tolist()) for part in np.split(vector, cuts))

        def residual(vector: Array) -> Array:
            return self.evidence.residual(with_values(base, effects, split(vector)))

        found = minimise(
            residual,
            space,
            np.concatenate([np.asarray(values, float) for values in start]),
            steps,
            self.bounds(effects),
            self.evidence.expected,
        )
        values = split(found.values)
        return Fit(
            effects,
            values,
            found.misfit,
            split(found.widths),
            with_values(self.plant, effects, values),
        )
