"""The computer that runs the controller, and the mains that all sensors pick up."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from rigtwin.components.effect import Kind
from rigtwin.components.quantity import Quantity


class Computer(NamedTuple):
    """Computer that runs the controller."""

    # Share of ticks at which the outputs keep their values, and delay of all commands.
    missed_ticks: Annotated[
        float, Quantity("1", 0.0, 0.5, "0: real-time computer; a share of all ticks")
    ] = 0.0
    delay: Annotated[float, Quantity("s", 0.0, 1.0, "0: no computation delay, assumed")] = 0.0


class Mains(NamedTuple):
    """Mains voltage, whose hum all sensors pick up, with a different phase for each."""

    frequency: Annotated[float, Quantity("Hz", 1.0, 400.0, "mains, thesis §3.4")] = 50.0


KINDS = (
    Kind(
        "missed_ticks",
        "share of missed ticks",
        ("missed_ticks",),
        "share of ticks at which the outputs stay as they are",
        {Computer: None},
    ),
)
