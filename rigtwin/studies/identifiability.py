"""What a machine's sensors can never show, whatever it does: before there are any data.

Every effect is given to the machine's model under made-up rich motions. One that changes nothing
that is recorded can never be seen. One whose changes are those of others, in every one of these
motions at once, can never be told from them: only what they do together is known.
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
from rigtwin.components.effect import Scales, Starts, Swing
from rigtwin.components.plant import Plant
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.fit import is_possible, with_values
from rigtwin.diagnosis.swing import swings
from rigtwin.models.model import Model
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording

NOTHING = 1e-7
"""rms of a change, in units of the signals' own rms, below which an effect does nothing."""
LEFT = 0.01
"""Share of an effect's change that others have to leave at most for it not to be told from
them."""
NEAR = 0.1
"""The same of what a little of it changes, from which it is tried whether they do."""
TOGETHER = 3
"""Others that may have to act together."""
BASIC = ("coulomb", "viscous")
"""Kinds that others refine."""
FORCELESS = 1e-9
"""N, rms, below which no force is predicted at all."""
RANK = 1e-10
"""Of a set of changes: what is smaller is rounding."""
EVALUATIONS = 12
"""Of a fit of others to what an effect does."""
STEPS = 4
"""Of integration a tick."""


@dataclass(frozen=True)
class Identifiability:
    """What made-up motions say of a machine's effects.

    Parameters
    ----------
    seen : tuple of str
        Effects that leave a trace of their own.
    unseen : tuple of str
        Those that change nothing that is recorded.
    alike : mapping
        Effect → others that together do what it does.
    motions : tuple of str
        What it was tried on; empty where nothing says how far the machine may move.
    sums : tuple of mappings
        Base parameters of bodies and rotors of joints that act on each other, however far they
        move: parameter → its coefficient (`find_base_parameters`).
    untried : tuple of str
        Effects for which the allowed time did not suffice.
    """

    seen: tuple[str, ...]
    unseen: tuple[str, ...]
    alike: Mapping[str, tuple[str, ...]]
    motions: tuple[str, ...]
    sums: tuple[Mapping[str, float], ...] = ()
    untried: tuple[str, ...] = ()


class _OutOfTime(Exception):
    """The time that was allowed is over."""


