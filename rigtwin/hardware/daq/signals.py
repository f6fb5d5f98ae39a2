"""Signals between a machine and a card: sensors, commands, and the safe state of each output."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from controllers import Commands, Measurements
from rigtwin.components import ForceActuator
from rigtwin.description.configuration import Configuration
from rigtwin.description.limits import HIGH, LOW
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.models.demands import list_movers, list_pushers, list_sensors
from rigtwin.recording.channels import CHANNELS

Channel = tuple[str, str]
"""Topic and field of a recording."""
RESERVED = ("time", "phase", "enable", "late", "missed")
"""Names of a session's own fields, which no component may have."""


def as_tuple(*values: float) -> tuple[float, ...]:
    """Return the values of a sample or a command as a tuple."""
    return values


@dataclass(frozen=True)
class Signal:
    """Signal on a card.

    Attributes
    ----------
    name
        Name in the channel table.
    channel
        Channel in a recording.
    unit
        Unit of the value.
    """

    name: str
    channel: Channel
    unit: str


@dataclass(frozen=True)
class Signals:
    """Signals of a machine.

    Parameters
    ----------
    inputs, outputs : tuple of Signal
        Sensors and commands, in the order in which the card reads and writes them.
    power : str
        Name of the digital line that enables the actuators' power while high.
    released : tuple of bool
        Whether the safe state of each output is zero, as for a force; otherwise it is held.
    written : tuple of int
        Index of each output in the controller's commands.
    sample, commands : callable
        Functions that form a sample, and commands, from values.
    """

    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    power: str
    released: tuple[bool, ...]
    written: tuple[int, ...]
    sample: Callable[..., tuple[float, ...]] = field(default=as_tuple, compare=False)
    commands: Callable[..., tuple[float, ...]] = field(default=as_tuple, compare=False)

    @property
    def released_places(self) -> list[int]:
        """Indices of the outputs whose safe state is zero."""
        return [place for place, released in enumerate(self.released) if released]

    def to_write(self, commands: tuple[float, ...]) -> list[float]:
        """Return the value of each output from the controller's commands."""
        return [commands[place] for place in self.written]

    def stop_state(self, outputs: list[float]) -> list[float]:
        """Return the safe state that follows these values of the outputs."""
        return [
            0.0 if released else value
            for released, value in zip(self.released, outputs, strict=True)
        ]


UNITS = {(channel.topic, channel.name): channel.unit for channel in CHANNELS}
_WRITTEN = ("ground", "structure", "voltage")
RIG = Signals(
    inputs=tuple(
        Signal(name, ("/sensor", name), UNITS["/sensor", name]) for name in Measurements._fields
    ),
    outputs=tuple(Signal(name, ("/command", name), UNITS["/command", name]) for name in _WRITTEN),
    power="pressure",
    released=(False, False, True),
    written=tuple(Commands._fields.index(name) for name in _WRITTEN),
    sample=Measurements,
    commands=Commands,
)
"""Signals of the suspension rig. The demanded force is internal to the controller."""


def signals_of(machine: Machine) -> Signals:
    """Return the signals of a described machine.

    Parameters
    ----------
    machine
        Machine whose signals are wanted.

    Returns
    -------
    Signals
        Sensors and actuators under their components' names.

    Raises
    ------
    RigtwinError
        If a joint's motion is prescribed by a sensor or position actuator, which a card cannot
        command, or if nothing can be commanded.
    """
    movers, pushers, components = list_movers(machine), list_pushers(machine), machine.components
    # A prescribed motion is an input of the model, which no output of a card can impose.
    if prescribed := [name for name in movers if name not in pushers]:
        raise RigtwinError(
            f"{machine.name}: {prescribed[0]} prescribes a motion, which a card cannot command; "
            "expected force actuators and servos alone"
        )
    if not pushers:
        raise RigtwinError(
            f"{machine.name}: nothing to command; expected at least one force actuator or servo"
        )
    sensors = list_sensors(machine)
    # Components share /session with the session's own fields.
    for name in (*sensors, *pushers):
        if name in RESERVED:
            raise RigtwinError(
                f"{machine.name}: a component called {name} cannot be on a card; "
                f"these names are a session's own: {', '.join(RESERVED)}"
            )

    def signal(name: str, channel: Channel | None) -> Signal:
        assert channel is not None
        return Signal(name, channel, components[name].unit or "1")

    return Signals(
        inputs=tuple(signal(name, components[name].channel) for name in sensors),
        outputs=tuple(signal(name, channel) for name, channel in pushers.items()),
        power="enable",
        # A force without a controller is safe at zero; a servo is safe where it stands.
        released=tuple(components[n].component_type is ForceActuator for n in pushers),
        written=tuple(range(len(pushers))),
    )


def reach_of(configuration: Configuration, name: str) -> tuple[float, float]:
    """Return the limits of a described machine's sensor or actuator, infinite without a limit."""
    limits = configuration.safety._asdict()
    return limits.get(name + LOW, -math.inf), limits.get(name + HIGH, math.inf)
