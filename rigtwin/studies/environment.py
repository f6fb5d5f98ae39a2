"""The rig as a dm_env environment for learning agents, in physical units.

An episode is one test of an experiment. Each episode uses the next seed, and with it a new road and
new sensor noise. A tripped safety limit ends the episode with discount 0 and a penalty; the test's
end has discount 1. An `ActionSchedule` held at `rest` reproduces the experiment bit for bit.
`experiments.environment` creates an environment by name::

    env = environment("active")    # the agent sets the suspension's damping and preload every 10 ms
    env = environment("active", actions=Actuators(), interval=1)    # the agent is the controller

dm_control's viewer and the wrappers of its suite accept the environment. In the viewer the rig can
be pushed with the mouse::

    from dm_control import viewer
    viewer.launch(env, policy=lambda step: env.rest())

The cameras `overview`, `side` and `wheel` provide images as observations. Without a display, set
MUJOCO_GL=egl::

    from dm_control.suite.wrappers import pixels
    env = pixels.Wrapper(env, render_kwargs={"camera_id": "overview"})
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from controllers import Commands, Demand, Measurements, initial_state
from rigtwin.components.tyre import tyre_force
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import set_up
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.safety import empty_memory, judge_limits
from rigtwin.simulation.trip import Trip
from rigtwin.simulation.twin import Twin
from rigtwin.studies.actions import Actions, suspension

try:
    import dm_env
    from dm_env import specs
except ModuleNotFoundError:
    raise RigtwinError("environments need dm-env: pip install 'rigtwin[learning]'") from None

if TYPE_CHECKING:
    from dm_control.mujoco import Physics

INTERVAL = 10
"""Number of ticks an action is held: 10 ms."""
OBSERVED = ("travel", "velocity", "force", "structure_position", "structure_velocity")
"""Observed states of the controller: filtered travel (m), its velocity (m/s), filtered force (N),
position (m) and velocity (m/s) of the structure model."""
TRIP_PENALTY = 1000.0
"""Penalty of a trip, in units of the cost of one step."""
ACTION_NOISE = 3
"""Index of the random stream for action noise, separate from the twin's streams."""


class Reward(NamedTuple):
    """Negative mean over a step's ticks of (a/ride)² + (ΔF/road_holding)² + (Δs/travel)².

    Each attribute is the value that costs 1. The defaults are about the values of the passive car
    on the road of the thesis' chapter 7. An infinite value removes its term.

    Attributes
    ----------
    ride
        Acceleration a of the body, in m/s².
    road_holding
        Deviation ΔF of the tyre's force from its static value, in N.
    travel
        Deviation Δs of the suspension's travel from its static value, in m.
    """

    ride: float = 0.25
    road_holding: float = 45.0
    travel: float = 0.01


class Task(NamedTuple):
    """Interface that dm_control's wrappers expect of a task.

    Attributes
    ----------
    random
        Random numbers of `dm_control.suite.wrappers.action_noise`, seeded anew from the seed of
        each episode.
    """

    random: np.random.Generator


def _task(seed: int) -> Task:
    # A stream apart from the twin's: noise on actions must not change the road or the sensors.
    return Task(np.random.default_rng([seed, ACTION_NOISE]))


