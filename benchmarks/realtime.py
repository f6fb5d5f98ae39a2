"""Work of a tick on the way to the card, and lateness of a loop in real time.

python -m benchmarks.realtime [--seconds S] [--tests NAME ...]

The reference is a loop that adds up numbers for the same time. It shows the disturbance by the
computer itself.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
from google.protobuf.message import Message

from controllers import Commands
from experiments import EXPERIMENTS
from rigtwin.description.changes import with_changes
from rigtwin.hardware.daq import CARD
from rigtwin.hardware.daq.card import Card
from rigtwin.hardware.daq.table_file import load_table
from rigtwin.hardware.daq.terminals import Terminals
from rigtwin.hardware.daq.virtual import Response, VirtualCard
from rigtwin.hardware.daq.wired import InRealTime, WiredTwin
from rigtwin.hardware.realtime import Pacer, in_real_time
from rigtwin.hardware.session.record import (
    open_virtual_card,
    record_in_real_time,
    record_unpaced,
)
from rigtwin.hardware.session.test import Test
from rigtwin.numerics.arrays import Array
from rigtwin.recording import load

SECONDS = 20.0
TESTS = ("road1.6", "semi-active", "beam-semi-active", "imposed")


class _Taped:
    """Terminals that record what a session reads, and then play it back at no cost."""

    def __init__(self, terminals: Terminals) -> None:
        self._terminals, self._tape, self._place = terminals, [terminals.volts.copy()], 0
        self.volts: Array = terminals.volts.copy()
        self._playing = False

    def advance(self, written: Array, power: bool) -> None:
        self._place += 1
        if not self._playing:
            self._terminals.advance(written, power)
            self._tape.append(self._terminals.volts.copy())
        self.volts[:] = self._tape[min(self._place, len(self._tape) - 1)]

    def rewind(self) -> None:
        self._playing, self._place = True, 0
        self.volts[:] = self._tape[0]


class _Timed:
    """Card that measures the work of every tick.

    The answering time of the virtual card is subtracted; it stands for driver and hardware. Without
    a pacer, ticks follow one another without a pause.
    """

    def __init__(self, card: Card, device: VirtualCard, pacer: Pacer | None) -> None:
        self._card, self._pacer, self.missed, self.late = card, pacer, 0, 0.0
        self.times, self._begun, self._answering = list[float](), 0.0, 0.0
        self._answer = device.answer
        device.answer = self._timed  # type: ignore[method-assign]

    def _timed(self, call: str, request: Message, response: Response) -> Message:
        begun = perf_counter()
        try:
            return self._answer(call, request, response)
        finally:
            self._answering += perf_counter() - begun

    def start(self) -> None:
        self._card.start()

    def read(self) -> tuple[float, ...]:
        self.times.append(perf_counter() - self._begun - self._answering)
        if self._pacer is not None:
            self.missed, self.late = self._pacer.wait(), self._pacer.late
        self._answering, self._begun = 0.0, perf_counter()
        return self._card.read()

    def write(self, commands: Commands) -> None:
        self._card.write(commands)

    def power(self, on: bool) -> None:
        self._card.power(on)

    def stop(self) -> None:
        self._card.stop()


def idle(work: float, period: float, seconds: float, paced: bool) -> Array:
    """Return the time of every tick of a loop that adds up numbers for about `work`, s."""
    numbers = [float(number) for number in range(50_000)]
    begun = perf_counter()
    for _ in range(200):
        sum(numbers)
    numbers = numbers[: max(1, round(len(numbers) * work / ((perf_counter() - begun) / 200.0)))]
    pacer, times = Pacer(period), []
    with in_real_time(fifo=paced):
        for _ in range(round(seconds / period)):
            if paced:
                pacer.wait()
            begun = perf_counter()
            sum(numbers)
            times.append(perf_counter() - begun)
    return np.array(times[400:])


def _test(name: str, seconds: float) -> Test:
    """Return a test that tolerates missed ticks.

    Without real-time scheduling a shared computer may delay a loop for longer than a rig tolerates;
    here nothing moves.
    """
    experiment = EXPERIMENTS[name]
    configuration = with_changes(
        experiment.configuration, {"timing": {"duration": seconds}, "safety": {"missed": 1e5}}
    )
    return Test(name, configuration, experiment.demands(configuration, 0), 0, load_table(CARD))


def compute(name: str, folder: Path, paced: bool, seconds: float = SECONDS) -> Array:
    """Return the time of every tick of a test on the virtual card, s.

    It covers the driver's client, conversion, limits, controller and recording, without twin and
    card. With `paced` there is one tick per period, with a cold cache as on the rig.
    """
    test = _test(name, seconds)
    tape = _Taped(test.terminals())
    card, _ = open_virtual_card(test, tape)
    record_unpaced(card, test, folder / "tape.mcap")
    tape.rewind()
    card, device = open_virtual_card(test, tape)
    timed = _Timed(card, device, Pacer(test.configuration.timing.period) if paced else None)
    # The kernel stops a FIFO loop without pauses for 50 ms of every second.
    ended = record_in_real_time(
        timed, test, folder / "timed.mcap", lambda: None, guarded=False, fifo=paced
    )
    if ended.cause.name != "completed":
        sys.exit(f"{name} ended after {ended.ticks} ticks: {ended.cause.reason}")
    # The first ticks run with cold caches and uncompiled imports.
    return np.array(timed.times[400:])


def late(fifo: bool, folder: Path) -> dict[str, str]:
    """Return the lateness of the twin in real time, with or without FIFO scheduling."""
    test = _test("road1.6", SECONDS)
    twin = InRealTime(WiredTwin(test.terminals(), test.table), test.configuration.timing.period)
    path = folder / f"{fifo}.mcap"
    record_in_real_time(twin, test, path, lambda: None, guarded=False, fifo=fifo)
    return dict(load(path).lateness)


def _show(name: str, times: Array, paced: bool) -> None:
    """Print the percentiles of some times, us."""
    figures = 1e6 * np.array([*np.percentile(times, [50, 99, 99.9]), times.max()])
    how = "one a ms" if paced else "without a pause"
    print(f"{name:16s} {how:16s} " + " ".join(f"{value:7.1f}" for value in figures), flush=True)


def main() -> None:
    """Print the work of a tick, and the lateness of a loop."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of each loop")
    parser.add_argument("--tests", nargs="+", default=TESTS, metavar="NAME")
    parsed = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print("work of a tick on the way to the card and back, us (period 1000 us)")
        print("test             ticks             median   99 %  99.9 %   most")
        for test in parsed.tests:
            for paced in (True, False):
                times = compute(test, folder, paced, parsed.seconds)
                _show(test, times, paced)
                alone = idle(float(np.median(times)), 1e-3, parsed.seconds, paced)
                _show("  nothing", alone, paced)
        print("\nlateness of the twin in real time, us")
        print("scheduling    median  99.9 %    most  missed of 20 000")
        for fifo in (True, False):
            lateness = late(fifo, folder)
            figures = (1e6 * float(lateness[f"late_{key}"]) for key in ("median", "999", "max"))
            print(
                f"{'FIFO' if fifo else 'default':12s} "
                + " ".join(f"{value:7.1f}" for value in figures)
                + f"  {lateness['missed']}"
            )
            print(f"  {lateness['scheduling']}\n  {lateness['histogram']}")


if __name__ == "__main__":
    main()
