"""Fits effects to evidence: Gauss-Newton on their parameters, all tolerances free within their
prior beside them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigtwin.components import Effect, Guide, Scales, Starts
from rigtwin.components.effect import Swing
from rigtwin.components.guide import THROUGH_FRICTION
from rigtwin.components.plant import P, Plant, with_parameters
from rigtwin.diagnosis.evidence import JUMPS, Evidence
from rigtwin.diagnosis.swing import swings
from rigtwin.numerics.arrays import Array

PRIOR = 1.0
"""χ² that a tolerance costs at its half width."""
BEYOND = 1.2
"""Half widths that no tolerance exceeds: what is more is a finding."""
SHAKES = (0.88, 0.95, 1.05, 1.12)
"""Shares of a magnitude at which a fit is tried to be better yet."""
SETTLING = 2
"""Times that the tolerances are taken anew at a fit."""
ITERATIONS = 8
REFINED = 3
"""Starts that are followed to their end at most."""
WORTH = 0.5
"""Share of the best start's gain that another may lack and still be followed."""
LOOKALIKES, RESEMBLES = 3, 0.6
"""Effects that are tried in another's place at most, if they can explain this share of what it
does."""
LIMITS = ("saturation", "rate_limit", "resonance")
"""Kinds whose magnitude is no measure of what they do."""
NOTHING = 1e-3
"""χ² below which an effect does nothing at all."""
Values = tuple[tuple[float, ...], ...]
"""Of effects, one tuple each, in the order of its parameters."""


@dataclass(frozen=True)
class Fit:
    """Effects with the values that explain the evidence best. misfit: χ² with tolerances and their
    prior; widths: standard deviation of each value; plant: with them."""

    effects: tuple[Effect, ...]
    values: Values
    misfit: float
    widths: Values
    plant: Plant = field(repr=False)

    @property
    def name(self) -> str:
        return " + ".join(effect.name for effect in self.effects) or "none"


def with_values(plant: P, effects: Sequence[Effect], values: Sequence[Sequence[float]]) -> P:
    """The plant with effects of these values.

    Parameters
    ----------
    plant
        Without them.
    effects
        Any that do not clash.
    values
        One tuple an effect, in the order of its parameters.

    Returns
    -------
    plant
        Of the same type.
    """
    for effect, numbers in zip(effects, values, strict=True):
        changes = dict(zip(effect.kind.parameters, numbers, strict=True))
        plant = with_parameters(plant, effect.group, changes)
    return plant


def clashes(effect: Effect, others: Sequence[Effect]) -> bool:
    """Whether an effect sets a parameter that another sets too.

    Parameters
    ----------
    effect
        The one.
    others
        The others.

    Returns
    -------
    bool
        True if they cannot stand together.
    """
    own = set(effect.kind.parameters)
    return any(other.group == effect.group and own & set(other.kind.parameters) for other in others)


def is_possible(effects: Sequence[Effect], plant: Plant) -> bool:
    """Whether each effect has what it acts through.

    Parameters
    ----------
    effects
        Of one explanation.
    plant
        Without them.

    Returns
    -------
    bool
        False if a guide's play, spring or Stribeck peak has no dry friction to act through.
    """
    dry = {effect.group for effect in effects if effect.kind.name == "coulomb"}
    return all(
        effect.of is not Guide
        or effect.kind.name not in THROUGH_FRICTION
        or effect.group in dry
        or getattr(plant, effect.group).coulomb > 0.0
        for effect in effects
    )


def without_each(fit: Fit) -> Iterator[tuple[Effect, tuple[Effect, ...], Values]]:
    """Leaves out each effect of a fit in turn.

    Parameters
    ----------
    fit
        Of one effect or more.

    Yields
    ------
    tuple
        The effect left out, the others, and their values.
    """
    for number, effect in enumerate(fit.effects):
        yield (
            effect,
            (*fit.effects[:number], *fit.effects[number + 1 :]),
            (*fit.values[:number], *fit.values[number + 1 :]),
        )


