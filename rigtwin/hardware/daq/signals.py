"""What of a machine is connected to a card: what it senses, what is commanded, and what is safe."""

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
"""Topic and field."""
RESERVED = ("time", "phase", "enable", "late", "missed")
"""Fields of a session's own topic."""


def sample_of(*values: float) -> tuple[float, ...]:
    """What was read, or is to be written."""
    return values


@dataclass(frozen=True)
class Signal:
    """name: in the channel table; channel: in a recording; unit: of its value."""

    name: str
    channel: Channel
    unit: str


@dataclass(frozen=True)
class Signals:
    """A machine's.

    Parameters
    ----------
    inputs, outputs : tuple of Signal
        In the order of what is read, and of what is written.
    power : str
        What the digital line is called that lets the actuators have power while high.
    released : tuple of bool
        Of each output, whether its safe state is zero, a force, or where it stands.
    written : tuple of int
        Of each output, its place among a controller's commands.
    sample, commands : callable
        What makes a sample of the inputs' values, and commands of theirs.
    """

    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    power: str
    released: tuple[bool, ...]
    written: tuple[int, ...]
    sample: Callable[..., tuple[float, ...]] = field(default=sample_of, compare=False)
    commands: Callable[..., tuple[float, ...]] = field(default=sample_of, compare=False)

    @property
    def released_places(self) -> list[int]:
        """Outputs whose safe state is zero."""
        return [place for place, released in enumerate(self.released) if released]

    def to_write(self, commands: tuple[float, ...]) -> list[float]:
        """Of each output, its value among commands."""
        return [commands[place] for place in self.written]

    def stop_state(self, outputs: list[float]) -> list[float]:
        """The outputs' safe state after these values."""
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
"""The suspension rig's. The force demanded stays inside the controller."""


def signals_of(machine: Machine) -> Signals:
    """A described machine's.

    Parameters
    ----------
    machine
        Its description.

    Returns
    -------
    Signals
        Its sensors and its actuators, by their components' names.

    Raises
    ------
    RigtwinError
        If it has joints that no actuator pushes, but a sensor or a position actuator prescribes.
    """
    movers, pushers, components = list_movers(machine), list_pushers(machine), machine.components
    if prescribed := [name for name in movers if name not in pushers]:
        raise RigtwinError(
            f"{machine.name}: {prescribed[0]} prescribes a motion, which a card cannot command; "
            "expected force actuators and servos alone"
        )
    if not pushers:
        raise RigtwinError(f"{machine.name}: nothing of it can be commanded")
    sensors = list_sensors(machine)
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
        released=tuple(isinstance(getattr(machine.plant, n), ForceActuator) for n in pushers),
        written=tuple(range(len(pushers))),
    )


def reach_of(configuration: Configuration, name: str) -> tuple[float, float]:
    """The limits of a described machine's sensor or actuator, infinite where it has none."""
    told = configuration.safety._asdict()
    return told.get(name + LOW, -math.inf), told.get(name + HIGH, math.inf)
