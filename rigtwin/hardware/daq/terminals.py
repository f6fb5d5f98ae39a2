"""The twin as it looks at a card's terminals.

Voltages in, voltages out, and the hydraulics' pressure.
"""

from __future__ import annotations

import numpy as np

from controllers import Measurements
from controllers.compiled import compilable
from rigtwin.components import RigPlant
from rigtwin.description.configuration import Configuration
from rigtwin.hardware.daq.conversion import (
    Conversion,
    conversion,
    digitise,
    values_of,
    volts_of,
)
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.simulation.converters import Sensing, sample_sensors, sensors
from rigtwin.simulation.plant import PlantState, advance, sense
from rigtwin.simulation.twin import Twin

AHEAD = 256
"""Ticks for which noise is drawn at a time."""


def without_bits(plant: RigPlant) -> RigPlant:
    """The plant with sensors that have no bits: those are the card's."""
    names = Measurements._fields
    return plant._replace(
        **{
            name: sensor._replace(resolution=0.0)
            for name, sensor in zip(names, sensors(plant), strict=True)
        }
    )


@compilable
def _sample(
    plant: PlantState,
    sensing: Sensing,
    disturbance: Array,
    inputs: Conversion,
    truth: Array,
    volts: Array,
) -> None:
    true = sense(plant)
    measured = sample_sensors(sensing, true, disturbance)
    for column in range(4):
        truth[column], volts[column] = true[column], measured[column]
    volts_of(inputs, volts, volts)
    digitise(inputs, volts, volts)


@kernel
def _advance(
    plant: PlantState,
    sensing: Sensing,
    disturbance: Array,
    inputs: Conversion,
    outputs: Conversion,
    written: Array,
    asked: Array,
    truth: Array,
    volts: Array,
) -> None:
    digitise(outputs, written, asked)
    values_of(outputs, asked, asked)
    advance(plant, asked[0], asked[1], asked[2])
    _sample(plant, sensing, disturbance, inputs, truth, volts)


_first_sample = kernel(_sample)


class Terminals:
    """A rig at rest, cylinders at zero, no pressure.

    `wiring` says what a volt truly means on each line, whatever the table of who reads it says.
    Without pressure the cylinders stay where they are.

    truth: last measurements without noise, before the wiring, shape (4,). asked: what the
    actuators make of the voltages, shape (3,), in the order of the table's outputs. volts: at the
    inputs now, as 16 bits hold them, shape (4,).
    """

    def __init__(self, configuration: Configuration, wiring: ChannelTable, seed: int) -> None:
        rest = configuration.controller._replace(start=0.0, preload=0.0)
        twin = Twin(
            configuration._replace(plant=without_bits(configuration.plant), controller=rest),
            0.0,
            seed,
        )
        self._twin, self._live = twin, twin.simulation.state
        self._dead = self._live._replace(
            ground=self._live.ground._replace(step=0.0),
            structure=self._live.structure._replace(step=0.0),
        )
        self._inputs, self._outputs = conversion(wiring.inputs), conversion(wiring.outputs)
        self.truth, self.volts, self.asked = np.zeros(4), np.empty(4), np.zeros(3)
        self._noise, self._place = twin.disturbance.take(AHEAD), 0
        _first_sample(
            self._live, twin.sensing, self._noise[0], self._inputs, self.truth, self.volts
        )

    def advance(self, written: Array, power: bool) -> None:
        """One period under voltages that the outputs hold, shape (3,), then the next sample."""
        self._place += 1
        if self._place == AHEAD:
            self._noise, self._place = self._twin.disturbance.take(AHEAD), 0
        _advance(
            plant=self._live if power else self._dead,
            sensing=self._twin.sensing,
            disturbance=self._noise[self._place],
            inputs=self._inputs,
            outputs=self._outputs,
            written=written,
            asked=self.asked,
            truth=self.truth,
            volts=self.volts,
        )
