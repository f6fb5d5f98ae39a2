"""Operation of the suspension rig: its controller, its limits and its stop state."""

from __future__ import annotations

from collections.abc import Callable

from controllers import (
    Commands,
    Controller,
    Demand,
    Measurements,
    MilState,
    Mode,
    initial_state,
    update,
)
from controllers.force import MOTOR_CONSTANT
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import set_up
from rigtwin.hardware.daq.signals import RIG
from rigtwin.hardware.operation import Course
from rigtwin.hardware.supervisor import Cause
from rigtwin.numerics.arrays import Array
from rigtwin.simulation.safety import (
    empty_memory,
    find_arming_obstacle,
    is_beyond,
    judge_commands,
    judge_measurements,
    stop_state,
)
from rigtwin.simulation.trip import Trip, explain_trip

LOOKING = 0.3
"""Time during which sensors are checked before the rig is armed, in s. Meanwhile everything that a
tick needs is warmed up."""
ARMED = 0.1
"""Time under pressure before anything moves, in s."""
SETTLING = 0.3
"""Time at the start position between ramp and test, in s."""
NOT_HELD = ("following", "structure", "ground", "travel", "velocity", "wheel")
"""Causes after which cylinders are not held under pressure, because a cylinder may be at fault."""
NOTHING = Commands(0.0, 0.0, 0.0, 0.0)
Update = Callable[[Controller, MilState, Measurements, Demand], tuple[MilState, Commands]]


class RigOperation:
    """An `Operation` of the suspension rig."""

    signals = RIG
    watched = (*Measurements._fields, "voltage")

    def __init__(
        self, configuration: Configuration, demands: Array, updating: Update = update
    ) -> None:
        """Prepare a test of the rig.

        Parameters
        ----------
        configuration
            Settings of the test, with the limits that the card adds.
        demands
            Demands, shape (ticks, 3), in the order of `controllers.Demand`.
        updating
            Controller. It is called once before anything moves, and that result is discarded.
        """
        self._limits, self._demands, self._updating = configuration.safety, demands, updating
        self.period, self.ticks = configuration.timing.period, len(demands)
        self.course = Course(LOOKING, ARMED, self._limits.ramp, SETTLING, self._limits.hold)
        self.missed = self._limits.missed
        self._controller = set_up(configuration.controller, self.period)
        self._state, self._memory = initial_state(self._controller), empty_memory()
        self.rest, self.target = NOTHING, _start_of(configuration, demands)

    def look(self, measured: Measurements) -> str | None:
        """Return why the rig must not be armed, or None; take its position as the rest."""
        refused = find_arming_obstacle(self._limits, measured)
        if refused is None:
            self.rest = Commands(measured.ground_lvdt, measured.structure_lvdt, 0.0, 0.0)
            first = Demand(*self._demands[0].tolist())
            # The first call of a controller is slow; here nothing waits for it.
            self._updating(self._controller, self._state, measured, first)
        return refused

    def control(self, tick: int, measured: Measurements) -> Commands:
        demand = Demand(*self._demands[tick].tolist())
        self._state, commands = self._updating(self._controller, self._state, measured, demand)
        return commands

    def judge_measured(self, measured: Measurements, interval: float) -> Cause | None:
        return self._explain(judge_measurements(self._limits, interval, self._memory, measured))

    def judge_commands(
        self, measured: Measurements, commands: Commands, interval: float
    ) -> Cause | None:
        return self._explain(
            judge_commands(self._limits, interval, self._memory, measured, commands)
        )

    def _explain(self, judgement: tuple[int, int]) -> Cause | None:
        number, column = judgement
        if number == Trip.NONE:
            return None
        trip = Trip(number)
        return Cause(trip.name.lower(), explain_trip(trip, self._limits, column))

    def stop_state(self, held: Commands) -> Commands:
        return stop_state(self._limits, held)

    def holds_after(self, cause: Cause) -> bool:
        return cause.name not in NOT_HELD

    def may_be_held(self, measured: Measurements) -> bool:
        return not is_beyond(self._limits, measured)

    def watch(self, measured: Measurements, commands: Commands) -> tuple[float, ...]:
        return (*measured, commands.voltage)


def _start_of(configuration: Configuration, demands: Array) -> Commands:
    """Return the commands at the start of a test: the controller's, unless motion is imposed."""
    settings = configuration.controller
    ground, structure, force = demands[0].tolist()
    # In a model-in-the-loop test only the ground is imposed; the rest starts from the settings.
    if settings.mode != Mode.IMPOSED:
        structure, force = settings.start, settings.preload
    return Commands(ground, structure, force, force / MOTOR_CONSTANT)
