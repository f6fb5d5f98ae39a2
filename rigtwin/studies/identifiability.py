"""Structural identifiability: the effects a machine's sensors can reveal, before any data exist.

The machine's model is simulated under synthetic rich motions, with one effect after another. An
effect that changes no recorded signal is unobservable. An effect whose changes equal a combination
of other effects' changes, in all motions at once, is confounded with them: only their sum is known.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from rigtwin.components import Effect
from rigtwin.components.effect import Starts
from rigtwin.components.plant import Plant
from rigtwin.components.scales import Scales, Swing
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.fit import is_possible, with_values
from rigtwin.diagnosis.swing import swings
from rigtwin.models.model import Model
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest

NO_CHANGE = 1e-7
"""RMS of a change, relative to the signals' own RMS, below which an effect is unobservable."""
UNEXPLAINED = 0.01
"""Share of an effect's change that a combination of other effects may leave unexplained while the
effect still counts as confounded with them."""
NEAR = 0.1
"""Same share for the linearised change; a combination below it is tested at full size."""
TOGETHER = 3
"""Maximum number of effects in a confounded combination."""
BASIC = ("coulomb", "viscous")
"""Kinds of effect that other kinds refine."""
FORCELESS = 1e-9
"""RMS of predicted forces, in N, below which a machine counts as free of forces."""
RANK = 1e-10
"""Relative singular value below which a direction of a set of changes is rounding error."""
EVALUATIONS = 12
"""Maximum number of evaluations when effects are fitted to another effect's change."""
STEPS = 4
"""Number of integration steps per tick."""


@dataclass(frozen=True)
class Identifiability:
    """Observable, unobservable and confounded effects of a machine.

    Parameters
    ----------
    seen : tuple of str
        Effects that can be told from all others.
    unseen : tuple of str
        Effects that change no recorded signal.
    confounded : mapping
        Effect → effects that together produce the same change.
    motions : tuple of str
        Synthetic motions used. Empty if the description does not limit the machine's motion.
    sums : tuple of mappings
        Base parameters of bodies and rotors whose joints act on each other: parameter →
        coefficient (see `find_base_parameters`). They do not depend on the range of motion.
    untried : tuple of str
        Effects for which the allowed time did not suffice.
    """

    seen: tuple[str, ...]
    unseen: tuple[str, ...]
    confounded: Mapping[str, tuple[str, ...]]
    motions: tuple[str, ...]
    sums: tuple[Mapping[str, float], ...] = ()
    untried: tuple[str, ...] = ()


class _OutOfTime(Exception):
    """The allowed time is over."""


def find_identifiable(
    machine: Machine, seconds: float = math.inf, progress: Callable[[str], object] = lambda _: None
) -> Identifiability:
    """Return which effects of a machine its sensors can identify.

    Parameters
    ----------
    machine
        Machine under study.
    seconds
        Allowed time, s; effects for which it does not suffice are `untried`.
    progress
        Called with the name of the next step.

    Returns
    -------
    Identifiability
        Result for all effects that a diagnosis searches. Only `sums` is filled if the description
        does not limit the motion: joints need a range, or the machine needs an experiment.

    Raises
    ------
    RigtwinError
        If an experiment of the machine cannot be simulated.
    """
    until = time.monotonic() + seconds
    searched = [effect for effect in machine.effects() if effect.searched]
    progress("made-up motions")
    sums = machine.physics.base_parameters(machine)
    recordings = list(machine.physics.excite(machine))
    if not recordings:
        return Identifiability((), (), {}, (), sums)
    motions = tuple(str(recording.experiment) for recording in recordings)
    responses: dict[str, Array | None] = {}
    try:
        trial = _Trial(machine, recordings, until)
        for number, effect in enumerate(searched, 1):
            progress(f"{effect.name}, {number} of {len(searched)}")
            responses[effect.name] = trial.response(effect)
    except _OutOfTime:
        remaining = tuple(effect.name for effect in searched if effect.name not in responses)
        unseen = tuple(name for name, shape in responses.items() if shape is None)
        seen = tuple(name for name, shape in responses.items() if shape is not None)
        return Identifiability((), unseen, {}, motions, sums, (*seen, *remaining))
    unseen = tuple(name for name, shape in responses.items() if shape is None)
    shapes = {name: shape for name, shape in responses.items() if shape is not None}
    effects = {effect.name: effect for effect in searched if effect.name in shapes}
    confounded, untried = _find_confounded(trial, effects, shapes, progress)
    known = {*unseen, *confounded, *untried}
    seen = tuple(name for name in responses if name not in known)
    return Identifiability(seen, unseen, confounded, motions, sums, untried)


