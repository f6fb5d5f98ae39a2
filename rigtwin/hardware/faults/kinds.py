"""Kinds of fault: what breaks, where, and which causes name it correctly."""

from __future__ import annotations

from dataclasses import dataclass

SIGNALS = ("ground_lvdt", "structure_lvdt", "suspension_lvdt", "load_cell")
# A broken sensor first shows as a contradiction to another; which one depends on the motion.
_IMPLAUSIBLE = (
    "jump",
    "wheel",
    "motor",
    "following",
    "structure",
    "travel",
    "ground",
    "force",
    "velocity",
)


@dataclass(frozen=True)
class FaultKind:
    """Kind of fault.

    Parameters
    ----------
    name : str
        Name of the kind.
    place : str
        Place: sensor, actuator, controller, loop, card, recording, operator or process.
    meaning : str
        Description of what breaks.
    causes : tuple of str
        Names of the supervisor's causes that are correct.
    everywhere : bool
        Whether the fault shows at once, whatever the rig does.
    """

    name: str
    place: str
    meaning: str
    causes: tuple[str, ...]
    everywhere: bool = True


KINDS = (
    FaultKind(
        "dropout", "sensor", "reads 0 V from then on", ("stuck", *_IMPLAUSIBLE), everywhere=False
    ),
    # A load cell may be off the force of the motor's voltage by its limit before its readings have
    # repeated often enough, or while they change by less than a jump.
    FaultKind("stuck", "sensor", "repeats its last reading", ("stuck", "motor"), everywhere=False),
    FaultKind("spike", "sensor", "one reading off by 10 to 90 % of its range", ("jump", "motor")),
    FaultKind("not a number", "sensor", "the driver gives NaN", ("not_a_number",)),
    FaultKind(
        "wrong sign",
        "sensor",
        "wires swapped",
        ("jump", "wheel", "motor", "following"),
        everywhere=False,
    ),
    FaultKind("gain x10", "sensor", "reads ten times as much", _IMPLAUSIBLE, everywhere=False),
    FaultKind("step", "sensor", "reads 20 % of its range too much", ("jump", "motor")),
    FaultKind("open input", "sensor", "reads anything within its range", ("jump", "motor")),
    FaultKind(
        "amplifier dead",
        "actuator",
        "the motor makes no force",
        ("motor", "following"),
        everywhere=False,
    ),
    FaultKind(
        "valve stuck",
        "actuator",
        "a cylinder stays where it is",
        ("following", "wheel"),
        everywhere=False,
    ),
    FaultKind(
        "valve open",
        "actuator",
        "a cylinder runs away",
        ("following", "structure", "ground", "travel", "wheel"),
        everywhere=False,
    ),
    FaultKind("controller exception", "controller", "it raises an exception", ("controller",)),
    FaultKind("command not a number", "controller", "it commands NaN", ("not_a_number",)),
    FaultKind("command jumps", "controller", "it commands a step", ("command_rate", "command")),
    FaultKind("slow tick", "loop", "a tick takes 4 periods", ("late",)),
    FaultKind("output refused", "card", "a write fails once", ("card",)),
    FaultKind("card disconnected", "card", "its cable is pulled", ("card",)),
    FaultKind(
        "full disk",
        "recording",
        "no more can be written; seen at the next block",
        ("recording",),
        everywhere=False,
    ),
    FaultKind("operator's signal", "operator", "SIGINT, SIGTERM or SIGHUP", ("operator",)),
    FaultKind("operator's file", "operator", "the stop file appears", ("operator",)),
    FaultKind("process killed", "process", "kill -9", ("process",)),
    FaultKind("process frozen", "process", "SIGSTOP", ("process",)),
    FaultKind("controller hangs", "process", "a tick never ends", ("process",)),
)
"""All kinds. Faults of a process need two processes with a card in between; all others run in one
process."""
