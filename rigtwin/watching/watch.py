"""Holds a test that is running against its twin, stretch by stretch."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.data_checks import require_fit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.errors import RigtwinError
from rigtwin.recording import Recording
from rigtwin.signals.noise import white_noise
from rigtwin.watching.alarm import Alarm
from rigtwin.watching.cusum import Cusum
from rigtwin.watching.gap import BANDS, Gap, find_gap, ratio
from rigtwin.watching.mending import mend
from rigtwin.watching.suspects import find_suspects

WINDOW = 20.0
"""s of a test that are predicted anew each time."""
WARM = 4.0
"""s at a window's beginning that are not judged: a twin must first forget where it started. Of a
session that has just ramped to its test, nobody knows exactly where dry friction holds the rig."""
SHORTEST = 2.0
"""s from which a test is judged."""
STEP = 0.5
"""s from one time to the next."""
BLOCK = 0.25
"""s that are judged at a time."""
HELD_BACK = 0.25
"""s at a window's end that are judged next time, where signals are limited to a band: a filter
knows them only once it knows what follows."""
LIMIT = 20.0
"""Of each CUSUM. Were blocks independent and normal, one would exceed it by chance once in
exp(20) blocks, which is four thousand years."""
KICK = 0.5
"""Share of themselves by which commands are changed at a window's beginning, to see whether the
twin forgets it."""
SAME = 0.5
"""Of what a signal is held to, by which such predictions may differ."""
STEPS = 4
"""Of integration a tick."""
SEEN = 3.0
"""s of a gap that must be seen until its suspects are looked for."""
SETTLED = 1.0
"""s of a gap that its suspects are not held against: they were not there before it."""
LOOKED = 1.5
"""Times as long as before a gap must be seen until its suspects are looked for again."""


class Watch:
    """A twin beside a test. It is given what was recorded so far, again and again.

    alarm: the gap that was found, None so far; gap, recording: what was judged last and what it is
    of, None before there was enough; ratios: by signal, the difference's rms in the last stretch in
    units of what noise and tolerances explain; note: why the last stretch could not be judged,
    empty if it was; judged: s, up to where; seconds: s up to there in which something
    could be judged; highest: the level's maximum so far.
    """

    def __init__(self, machine: Machine, base: Configuration | None = None) -> None:
        """base: the twin, by default the described one."""
        self.machine = machine
        self._base = base
        self._cusums: list[list[Cusum]] = []
        self._start, self._looked = math.nan, 0.0
        self.alarm: Alarm | None = None
        self.gap: Gap | None = None
        self.ratios: dict[str, float] = {}
        self.note, self.judged = "", -math.inf
        self.recording: Recording | None = None
        self.highest = self.seconds = 0.0

    @property
    def level(self) -> float:
        """How near an alarm is: the largest CUSUM in units of its limit."""
        return max((each.value for row in self._cusums for each in row), default=0.0) / LIMIT

    def take(self, recording: Recording, *, last: bool = False) -> bool:
        """Judges what is new of a test.

        Parameters
        ----------
        recording
            What there is of it: its last `WINDOW` seconds, or all.
        last
            Whether nothing will follow.

        Returns
        -------
        bool
            Whether there was enough that is new.

        Raises
        ------
        RigtwinError
            If the recording is of another machine or lacks a channel.
        """
        if not self._cusums:
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
        held = 0.0 if last or math.isinf(evidence.models[0].band) else HELD_BACK
        first, stop = np.searchsorted(gap.time, [self.judged, end - held])
        new = slice(int(first), max(int(stop), int(first)))
        if new.start == new.stop:
            return False
        names = evidence.names
        self.ratios = dict(zip(names, ratio(gap, new).tolist(), strict=True))
        self._judge(gap, new, names, end)
        seen = float(np.mean(gap.counts[:, new].any(axis=0)))
        here = float(gap.time[new.stop - 1]) + evidence.lines[0].period
        self.seconds += seen * (here - self.judged)
        self.judged = here
        self.highest = max(self.highest, self.level)
        return True

    def _evidence(self, window: Recording, counts: NDArray[np.bool_]) -> Evidence:
        """counts: ticks that do, if the twin has forgotten where it started."""
        configuration = self.machine.configuration_of(window, self._base)
        require_fit(self.machine, window, configuration)
        counted = counts.astype(float)
        if window.transitions or window.time[0] > self._start + 0.5 * window.period:
            counted[~self._has_forgotten(window, configuration)] = 0.0
        return Evidence(self.machine, [window], [configuration], [counted])

    def _has_forgotten(self, window: Recording, configuration: Configuration) -> NDArray[np.bool_]:
        """Ticks at which it makes no difference how the twin started, shape (ticks,): what stands
        still keeps where dry friction holds it."""
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
            with np.errstate(invalid="ignore"):
                apart = np.abs(kicked.predict(plant) - predicted)
            alike = np.all(apart <= SAME * np.array(held)[:, None], axis=0)
            known &= np.repeat(alike, model.every)[: window.ticks]
        return known

    def _judge(self, gap: Gap, new: slice, names: list[str], end: float) -> None:
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
                    if self.alarm is None and cusum.value >= LIMIT:
                        self.alarm = Alarm(end, cusum.since, name, BANDS[number])

    def investigate(self, recording: Recording, *, last: bool = False) -> bool:
        """Looks for what may be behind an alarm: at once, and again as more of the gap was seen.

        Parameters
        ----------
        recording
            What `take` judged last.
        last
            Whether nothing will follow.

        Returns
        -------
        bool
            Whether it looked. It takes seconds.
        """
        if self.alarm is None:
            return False
        window, recorded = mend(recording.between(float(recording.time[-1]) - WINDOW, math.inf))
        since = max(self.alarm.since, float(window.time[0]))
        seen = self.judged - since
        if seen < max(SEEN, LOOKED * self._looked) and not (last and not self._looked):
            return False
        if self._looked and seen > WINDOW - WARM - STEP:
            return False
        self._looked = seen
        part = window.between(since - WARM, math.inf)
        from_here = part.time >= (since + SETTLED if since > self._start else since)
        try:
            suspects = find_suspects(self._evidence(part, recorded[-part.ticks :] & from_here))
        except RigtwinError as error:
            self.note = str(error)
            return False
        self.alarm = replace(self.alarm, suspects=suspects)
        return True


def _kick(window: Recording, share: float) -> Recording:
    """A recording whose first commands are greater by a share of themselves."""
    ticks = round(0.25 * WARM / window.period)
    commands = {}
    for name, values in window.columns.get("/command", {}).items():
        commands[name] = values.copy()
        commands[name][:ticks] *= 1.0 + share
    return replace(window, columns={**window.columns, "/command": commands})
