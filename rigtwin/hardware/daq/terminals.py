"""Twin of the suspension rig as seen at a card's terminals: voltages and hydraulic pressure."""

from __future__ import annotations

import numpy as np

from controllers import Measurements
from controllers.compiled import compilable
from rigtwin.components import RigPlant
from rigtwin.description.configuration import Configuration
from rigtwin.hardware.daq.conversion import Conversion, conversion, digitise, values_of, volts_of
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.simulation.converters import Sensing, sample_sensors, sensors
from rigtwin.simulation.plant import PlantState, advance, sense
from rigtwin.simulation.twin import Twin

AHEAD = 256
"""Number of ticks whose noise is drawn in one block."""


def without_bits(plant: RigPlant) -> RigPlant:
    """Return the plant with sensors of infinite resolution; the card's converter quantises."""
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
    # Order of the signal chain: truth, transducer with noise, voltage, 16-bit code.
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
    # The card's converter quantises the outputs too, before the actuators see them.
    digitise(outputs, written, asked)
    values_of(outputs, asked, asked)
    advance(plant, asked[0], asked[1], asked[2])
    _sample(plant, sensing, disturbance, inputs, truth, volts)


_first_sample = kernel(_sample)


class Terminals:
    """The suspension rig at rest, with its cylinders at zero and without pressure.

    `wiring` is the true meaning of a volt on each line, whatever the reader's channel table says.
    Without pressure the cylinders stay where they are.

    Attributes
    ----------
    truth
        Last measurements without noise, before conversion to volts, shape (4,).
    asked
        Commands the actuators receive, shape (3,), in the order of the table's outputs.
    volts
        Voltages at the inputs, rounded to 16 bits, shape (4,).
    """

    def __init__(self, configuration: Configuration, wiring: ChannelTable, seed: int) -> None:
        # Without pressure the rig stands at zero, wherever the test will start.
        rest = configuration.controller._replace(start=0.0, preload=0.0)
        twin = Twin(
            configuration._replace(plant=without_bits(configuration.plant), controller=rest),
            0.0,
            seed,
        )
        self._twin, self._live = twin, twin.simulation.state
        # Without pressure a cylinder does not move: a step of 0 freezes its filter.
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
        """Advance by one period under held output voltages, shape (3,), and sample."""
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
