"""Actions of a learning agent: adjust the running controller, or replace it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from controllers import Commands, Controller, Demand, Measurements, MilState, Settings, update
from controllers.quantity import Quantity, fields
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

try:
    from dm_env import specs
except ModuleNotFoundError:
    raise RigtwinError("environments need dm-env: pip install 'rigtwin[learning]'") from None


class Actions(Protocol):
    """Interface between an agent's action and the rig's controller."""

    def spec(self, configuration: Configuration) -> specs.BoundedArray:
        """Return the shape and the bounds of an action, in physical units."""
        ...

    def rest(self, configuration: Configuration) -> Array:
        """Return the action that leaves the experiment unchanged."""
        ...

    def act(
        self,
        controlling: Controller,
        state: MilState,
        measured: Measurements,
        demand: Demand,
        action: Array,
    ) -> tuple[MilState, Commands]:
        """Advance the controller by one tick under an action.

        Returns
        -------
        tuple of MilState and Commands
            State of the controller after the tick, and the commands for the actuators.
        """
        ...


class ActionSchedule:
    """Actions that set parameters of the running controller.

    Parameters
    ----------
    bounds
        Bounds (low, high) of each setting, in the setting's unit.

    Raises
    ------
    RigtwinError
        If a name is not a numeric setting of the controller, or its bounds exceed the setting's.
    """

    def __init__(self, bounds: Mapping[str, tuple[float, float]]) -> None:
        self.bounds = dict(bounds)
        # Bounds are checked against the units' ranges in the settings' annotations.
        known = fields(Settings)
        if not self.bounds:
            raise RigtwinError("actions: expected at least one setting with its bounds")
        for name, ends in self.bounds.items():
            meaning = known.get(name)
            if not isinstance(meaning, Quantity):
                raise RigtwinError(
                    f"action {name!r}: expected a setting of the controller that is a number"
                )
            if not isinstance(ends, tuple | list) or len(ends) != 2:
                raise RigtwinError(f"action {name}: {ends!r}; expected its bounds, (low, high)")
            low, high = ends
            if not meaning.low <= low < high <= meaning.high:
                allowed = f"{meaning.low:g} to {meaning.high:g} {meaning.unit}"
                raise RigtwinError(
                    f"action {name} from {low:g} to {high:g}: expected "
                    f"low below high within {allowed}"
                )

    def spec(self, configuration: Configuration) -> specs.BoundedArray:  # noqa: ARG002
        low, high = (np.array(ends) for ends in zip(*self.bounds.values(), strict=True))
        return specs.BoundedArray(
            (len(self.bounds),), np.float64, low, high, name=", ".join(self.bounds)
        )

    def rest(self, configuration: Configuration) -> Array:
        return np.array([getattr(configuration.controller, name) for name in self.bounds])

    def act(
        self,
        controlling: Controller,
        state: MilState,
        measured: Measurements,
        demand: Demand,
        action: Array,
    ) -> tuple[MilState, Commands]:
        # The replacement lasts for one tick: the next action starts from the same settings.
        changed = dict(zip(self.bounds, action.tolist(), strict=True))
        return update(
            controlling._replace(settings=controlling.settings._replace(**changed)),
            state,
            measured,
            demand,
        )


def suspension(settings: Settings) -> ActionSchedule:
    """Return the actions of a semi-active or active suspension.

    Parameters
    ----------
    settings
        Settings of the running controller.

    Returns
    -------
    ActionSchedule
        Bounds of the suspension's damping, in Ns/m, from 0.2 to 10 times its present value, and
        of its preload, in N, from 0.5 to 1.5 times.
    """
    # The upper bound of a setting's own range may be lower than the factor allows.
    factors = {"suspension_damping": (0.2, 10.0), "preload": (0.5, 1.5)}
    bounds = {}
    for name, (low, high) in factors.items():
        present, meaning = getattr(settings, name), fields(Settings)[name]
        assert isinstance(meaning, Quantity)
        bounds[name] = (low * present, min(high * present, meaning.high))
    return ActionSchedule(bounds)


class Actuators:
    """Actions that replace the controller: plate position, in m, and motor voltage, in V.

    The ground motion remains the experiment's.
    """

    def spec(self, configuration: Configuration) -> specs.BoundedArray:
        # The bounds are those of the safety limits, so that no action alone can trip the test.
        high = np.array([configuration.safety.structure, configuration.controller.voltage_limit])
        return specs.BoundedArray((2,), np.float64, -high, high, name="structure, voltage")

    def rest(self, configuration: Configuration) -> Array:
        settings = configuration.controller
        # Steady state of the motor: force = constant * voltage.
        return np.array([settings.start, settings.preload / configuration.plant.motor.constant])

    def act(
        self,
        controlling: Controller,
        state: MilState,
        measured: Measurements,
        demand: Demand,
        action: Array,
    ) -> tuple[MilState, Commands]:
        # The controller is still updated, because its filters are part of the observation. Its
        # commands are discarded.
        state, _ = update(controlling, state, measured, demand)
        # No force is demanded here. The measured one takes its place, so that the force error is
        # zero.
        structure, voltage = action.tolist()
        return state, Commands(demand.ground, structure, measured.load_cell, voltage)
