"""The rig as a dm_env environment, for whatever learns: observations, actions and rewards in physical units.

    environment("active")                           the agent sets the suspension's damping and preload every 10 ms
    environment("active", actions=Actuators(), interval=1)   it is the controller: plate position and motor voltage

An episode is one test of an experiment; each takes the next seed, so another road and other noise. A trip of a safety limit
ends it with discount 0 and a penalty, the test's end with discount 1. A schedule at `rest` is the experiment to the bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

import dm_env
import numpy as np
from dm_env import specs

from controllers import (
    Commands,
    Controller,
    Demand,
    Measurements,
    Settings,
    State,
    controller,
    initial_state,
    update,
)
from controllers.quantity import Quantity, fields
from rigtwin.components.tyre import tyre_force
from rigtwin.errors import RigtwinError
from rigtwin.machine.configuration import Configuration
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.safety import Trip, judged, watching
from rigtwin.simulation.twin import Twin

INTERVAL = 10
"""Ticks that an action is held for: 10 ms."""
OBSERVED = ("travel", "velocity", "force", "structure_position", "structure_velocity")
"""Of the controller's state: filtered travel (m), its velocity (m/s), filtered force (N), structure model's position (m) and
velocity (m/s)."""
TRIP_PENALTY = 1000.0
"""Of a trip, in costs of a step."""


class Reward(NamedTuple):
    """A step's reward is minus the mean over its ticks of (a/ride)² + (ΔF/road_holding)² + (Δs/travel)²: body acceleration a,
    m/s²; tyre force off its static value ΔF, N; suspension travel off its static value Δs, m. Each figure is what costs 1; by
    default about what the passive car shows on the road of chapter 7. Infinite: does not count."""

    ride: float = 0.25
    road_holding: float = 45.0
    travel: float = 0.01


class Actions(Protocol):
    """What an agent does to the rig."""

    def spec(self, configuration: Configuration) -> specs.BoundedArray:
        """Shape and bounds, in units."""
        ...

    def rest(self, configuration: Configuration) -> Array:
        """The action that changes nothing."""
        ...

    def act(
        self, controlling: Controller, state: State, measured: Measurements, demand: Demand, action: Array
    ) -> tuple[State, Commands]:
        """One tick under an action."""
        ...


class Schedule:
    """The agent changes settings of the controller that runs: name → (low, high), in the setting's unit."""

    def __init__(self, bounds: Mapping[str, tuple[float, float]]) -> None:
        """Raises RigtwinError for a setting that is none or no number, or bounds beyond its own."""
        self.bounds = dict(bounds)
        known = fields(Settings)
        if not self.bounds:
            raise RigtwinError("actions: expected at least one setting with its bounds")
        for name, ends in self.bounds.items():
            meaning = known.get(name)
            if not isinstance(meaning, Quantity):
                raise RigtwinError(f"action {name!r}: expected a setting of the controller that is a number")
            if not isinstance(ends, tuple | list) or len(ends) != 2:
                raise RigtwinError(f"action {name}: {ends!r}; expected its bounds, (low, high)")
            low, high = ends
            if not meaning.low <= low < high <= meaning.high:
                allowed = f"{meaning.low:g} to {meaning.high:g} {meaning.unit}"
                raise RigtwinError(f"action {name} from {low:g} to {high:g}: expected low below high within {allowed}")

    def spec(self, configuration: Configuration) -> specs.BoundedArray:  # noqa: ARG002
        low, high = (np.array(ends) for ends in zip(*self.bounds.values(), strict=True))
        return specs.BoundedArray((len(self.bounds),), np.float64, low, high, name=", ".join(self.bounds))

    def rest(self, configuration: Configuration) -> Array:
        return np.array([getattr(configuration.controller, name) for name in self.bounds])

    def act(
        self, controlling: Controller, state: State, measured: Measurements, demand: Demand, action: Array
    ) -> tuple[State, Commands]:
        changed = dict(zip(self.bounds, action.tolist(), strict=True))
        return update(controlling._replace(settings=controlling.settings._replace(**changed)), state, measured, demand)


def suspension(settings: Settings) -> Schedule:
    """The suspension's damping, Ns/m, from a fifth to ten times what it is, and its preload, N, half as much more or less: a
    semi-active and an active suspension."""
    factors = {"suspension_damping": (0.2, 10.0), "preload": (0.5, 1.5)}
    bounds = {}
    for name, (low, high) in factors.items():
        there, meaning = getattr(settings, name), fields(Settings)[name]
        assert isinstance(meaning, Quantity)
        bounds[name] = (low * there, min(high * there, meaning.high))
    return Schedule(bounds)


class Actuators:
    """The agent is the controller: plate position, m, and motor voltage, V. The road stays the experiment's."""

    def spec(self, configuration: Configuration) -> specs.BoundedArray:
        high = np.array([configuration.safety.structure, configuration.controller.voltage_limit])
        return specs.BoundedArray((2,), np.float64, -high, high, name="structure, voltage")

    def rest(self, configuration: Configuration) -> Array:
        settings = configuration.controller
        return np.array([settings.start, settings.preload / configuration.plant.motor.constant])

    def act(
        self, controlling: Controller, state: State, measured: Measurements, demand: Demand, action: Array
    ) -> tuple[State, Commands]:
        # The controller runs beside, so that its filters show what they would; what it wants is not done.
        state, _ = update(controlling, state, measured, demand)
        structure, voltage = action.tolist()
        return state, Commands(demand.ground, structure, measured.load_cell, voltage)


