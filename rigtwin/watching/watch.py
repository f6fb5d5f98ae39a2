"""Watch: compares a running test with its twin, stretch by stretch."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.data_checks import require_fit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.unit_checks import channels
from rigtwin.errors import RigtwinError
from rigtwin.recording import RecordedTest
from rigtwin.signals.noise import white_noise
from rigtwin.watching.alarm import Alarm
from rigtwin.watching.cusum import Cusum
from rigtwin.watching.gap import BANDS, GapTrace, find_gap, ratio
from rigtwin.watching.mending import mend
from rigtwin.watching.suspects import find_suspects

WINDOW = 20.0
"""Length of the window that is predicted anew each time, in s."""
WARM = 4.0
"""Time at a window's start that is not judged, in s, because the twin must first forget its initial
state. Where dry friction holds the rig after the ramp to a test is not exactly known."""
SHORTEST = 2.0
"""Length from which a test is judged, in s."""
STEP = 0.5
"""Time between two judgements, in s."""
BLOCK = 0.25
"""Length of a block of the CUSUM, in s."""
HELD_BACK = 0.25
"""Time at a window's end that is left to the next judgement, in s, if signals are limited to a
band: the filter needs what follows."""
LIMIT = 20.0
"""Limit of each CUSUM. If blocks were independent and normal, one would exceed it by chance once in
exp(20) blocks, which is four thousand years."""
KICK = 0.5
"""Relative change of the commands at a window's start, which tests whether the twin forgets its
initial state."""
SAME = 0.5
"""Allowed difference of such predictions, relative to the accuracy a signal is compared with."""
STEPS = 4
"""Number of integration steps per tick."""
SEEN = 3.0
"""Length of a gap from which suspects are searched, in s."""
SETTLED = 1.0
"""Length at a gap's beginning that suspects are not fitted to, in s: its onset is uncertain."""
LOOKED = 1.5
"""Factor by which a gap must have grown before suspects are searched again."""