def _find_confounded(
    trial: _Trial,
    effects: Mapping[str, Effect],
    shapes: Mapping[str, Array],
    progress: Callable[[str], object],
) -> tuple[dict[str, tuple[str, ...]], tuple[str, ...]]:
    """Return the combination that reproduces each confounded effect, and the effects untried."""
    confounded: dict[str, tuple[str, ...]] = {}
    untried: tuple[str, ...] = ()
    for number, (name, shape) in enumerate(shapes.items(), 1):
        progress(f"rivals of {name}, {number} of {len(shapes)}")
        rivals = {n: s for n, s in shapes.items() if not _shares(effects[n], effects[name])}
        try:
            for combination in _propose(shape, rivals):
                if trial.reproduces([effects[n] for n in combination], effects[name]):
                    confounded[name] = combination
                    break
        except _OutOfTime:
            untried = (*untried, name)
    return confounded, untried


class _Trial:
    """Model of a machine under the synthetic motions.

    Predictions are divided by the RMS of each signal, so that all signals weigh the same.
    """

    def __init__(self, machine: Machine, recordings: Sequence[RecordedTest], until: float) -> None:
        """Simulate the motions until a moment, as `time.monotonic` has it."""
        self._machine, self.plant, self._until = machine, machine.plant, until
        self._period = recordings[0].period
        self._models: list[Model[Any]] = [
            machine.physics.model(
                machine, recording.inputs, machine.configuration_of(recording), STEPS
            )
            for recording in recordings
        ]
        self._swings = swings(machine, recordings)
        self._size = np.ones((len(machine.rows), 1))
        moved = self._predict(self.plant)
        rms = np.sqrt(np.mean(moved**2, axis=1, keepdims=True))
        # A signal that stays zero must not divide by zero.
        self._size = np.maximum(rms, 1e-12)
        # Refinements of dry friction have no effect without it, so friction is added first.
        for effect in machine.effects():
            if effect.kind.name in BASIC and not any(effect.nominal(machine.plant).values()):
                values = self._starts(effect).values
                self.plant = with_values(
                    self.plant, (effect,), (min(v for v in values if v[0] > 0.0),)
                )
        self._baseline = self._predict(self.plant)

    def _predict(self, plant: Plant) -> Array:
        if time.monotonic() > self._until:
            raise _OutOfTime
        rows = np.concatenate([model.predict(plant) for model in self._models], axis=1)
        return rows / self._size

    def _scales(self, component: str) -> Scales:
        motion = self._models[0].motion(component, self._machine.plant)
        forces = [
            float(size)
            for row, size in zip(self._machine.rows, self._size[:, 0], strict=True)
            if row.kind == "force"
        ]
        force = max(forces, default=0.0)
        # Without any predicted force the scale is arbitrary, because effects are compared in shape.
        return Scales.of(motion, force if force > FORCELESS else 1.0, self._period)

    def _starts(self, effect: Effect) -> Starts:
        swing = self._swings.get(effect.component, Swing())
        return effect.starts(self.plant, swing, lambda: self._scales(effect.group))

    def response(self, effect: Effect) -> Array | None:
        """Return the change of all signals by a small effect, normalised to length 1.

        If a small effect changes nothing, the smallest start that changes anything is used. None
        if no start does.
        """
        if not is_possible((effect,), self.plant):
            return None
        nominal = tuple(effect.nominal(self.plant).values())
        starts = self._starts(effect)
        sizes = sorted(starts.values, key=lambda values: abs(values[0] - nominal[0]))
        # Only the first parameter is made small; the others keep the values of the smallest
        # start, as an effect may need them to act at all.
        little = (nominal[0] + starts.steps[0], *sizes[0][1:])
        for values in (little, *sizes):
            if values == nominal:
                continue
            change = self._predict(with_values(self.plant, (effect,), (values,))) - self._baseline
            if float(np.sqrt(np.mean(change**2))) > NO_CHANGE:
                return np.ravel(change) / float(np.linalg.norm(change))
        return None

    def reproduces(self, combination: Sequence[Effect], effect: Effect) -> bool:
        """Return whether a combination of effects reproduces an effect of medium size.

        Linear dependence of small changes is not enough: a delay equals a lag only while small.
        """
        nominal = tuple(effect.nominal(self.plant).values())
        sizes = sorted(self._starts(effect).values, key=lambda values: abs(values[0] - nominal[0]))
        target = self._predict(with_values(self.plant, (effect,), (sizes[len(sizes) // 2],)))
        change = float(np.linalg.norm(target - self._baseline))
        rest = [tuple(e.nominal(self.plant).values()) for e in combination]
        steps = np.array([self._starts(e).steps[0] for e in combination])
        quantities = [e.quantities()[e.kind.parameters[0]] for e in combination]

        def residual(point: Array) -> Array:
            # The search starts at 1, not 0, because the solver's difference steps are relative.
            moved = point - 1.0
            values = [
                (min(max(start[0] + step * by, q.low), q.high), *start[1:])
                for start, step, by, q in zip(rest, steps, moved, quantities, strict=True)
            ]
            return np.ravel(target - self._predict(with_values(self.plant, combination, values)))

        start = np.ones(len(combination))
        # diff_step is relative to the start at 1, so one step is one of the effects' own steps.
        fit = least_squares(residual, start, diff_step=1.0, max_nfev=EVALUATIONS)
        return change > 0.0 and float(np.linalg.norm(fit.fun)) < UNEXPLAINED * change


def _shares(first: Effect, second: Effect) -> bool:
    """Return whether two effects set the same parameter."""
    common = set(first.kind.parameters) & set(second.kind.parameters)
    return first.group == second.group and bool(common)


def _propose(shape: Array, rivals: Mapping[str, Array]) -> Iterator[tuple[str, ...]]:
    """Propose combinations of rivals that may reproduce a shape, the smallest first.

    Backward elimination: starting from all rivals, the one whose removal raises the residual least
    is removed in each round, while the residual stays below NEAR.
    """
    names, columns = list(rivals), np.array(list(rivals.values()))
    # All shapes have length 1, so every projection follows from the Gram matrix alone.
    gram, shared = columns @ columns.T, columns @ shape

    def residual(chosen: list[int]) -> float:
        # For unit vectors: ‖shape − projection‖² = 1 − tᵀ G⁻¹ t with the Gram matrix G of the
        # chosen.
        part, target = gram[np.ix_(chosen, chosen)], shared[chosen]
        return 1.0 - float(target @ np.linalg.lstsq(part, target, rcond=RANK)[0])

    chosen = list(range(len(names)))
    combinations: list[tuple[str, ...]] = []
    while chosen and residual(chosen) < NEAR**2:
        if len(chosen) <= TOGETHER:
            combinations.append(tuple(names[n] for n in chosen))
        chosen.remove(min(chosen, key=lambda n: residual([c for c in chosen if c != n])))
    yield from reversed(combinations)
