"""Recorder of a session in the process that runs it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from controllers import Commands
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.signals import RIG, Channel, Signals
from rigtwin.hardware.supervisor import Transition
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Writer
from rigtwin.recording.channels import topic_fields
from rigtwin.recording.schema import TRANSITION_RECORD
from rigtwin.simulation.loop import BLOCK

SESSION = "/session"


@dataclass(frozen=True)
class TickLayout:
    """Layout of a tick's numbers in the row that a `rigtwin.hardware.supervision.Recorder` gets.

    A row has the fields of /session, the commands, and the tick's number in the test.

    Parameters
    ----------
    session : tuple of str
        Fields of /session.
    topics : dict
        Topic → fields of the recording → index in the row.
    number : int
        Index of the tick's number.
    outputs : int
        Number of outputs on the card.
    """

    session: tuple[str, ...]
    topics: Mapping[str, Mapping[str, int]]
    number: int
    outputs: int

    @property
    def row(self) -> int:
        """Length of a row."""
        return self.number + 1

    @property
    def fields(self) -> dict[str, tuple[str, ...]]:
        """Topic → field names, as a `Writer` takes them."""
        return {SESSION: self.session, **{name: tuple(at) for name, at in self.topics.items()}}


def layout_of(signals: Signals, demanded: Sequence[Channel] = ()) -> TickLayout:
    """Return the layout of a machine; `demanded` are channels that are no outputs of the card."""
    inputs, outputs = signals.inputs, signals.outputs
    session = ("time", "phase", *(s.name for s in outputs), signals.power)
    first = len(session)
    session = (*session, *(s.name for s in inputs), "late", "missed")
    topics: dict[str, dict[str, int]] = {}
    if signals == RIG:
        commands = [("/command", name) for name in Commands._fields]
    else:
        commands = [*(s.channel for s in outputs), *demanded]
    for place, (topic, name) in enumerate(commands):
        topics.setdefault(topic, {})[name] = len(session) + place
    # Sensors are stored once in a row; /session and the sensors' own topics share the numbers.
    for place, signal in enumerate(inputs):
        topics.setdefault(signal.channel[0], {})[signal.channel[1]] = first + place
    return TickLayout(session, topics, len(session) + len(commands), len(outputs))


RIG_LAYOUT = layout_of(RIG)
assert RIG_LAYOUT.session == topic_fields(SESSION)


class SessionRecorder:
    """A `rigtwin.hardware.supervision.Recorder` that writes block by block.

    A failed write is stored as `fault` instead of raised, because the rig must be stopped first.
    """

    def __init__(self, writer: Writer, layout: TickLayout) -> None:
        self._writer, self._layout = writer, layout
        self.fault: str | None = None
        self._rows, self._count = np.empty((BLOCK, layout.row)), 0
        self._places = {
            topic.strip("/"): list(fields.values()) for topic, fields in layout.topics.items()
        }

    def tick(self, row: tuple[float, ...]) -> None:
        self._rows[self._count] = row
        self._count += 1
        if self._count == BLOCK:
            self.flush()

    def flush(self) -> None:
        """Write the ticks that have not filled a block."""
        rows = self._rows[: self._count]
        self._count = 0
        self.block(rows)

    def block(self, rows: Array) -> None:
        """Write consecutive ticks, shape (ticks, numbers)."""
        if self.fault is not None or not len(rows):
            return
        number = self._layout.number
        # Ticks of ramps have no number in the test: only /session contains them.
        tested = rows[np.isfinite(rows[:, number])]
        if len(tested):
            topics = {topic: tested[:, places] for topic, places in self._places.items()}
            # Missed ticks leave gaps in the numbers, which become gaps in the recorded times.
            self._try(lambda: self._writer.append_at(tested[:, number].astype(np.int64), topics))
        session = np.ascontiguousarray(rows[:, : len(self._layout.session)])
        self._try(lambda: self._writer.append_beside(SESSION, session, session[:, 0]))

    def transition(self, transition: Transition) -> None:
        """Write a transition, even on a full disk: the writer has reserved space for it."""
        self._try(lambda: self._writer.add_metadata(TRANSITION_RECORD, transition.record()))

    def ready(self) -> None:
        """Do nothing: the writer is open."""

    def beat(self, outputs: Sequence[float]) -> None:
        """Do nothing: no process watches this one."""

    def _try(self, write: Callable[[], None]) -> None:
        try:
            write()
        except RigtwinError as error:
            self.fault = self.fault or str(error)
