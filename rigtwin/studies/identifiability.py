"""Structural identifiability: the effects a machine's sensors can reveal, before any data exist.

The machine's model is simulated under synthetic rich motions, with one effect after another. An
effect that changes no recorded signal is unobservable. An effect whose changes equal a combination
of other effects' changes, in all motions at once, is confounded with them: only their sum is known.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from rigtwin.components import Effect, ForceActuator
from rigtwin.components.effect import Scales, Starts, Swing
from rigtwin.components.plant import Plant
from rigtwin.description.machine import Joint, Machine, Structure
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.settings import Nothing
from rigtwin.diagnosis.fit import is_possible, with_values
from rigtwin.diagnosis.next_test import record_on_twin
from rigtwin.diagnosis.swing import swings
from rigtwin.errors import RigtwinError
from rigtwin.models.choose import model_of
from rigtwin.models.demands import demanded_channels
from rigtwin.models.machine_twin import run_machine
from rigtwin.models.model import Model
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording, reader
from rigtwin.signals.excitation import multisine
from rigtwin.simulation.experiment import find_experiment
from rigtwin.studies.base_parameters import find_base_parameters

SECONDS = 8.0
"""Duration of each synthetic motion, in s."""
REACHES = (0.3, 0.08)
"""RMS of the synthetic motions, as shares of half a joint's range."""
BAND = (0.15, 12.0)
"""Frequency band of the synthetic motions, in Hz."""
SLOPE = 1.0
"""Power of the frequency with which the amplitudes of the synthetic motions fall."""
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
"""Relative singular value below which a direction of a set of changes is rounding."""
EVALUATIONS = 12
"""Maximum number of evaluations when effects are fitted to another effect's change."""
SPARSE = 4e-3
"""Period of synthetic motions of joints with prescribed motion, in s."""
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
    """

    seen: tuple[str, ...]
    unseen: tuple[str, ...]
    confounded: Mapping[str, tuple[str, ...]]
    motions: tuple[str, ...]
    sums: tuple[Mapping[str, float], ...] = ()


def find_identifiable(machine: Machine) -> Identifiability:
    """Return which effects of a machine its sensors can identify.

    Parameters
    ----------
    machine
        Machine under study.

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
    sums = find_base_parameters(machine)
    recordings = list(_make_up(machine))
    if not recordings:
        return Identifiability((), (), {}, (), sums)
    trial = _Trial(machine, recordings)
    responses = {e.name: trial.response(e) for e in machine.effects() if e.searched}
    unseen = [name for name, response in responses.items() if response is None]
    shapes = {name: response for name, response in responses.items() if response is not None}
    effects = {e.name: e for e in machine.effects() if e.name in shapes}
    confounded = {}
    for name, shape in shapes.items():
        # Two effects that set the same parameter are the same change by construction.
        rivals = {n: s for n, s in shapes.items() if not _shares(effects[n], effects[name])}
        for combination in _propose(shape, rivals):
            if trial.reproduces([effects[n] for n in combination], effects[name]):
                confounded[name] = combination
                break
    # All effects that are neither unobservable nor confounded are identifiable.
    seen = [name for name in responses if name not in unseen and name not in confounded]
    return Identifiability(
        tuple(seen), tuple(unseen), confounded, tuple(str(r.experiment) for r in recordings), sums
    )


