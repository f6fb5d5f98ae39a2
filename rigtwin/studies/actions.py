"""What an agent does to the rig: it sets the controller that runs, or is the controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from dm_env import specs

from controllers import Commands, Controller, Demand, Measurements, Settings, State, update
from controllers.quantity import Quantity, fields
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array


class Actions(Protocol):
    """What an agent does to the rig."""

    def spec(self, configuration: Configuration) -> specs.BoundedArray:
        """Shape and bounds, in units."""
        ...

    def rest(self, configuration: Configuration) -> Array:
        """The action that changes nothing."""
        ...

    def act(
        self,
        controlling: Controller,
        state: State,
        measured: Measurements,
        demand: Demand,
        action: Array,
    ) -> tuple[State, Commands]:
        """One tick under an action."""
        ...


class Schedule:
    """The agent changes settings of the controller that runs.

    Parameters
    ----------
    bounds
        Setting → (low, high), in its unit.

    Raises
    ------
    RigtwinError
        For a setting that is none or no number, or bounds beyond its own.
    """

    def __init__(self, bounds: Mapping[str, tuple[float, float]]) -> None:
        self.bounds = dict(bounds)
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
        state: State,
        measured: Measurements,
        demand: Demand,
        action: Array,
    ) -> tuple[State, Commands]:
        changed = dict(zip(self.bounds, action.tolist(), strict=True))
        return update(
            controlling._replace(settings=controlling.settings._replace(**changed)),
            state,
            measured,
            demand,
        )


def suspension(settings: Settings) -> Schedule:
    """The actions of a semi-active and an active suspension.

    Parameters
    ----------
    settings
        Of the controller that runs.

    Returns
    -------
    Schedule
        The suspension's damping, Ns/m, from a fifth to ten times what it is, and its preload, N,
        half as much more or less.
    """
    factors = {"suspension_damping": (0.2, 10.0), "preload": (0.5, 1.5)}
    bounds = {}
    for name, (low, high) in factors.items():
        there, meaning = getattr(settings, name), fields(Settings)[name]
        assert isinstance(meaning, Quantity)
        bounds[name] = (low * there, min(high * there, meaning.high))
    return Schedule(bounds)


class Actuators:
    """The agent is the controller: plate position, m, and motor voltage, V. The road stays the
    experiment's."""

    def spec(self, configuration: Configuration) -> specs.BoundedArray:
        high = np.array([configuration.safety.structure, configuration.controller.voltage_limit])
        return specs.BoundedArray((2,), np.float64, -high, high, name="structure, voltage")

    def rest(self, configuration: Configuration) -> Array:
        settings = configuration.controller
        return np.array([settings.start, settings.preload / configuration.plant.motor.constant])

    def act(
        self,
        controlling: Controller,
        state: State,
        measured: Measurements,
        demand: Demand,
        action: Array,
    ) -> tuple[State, Commands]:
        # The controller runs beside, so that its filters show what they would; what it wants is not
        # done.
        state, _ = update(controlling, state, measured, demand)
        structure, voltage = action.tolist()
        return state, Commands(demand.ground, structure, measured.load_cell, voltage)
