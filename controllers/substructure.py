"""The rig's controller with a structure whose model is elsewhere: an object in Python, a compiled
function, or another program behind a socket."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from controllers.linear_law import LinearLaw
from controllers.mil import controller, initial_state, update
from controllers.plate import at_rest, compensate, compensation, plate
from controllers.settings import PlateCompensator, Settings
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
        A delay compensator of the plate, in place of the one that the settings ask for.
    """

    def __init__(
        self,
        settings: Settings,
        period: float,
        model: Model | Callable[[float, float], float],
        law: LinearLaw | None = None,
    ) -> None:
        # The settings' own structure runs along unused, so its plate needs no compensation.
        plain = settings._replace(plate_compensator=PlateCompensator.NONE)
        self._controller = controller(plain, period)
        self._plate = plate(settings, period) if law is None else compensation(law, period)
        self._state = initial_state(self._controller)
        self._advance: Callable[[float, float], float] = getattr(model, "advance", model)
        self._period, self._memory = period, at_rest(self._plate)

    def tick(self, measured: Measurements, demand: Demand) -> Commands:
        """The commands of one tick, the plate's where the model has it."""
        self._state, commands = update(self._controller, self._state, measured, demand)
        position = float(self._advance(self._state.force, self._period))
        self._memory, asked = compensate(
            self._plate, self._memory, position, measured.structure_lvdt
        )
        return commands._replace(structure=float(asked))
