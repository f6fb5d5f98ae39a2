"""The rig's controller with a structure whose model is elsewhere: an object in Python, a compiled
function, or another program behind a socket."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from controllers.linear_law import LinearLaw, step_linear
from controllers.mil import controller, initial_state, update
from controllers.settings import Settings
from controllers.signals import Commands, Demand, Measurements


class Model(Protocol):
    """A structure: where its plate is at the next tick."""

    def advance(self, force: float, period: float) -> float:
        """Its position, m. force: that the suspension carries it with, N; period: s."""
        ...


class Substructured:
    """One test's controller; a new one is needed for every test. The suspension is the rig's own,
    in `settings`; of the structure only its start.

    Parameters
    ----------
    settings
        Of the test.
    period
        s, of a tick.
    model
        The structure, or its `advance` alone.
    law
        A delay compensator of the plate, if there is one.
    """

    def __init__(
        self,
        settings: Settings,
        period: float,
        model: Model | Callable[[float, float], float],
        law: LinearLaw | None = None,
    ) -> None:
        self._controller = controller(settings, period)
        self._state = initial_state(self._controller)
        self._advance: Callable[[float, float], float] = getattr(model, "advance", model)
        self._period, self._start, self._law = period, settings.start, law
        self._memory = np.zeros(0 if law is None else len(law.a))

    def tick(self, measured: Measurements, demand: Demand) -> Commands:
        """The commands of one tick, the plate's where the model has it."""
        self._state, commands = update(self._controller, self._state, measured, demand)
        position = float(self._advance(self._state.force, self._period))
        if self._law is not None:
            moved = measured.structure_lvdt - self._start
            wanted = position - self._start
            position = float(step_linear(self._law, self._memory, wanted, moved)) + self._start
        return commands._replace(structure=position)
