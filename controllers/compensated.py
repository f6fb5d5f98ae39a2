"""The rig's controller with a delay compensator between the structure model and its cylinder: an
object with a `tick`, as `rigtwin.run` takes it.

The limits stay outside: what the compensator asks for is judged like any other command.
"""

from __future__ import annotations

import numpy as np

from controllers.linear_law import LinearLaw, step_linear
from controllers.mil import controller, initial_state, update
from controllers.settings import Settings
from controllers.signals import Commands, Demand, Measurements

FADE = 0.01
"""s over which the compensation sets in: a plate that is read with hum is not where the law starts,
and would be answered by a jump of the command."""


class Compensated:
    """One test's controller; a new one is needed for every test.

    Positions are compensated as differences from `settings.start`, so that the law starts at rest.
    """

    def __init__(self, settings: Settings, period: float, law: LinearLaw) -> None:
        self._controller = controller(settings, period)
        self._state = initial_state(self._controller)
        self._law = law
        self._memory = np.zeros(len(law.a))
        self._start = settings.start
        self._share, self._more = 0.0, period / FADE

    def tick(self, measured: Measurements, demand: Demand) -> Commands:
        """The commands of one tick, the plate's compensated."""
        self._state, commands = update(self._controller, self._state, measured, demand)
        wanted = commands.structure - self._start
        moved = measured.structure_lvdt - self._start
        plate = float(step_linear(self._law, self._memory, wanted, moved))
        self._share = min(self._share + self._more, 1.0)
        moved_to = wanted + self._share * (plate - wanted)
        return commands._replace(structure=moved_to + self._start)
