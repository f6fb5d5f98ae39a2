"""The rig's controller with an external structure model.

The model is a Python object, a compiled function, or another program behind a socket.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from controllers.linear_law import LinearLaw
from controllers.mil import controller, initial_state, update
from controllers.plate import at_rest, compensate, compensation, plate
from controllers.settings import PlateCompensator, Settings
from controllers.signals import Commands, Demand, Measurements


class SubstructureModel(Protocol):
    """Structure model that returns the position of its plate at the next tick."""

    def advance(self, force: float, period: float) -> float:
        """Return the position of the plate, m; force: of the suspension on it, N; period: s."""
        ...


class Substructured:
    """Controller of one test; every test needs a new one.

    The suspension is that of `settings`. Of the structure in `settings` only the start is used.

    Parameters
    ----------
    settings : Settings
        Settings of the test.
    period : float
        Period of a tick, s.
    model : Model or callable
        Structure model, or its `advance` alone.
    law : LinearLaw, optional
        Delay compensator of the plate. Defaults to the one of the settings.
    """

    def __init__(
        self,
        settings: Settings,
        period: float,
        model: SubstructureModel | Callable[[float, float], float],
        law: LinearLaw | None = None,
    ) -> None:
        # The structure of the settings is simulated but unused: its plate needs no compensation.
        plain = settings._replace(plate_compensator=PlateCompensator.NONE)
        self._controller = controller(plain, period)
        self._plate = plate(settings, period) if law is None else compensation(law, period)
        self._state = initial_state(self._controller)
        self._advance: Callable[[float, float], float] = getattr(model, "advance", model)
        self._period, self._memory = period, at_rest(self._plate)

    def tick(self, measured: Measurements, demand: Demand) -> Commands:
        """Return the commands of one tick, with the plate at the position of the model."""
        self._state, commands = update(self._controller, self._state, measured, demand)
        position = float(self._advance(self._state.force, self._period))
        self._memory, plate_command = compensate(
            self._plate, self._memory, position, measured.structure_lvdt
        )
        return commands._replace(structure=float(plate_command))
