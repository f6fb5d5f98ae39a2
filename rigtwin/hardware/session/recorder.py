"""Keeps a session in a recording, in the process that runs it."""

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
class Layout:
    """How the numbers of a tick lie, as a `rigtwin.hardware.supervision.Recorder` gets them: those
    of /session, commands, the tick's number in the test.

    Parameters
    ----------
    session : tuple of str
        Fields of /session.
    topics : dict
        Topic → its fields in a recording, each with the place of its number.
    number : int
        Place of the tick's number.
    outputs : int
        How many are written to the card.
    """

    session: tuple[str, ...]
    topics: Mapping[str, Mapping[str, int]]
    number: int
    outputs: int

    @property
    def row(self) -> int:
        """Numbers of a tick."""
        return self.number + 1

    @property
    def fields(self) -> dict[str, tuple[str, ...]]:
        """Topic → field names, as a `Writer` takes them."""
        return {SESSION: self.session, **{name: tuple(at) for name, at in self.topics.items()}}


def layout_of(signals: Signals, given: Sequence[Channel] = ()) -> Layout:
    """That of a machine. given: what is demanded besides its outputs."""
    inputs, outputs = signals.inputs, signals.outputs
    session = ("time", "phase", *(s.name for s in outputs), signals.power)
    first = len(session)
    session = (*session, *(s.name for s in inputs), "late", "missed")
    topics: dict[str, dict[str, int]] = {}
    if signals == RIG:
        told = [("/command", name) for name in Commands._fields]
    else:
        told = [*(s.channel for s in outputs), *given]
    for place, (topic, name) in enumerate(told):
        topics.setdefault(topic, {})[name] = len(session) + place
    for place, signal in enumerate(inputs):
        topics.setdefault(signal.channel[0], {})[signal.channel[1]] = first + place
    return Layout(session, topics, len(session) + len(told), len(outputs))


RIG_LAYOUT = layout_of(RIG)
assert RIG_LAYOUT.session == topic_fields(SESSION)


class Keeper:
    """A `rigtwin.hardware.supervision.Recorder` that writes block by block.

    What cannot be written is no exception but a `fault`: the rig has to be stopped first.
    """

    def __init__(self, writer: Writer, layout: Layout) -> None:
        self._writer, self._layout = writer, layout
        self.fault: str | None = None
        self._rows, self._kept = np.empty((BLOCK, layout.row)), 0
        self._places = {
            topic.strip("/"): list(fields.values()) for topic, fields in layout.topics.items()
        }

    def tick(self, row: tuple[float, ...]) -> None:
        self._rows[self._kept] = row
        self._kept += 1
        if self._kept == BLOCK:
            self.flush()

    def flush(self) -> None:
        rows = self._rows[: self._kept]
        self._kept = 0
        self.block(rows)

    def block(self, rows: Array) -> None:
        """Consecutive ticks, shape (ticks, numbers)."""
        if self.fault is not None or not len(rows):
            return
        number = self._layout.number
        tested = rows[np.isfinite(rows[:, number])]
        if len(tested):
            topics = {topic: tested[:, places] for topic, places in self._places.items()}
            self._try(lambda: self._writer.append_at(tested[:, number].astype(np.int64), topics))
        session = np.ascontiguousarray(rows[:, : len(self._layout.session)])
        self._try(lambda: self._writer.append_beside(SESSION, session, session[:, 0]))

    def transition(self, transition: Transition) -> None:
        """Also when nothing else can be written any more: the writer has kept room for it."""
        self._try(lambda: self._writer.add_metadata(TRANSITION_RECORD, transition.record()))

    def ready(self) -> None:
        """It is, since the writer is there."""

    def beat(self, outputs: Sequence[float]) -> None:
        """Nobody watches this process."""

    def _try(self, write: Callable[[], None]) -> None:
        try:
            write()
        except RigtwinError as error:
            self.fault = self.fault or str(error)
