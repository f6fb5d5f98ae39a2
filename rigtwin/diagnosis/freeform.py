"""Where an effect acts that nobody has a name for: which component, disturbed in any way it could be, explains most.

Each component gets a set of disturbances at its place, functions of what it goes through: its motion, speed, force, the time.
Their strengths are fitted together, linearly. A sensor's disturbance shows in that sensor alone; a cylinder's moves its plate
and all that hangs on it; the motor's force shows in load cell and wheel; what acts on the carriage shows in the wheel.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from controllers import Measurements
from controllers.force import MOTOR_CONSTANT
from rigtwin.arrays import Array
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fit import Space
from rigtwin.diagnosis.reduced import Disturbances
from rigtwin.effects import Effect
from rigtwin.parameters import Plant

PRICE = 20.0
"""Of each disturbance, in χ²."""
STRENGTH = {"m": 1e-4, "N": 4.0}
"""rms of each disturbance as tried; its response is taken as in proportion to it."""
ROUNDS = 4
"""Times that a disturbance is fitted anew at what was found."""
FOLLOWED = 6
"""Components that are fitted so; those that come last at first stay there."""
WAVES = (0.005, 0.008, 0.012, 0.018, 0.028)
"""m; wave lengths of friction along the way."""
RELAXATIONS = (0.02, 0.07, 0.25)
"""s; times in which a tyre may relax."""


@dataclass(frozen=True)
class Disturbed:
    """How well a component, disturbed freely, explains the evidence. misfit: χ²; forms: what the disturbance goes with, the
    strongest first."""

    component: str
    misfit: float
    forms: tuple[str, ...]


@dataclass(frozen=True)
class _Signals:
    """What the components go through, shape (ticks,) each."""

    time: Array
    sensed: Array
    wheel: Array
    wheel_speed: Array
    wheel_acceleration: Array
    deflection: Array
    travel: Array
    sliding: Array
    force: Array
    period: float


def _signals(true: Array, sensed: Array, period: float) -> _Signals:
    wheel = true[1] - true[2]
    speed = np.gradient(wheel, period)
    deflection = np.maximum(true[0] - wheel, 0.0)
    sliding = np.gradient(true[2], period)
    time = np.arange(true.shape[1]) * period
    acceleration = np.gradient(speed, period)
    return _Signals(time, sensed, wheel, speed, acceleration, deflection, true[2], sliding, true[3], period)


def _relaxed(signal: Array, time_constant: float, period: float) -> Array:
    share = period / (time_constant + period)
    out, _ = lfilter([share], [1.0, share - 1.0], signal, zi=[(1.0 - share) * signal[0]])
    return np.asarray(out)


def _polynomials(signal: Array, time: Array, period: float) -> Iterator[tuple[str, Array]]:
    centred = signal - np.mean(signal)
    rate = np.gradient(centred, period)
    yield "constant", np.ones_like(signal)
    yield "time", time
    yield "time squared", time**2
    yield "its value", centred
    yield "its value squared", centred**2
    yield "its value cubed", centred**3
    yield "its value growing with time", centred * time
    yield "its rate", rate
    yield "its rate of rate", np.gradient(rate, period)


def _forms(component: str, signals: _Signals) -> Iterator[tuple[str, str, Array]]:
    """(what the disturbance goes with, where it enters, the disturbance) of one component."""
    time, period = signals.time, signals.period
    if component in Measurements._fields:
        row = Measurements._fields.index(component)
        for name, signal in _polynomials(signals.sensed[row], time, period):
            yield name, component, signal
        if component == "load_cell":
            yield "the carriage's acceleration", component, signals.wheel_acceleration
    elif component in ("ground_cylinder", "structure_cylinder"):
        place = component.removesuffix("_cylinder")
        motion = signals.sensed[("ground_cylinder", "structure_cylinder").index(component)]
        for name, signal in _polynomials(motion, time, period):
            yield name, place, signal
        for seconds in RELAXATIONS:
            yield "its past", place, _relaxed(motion, seconds, period)
        yield "its load", place, signals.force - np.mean(signals.force)
    elif component == "motor":
        sign = np.sign(signals.sliding)
        for name, signal in _polynomials(signals.force, time, period):
            yield name, "voltage", signal
        yield "sliding speed", "voltage", signals.sliding
        yield "sliding speed squared", "voltage", signals.sliding * np.abs(signals.sliding)
        yield "sliding direction", "voltage", sign
        yield "sliding direction growing with time", "voltage", sign * time
        yield "travel", "voltage", signals.travel
    elif component == "rail":
        sign = np.sign(signals.wheel_speed)
        yield "speed", "force", signals.wheel_speed
        yield "speed squared", "force", signals.wheel_speed * np.abs(signals.wheel_speed)
        yield "direction", "force", sign
        yield "direction growing with time", "force", sign * time
        yield "place", "force", signals.wheel
        for wave in WAVES:
            yield "direction and place", "force", sign * np.sin(2 * np.pi * signals.wheel / wave)
            yield "direction and place", "force", sign * np.cos(2 * np.pi * signals.wheel / wave)
    elif component == "tyre":
        squeeze = np.gradient(signals.deflection, period)
        yield "deflection", "force", signals.deflection
        yield "deflection squared", "force", signals.deflection**2
        yield "deflection cubed", "force", signals.deflection**3
        yield "deflection growing with time", "force", signals.deflection * time
        yield "rate of deflection", "force", squeeze
        yield "rate and deflection", "force", squeeze * signals.deflection
        for seconds in RELAXATIONS:
            yield "its past", "force", _relaxed(signals.deflection, seconds, period)
    else:
        yield "acceleration", "force", signals.wheel_acceleration
        yield "acceleration growing with time", "force", signals.wheel_acceleration * time
        yield "acceleration squared", "force", signals.wheel_acceleration * np.abs(signals.wheel_acceleration)


PLACES = (
    "motor",
    "rail",
    "tyre",
    "carriage",
    "ground_cylinder",
    "structure_cylinder",
    *Measurements._fields,
)
"""Components that are disturbed in turn."""


class _Disturbance:
    """All forms of one component's disturbance in every recording, and what they do."""

    def __init__(self, component: str, evidence: Evidence, plant: Plant, signals: list[_Signals]) -> None:
        forms = list(zip(*(_forms(component, each) for each in signals), strict=True))
        self.component, self.names = component, [same[0][0] for same in forms]
        self._evidence, self._plant = evidence, plant
        self._enter = forms[0][0][1]
        strength = STRENGTH["N" if self._enter in ("voltage", "force", "load_cell") else "m"]
        sizes = [float(np.sqrt(np.mean(np.concatenate([signal for _, _, signal in same]) ** 2))) for same in forms]
        # One row a form, one column a tick; each of the same strength.
        self._forms = [
            np.stack([strength / max(size, 1e-300) * same[number][2] for same, size in zip(forms, sizes, strict=True)])
            for number in range(len(signals))
        ]

    def predicted(self, strengths: Array) -> list[Array]:
        """The sensors under the disturbance, shape (4, ticks) for each recording."""
        found = []
        for reduced, forms in zip(self._evidence.plants, self._forms, strict=True):
            pushed = strengths @ forms
            if self._enter in Measurements._fields:
                sensed = reduced.sensed(self._plant)
                sensed[Measurements._fields.index(self._enter)] += pushed
            else:
                amounts = dict.fromkeys(Disturbances._fields, np.zeros_like(pushed))
                amounts[self._enter] = pushed / MOTOR_CONSTANT if self._enter == "voltage" else pushed
                sensed = reduced.disturbed(self._plant, Disturbances(**amounts))
            found.append(sensed)
        return found

    def fitted(self, space: Space, rounds: int) -> tuple[float, Array, Array]:
        """Gauss-Newton: misfit, strengths, and what would be missing without each form."""
        here = np.zeros(len(self.names))
        predicted = self.predicted(here)
        residual = self._evidence.unlike(predicted)
        misfit, worth = space.misfit(residual), np.zeros_like(here)
        for _ in range(rounds):
            columns = []
            for number in range(len(here)):
                there = here.copy()
                there[number] += 1.0
                columns.append(self._evidence.whitened([b - a for a, b in zip(predicted, self.predicted(there), strict=True)]))
            normal, gradient = space.normal_equations(np.stack(columns, axis=1), residual)
            normal += np.diag(1e-6 * np.diag(normal) + 1e-9)
            move = np.linalg.solve(normal, gradient)
            gained = 0.0
            for share in (1.0, 0.5, 0.2):
                tried = self.predicted(here + share * move)
                left = self._evidence.unlike(tried)
                if (value := space.misfit(left)) < misfit:
                    gained = misfit - value
                    here, predicted, residual, misfit = here + share * move, tried, left, value
                    break
            worth = here**2 / np.diag(np.linalg.inv(normal))
            if gained < 0.02 * misfit:
                break
        return misfit, here, worth


