"""Page of a running test: the machine and its twin, the gap as it arises, and an alarm.

One thread watches the test, another draws. After the test the page becomes a look at the whole
recording.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.looking.local_server import LocalServer, clear, stop_server
from rigtwin.looking.motions import find_positions, predicts_motion
from rigtwin.looking.page import FRAME, Page
from rigtwin.looking.plots import TWIN, Plots
from rigtwin.looking.scene import Scene
from rigtwin.looking.texts import describe_watch, note
from rigtwin.looking.timeline import MAGNIFIED, WIDTH
from rigtwin.numerics.arrays import Array
from rigtwin.watching import Watch

BEHIND = 1.0
"""Delay of the picture behind the recording, in s. It lets motion run evenly although new data
arrive in irregular stretches."""
LATE = 2.0
"""Delay in s beyond which the picture jumps to the present."""


class Follow(Protocol):
    """Function that watches a test to its end."""

    def __call__(self, *, on_update: Callable[[Watch], object], stop: Callable[[], bool]) -> Watch:
        """Watch a test to its end.

        Parameters
        ----------
        on_update
            Function called with every new state of the watch.
        stop
            Function that returns whether to end early.
        """
        ...


class LivePage:
    """A test and its twin in the browsers of this computer, until the page is closed.

    Attributes
    ----------
    url
        Address of the page.
    watch
        State of the test; None until enough was recorded.
    """

    def __init__(
        self,
        server: LocalServer,
        follow: Follow,
        look_back: Callable[[LocalServer, Watch], Page],
        report: Callable[[str], object],
    ) -> None:
        """Open the page.

        Parameters
        ----------
        server
            Server without content; the page stops it.
        follow
            Function that watches the test.
        look_back
            Function that builds the page of the whole test.
        report
            Function called with each message: an alarm, its suspects, or why the watch ended early.
        """
        self._server, self.url = server, server.url
        self._report, self._last_message = report, ""
        self.watch: Watch | None = None
        self._page: Page | None = None
        # Guards `_closed`, and wakes whoever waits for the page.
        self._wake = threading.Condition()
        self._closed = False
        self._over = threading.Event()
        self._failure: BaseException | None = None
        self._scene: Scene | None = None
        self._positions: tuple[Array, dict[str, Array], dict[str, Array]] | None = None
        self._now, self._alarmed = -np.inf, False
        self._status = server.gui.add_html(note("waiting for the test to begin"))
        server.gui.main_panel.dock_right()
        self._threads = [
            threading.Thread(target=self._follow, args=(follow, look_back), daemon=True),
            threading.Thread(target=self._animate, daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def over(self) -> Page | None:
        """Page of the whole test; None while the test runs."""
        return self._page

    def wait(self) -> None:
        """Wait until the page is closed. Raise the error that stopped it, if any."""
        while not self._closed and self._failure is None and self._page is None:
            with self._wake:
                # Short waits, because a wait without timeout cannot be interrupted on Windows.
                self._wake.wait(0.5)
        if self._failure is not None:
            raise self._failure
        if self._page is not None:
            self._page.wait()

    def close(self) -> None:
        """Close the page in all browser tabs."""
        with self._wake:
            self._closed = True
            self._wake.notify_all()
        for thread in self._threads:
            thread.join(timeout=2.0)
        if self._page is not None:
            self._page.close()
        else:
            stop_server(self._server)

    def __enter__(self) -> LivePage:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _follow(self, follow: Follow, look_back: Callable[[LocalServer, Watch], Page]) -> None:
        """Watch the test, then replace the page by a look at the recording."""
        try:
            watch, ended = self._watch_to_its_end(follow)
            self._over.set()
            # The drawing thread must have ended before its scene is removed.
            self._threads[1].join()
            if self._closed:
                return
            clear(self._server)
            self._page = look_back(self._server, watch)
            if ended:
                self._page.add_note(ended)
        except BaseException as error:  # handed to the thread that waits for the page
            # After closing, errors are expected: the server that they come from is gone.
            if not self._closed:
                self._failure = error
        finally:
            self._over.set()
            with self._wake:
                self._wake.notify_all()

    def _watch_to_its_end(self, follow: Follow) -> tuple[Watch, str]:
        """Return the final state of the watch, and why it ended early, or an empty text."""
        try:
            return follow(on_update=self._take, stop=lambda: self._closed), ""
        except RigtwinError as error:
            if self.watch is None:
                raise
            self._say(str(error))
            return self.watch, str(error)

    def _say(self, line: str) -> None:
        """Report a message, unless it repeats the last one or the page is closed."""
        if not self._closed and line != self._last_message:
            self._last_message = line
            self._report(line)

    def _take(self, watch: Watch) -> None:
        """Show a new state of the watch."""
        gap, recording = watch.gap, watch.recording
        if gap is None or recording is None:
            return
        if self._scene is None:
            self._build(watch, gap.time)
        # The model may use every other tick only; its grid is the gap's.
        period = float(gap.time[1] - gap.time[0])
        measured = find_positions(watch.machine, recording, period)
        predicted = find_positions(watch.machine, recording, period, gap.predicted)
        # One assignment, so the drawing thread never sees half an update.
        self._positions = gap.time, measured, predicted
        # At the first alarm the plot shows its signal; afterwards the user's choice stays.
        if watch.alarm is not None and not self._alarmed:
            self._alarmed, self._sensor.value = True, watch.alarm.signal
        self.watch = watch
        self._status.content = describe_watch(watch)
        self._plot(watch)
        if watch.alarm is not None:
            self._say(str(watch.alarm))

    def _build(self, watch: Watch, times: Array) -> None:
        """Build the page's content once the first stretch is judged."""
        machine, gui = watch.machine, self._server.gui
        moves = predicts_motion(machine)
        panel = gui.add_panel()
        names = [row.name for row in machine.rows]
        with panel.add_tab("the last seconds"):
            self._sensor = gui.add_dropdown("sensor", names, initial_value=names[-1])
            self._sensor.on_update(lambda _: self._plot(watch))
            self._plots = Plots(self._server, {"twin": TWIN}, float(times[0]), float(times[-1]))
            self._magnified = gui.add_dropdown(
                "gap in the picture", tuple(MAGNIFIED), visible=moves
            )
            legend = "solid: the machine as measured; orange: the twin's prediction"
            gui.add_html(
                note(f"{legend if moves else 'this twin moves as measured'}; {BEHIND:g} s ago")
            )
        panel.dock_left()
        panel.set_width(WIDTH)
        self._scene = Scene(self._server, machine, moves)

    def _plot(self, watch: Watch) -> None:
        """Draw the chosen sensor as measured and predicted."""
        gap = watch.gap
        if gap is None:
            return
        row = next(n for n, row in enumerate(watch.machine.rows) if row.name == self._sensor.value)
        # Beyond `judged` the band filter lacks what follows, and distorts the signal.
        known = gap.time < watch.judged
        time = gap.time[known]
        measured = gap.measured[row][known]
        predicted = gap.predicted[row][known]
        residual = measured - predicted
        self._plots.name(
            self._sensor.value,
            watch.machine.rows[row].unit,
            float(np.max(np.abs(measured))),
            float(np.max(np.abs(residual))),
        )
        self._plots.draw(time, measured, [predicted], float(time[-1]))

    def _animate(self) -> None:
        """Move both machines, a little behind the test."""
        last = time.monotonic()
        while not (self._closed or self._over.wait(FRAME)):
            present = time.monotonic()
            passed, last = present - last, present
            scene, positions = self._scene, self._positions
            if scene is None or positions is None:
                continue
            times, measured, predicted = positions
            end = float(times[-1])
            self._now += passed
            # New data may come late or all at once: then the picture jumps.
            if not end - LATE <= self._now <= end:
                self._now = min(max(self._now, end - BEHIND), end)
            # The positions come in one tuple, which the watching thread replaces as a whole: no
            # lock is needed.
            tick = min(int(np.searchsorted(times, self._now)), len(times) - 1)
            scene.draw(
                {joint: float(values[tick]) for joint, values in measured.items()},
                {joint: float(values[tick]) for joint, values in predicted.items()},
                MAGNIFIED[self._magnified.value],
            )