def _make_up(machine: Machine) -> Iterator[Recording]:
    """Yield rich motions within the machine's limits, without noise where the twin allows it."""
    if machine.structure is Structure.QUARTER_CAR:
        for name in machine.next_tests[:1]:
            test = find_experiment(machine, name)
            timing = test.configuration.timing._replace(duration=0.5 * SECONDS)
            configuration = test.configuration._replace(timing=timing, plant=machine.plant)
            # Two roads show effects that one road could hide by chance.
            for seed in (1, 2):
                demands = test.demands(configuration, seed)
                yield record_on_twin(machine, name, configuration, demands, seed)
        return
    timing = machine.configuration.timing._replace(duration=SECONDS)
    if machine.structure is Structure.MOVED:
        # Prescribed motion is evaluated point by point, not integrated, so long steps suffice.
        timing = timing._replace(period=max(timing.period, SPARSE))
    # Safety limits would end a motion early without changing what the sensors can show.
    unlimited: Any = Nothing()
    configuration = machine.configuration._replace(timing=timing, safety=unlimited)
    time = np.arange(configuration.ticks) * timing.period
    with TemporaryDirectory(prefix="rigtwin-") as folder:
        for number, reach in enumerate(REACHES, 1):
            # The motions are the same on every call, so that answers are reproducible.
            random = np.random.default_rng([number, 17])
            demands = {}
            for topic, field in demanded_channels(machine):
                size = _reach(machine, (topic, field))
                if size is None:
                    return
                # A fifth of the sampling rate keeps the highest sine well below Nyquist.
                highest = min(BAND[1], 0.2 / timing.period)
                wave = multisine(
                    time,
                    lowest=BAND[0],
                    highest=highest,
                    spacing=BAND[0],
                    slope=SLOPE,
                    rms=1.0,
                    random=random,
                )
                middle, half = size
                demands[f"{topic}.{field}"] = middle + reach * half * wave
            path = Path(folder) / f"{number}.mcap"
            try:
                run_machine(path, machine, f"multisine {number}", configuration, demands, number)
            # A machine that diverges under these motions cannot be studied with them.
            except RigtwinError:
                return
            yield reader.load(path)


def _reach(machine: Machine, channel: tuple[str, str]) -> tuple[float, float] | None:
    """Return (middle, half) of a demanded channel's range, or None if it is unlimited."""
    if machine.structure in (Structure.MOVED, Structure.COUPLED):
        mechanism = Mechanism(machine.model)
        moved = next((c for c in machine.components.values() if c.channel == channel), None)
        if moved is None:
            # The demand is an input of the controller, whose range the description does not state.
            return None
        joint = mechanism.joint(moved.joint or moved.acts_on[0][0])
        middle, half = _range(joint)
        if not isinstance(getattr(machine.plant, moved.name), ForceActuator):
            return middle, half
        constant = getattr(machine.plant, moved.name).constant
        # Half the force that lifts the joint where gravity loads it, otherwise the force that moves
        # its inertia to and fro at 1 Hz.
        lifts = 0.5 * max(np.abs(joint.gravity))
        return 0.0, (lifts or joint.inertia * (2.0 * math.pi) ** 2 * half) / constant
    for replay in machine.replays:
        joint, mover = replay.joint, machine.components[replay.moved_by[0]]
        middle, half = _range(joint)
        if replay.closed and channel != mover.channel:
            return middle, half
        if channel == mover.channel:
            constant = getattr(getattr(machine.plant, mover.name), "constant", None)
            if constant is None:
                return middle, half
            # As above: half the weight, or the force of a motion at 1 Hz.
            lifts = 0.5 * max(np.abs(joint.gravity))
            return 0.0, (lifts or joint.inertia * (2.0 * math.pi) ** 2 * half) / constant
    return None


def _range(joint: Joint) -> tuple[float, float]:
    """Return (middle, half) of a joint's range, centred on its rest position if that is inside."""
    low, high = joint.positions[0], joint.positions[-1]
    middle = min(max(joint.rest, low), high)
    # A rest position near a stop would allow no motion: at least a quarter of the range is used.
    return middle, max(min(high - middle, middle - low), 0.25 * (high - low))


class _Trial:
    """Model of a machine under the synthetic motions.

    Predictions are divided by the RMS of each signal, so that all signals weigh the same.
    """

    def __init__(self, machine: Machine, recordings: Sequence[Recording]) -> None:
        self._machine, self.plant = machine, machine.plant
        self._period = recordings[0].period
        self._models: list[Model[Any]] = [
            model_of(machine, recording, machine.configuration_of(recording), STEPS)
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
        part, target = gram[np.ix_(chosen, chosen)], shared[chosen]
        return 1.0 - float(target @ np.linalg.lstsq(part, target, rcond=RANK)[0])

    chosen = list(range(len(names)))
    combinations: list[tuple[str, ...]] = []
    while chosen and residual(chosen) < NEAR**2:
        if len(chosen) <= TOGETHER:
            combinations.append(tuple(names[n] for n in chosen))
        chosen.remove(min(chosen, key=lambda n: residual([c for c in chosen if c != n])))
    yield from reversed(combinations)