class Environment(dm_env.Environment):
    """Episodes of one experiment.

    An observation is a dictionary of three arrays: `sensors`, the latest raw samples in the order
    of `controllers.Measurements`, in m and N; `controller`, the states listed in `OBSERVED`; and
    `commands`, the latest commands in the order of `controllers.Commands`, in m, N and V.

    Parameters
    ----------
    configuration
        Settings of the rig, its controller and the test.
    demands
        Function of (configuration, seed) that returns the test's demands, shape (ticks, 3), as an
        experiment has it.
    seed
        Seed of the first episode.
    actions
        Actions of the agent. Defaults to the damping and preload of `suspension`.
    reward
        Cost of a step.
    interval
        Number of ticks an action is held.

    Attributes
    ----------
    trip : Trip
        Reason why the last episode ended early.
    task : Task
        Source of the random numbers of dm_control's wrappers.

    Raises
    ------
    RigtwinError
        If the seed, the interval or a figure of the reward is out of range.
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
        # A bool is an int in Python; `seed=True` would otherwise pass as 1.
        whole = all(
            isinstance(number, int) and not isinstance(number, bool) for number in (seed, interval)
        )
        if not (
            whole
            and seed >= 0
            and interval >= 1
            and isinstance(reward, Reward)
            and all(figure > 0.0 for figure in reward)
        ):
            values = f"seed {seed}, interval {interval}, {reward}"
            raise RigtwinError(
                f"{values}: expected seed 0 or more, interval 1 or "
                "more ticks, a Reward of figures above 0"
            )
        self.configuration, self.interval, self.reward = configuration, interval, reward
        self.actions: Actions = suspension(configuration.controller) if actions is None else actions
        self.trip = Trip.NONE
        self.task = _task(seed)
        self._demands, self._next_seed = demands, seed
        self._controlling = set_up(configuration.controller, configuration.timing.period)
        # The static force of the tyre is the body's weight; the reward counts deviations from it.
        self._static = configuration.controller.sprung_mass * configuration.controller.gravity
        # Static deflection of the suspension spring under the body's weight.
        # Travel at rest = (preload − weight) / stiffness, about which the reward measures.
        self._sag = (configuration.controller.preload - self._static) / max(
            configuration.controller.suspension_stiffness, 1e-9
        )
        self._over = True
        self._twin: Twin | None = None
        self._physics: Physics | None = None

    @property
    def physics(self) -> Physics:
        """dm_control's view of the running twin: time, joints and camera images.

        The view shares the twin's model and data, so a force written to `data.xfrc_applied` acts
        on the rig. Only the environment may step it. Each episode creates a view and frees the
        one of the episode before.

        Raises
        ------
        RigtwinError
            If dm_control is not installed, as on Python 3.13.
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
        """Return the time an action is held.

        Returns
        -------
        float
            Time in s.
        """
        return self.interval * self.configuration.timing.period

    def action_spec(self) -> specs.BoundedArray:  # type: ignore[override]
        """Return the shape and the bounds of an action, in physical units."""
        return self.actions.spec(self.configuration)

    def observation_spec(self) -> dict[str, specs.Array]:  # type: ignore[override]
        """Return the shapes of the observation's arrays, each named by its columns."""
        return {
            "sensors": specs.Array((4,), np.float64, name=", ".join(Measurements._fields)),
            "controller": specs.Array((len(OBSERVED),), np.float64, name=", ".join(OBSERVED)),
            "commands": specs.Array((4,), np.float64, name=", ".join(Commands._fields)),
        }

    def rest(self) -> Array:
        """Return the action that leaves the experiment unchanged.

        For `Actuators` this is the action that holds the rig at its start.

        Returns
        -------
        Array
            Action within `action_spec`.
        """
        return self.actions.rest(self.configuration)

    def reset(self) -> dm_env.TimeStep:
        """Begin the next episode. Its first observation shows the rig before the first tick.

        Returns
        -------
        dm_env.TimeStep
            First step of the episode, of type FIRST.
        """
        twin = (
            self._begin(self._next_seed)
            if self._twin is None or self.seed != self._next_seed
            else self._twin
        )
        self._next_seed += 1
        # The controller starts afresh in each episode, as a session on the rig does.
        self._state, self._memory = initial_state(self._controlling), empty_memory()
        self._tick, self._over, self.trip = 0, False, Trip.NONE
        start = self.configuration.controller.start
        # Before the first tick nothing is measured; the observation shows the known start.
        self._measured = Measurements(
            float(self._asked[0, 0]), start, 0.0, self.configuration.controller.preload
        )
        self._plate: list[float] = []
        return dm_env.restart(self._observation(twin))

    def step(self, action: Array) -> dm_env.TimeStep:
        """Hold an action for the interval. After the end of an episode, begin the next one.

        Parameters
        ----------
        action
            Action within `action_spec`.

        Returns
        -------
        dm_env.TimeStep
            Observation after the interval, and the reward of the interval.

        Raises
        ------
        ValueError
            If the action is out of bounds or not finite.
        """
        twin = self._twin
        # dm_env's convention: a step after the last one begins a new episode.
        if self._over or twin is None:
            return self.reset()
        # validate() checks shape, type and bounds, but lets NaN pass.
        action = np.asarray(self.action_spec().validate(np.asarray(action, dtype=np.float64)))
        if not np.all(np.isfinite(action)):
            raise ValueError(
                f"action {action} for {self.action_spec().name}: expected finite numbers"
            )
        cost, first = 0.0, self._tick
        while self._tick < min(first + self.interval, len(self._asked)) and self.trip == Trip.NONE:
            cost += self._advance_tick(twin, action)
        # An interval cut short by a trip or the test's end has fewer ticks.
        cost /= self._tick - first
        self._over = self.trip != Trip.NONE or self._tick == len(self._asked)
        if self.trip != Trip.NONE:
            return dm_env.termination(-cost - TRIP_PENALTY, self._observation(twin))
        if self._over:
            return dm_env.truncation(-cost, self._observation(twin))
        return dm_env.transition(-cost, self._observation(twin))

    def _begin(self, seed: int) -> Twin:
        """Build the twin for the episode of one seed, and start it."""
        self.seed, self.task = seed, _task(seed)
        self._asked = self._demands(self.configuration, seed)
        # The view refers to the memory of the old twin's MuJoCo data: free it before that goes.
        if self._physics is not None:
            self._physics.free()
            self._physics = None
        self._twin = Twin(self.configuration, float(self._asked[0, 0]), seed)
        self._twin.start()
        return self._twin

    def _advance_tick(self, twin: Twin, action: Array) -> float:
        """Advance the rig by one tick, and return the cost of the tick."""
        period = self.configuration.timing.period
        measured, demand = twin.read(), Demand(*self._asked[self._tick].tolist())
        # A missed tick, as on a busy computer: the card keeps the commands of the tick before.
        if twin.misses(1)[0]:
            commands = twin.held
        else:
            self._state, commands = self.actions.act(
                self._controlling, self._state, measured, demand, action
            )
        self._measured = measured
        self._tick += 1
        # The same function judges limits on the twin, the virtual card and the rig.
        number, _ = judge_limits(
            self.configuration.safety, period, self._memory, measured, commands
        )
        self.trip = Trip(number)
        if self.trip == Trip.NONE:
            twin.write(commands)
        return self._cost(twin.truth)

    def _cost(self, true: Measurements) -> float:
        period = self.configuration.timing.period
        # Three positions suffice for a second difference.
        self._plate = [*self._plate[-2:], true.structure_lvdt]
        # Second central difference of the plate's position: no acceleration is simulated for the
        # plate, whose motion is prescribed.
        ride = (
            (self._plate[0] - 2.0 * self._plate[1] + self._plate[2]) / period**2
            if len(self._plate) == 3
            else 0.0
        )
        deflection = np.array([true.ground_lvdt - true.structure_lvdt + true.suspension_lvdt])
        # The tyre's deflection is ground minus wheel, and the wheel stands at plate minus travel.
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
