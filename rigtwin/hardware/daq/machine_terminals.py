"""Twin of a described machine as seen at a card's terminals."""

from __future__ import annotations

import numpy as np

from rigtwin.components.sensors import sensor_of, start_transducer, transduce, transducer
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.replay import Row
from rigtwin.hardware.daq.conversion import conversion, to_bits, to_values, to_volts
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.models.demands import list_sensors
from rigtwin.models.forward_twin import begin_live
from rigtwin.models.reading import hum_of, round_reading
from rigtwin.numerics.arrays import Array

AHEAD = 1000
"""Number of ticks whose noise is drawn in one block."""


class MachineTerminals:
    """A described machine at rest in the pose of its MJCF, with the power off.

    Without power nothing moves, because brakes hold the machine. `wiring` is the true meaning of a
    volt on each line, whatever the reader's channel table says.

    Attributes
    ----------
    volts
        Voltages at the inputs, rounded to 16 bits, shape (inputs,).
    """

    def __init__(
        self, machine: Machine, configuration: Configuration, wiring: ChannelTable, seed: int
    ) -> None:
        plant, period = configuration.plant, configuration.timing.period
        rows = []
        for name, kind in list_sensors(machine).items():
            component = machine.components[name]
            assert component.channel is not None
            rows.append(Row(name, kind, component.channel, component.unit))
        self._names, self._plant, self._period = [row.name for row in rows], plant, period
        outputs = [line.name for line in wiring.outputs]
        self._stepped = begin_live(machine, configuration, outputs, rows)
        self._sensors = [sensor_of(plant, name) for name in self._names]
        self._models = [transducer(sensor, period) for sensor in self._sensors]
        self._states = [start_transducer(model) for model in self._models]
        self._inputs, self._outputs = conversion(wiring.inputs), conversion(wiring.outputs)
        # An independent random stream for the sensors: the seed also draws other quantities, which
        # must not get the same numbers.
        self._random, self._place = np.random.default_rng([seed, 3]), AHEAD
        # Each sensor's hum has a random phase of its own.
        self._phases, self._drawn = self._random.uniform(0.0, 2.0 * np.pi, len(rows)), 0
        self._noise: list[Array] = []
        self._written = np.zeros(len(outputs))
        self._values, self.volts = np.zeros(len(rows)), np.zeros(len(rows))
        self._sample()
        # A step of a second twin compiles what a tick needs, so that the first tick is in time.
        self._receive(self._written)
        begin_live(machine, configuration, outputs, rows).step(self._written.tolist())

    def advance(self, written: Array, power: bool) -> None:
        """Advance by one period under held output voltages, shape (outputs,), and sample."""
        # Without power the brakes hold the machine: its state does not advance.
        if power:
            self._receive(written)
            self._stepped.step(self._written.tolist())
        self._sample()

    def _receive(self, written: Array) -> None:
        """Convert output voltages, shape (outputs,), to the actuators' commands."""
        # The actuators receive what the card's 16-bit converter makes of a voltage.
        to_bits(self._outputs, written, self._written)
        to_values(self._outputs, self._written, self._written)

    def _sample(self) -> None:
        """Sample the sensors: noise and hum, transducer, quantisation, conversion to volts."""
        # Noise is drawn in blocks, because one draw per tick would cost more than the step.
        if self._place == AHEAD:
            time = self._period * (self._drawn + np.arange(AHEAD))
            self._noise = [
                sensor.white * self._random.standard_normal(AHEAD)
                + hum_of(self._plant, name, phase, time)
                for name, sensor, phase in zip(
                    self._names, self._sensors, self._phases.tolist(), strict=True
                )
            ]
            self._place, self._drawn = 0, self._drawn + AHEAD
        true = self._stepped.sense()
        for number, name in enumerate(self._names):
            value = transduce(self._models[number], self._states[number], true[name])
            self._values[number] = value + self._noise[number][self._place]
            # A sensor with its own resolution quantises before the card's converter does.
            if self._sensors[number].resolution > 0.0:
                reading = round_reading(self._plant, name, self._values[number : number + 1])
                self._values[number] = reading[0]
        self._place += 1
        to_volts(self._inputs, self._values, self.volts)
        to_bits(self._inputs, self.volts, self.volts)
