"""The controller of a machine: a formula of its description, or the Python controller of the
suspension rig.

A diagnosis replays a controller: it recomputes the commands from the recorded inputs and compares
them with the recorded commands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from controllers import (
    SIZE,
    Commands,
    Controller,
    Demand,
    Measurements,
    Settings,
    controller,
    initial_state,
    packed,
    unpacked,
    update,
)
from controllers.formula import Formula, formula
from controllers.formula_program import Program
from rigtwin.description.settings import Nothing, settings_of
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

Channel = tuple[str, str]
"""Topic and field of a recorded signal."""


class Control(Protocol):
    """Controller whose commands can be recomputed from a recording."""

    @property
    def settings(self) -> Any:
        """Settings as described, a NamedTuple."""
        ...

    @property
    def text(self) -> str:
        """Summary of the controller in one line."""
        ...

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Channels that the controller reads, in the order of the inputs of `replay`."""
        ...

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the commands that the controller computes."""
        ...

    @property
    def exact(self) -> float | None:
        """Largest rms deviation of a replay that counts as exact, in the command's unit. None
        stands for the rounding of the recording."""
        ...

    def replay(self, settings: Any, inputs: Sequence[Array], period: float) -> Array:
        """Return the commands for recorded inputs.

        Parameters
        ----------
        settings
            Settings to replay with: the type of `settings`, with any allowed values.
        inputs
            Recorded signal of every channel, shape (ticks,).
        period
            Period of a tick, s.

        Returns
        -------
        Commands at every tick, shape (outputs, ticks).
        """
        ...


@dataclass(frozen=True)
class FormulaControl:
    """Controller given by a formula that computes one command.

    Attributes
    ----------
    output
        Name of the command.
    formula
        Compiled formula.
    inputs
        Name in the formula → channel that it reads.
    exact
        Largest rms deviation of a replay that counts as exact, in the command's unit.
    """

    output: str
    formula: Formula
    inputs: Mapping[str, Channel]
    exact: float | None = None

    @cached_property
    def settings(self) -> Any:
        """Settings of the formula with their described values, a NamedTuple."""
        values = self.formula.settings
        return settings_of(values, "the description") if values else Nothing()

    @property
    def text(self) -> str:
        """Command and formula, as the description writes them."""
        return f"{self.output} = {self.formula.text}"

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Channels that the formula reads, in the order of its inputs."""
        return tuple(self.inputs[name] for name in self.formula.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Name of the one command."""
        return (self.output,)

    def program(self, settings: Mapping[str, float]) -> Program:
        """Return the program that runs the formula with other values of its settings.

        Parameters
        ----------
        settings
            Setting → value. Settings that are not named have the described value.

        Raises
        ------
        RigtwinError
            If a block refuses a value, such as a low-pass filter with a negative time constant.
        """
        # Compiling the text again checks the arguments of the blocks, such as a filter's time
        # constant; `with_settings` alone replaces values without a check.
        try:
            described = self.formula.settings
            formula(
                self.formula.text, {name: settings.get(name, described[name]) for name in described}
            )
        except ValueError as error:
            raise RigtwinError(f"controller of {self.output}: {error}") from None
        return self.formula.with_settings(settings)

    def replay(self, settings: Any, inputs: Sequence[Array], period: float) -> Array:
        """Return the command for recorded inputs, shape (1, ticks); see `Control.replay`."""
        return self.formula.replayed(settings._asdict(), inputs, period)[None]


@kernel
def _replay(
    controlling: Controller, start: Array, plate: Array, sensors: Array, demands: Array, out: Array
) -> None:
    """Run the rig's controller over recorded ticks.

    sensors: shape (ticks, 4); demands: shape (ticks, 3); out: receives the commands, (ticks, 4).
    """
    # A kernel takes arrays only, so the state arrives packed: its size must be a constant.
    state = unpacked(to_fixed_tuple(start, SIZE), plate)  # type: ignore[call-arg]
    for tick in range(len(sensors)):
        measured = Measurements(
            sensors[tick, 0], sensors[tick, 1], sensors[tick, 2], sensors[tick, 3]
        )
        demand = Demand(demands[tick, 0], demands[tick, 1], demands[tick, 2])
        state, commands = update(controlling, state, measured, demand)
        for column in range(4):
            out[tick, column] = commands[column]


def set_up(settings: Settings, period: float) -> Controller:
    """Return the suspension rig's controller.

    Parameters
    ----------
    settings
        Settings of the controller.
    period
        Period of a tick, s.

    Raises
    ------
    RigtwinError
        If the settings ask for a compensator that cannot be made.
    """
    try:
        return controller(settings, period)
    except ValueError as error:
        raise RigtwinError(str(error)) from error


@dataclass(frozen=True)
class RigControl:
    """Controller of the suspension rig, `controllers.update`.

    Recordings store its demands in the topic of the commands.

    Attributes
    ----------
    exact
        Largest rms deviation of a replay that counts as exact; None for the recording's rounding.
    """

    exact: float | None = None

    @property
    def settings(self) -> Settings:
        """Nominal settings."""
        return Settings()

    @property
    def text(self) -> str:
        """Module that implements the controller."""
        return "controllers.mil, in Python"

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Channels of the four sensors, then of the three demands."""
        sensors = (("/sensor", name) for name in Measurements._fields)
        return (*sensors, *(("/command", name) for name in Demand._fields))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the four commands."""
        return Commands._fields

    def replay(self, settings: Settings, inputs: Sequence[Array], period: float) -> Array:
        """Return the commands for recorded inputs, shape (4, ticks); see `Control.replay`."""
        controlling = set_up(settings, period)
        table = np.ascontiguousarray(np.column_stack(inputs), np.float64)
        sensors, demands = np.hsplit(table, [len(Measurements._fields)])
        out = np.empty((len(table), len(Commands._fields)))
        start = initial_state(controlling)
        _replay(
            controlling,
            np.array(packed(start)),
            start.plate,
            np.ascontiguousarray(sensors),
            np.ascontiguousarray(demands),
            out,
        )
        return out.T


PYTHON: dict[str, Control] = {"controllers.mil": RigControl()}
"""Name in a description → controller written in Python."""