class Space:
    """The tolerances about one plant: what they can take up of a residual at what price, none
    beyond its bound."""

    def __init__(
        self,
        evidence: Evidence,
        plant: Plant,
        used: Array | None = None,
        effects: Sequence[Effect] = (),
    ) -> None:
        """used: by how many half widths the plant already uses each tolerance. An effect's own
        parameters have none."""
        self._columns = evidence.tolerance_responses(plant)
        machine = evidence.machine
        own = [
            machine.tolerance_of(effect.group, parameter)
            for effect in effects
            for parameter in effect.kind.parameters
        ]
        # With a delay to be found, when samples were taken is no question of its own any more.
        timed = any("delay" in effect.kind.parameters for effect in effects)
        fixed = [
            tolerance in own or (timed and tolerance.ticks) for tolerance in machine.tolerances
        ]
        self._columns[:, fixed] = 0.0
        self._used = np.zeros(len(machine.tolerances)) if used is None else used
        self._taken = self._columns @ self._used
        self._normal = self._columns.T @ self._columns + PRIOR * np.eye(self._columns.shape[1])

    def estimate_tolerances(self, residual: Array) -> Array:
        """The tolerances that take up most of a residual, in half widths."""
        wanted = self._columns.T @ (residual + self._taken)
        found = np.zeros(len(wanted))
        free = np.ones(len(wanted), bool)
        for _ in range(len(wanted)):
            right = wanted[free] - self._normal[np.ix_(free, ~free)] @ found[~free]
            found[free] = np.linalg.solve(self._normal[np.ix_(free, free)], right)
            beyond = free & (np.abs(found) > BEYOND)
            if not beyond.any():
                break
            found[beyond] = np.sign(found[beyond]) * BEYOND
            free &= ~beyond
        return found

    def subtract_tolerances(self, residual: Array) -> Array:
        """The residual less what the tolerances take up."""
        return residual + self._columns @ (self._used - self.estimate_tolerances(residual))

    def project_out(self, responses: Array) -> Array:
        """Responses, shape (size, count), less what tolerances without bounds take up."""
        return responses - self._columns @ np.linalg.solve(
            self._normal, self._columns.T @ responses
        )

    def misfit(self, residual: Array) -> float:
        """min over tolerances of |residual − what they do|² + their prior."""
        found = self.estimate_tolerances(residual)
        left = residual + self._columns @ (self._used - found)
        return float(left @ left + PRIOR * found @ found)

    def normal_equations(self, jacobian: Array, residual: Array) -> tuple[Array, Array]:
        """Normal matrix and gradient of the misfit in parameters whose responses are the jacobian's
        columns, with all tolerances that are not at their bound free beside them."""
        found = self.estimate_tolerances(residual)
        free = np.abs(found) < BEYOND
        columns = self._columns[:, free]
        shared = columns.T @ jacobian
        normal = jacobian.T @ jacobian - shared.T @ np.linalg.solve(
            self._normal[np.ix_(free, free)], shared
        )
        return normal, jacobian.T @ (residual + self._columns @ (self._used - found))


@dataclass(frozen=True)
class Proposal:
    """Effects worth a fit. promised: the misfit that a linear estimate gives them; values: to start
    from; space: tolerances."""

    promised: float
    effects: tuple[Effect, ...]
    values: Values
    space: Space = field(repr=False)


