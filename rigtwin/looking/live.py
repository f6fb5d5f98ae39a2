"""The page of a test that is running: the machine and its twin, the gap as it arises, an alarm.

One thread watches, one draws; when the test is over, the page becomes that of a look at all of it.
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
"""s by which the picture is behind what was recorded, so that it moves evenly while new stretches
come at times of their own."""
LATE = 2.0
"""s behind, beyond which the picture leaps."""


class Follow(Protocol):
    """Watches a test to its end."""

    def __call__(self, *, told: Callable[[Watch], object], stop: Callable[[], bool]) -> Watch:
        """told: called whenever there is something new; stop: says that it shall end."""
        ...


class LivePage:
    """A test and its twin in the browsers of this computer, until it is closed.

    url: where it is; watch: how the test goes, None before there was enough of it.
    """

    def __init__(
        self,
        server: LocalServer,
        follow: Follow,
        look_back: Callable[[LocalServer, Watch], Page],
        said: Callable[[str], object],
    ) -> None:
        """
        Parameters
        ----------
        server
            With nothing on it yet; the page stops it.
        follow
            The test.
        look_back
            The page of the whole test.
        said
            Called with what there is to say, a line each: an alarm, suspects, why the watch ended
            early.
        """
        self._server, self.url = server, server.url
        self._said, self._last_said = said, ""
        self.watch: Watch | None = None
        self._page: Page | None = None
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
        """The page of the whole test, None while it runs."""
        return self._page

    def wait(self) -> None:
        """Returns when the page is closed. Raises what went wrong in it."""
        while not self._closed and self._failure is None and self._page is None:
            with self._wake:
                self._wake.wait(0.5)
        if self._failure is not None:
            raise self._failure
        if self._page is not None:
            self._page.wait()

    def close(self) -> None:
        """Ends the page in all its tabs."""
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

    def _follow(
        self,
        follow: Follow,
        look_back: Callable[[LocalServer, Watch], Page],
    ) -> None:
        try:
            watch, ended = self._watch_to_its_end(follow)
            self._over.set()
            self._threads[1].join()
            if self._closed:
                return
            clear(self._server)
            self._page = look_back(self._server, watch)
            if ended:
                self._page.add_note(ended)
        except BaseException as error:  # whoever waits for the page is told
            if not self._closed:
                self._failure = error
        finally:
            self._over.set()
            with self._wake:
                self._wake.notify_all()

    def _watch_to_its_end(self, follow: Follow) -> tuple[Watch, str]:
        """How the test went, and why no more of it was seen; empty if all was."""
        try:
            return follow(told=self._take, stop=lambda: self._closed), ""
        except RigtwinError as error:
            if self.watch is None:
                raise
            self._say(str(error))
            return self.watch, str(error)

    def _say(self, line: str) -> None:
        if line != self._last_said:
            self._last_said = line
            self._said(line)

    def _take(self, watch: Watch) -> None:
        gap, recording = watch.gap, watch.recording
        if gap is None or recording is None:
            return
        if self._scene is None:
            self._build(watch, gap.time)
        period = float(gap.time[1] - gap.time[0])
        measured = find_positions(watch.machine, recording, period)
        predicted = find_positions(watch.machine, recording, period, gap.predicted)
        self._positions = gap.time, measured, predicted
        if watch.alarm is not None and not self._alarmed:
            self._alarmed, self._sensor.value = True, watch.alarm.signal
        self.watch = watch
        self._status.content = describe_watch(watch)
        self._plot(watch)
        if watch.alarm is not None:
            self._say(str(watch.alarm))

    def _build(self, watch: Watch, times: Array) -> None:
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
            said = "solid: the machine as measured; orange: the twin's prediction"
            gui.add_html(
                note(f"{said if moves else 'this twin moves as measured'}; {BEHIND:g} s ago")
            )
        panel.dock_left()
        panel.set_width(WIDTH)
        self._scene = Scene(self._server, machine, moves)

    def _plot(self, watch: Watch) -> None:
        gap = watch.gap
        if gap is None:
            return
        row = next(n for n, row in enumerate(watch.machine.rows) if row.name == self._sensor.value)
        # What is not judged yet is bent by the filter's end.
        known = gap.time < watch.judged
        time, measured, predicted = (
            gap.time[known],
            gap.measured[row][known],
            gap.predicted[row][known],
        )
        left = measured - predicted
        self._plots.name(
            self._sensor.value,
            watch.machine.rows[row].unit,
            float(np.max(np.abs(measured))),
            float(np.max(np.abs(left))),
        )
        self._plots.draw(time, measured, [predicted], float(time[-1]))

    def _animate(self) -> None:
        """Moves both machines, a little behind the test."""
        last = time.monotonic()
        while not (self._closed or self._over.wait(FRAME)):
            here = time.monotonic()
            passed, last = here - last, here
            scene, positions = self._scene, self._positions
            if scene is None or positions is None:
                continue
            times, measured, predicted = positions
            end = float(times[-1])
            self._now += passed
            if not end - LATE <= self._now <= end:
                self._now = min(max(self._now, end - BEHIND), end)
            tick = min(int(np.searchsorted(times, self._now)), len(times) - 1)
            scene.draw(
                {joint: float(values[tick]) for joint, values in measured.items()},
                {joint: float(values[tick]) for joint, values in predicted.items()},
                MAGNIFIED[self._magnified.value],
            )
