"""Channel table: the line of each signal on the card, and the meaning of a volt on that line.

There is one TOML file per card. Inputs and outputs convert by the same equation,

    value = sign · scale · volts + offset.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from typing import Annotated, NamedTuple

from controllers.quantity import Quantity
from rigtwin.description.settings import Safety
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.signals import RIG, Signals

OUTPUTS = tuple(signal.name for signal in RIG.outputs)
"""Commands of the rig that go to the card, in the order in which they are written."""
HEADROOM = 1.05
"""Factor by which a line's range must exceed the signal's limit. A signal that saturates at its
limit could never be seen to exceed it."""
OLDEST = 10 * 365
"""Age in days above which a calibration is refused."""


class LineScaling(NamedTuple):
    """Meaning of a volt on a line."""

    scale: Annotated[float, Quantity("unit/V", 1e-9, 1e9, "calibration")]
    offset: Annotated[float, Quantity("unit", -1e6, 1e6, "calibration")] = 0.0
    sign: Annotated[float, Quantity("1", -1.0, 1.0, "which way the cable is connected")] = 1.0
    range: Annotated[float, Quantity("V", 0.05, 10.0, "of the card's line, both ways")] = 10.0


class Plausible(NamedTuple):
    """Limits of what working sensors of the suspension rig can show together.

    See rigtwin.simulation.safety. `stuck` counts equal readings in a row. The largest values on
    the twin in all experiments are 4 readings, 9.5 mm and 34 N.
    """

    stuck: Annotated[
        float, Quantity("tick", 3.0, 1e9, "by chance in none of 1800 simulated tests of 45 s")
    ] = 7.0
    wheel: Annotated[
        float, Quantity("m", 1e-4, 1e9, "twice what the tyre gives in the experiments")
    ] = 0.02
    motor: Annotated[
        float, Quantity("N", 1.0, 1e9, "3 times friction, hum and noise in the experiments")
    ] = 100.0


class StuckLimit(NamedTuple):
    """Limit of what working sensors of a described machine can show.

    `stuck` counts equal readings in a row; 0 where a working sensor may repeat itself.
    """

    stuck: Annotated[
        float, Quantity("tick", 0.0, 1e9, "of readings after the card's conversion")
    ] = 0.0


class CardLine(NamedTuple):
    """Line of the card, and the machine's signal on it.

    Attributes
    ----------
    name
        Name of the signal.
    line
        Name of the line in the driver, without the device's name.
    unit
        Unit of the signal.
    scaling
        Meaning of a volt.
    sign_checked
        Whether an operator has seen the signal move in the right direction.
    """

    name: str
    line: str
    unit: str
    scaling: LineScaling
    sign_checked: bool

    @property
    def reach(self) -> float:
        """Largest magnitude, in the signal's unit, that the line can carry in both directions."""
        # An offset shifts the range, so one direction carries less.
        return self.scaling.range * self.scaling.scale - abs(self.scaling.offset)


@dataclass(frozen=True)
class ChannelTable:
    """Channel table of a card.

    Parameters
    ----------
    inputs, outputs : tuple of CardLine
        Lines in the order of the machine's signals.
    power : str
        Digital line that enables the actuators' power while high; on the suspension rig, the
        hydraulic pressure.
    plausible : Plausible or StuckLimit
        Limits of what working sensors can show.
    device : str
        Name of the card in the driver.
    address : str
        Address of a gRPC device server; empty for this computer's driver.
    timing : str
        `hardware` or `software`: the clock that the inputs follow.
    calibrated, operator, note : str
        Date, author and remark of the calibration.
    signals : Signals
        Signals of the machine on the card.
    """

    inputs: tuple[CardLine, ...]
    outputs: tuple[CardLine, ...]
    power: str
    plausible: Plausible | StuckLimit
    device: str = "Dev1"
    address: str = ""
    timing: str = "hardware"
    calibrated: str = ""
    operator: str = ""
    note: str = ""
    signals: Signals = RIG

    @property
    def lines(self) -> tuple[CardLine, ...]:
        """All lines, inputs first."""
        return self.inputs + self.outputs

    def physical(self, line: str) -> str:
        """Return the driver's full name of a line."""
        return f"{self.device}/{line}"

    def tighten(self, safety: Safety) -> Safety:
        """Return the limits, tightened by the table's limits on plausibility."""
        # The fields of Plausible have the names of the limits in Safety that they tighten.
        return safety._replace(
            **{
                name: min(value, getattr(safety, name))
                for name, value in self.plausible._asdict().items()
            }
        )


def require_ranges(table: ChannelTable, safety: Safety) -> None:
    """Raise RigtwinError unless every line can carry its signal up to the rig's limit."""
    require_reach(
        table,
        {
            "ground_lvdt": ("safety.ground", safety.ground),
            "structure_lvdt": ("safety.structure", safety.structure),
            "suspension_lvdt": ("safety.travel", safety.travel),
            "load_cell": ("safety.force", safety.force),
            "ground": ("safety.ground", safety.ground),
            "structure": ("safety.structure", safety.structure),
        },
    )


def require_reach(table: ChannelTable, limits: Mapping[str, tuple[str, float]]) -> None:
    """Raise RigtwinError unless every line can carry its signal up to a limit.

    Parameters
    ----------
    table
        Channel table.
    limits
        Signal → name and magnitude of its limit, in the signal's unit.
    """
    inputs = [line.name for line in table.inputs]
    for line in table.lines:
        key, limit = limits.get(line.name, ("", 0.0))
        # An input must show that a limit is exceeded; an output must only reach it.
        if line.reach < HEADROOM * limit and line.name in inputs:
            raise RigtwinError(
                f"range too small for the limit: {line.name} on {line.line} reads up to "
                f"{line.reach:.4g} {line.unit}, {key} is {limit:g} {line.unit}; expected at least "
                f"{HEADROOM:g} times that, or a smaller limit"
            )
        if line.reach < limit:
            raise RigtwinError(
                f"range too small for the limit: {line.name} on {line.line} commands up to "
                f"{line.reach:.4g} {line.unit}, {key} is {limit:g} {line.unit}"
            )


def list_doubts(table: ChannelTable, today: date) -> list[str]:
    """Return the reasons why this table must not move a real machine, one per line.

    A table is trusted if every sign was checked, and it states when and by whom it was calibrated.
    """
    doubts: list[str] = []
    unchecked = [line.name for line in table.lines if not line.sign_checked]
    if unchecked:
        how = (
            "rigtwin card check moves each a little and looks"
            if table.signals == RIG
            else "move each a little, and say sign_checked = true once it goes the right way"
        )
        doubts.append(f"sign not checked: {', '.join(unchecked)}; {how}")
    entry = f"card.calibrated = {table.calibrated!r}"
    try:
        calibrated = date.fromisoformat(table.calibrated)
    except ValueError:
        doubts.append(f"{entry}: expected the date of calibration, 2026-01-31")
    else:
        entry = f"card.calibrated = {table.calibrated}"
        if calibrated > today:
            doubts.append(f"{entry}: that is after today, {today}")
        if (today - calibrated).days > OLDEST:
            doubts.append(
                f"{entry}: that is more than {OLDEST // 365} years ago; calibrate it anew"
            )
    if not table.operator.strip():
        doubts.append("card.operator is missing: expected who calibrated it")
    return doubts


def require_trust(table: ChannelTable, today: date) -> None:
    """Raise RigtwinError unless the table may move a real machine (see `list_doubts`)."""
    # The first doubt alone is raised, because an error is one line.
    for doubt in list_doubts(table, today):
        raise RigtwinError(doubt)
