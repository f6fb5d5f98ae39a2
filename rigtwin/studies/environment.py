"""The rig as a dm_env environment, for whatever learns: observations, actions and rewards in
physical units.

An episode is one test of an experiment; each takes the next seed, so another road and other noise.
A trip of a safety limit ends it with discount 0 and a penalty, the test's end with discount 1. A
schedule at `rest` is the experiment to the bit. `experiments.environment` makes one by name::

    env = environment("active")    # the agent sets the suspension's damping and preload every 10 ms
    env = environment("active", actions=Actuators(), interval=1)    # it is the controller

dm_control's viewer and its suite's wrappers take it too. To watch it, and to push the rig with the
mouse::

    from dm_control import viewer
    viewer.launch(env, policy=lambda step: env.rest())

Pictures as observations, of the cameras `overview`, `side` and `wheel`; without a display set
MUJOCO_GL=egl::

    from dm_control.suite.wrappers import pixels
    env = pixels.Wrapper(env, render_kwargs={"camera_id": "overview"})
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import dm_env
import numpy as np
from dm_env import specs

from controllers import Commands, Demand, Measurements, initial_state
from rigtwin.components.tyre import tyre_force
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import set_up
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.safety import Trip, empty_memory, judge_limits
from rigtwin.simulation.twin import Twin
from rigtwin.studies.actions import Actions, suspension

if TYPE_CHECKING:
    from dm_control.mujoco import Physics

INTERVAL = 10
"""Ticks that an action is held for: 10 ms."""
OBSERVED = ("travel", "velocity", "force", "structure_position", "structure_velocity")
"""Of the controller's state: filtered travel (m), its velocity (m/s), filtered force (N), structure
model's position (m) and velocity (m/s)."""
TRIP_PENALTY = 1000.0
"""Of a trip, in costs of a step."""
ACTION_NOISE = 3
"""Number of the random stream of noise on actions, beside the twin's own."""


class Reward(NamedTuple):
    """Minus the mean over a step's ticks of (a/ride)² + (ΔF/road_holding)² + (Δs/travel)².

    Each figure is what costs 1, by default about what the passive car shows on the road of chapter
    7; an infinite one does not count.

    Attributes
    ----------
    ride
        Of the body's acceleration a, m/s².
    road_holding
        Of the tyre's force off its static value ΔF, N.
    travel
        Of the suspension's travel off its static value Δs, m.
    """

    ride: float = 0.25
    road_holding: float = 45.0
    travel: float = 0.01


class Task(NamedTuple):
    """What dm_control's wrappers ask of a task.

    Attributes
    ----------
    random
        Where `dm_control.suite.wrappers.action_noise` draws from; begins anew with each episode,
        from its seed.
    """

    random: np.random.Generator


def _task(seed: int) -> Task:
    return Task(np.random.default_rng([seed, ACTION_NOISE]))


