"""The controller of a machine: a formula of its description, or the Python controller of the
suspension rig.

A diagnosis replays it: recorded inputs in, commands out, to be compared with those recorded.
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
from controllers.formula import Formula, Program, formula
from rigtwin.description.settings import Nothing, settings_of
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel

Channel = tuple[str, str]
"""Topic and field of a recording."""


class Control(Protocol):
    """A controller whose commands can be worked out again from what was recorded."""

    @property
    def settings(self) -> Any:
        """Its settings as described: a NamedTuple."""
        ...

    @property
    def text(self) -> str:
        """What it is, in a line."""
        ...

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What it reads, in order."""
        ...

    @property
    def outputs(self) -> tuple[str, ...]:
        """The commands that it computes."""
        ...

    @property
    def exact(self) -> float | None:
        """rms in the command's unit within which its replay counts as exact; None for the
        recording's rounding."""
        ...

    def replay(self, settings: Any, inputs: Sequence[Array], period: float) -> Array:
        """Its commands for recorded inputs.

        Parameters
        ----------
        settings
            As in `settings`, maybe with other values.
        inputs
            One signal a channel, shape (ticks,) each.
        period
            s, of a tick.

        Returns
        -------
        Commands at every tick, shape (outputs, ticks).
        """
        ...


@dataclass(frozen=True)
class FormulaControl:
    """A formula that computes one command. inputs: name in the formula → channel."""

    output: str
    formula: Formula
    inputs: Mapping[str, Channel]
    exact: float | None = None

    @cached_property
    def settings(self) -> Any:
        values = self.formula.settings
        return settings_of(values, "the description") if values else Nothing()

    @property
    def text(self) -> str:
        return f"{self.output} = {self.formula.text}"

    @property
    def channels(self) -> tuple[Channel, ...]:
        return tuple(self.inputs[name] for name in self.formula.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        return (self.output,)

    def program(self, settings: Mapping[str, float]) -> Program:
        """The formula as it runs with some values of its settings.

        Parameters
        ----------
        settings
            Name → value.

        Raises
        ------
        RigtwinError
            If a block cannot work with them, such as a low-pass filter with a negative time.
        """
        try:
            own = self.formula.settings
            formula(self.formula.text, {name: settings.get(name, own[name]) for name in own})
        except ValueError as error:
            raise RigtwinError(f"controller of {self.output}: {error}") from None
        return self.formula.with_settings(settings)

    def replay(self, settings: Any, inputs: Sequence[Array], period: float) -> Array:
        return self.formula.replayed(settings._asdict(), inputs, period)[None]


@kernel
def _replay(
    controlling: Controller,
    start: Array,
    plate: Array,
    sensors: Array,
    demands: Array,
    out: Array,
) -> None:
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
    """The rig's controller at some settings.

    Parameters
    ----------
    settings
        Of it.
    period
        s, of a tick.

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
    """The controller of the suspension rig, `controllers.update`. What was demanded of it stands
    among its commands."""

    exact: float | None = None

    @property
    def settings(self) -> Settings:
        return Settings()

    @property
    def text(self) -> str:
        return "controllers.mil, in Python"

    @property
    def channels(self) -> tuple[Channel, ...]:
        sensors = (("/sensor", name) for name in Measurements._fields)
        return (*sensors, *(("/command", name) for name in Demand._fields))

    @property
    def outputs(self) -> tuple[str, ...]:
        return Commands._fields

    def replay(self, settings: Settings, inputs: Sequence[Array], period: float) -> Array:
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
"""Controllers written in Python, by the name that a description gives them."""