class Environment(dm_env.Environment):
    """One experiment as episodes. Observations, a dictionary: `sensors`, the last raw samples, columns of
    controllers.Measurements, m and N; `controller`, see OBSERVED; `commands`, the last, of controllers.Commands, m, N, V.
    `trip` says why the last episode ended early."""

    def __init__(
        self,
        configuration: Configuration,
        demands: Callable[[Configuration, int], Array],
        seed: int = 0,
        actions: Actions | None = None,
        reward: Reward = Reward(),  # noqa: B008
        interval: int = INTERVAL,
    ) -> None:
        """demands: of (configuration, seed), shape (ticks, 3), as an experiment has them; seed: of the first episode; interval:
        ticks a step. Raises RigtwinError for figures that make no sense."""
        whole = all(isinstance(number, int) and not isinstance(number, bool) for number in (seed, interval))
        if not (whole and seed >= 0 and interval >= 1 and isinstance(reward, Reward) and all(one > 0.0 for one in reward)):
            given = f"seed {seed}, interval {interval}, {reward}"
            raise RigtwinError(f"{given}: expected seed 0 or more, interval 1 or more ticks, a Reward of figures above 0")
        self.configuration, self.interval, self.reward = configuration, interval, reward
        self.actions: Actions = suspension(configuration.controller) if actions is None else actions
        self.trip = Trip.NONE
        self._demands, self._next_seed = demands, seed
        self._controlling = controller(configuration.controller, configuration.timing.period)
        self._static = configuration.controller.sprung_mass * configuration.controller.gravity
        self._sag = (configuration.controller.preload - self._static) / max(configuration.controller.suspension_stiffness, 1e-9)
        self._over = True

    def action_spec(self) -> specs.BoundedArray:  # type: ignore[override]
        return self.actions.spec(self.configuration)

    def observation_spec(self) -> dict[str, specs.Array]:  # type: ignore[override]
        return {
            "sensors": specs.Array((4,), np.float64, name=", ".join(Measurements._fields)),
            "controller": specs.Array((len(OBSERVED),), np.float64, name=", ".join(OBSERVED)),
            "commands": specs.Array((4,), np.float64, name=", ".join(Commands._fields)),
        }

    def rest(self) -> Array:
        """The action that leaves the experiment as it is; of Actuators, the one that it starts with."""
        return self.actions.rest(self.configuration)

    def reset(self) -> dm_env.TimeStep:
        """Begins the next episode; its first observation is of the rig before the first tick."""
        self.seed = self._next_seed
        self._next_seed += 1
        self._asked = self._demands(self.configuration, self.seed)
        self._twin = Twin(self.configuration, float(self._asked[0, 0]), self.seed)
        self._twin.start()
        self._state, self._watch = initial_state(self._controlling), watching()
        self._tick, self._over, self.trip = 0, False, Trip.NONE
        start = self.configuration.controller.start
        self._measured = Measurements(float(self._asked[0, 0]), start, 0.0, self.configuration.controller.preload)
        self._plate: list[float] = []
        return dm_env.restart(self._observation())

    def step(self, action: Array) -> dm_env.TimeStep:
        """Holds an action for the interval. Raises ValueError for one out of its bounds."""
        if self._over:
            return self.reset()
        action = np.asarray(self.action_spec().validate(np.asarray(action, dtype=np.float64)))
        if not np.all(np.isfinite(action)):
            raise ValueError(f"action {action} for {self.action_spec().name}: expected finite numbers")
        cost, first = 0.0, self._tick
        while self._tick < min(first + self.interval, len(self._asked)) and self.trip == Trip.NONE:
            cost += self._ticked(action)
        cost /= self._tick - first
        self._over = self.trip != Trip.NONE or self._tick == len(self._asked)
        if self.trip != Trip.NONE:
            return dm_env.termination(-cost - TRIP_PENALTY, self._observation())
        if self._over:
            return dm_env.truncation(-cost, self._observation())
        return dm_env.transition(-cost, self._observation())

    def _ticked(self, action: Array) -> float:
        """One tick, and its cost."""
        twin, period = self._twin, self.configuration.timing.period
        measured, demand = twin.read(), Demand(*self._asked[self._tick].tolist())
        if twin.misses(1)[0]:
            commands = twin.held
        else:
            self._state, commands = self.actions.act(self._controlling, self._state, measured, demand, action)
        self._measured = measured
        self._tick += 1
        number, _ = judged(self.configuration.safety, period, self._watch, measured, commands)
        self.trip = Trip(number)
        if self.trip == Trip.NONE:
            twin.write(commands)
        return self._cost(twin.truth)

    def _cost(self, true: Measurements) -> float:
        period = self.configuration.timing.period
        self._plate = [*self._plate[-2:], true.structure_lvdt]
        ride = (self._plate[0] - 2.0 * self._plate[1] + self._plate[2]) / period**2 if len(self._plate) == 3 else 0.0
        deflection = np.array([true.ground_lvdt - true.structure_lvdt + true.suspension_lvdt])
        tyre = float(tyre_force(self.configuration.plant.tyre, deflection, np.zeros(1))[0]) - self._static
        travel = true.suspension_lvdt - self._sag
        return (ride / self.reward.ride) ** 2 + (tyre / self.reward.road_holding) ** 2 + (travel / self.reward.travel) ** 2

    def _observation(self) -> dict[str, Array]:
        state = self._state
        return {
            "sensors": np.array(self._measured, dtype=np.float64),
            "controller": np.array([float(getattr(state, name)) for name in OBSERVED]),
            "commands": np.array(self._twin.held, dtype=np.float64),
        }


def environment(
    experiment: str,
    seed: int = 0,
    actions: Actions | None = None,
    reward: Reward = Reward(),  # noqa: B008
    interval: int = INTERVAL,
) -> Environment:
    """An experiment of `rigtwin list` as an environment. Raises RigtwinError for one that there is not."""
    import experiments

    found = experiments.find(experiment)
    return Environment(found.configuration, found.demands, seed, actions, reward, interval)