class Environment(dm_env.Environment):
    """One experiment as episodes.

    An observation is a dictionary: `sensors`, the last raw samples, columns of
    `controllers.Measurements`, m and N; `controller`, see `OBSERVED`; `commands`, the last, columns
    of `controllers.Commands`, m, N and V.

    Parameters
    ----------
    configuration
        The rig, its controller and the test.
    demands
        Of (configuration, seed): what a test asks for, shape (ticks, 3), as an experiment has them.
    seed
        Of the first episode.
    actions
        What the agent does; by default the damping and preload of `suspension`.
    reward
        What a step costs.
    interval
        Ticks that an action is held for.

    Attributes
    ----------
    trip : Trip
        Why the last episode ended early.
    task : Task
        What dm_control's wrappers draw from.

    Raises
    ------
    RigtwinError
        For a seed, an interval or a reward that makes no sense.
    """

    def __init__(
        self,
        configuration: Configuration,
        demands: Callable[[Configuration, int], Array],
        seed: int = 0,
        actions: Actions | None = None,
        reward: Reward = Reward(),  # noqa: B008
        interval: int = INTERVAL,
    ) -> None:
        whole = all(
            isinstance(number, int) and not isinstance(number, bool) for number in (seed, interval)
        )
        if not (
            whole
            and seed >= 0
            and interval >= 1
            and isinstance(reward, Reward)
            and all(one > 0.0 for one in reward)
        ):
            given = f"seed {seed}, interval {interval}, {reward}"
            raise RigtwinError(
                f"{given}: expected seed 0 or more, interval 1 or "
                "more ticks, a Reward of figures above 0"
            )
        self.configuration, self.interval, self.reward = configuration, interval, reward
        self.actions: Actions = suspension(configuration.controller) if actions is None else actions
        self.trip = Trip.NONE
        self.task = _task(seed)
        self._demands, self._next_seed = demands, seed
        self._controlling = set_up(configuration.controller, configuration.timing.period)
        self._static = configuration.controller.sprung_mass * configuration.controller.gravity
        self._sag = (configuration.controller.preload - self._static) / max(
            configuration.controller.suspension_stiffness, 1e-9
        )
        self._over = True
        self._twin: Twin | None = None
        self._physics: Physics | None = None

    @property
    def physics(self) -> Physics:
        """dm_control's view of the twin that runs, for its time, its joints and pictures of it.

        It looks at the twin's own model and data, so a force written to `data.xfrc_applied` acts on
        the rig. Only the environment steps it. Each episode has its own, and frees the one before.

        Raises RigtwinError where there is no dm_control, as on Python 3.13.
        """
        try:
            from dm_control.mujoco import Physics, wrapper  # loads OpenGL, which only pictures need
        except ImportError as error:
            raise RigtwinError(f"physics: needs dm_control, Python 3.11 or 3.12: {error}") from None

        twin = self._begin(self._next_seed) if self._twin is None else self._twin
        if self._physics is None:
            self._physics = Physics(wrapper.MjData(twin.simulation.data))
        return self._physics

    def control_timestep(self) -> float:
        """How long an action is held for.

        Returns
        -------
        float
            In s.
        """
        return self.interval * self.configuration.timing.period

    def action_spec(self) -> specs.BoundedArray:  # type: ignore[override]
        """Shape and bounds of an action, in units."""
        return self.actions.spec(self.configuration)

    def observation_spec(self) -> dict[str, specs.Array]:  # type: ignore[override]
        """Shapes of the parts of an observation, each named by its columns."""
        return {
            "sensors": specs.Array((4,), np.float64, name=", ".join(Measurements._fields)),
            "controller": specs.Array((len(OBSERVED),), np.float64, name=", ".join(OBSERVED)),
            "commands": specs.Array((4,), np.float64, name=", ".join(Commands._fields)),
        }

    def rest(self) -> Array:
        """The action that leaves the experiment as it is; of `Actuators`, the one that it starts
        with.

        Returns
        -------
        Array
            As `action_spec` has it.
        """
        return self.actions.rest(self.configuration)

    def reset(self) -> dm_env.TimeStep:
        """Begins the next episode; its first observation is of the rig before the first tick.

        Returns
        -------
        dm_env.TimeStep
            Of type FIRST.
        """
        twin = (
            self._begin(self._next_seed)
            if self._twin is None or self.seed != self._next_seed
            else self._twin
        )
        self._next_seed += 1
        self._state, self._memory = initial_state(self._controlling), empty_memory()
        self._tick, self._over, self.trip = 0, False, Trip.NONE
        start = self.configuration.controller.start
        self._measured = Measurements(
            float(self._asked[0, 0]), start, 0.0, self.configuration.controller.preload
        )
        self._plate: list[float] = []
        return dm_env.restart(self._observation(twin))

    def step(self, action: Array) -> dm_env.TimeStep:
        """Holds an action for the interval; after an episode's end, begins the next.

        Parameters
        ----------
        action
            As `action_spec` has it.

        Returns
        -------
        dm_env.TimeStep
            What the rig shows after the interval, and the reward of it.

        Raises
        ------
        ValueError
            For an action out of its bounds.
        """
        twin = self._twin
        if self._over or twin is None:
            return self.reset()
        action = np.asarray(self.action_spec().validate(np.asarray(action, dtype=np.float64)))
        if not np.all(np.isfinite(action)):
            raise ValueError(
                f"action {action} for {self.action_spec().name}: expected finite numbers"
            )
        cost, first = 0.0, self._tick
        while self._tick < min(first + self.interval, len(self._asked)) and self.trip == Trip.NONE:
            cost += self._ticked(twin, action)
        cost /= self._tick - first
        self._over = self.trip != Trip.NONE or self._tick == len(self._asked)
        if self.trip != Trip.NONE:
            return dm_env.termination(-cost - TRIP_PENALTY, self._observation(twin))
        if self._over:
            return dm_env.truncation(-cost, self._observation(twin))
        return dm_env.transition(-cost, self._observation(twin))

    def _begin(self, seed: int) -> Twin:
        """Builds the rig of the episode of a seed, at its start."""
        self.seed, self.task = seed, _task(seed)
        self._asked = self._demands(self.configuration, seed)
        if self._physics is not None:
            self._physics.free()
            self._physics = None
        self._twin = Twin(self.configuration, float(self._asked[0, 0]), seed)
        self._twin.start()
        return self._twin

    def _ticked(self, twin: Twin, action: Array) -> float:
        """One tick, and its cost."""
        period = self.configuration.timing.period
        measured, demand = twin.read(), Demand(*self._asked[self._tick].tolist())
        if twin.misses(1)[0]:
            commands = twin.held
        else:
            self._state, commands = self.actions.act(
                self._controlling, self._state, measured, demand, action
            )
        self._measured = measured
        self._tick += 1
        number, _ = judge_limits(
            self.configuration.safety, period, self._memory, measured, commands
        )
        self.trip = Trip(number)
        if self.trip == Trip.NONE:
            twin.write(commands)
        return self._cost(twin.truth)

    def _cost(self, true: Measurements) -> float:
        period = self.configuration.timing.period
        self._plate = [*self._plate[-2:], true.structure_lvdt]
        ride = (
            (self._plate[0] - 2.0 * self._plate[1] + self._plate[2]) / period**2
            if len(self._plate) == 3
            else 0.0
        )
        deflection = np.array([true.ground_lvdt - true.structure_lvdt + true.suspension_lvdt])
        tyre = (
            float(tyre_force(self.configuration.plant.tyre, deflection, np.zeros(1))[0])
            - self._static
        )
        travel = true.suspension_lvdt - self._sag
        return (
            (ride / self.reward.ride) ** 2
            + (tyre / self.reward.road_holding) ** 2
            + (travel / self.reward.travel) ** 2
        )

    def _observation(self, twin: Twin) -> dict[str, Array]:
        state = self._state
        return {
            "sensors": np.array(self._measured, dtype=np.float64),
            "controller": np.array([float(getattr(state, name)) for name in OBSERVED]),
            "commands": np.array(twin.held, dtype=np.float64),
        }