def find_identifiable(
    machine: Machine,
    seconds: float = math.inf,
    progress: Callable[[str], object] = lambda _: None,
) -> Identifiability:
    """What the sensors of a machine can show of its effects, and what they never can.

    Parameters
    ----------
    machine
        Its description.
    seconds
        Time that the work may take, s; effects that it does not suffice for are `untried`.
    progress
        Called with the name of what is worked out next.

    Returns
    -------
    Identifiability
        Of all effects that are searched for; empty but for its sums where the description does not
        say how far the machine may move: its joints need a range, or it needs an experiment.

    Raises
    ------
    RigtwinError
        If one of its own experiments cannot be run.
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
        tried = _Tried(machine, recordings, until)
        for number, effect in enumerate(searched, 1):
            progress(f"{effect.name}, {number} of {len(searched)}")
            responses[effect.name] = tried.response(effect)
    except _OutOfTime:
        untried = tuple(each.name for each in searched if each.name not in responses)
        unseen = tuple(name for name, shape in responses.items() if shape is None)
        seen = tuple(name for name, shape in responses.items() if shape is not None)
        return Identifiability((), unseen, {}, motions, sums, (*seen, *untried))
    unseen = tuple(name for name, shape in responses.items() if shape is None)
    shapes = {name: shape for name, shape in responses.items() if shape is not None}
    effects = {each.name: each for each in searched if each.name in shapes}
    alike: dict[str, tuple[str, ...]] = {}
    untried: tuple[str, ...] = ()
    for number, (name, shape) in enumerate(shapes.items(), 1):
        progress(f"rivals of {name}, {number} of {len(shapes)}")
        rivals = {n: s for n, s in shapes.items() if not _shares(effects[n], effects[name])}
        try:
            for others in _propose(shape, rivals):
                if tried.stands_for([effects[n] for n in others], effects[name]):
                    alike[name] = others
                    break
        except _OutOfTime:
            untried = (*untried, name)
    known = {*unseen, *alike, *untried}
    seen = tuple(name for name in responses if name not in known)
    return Identifiability(seen, unseen, alike, motions, sums, untried)


class _Tried:
    """A machine's model under made-up motions."""

    def __init__(self, machine: Machine, recordings: Sequence[Recording], until: float) -> None:
        """until: moment at which the time is over, as `time.monotonic` has it."""
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
        self._size = np.maximum(rms, 1e-12)
        # Refinements of friction do nothing where there is none.
        for effect in machine.effects():
            if effect.kind.name in BASIC and not any(effect.nominal(machine.plant).values()):
                values = self._starts(effect).values
                self.plant = with_values(
                    self.plant, (effect,), (min(v for v in values if v[0] > 0.0),)
                )
        self._here = self._predict(self.plant)

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
        # A guide that nothing is known of bears no force; then any unit of it will do.
        return Scales.of(motion, force if force > FORCELESS else 1.0, self._period)

    def _starts(self, effect: Effect) -> Starts:
        swing = self._swings.get(effect.component, Swing())
        return effect.starts(self.plant, swing, lambda: self._scales(effect.group))

    def response(self, effect: Effect) -> Array | None:
        """What a little of an effect changes, of length 1, all signals one after another; if that
        is nothing, what the smallest size does that does anything; None if none does."""
        if not is_possible((effect,), self.plant):
            return None
        there = tuple(effect.nominal(self.plant).values())
        starts = self._starts(effect)
        sizes = sorted(starts.values, key=lambda values: abs(values[0] - there[0]))
        little = (there[0] + starts.steps[0], *sizes[0][1:])
        for values in (little, *sizes):
            if values == there:
                continue
            change = self._predict(with_values(self.plant, (effect,), (values,))) - self._here
            if float(np.sqrt(np.mean(change**2))) > NOTHING:
                return np.ravel(change) / float(np.linalg.norm(change))
        return None

    def stands_for(self, others: Sequence[Effect], effect: Effect) -> bool:
        """Whether others can do what a good deal of an effect does, not only what a little does:
        as far as a delay is a lag at low frequencies."""
        there = tuple(effect.nominal(self.plant).values())
        sizes = sorted(self._starts(effect).values, key=lambda values: abs(values[0] - there[0]))
        wanted = self._predict(with_values(self.plant, (effect,), (sizes[len(sizes) // 2],)))
        change = float(np.linalg.norm(wanted - self._here))
        rest = [tuple(each.nominal(self.plant).values()) for each in others]
        steps = np.array([self._starts(each).steps[0] for each in others])
        quantities = [each.quantities()[each.kind.parameters[0]] for each in others]

        def left(point: Array) -> Array:
            # About 1, since the solver's steps are shares of where it stands.
            moved = point - 1.0
            values = [
                (min(max(own[0] + step * by, q.low), q.high), *own[1:])
                for own, step, by, q in zip(rest, steps, moved, quantities, strict=True)
            ]
            return np.ravel(wanted - self._predict(with_values(self.plant, others, values)))

        fit = least_squares(left, np.ones(len(others)), diff_step=1.0, max_nfev=EVALUATIONS)
        return change > 0.0 and float(np.linalg.norm(fit.fun)) < LEFT * change


def _shares(one: Effect, other: Effect) -> bool:
    """Whether both are values of one parameter."""
    common = set(one.kind.parameters) & set(other.kind.parameters)
    return one.group == other.group and bool(common)


def _propose(shape: Array, others: Mapping[str, Array]) -> Iterator[tuple[str, ...]]:
    """Others that may do the same together, the fewest first: of all of them, the one that is
    missed least is left out, one after another."""
    names, columns = list(others), np.array(list(others.values()))
    gram, shared = columns @ columns.T, columns @ shape

    def left(chosen: list[int]) -> float:
        part, own = gram[np.ix_(chosen, chosen)], shared[chosen]
        return 1.0 - float(own @ np.linalg.lstsq(part, own, rcond=RANK)[0])

    chosen = list(range(len(names)))
    found: list[tuple[str, ...]] = []
    while chosen and left(chosen) < NEAR**2:
        if len(chosen) <= TOGETHER:
            found.append(tuple(names[n] for n in chosen))
        chosen.remove(min(chosen, key=lambda n: left([c for c in chosen if c != n])))
    yield from reversed(found)