class Watch:
    """Comparison of a test with its twin, which is updated with what was recorded so far.

    Attributes
    ----------
    alarm
        Gap that was detected; None so far.
    gap, recording
        Last judged stretch and its recording; None until there is enough.
    ratios
        RMS of each signal's residual in the last stretch, in units of what noise and tolerances
        explain.
    note
        Why the last stretch could not be judged; empty if it was.
    judged
        Time up to which the test is judged, in s.
    seconds
        Total time in which something could be judged, in s.
    highest
        Maximum of the level so far.
    """

    def __init__(self, machine: Machine, base: Configuration | None = None) -> None:
        """Watch a test of a machine. `base` is the twin; it defaults to the described one."""
        self.machine = machine
        self._base = base
        self._cusums: list[list[Cusum]] = []
        self._start, self._looked = math.nan, 0.0
        self.alarm: Alarm | None = None
        self.gap: GapTrace | None = None
        self.ratios: dict[str, float] = {}
        self.note, self.judged = "", -math.inf
        self.recording: RecordedTest | None = None
        self.highest = self.seconds = 0.0

    @property
    def level(self) -> float:
        """Distance to an alarm: the largest CUSUM in units of its limit."""
        return max((cusum.value for row in self._cusums for cusum in row), default=0.0) / LIMIT

    def take(self, recording: RecordedTest, *, last: bool = False) -> bool:
        """Judge what is new of a test.

        Parameters
        ----------
        recording
            Recording so far: its last `WINDOW` seconds, or all.
        last
            Whether the test has ended.

        Returns
        -------
        bool
            Whether enough was new to be judged.

        Raises
        ------
        RigtwinError
            If the recording is of another machine or lacks a channel.
        """
        if not self._cusums:
            self._require_channels(recording)
            self._start = self.judged = float(recording.time[0])
            names = [row.name for row in self.machine.rows]
            self._cusums = [[Cusum(self._start) for _ in BANDS] for _ in names]
        end = float(recording.time[-1])
        if end - self._start < SHORTEST or (end - self.judged < STEP and not last):
            return False
        window, recorded = mend(recording.between(end - WINDOW, math.inf))
        try:
            evidence = self._evidence(window, recorded)
        except RigtwinError as error:
            self.note = str(error)
            return False
        self.note = ""
        self.recording, self.gap = window, find_gap(evidence)
        gap = self.gap
        # At the end of a test nothing follows, so everything is judged.
        # A model with an infinite band has no filter, so nothing has to wait.
        held = 0.0 if last or math.isinf(evidence.models[0].band) else HELD_BACK
        first, stop = np.searchsorted(gap.time, [self.judged, end - held])
        new = slice(int(first), max(int(stop), int(first)))
        if new.start == new.stop:
            return False
        names = evidence.names
        self.ratios = dict(zip(names, ratio(gap, new).tolist(), strict=True))
        self._judge(gap, new, names, end)
        # The share of ticks at which at least one signal was judged.
        seen = float(np.mean(gap.counts[:, new].any(axis=0)))
        until = float(gap.time[new.stop - 1]) + evidence.lines[0].period
        self.seconds += seen * (until - self.judged)
        self.judged = until
        self.highest = max(self.highest, self.level)
        return True

    def _require_channels(self, recording: RecordedTest) -> None:
        """Raise RigtwinError if the recording is of another machine or lacks a channel."""
        if recording.machine != self.machine.name:
            raise RigtwinError(
                f"{recording.path}: it is of machine {recording.machine!r}; this twin is "
                f"{self.machine.name!r}"
            )
        for topic, name in channels(self.machine):
            recording.column(topic, name)

    def _evidence(self, window: RecordedTest, counts: NDArray[np.bool_]) -> Evidence:
        """Return the evidence of a window; only the given ticks count, once the twin is settled."""
        configuration = self.machine.configuration_of(window, self._base)
        require_fit(self.machine, window, configuration)
        counted = counts.astype(float)
        # A test that began at rest without a ramp starts as the twin does; nothing needs to be
        # forgotten.
        if window.transitions or window.time[0] > self._start + 0.5 * window.period:
            counted[~self._has_forgotten(window, configuration)] = 0.0
        return Evidence(self.machine, [window], [configuration], [counted])

    def _has_forgotten(
        self, window: RecordedTest, configuration: Configuration
    ) -> NDArray[np.bool_]:
        """Return the ticks whose prediction does not depend on the initial state, shape (ticks,).

        The commands at the window's start are changed, and the predictions compared. They never
        converge where dry friction holds a joint that stands still.
        """
        known = window.time >= window.time[0] + WARM
        plant = configuration.plant
        model = self.machine.physics.model(self.machine, window.inputs, configuration, STEPS)
        predicted = model.predict(plant)
        measured = [window.column(*row.channel) for row in self.machine.rows]
        held = [
            max(white_noise(signal), self.machine.form_of(row) * float(np.std(signal)))
            for row, signal in zip(self.machine.rows, measured, strict=True)
        ]
        for share in (-KICK, KICK):
            kicked = self.machine.physics.model(
                self.machine, _kick(window, share).inputs, configuration, STEPS
            )
            # A diverged twin predicts infinities, whose difference is NaN and never converges.
            with np.errstate(invalid="ignore"):
                difference = np.abs(kicked.predict(plant) - predicted)
            # A tick counts only if all signals have converged, as they act on each other.
            converged = np.all(difference <= SAME * np.array(held)[:, None], axis=0)
            # The model may predict every n-th tick only.
            known &= np.repeat(converged, model.every)[: window.ticks]
        return known

    def _judge(self, gap: GapTrace, new: slice, names: list[str], end: float) -> None:
        """Add the new stretch to the CUSUMs, and raise the alarm if one exceeds its limit."""
        period = float(gap.time[1] - gap.time[0])
        length = max(1, round(BLOCK / period))
        for start in range(new.start, new.stop, length):
            block = slice(start, min(start + length, new.stop))
            time = float(gap.time[block.stop - 1]) + period
            for row, name in enumerate(names):
                counts = gap.counts[row, block]
                if not counts.any():
                    continue
                for number, cusum in enumerate(self._cusums[row]):
                    freedom = float(gap.freedom[row, number]) * int(counts.sum())
                    power = float(np.sum(gap.power[row, number, block][counts]))
                    if freedom > 0.0:
                        cusum.add(power, freedom, time)
                    # Only the first alarm is raised; later ones would be consequences of the same
                    # gap.
                    if self.alarm is None and cusum.value >= LIMIT:
                        self.alarm = Alarm(end, cusum.since, name, BANDS[number])

    def investigate(self, recording: RecordedTest, *, last: bool = False) -> bool:
        """Search for suspects of an alarm, at once and again as the gap grows.

        Parameters
        ----------
        recording
            Recording that `take` judged last.
        last
            Whether the test has ended.

        Returns
        -------
        bool
            Whether suspects were searched, which takes seconds.
        """
        if self.alarm is None:
            return False
        window, recorded = mend(recording.between(float(recording.time[-1]) - WINDOW, math.inf))
        since = max(self.alarm.since, float(window.time[0]))
        seen = self.judged - since
        if seen < max(SEEN, LOOKED * self._looked) and not (last and not self._looked):
            return False
        # A gap older than the window adds no new evidence.
        if self._looked and seen > WINDOW - WARM - STEP:
            return False
        self._looked = seen
        # The twin needs the time before the gap to settle.
        part = window.between(since - WARM, math.inf)
        # A gap since the test's first tick has no onset within it.
        from_here = part.time >= (since + SETTLED if since > self._start else since)
        try:
            suspects = find_suspects(self._evidence(part, recorded[-part.ticks :] & from_here))
        except RigtwinError as error:
            self.note = str(error)
            return False
        self.alarm = replace(self.alarm, suspects=suspects)
        return True


def _kick(window: RecordedTest, share: float) -> RecordedTest:
    """Return a recording whose first commands are enlarged by a share of themselves."""

    ticks = round(0.25 * WARM / window.period)
    commands = {}
    for name, values in window.columns.get("/command", {}).items():
        commands[name] = values.copy()
        commands[name][:ticks] *= 1.0 + share
    return replace(window, columns={**window.columns, "/command": commands})