class Fitter:
    """Fits any effects to one body of evidence."""

    def __init__(self, evidence: Evidence) -> None:
        self.evidence, self.plant = evidence, evidence.plant
        self.space = Space(evidence, evidence.plant)
        self.swing = swings(evidence.machine, evidence.recordings)
        self._scales: dict[str, Scales] = {}
        self._nominal = evidence.residual(evidence.plant)
        self.nothing = Fit((), (), self.space.misfit(self._nominal), (), evidence.plant)
        self._responses: dict[Effect, list[tuple[tuple[float, ...], Array]]] = {}

    def starts(self, effect: Effect) -> Starts:
        """Where a search for an effect starts."""
        own = self.swing.get(effect.component, Swing())
        return effect.starts(self.plant, own, lambda: self._scale(effect.group))

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
            self._scales[component] = Scales.of(
                motion, force, self.evidence.recordings[longest].period
            )
        return self._scales[component]

    def fit_one(self, effect: Effect) -> Fit:
        """The best fit of one effect.

        Parameters
        ----------
        effect
            One that is searched for.

        Returns
        -------
        Fit
            From the best of its starts.
        """
        if not is_possible((effect,), self.plant):
            start = self.starts(effect).values
            self._responses[effect] = [
                (values, np.zeros_like(self._nominal, np.float32)) for values in start
            ]
            return Fit(
                (effect,), (start[0],), self.nothing.misfit, ((0.0,) * len(start[0]),), self.plant
            )
        scored: list[tuple[float, tuple[float, ...]]] = []
        responses = []
        found = self.starts(effect)
        for start in found.values:
            residual = self.evidence.residual(with_values(self.plant, (effect,), (start,)))
            scored.append((self.space.misfit(residual), start))
            responses.append((start, (self._nominal - residual).astype(np.float32)))
        self._responses[effect] = responses
        if found.quadrature:
            scored += self._blend(effect, responses)
        scored.sort()
        # Another start is followed too where it comes near the best; where none helps, the best is
        # followed alone.
        enough = scored[0][0] + WORTH * max(self.nothing.misfit - scored[0][0], 0.0)
        followed = [
            start
            for number, (misfit, start) in enumerate(scored[:REFINED])
            if number == 0 or misfit < enough
        ]
        return min(
            (self.refine((effect,), (start,)) for start in followed), key=lambda fit: fit.misfit
        )

    def _blend(
        self, effect: Effect, responses: list[tuple[tuple[float, ...], Array]]
    ) -> list[tuple[float, tuple[float, ...]]]:
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

    def _responses_beside(
        self, effect: Effect, first: Fit
    ) -> list[tuple[tuple[float, ...], Array]]:
        """The responses of an effect: at the nominal plant, or beside `first` if it does nothing
        without that, as a play does nothing without friction."""
        if self.largest_response(effect) > NOTHING:
            return self._responses[effect]
        here = self.evidence.residual(first.plant)
        found = []
        for start, _ in self._responses[effect]:
            there = self.evidence.residual(with_values(first.plant, (effect,), (start,)))
            found.append((start, (here - there).astype(np.float32)))
        return found

    def propose_additions(
        self, first: Fit, effects: Sequence[Effect], least: float
    ) -> list[Proposal]:
        """Further effects beside a fit, by how well their responses at the nominal plant, or beside
        it, resemble what it leaves.

        Parameters
        ----------
        first
            The fit.
        effects
            Candidates, all fitted alone before.
        least
            χ² that one must promise to explain.

        Returns
        -------
        list of Proposal
            In the order of the candidates.
        """
        space = Space(self.evidence, first.plant)
        left = space.subtract_tolerances(self.evidence.residual(first.plant))
        found = []
        for effect in effects:
            if clashes(effect, first.effects) or not is_possible(
                (*first.effects, effect), self.plant
            ):
                continue
            starts, responses = zip(*self._responses_beside(effect, first), strict=True)
            apart = space.project_out(np.stack(responses, axis=1).astype(np.float64))
            alike, power = apart.T @ left, np.maximum(np.sum(apart**2, axis=0), 1e-300)
            # A response may be too strong or too weak, but not the other way round.
            share = np.clip(alike / power, 0.0, 3.0)
            gains = 2.0 * share * alike - share**2 * power
            best = int(np.argmax(gains))
            if gains[best] > least:
                promised = first.misfit - float(gains[best])
                start = self._scale_start(effect, starts[best], float(share[best]))
                found.append(
                    Proposal(promised, (*first.effects, effect), (*first.values, start), space)
                )
        return found

    def _scale_start(
        self, effect: Effect, start: tuple[float, ...], share: float
    ) -> tuple[float, ...]:
        """A start with that share of its magnitude; limits, which nothing can be scaled from, as
        they are."""
        nominal = effect.nominal(self.plant)[effect.kind.parameters[0]]
        if effect.kind.name in LIMITS:
            return start
        return (nominal + share * (start[0] - nominal), *start[1:])

    def propose_replacements(
        self, fit: Fit, effects: Sequence[Effect]
    ) -> list[tuple[tuple[Effect, ...], Values]]:
        """The effects of a fit with each in turn replaced by those whose response is most like its
        own: what was found first may only resemble what is there.

        Parameters
        ----------
        fit
            The fit.
        effects
            Candidates, all fitted alone before.

        Returns
        -------
        list of pairs
            Effects, and values to start from.
        """
        found = []
        here = self.evidence.residual(fit.plant)
        for number in range(len(fit.effects)):
            rest = [place for place in range(len(fit.effects)) if place != number]
            plant = with_values(
                self.plant, [fit.effects[p] for p in rest], [fit.values[p] for p in rest]
            )
            own = self.space.project_out((self.evidence.residual(plant) - here)[:, None])[:, 0]
            scored = []
            for other in effects:
                kept = [fit.effects[place] for place in rest]
                if (
                    other in fit.effects
                    or clashes(other, kept)
                    or not is_possible((*kept, other), self.plant)
                ):
                    continue
                starts, responses = zip(*self._responses[other], strict=True)
                apart = self.space.project_out(np.stack(responses, axis=1).astype(np.float64))
                along, power = apart.T @ own, np.maximum(np.sum(apart**2, axis=0), 1e-300)
                resemblance = np.maximum(along, 0.0) ** 2 / power
                best = int(np.argmax(resemblance))
                share = min(float(along[best] / power[best]), 3.0)
                scored.append(
                    (
                        float(resemblance[best]),
                        number,
                        other,
                        self._scale_start(other, starts[best], share),
                    )
                )
            scored.sort(key=lambda item: -item[0])
            for gain, place, other, start in scored[:LOOKALIKES]:
                if gain > RESEMBLES * float(own @ own):
                    changed, values = list(fit.effects), list(fit.values)
                    changed[place], values[place] = other, start
                    found.append((tuple(changed), tuple(values)))
        return found

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
        used = np.zeros(len(tolerances))
        space = Space(self.evidence, fit.plant, used, fit.effects)
        residual = self.evidence.residual(fit.plant)
        for _ in range(SETTLING):
            found = space.estimate_tolerances(residual)
            used = np.array(
                [share if t.mechanical else 0.0 for t, share in zip(tolerances, found, strict=True)]
            )
            base = self.evidence.shift(self.plant, used.tolist())
            space = Space(
                self.evidence, with_values(base, fit.effects, fit.values), used, fit.effects
            )
            fit = self._perturb(self.refine(fit.effects, fit.values, space, base), space, base)
            residual = self.evidence.residual(with_values(base, fit.effects, fit.values))
        return fit

    def _perturb(self, fit: Fit, space: Space, base: Plant) -> Fit:
        """The fit, or a better one a little further away: where a stick begins or is missed, the
        misfit has a step, and Gauss-Newton does not climb it."""
        for number, effect in enumerate(fit.effects):
            nominal = effect.nominal(self.plant)[effect.kind.parameters[0]]
            if effect.kind.name in LIMITS:
                nominal = 0.0
            for share in SHAKES:
                magnitude = nominal + share * (fit.values[number][0] - nominal)
                values = (
                    *fit.values[:number],
                    (magnitude, *fit.values[number][1:]),
                    *fit.values[number + 1 :],
                )
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
        quantities = [quantity for effect in effects for quantity in effect.quantities().values()]
        low, high = np.array([q.low for q in quantities]), np.array([q.high for q in quantities])
        narrower = [self.starts(effect).bounds for effect in effects]
        cuts = np.concatenate([[0], np.cumsum(sizes)])
        for number, bounds in enumerate(narrower):
            if bounds is not None:
                own = slice(cuts[number], cuts[number + 1])
                low[own] = np.maximum(low[own], [pair[0] for pair in bounds])
                high[own] = np.minimum(high[own], [pair[1] for pair in bounds])

        def split(vector: Array) -> Values:
            cuts = np.cumsum(sizes)[:-1]
            return tuple(tuple(part.tolist()) for part in np.split(vector, cuts))

        def residual(vector: Array) -> Array:
            return self.evidence.residual(with_values(base, effects, split(vector)))

        here = np.clip(np.concatenate([np.asarray(values, float) for values in start]), low, high)
        left = residual(here)
        misfit = space.misfit(left)
        normal = np.eye(len(here))
        for _ in range(ITERATIONS):
            columns = []
            for number in range(len(here)):
                step = (
                    steps[number]
                    if here[number] + steps[number] <= high[number]
                    else -steps[number]
                )
                beside = here.copy()
                beside[number] += step
                columns.append((residual(beside) - left) / (step / steps[number]))
            jacobian = np.stack(columns, axis=1)
            normal, gradient = space.normal_equations(jacobian, left)
            damped = normal + np.diag(1e-6 * np.diag(normal) + 1e-12)
            move = -np.linalg.solve(damped, gradient) * steps
            gained = 0.0
            for share in (1.0, 0.5, 0.2, 0.05):
                there = np.clip(here + share * move, low, high)
                tried = residual(there)
                if (value := space.misfit(tried)) < misfit:
                    gained = misfit - value
                    here, left, misfit = there, tried, value
                    break
            if gained < 0.2:
                break
        spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(normal)), 0.0)) * steps
        return Fit(
            effects,
            split(here),
            misfit,
            split(spread),
            with_values(self.plant, effects, split(here)),
        )