def located(evidence: Evidence, plant: Plant, effects: Sequence[Effect] = (), follow: bool = True) -> tuple[Disturbed, ...]:
    """Every component disturbed freely, the one that explains most first. plant: with the effects that are known already;
    follow: fit the foremost anew at what was found, as large disturbances need."""
    space = Space(evidence, plant, None, effects)
    base = evidence.predicted(plant)
    signals = [
        _signals(reduced.true(plant), sensed, recording.period)
        for reduced, sensed, recording in zip(evidence.plants, base, evidence.recordings, strict=True)
    ]
    disturbances = [_Disturbance(component, evidence, plant, signals) for component in PLACES]
    found = sorted((_found(each, space, 1) for each in disturbances), key=lambda each: each.misfit)
    if follow:
        foremost = [each.component for each in found[:FOLLOWED]]
        again = [_found(each, space, ROUNDS) for each in disturbances if each.component in foremost]
        found = sorted([*again, *found[FOLLOWED:]], key=lambda each: each.misfit)
    return tuple(found)


def _found(disturbance: _Disturbance, space: Space, rounds: int) -> Disturbed:
    misfit, _, worth = disturbance.fitted(space, rounds)
    order = np.argsort(-worth)
    forms = tuple(dict.fromkeys(disturbance.names[form] for form in order[:3] if worth[form] > PRICE))
    return Disturbed(disturbance.component, misfit + PRICE * len(disturbance.names), forms)
