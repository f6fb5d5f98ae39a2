"""Timeline of a look: the present time, dragged or playing, and one sensor's traces about it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import viser

from rigtwin.looking.look import Look
from rigtwin.looking.plots import DESCRIBED, TWIN, Plots
from rigtwin.looking.prediction import Prediction
from rigtwin.looking.texts import note
from rigtwin.numerics.arrays import Array

RATES = {"as it was": 1.0, "a quarter as fast": 0.25, "a tenth as fast": 0.1}
MAGNIFIED = {"as it is": 1.0, "10 times": 10.0, "100 times": 100.0}
WHOLE = "whole test"
STRETCHES = {WHOLE: np.inf, "10 s": 10.0, "2 s": 2.0, "0.5 s": 0.5}
"""Length of the shown stretch about the present time, in s."""
WIDTH = 560
"""Width of the panel in pixels."""


class Timeline:
    """Panel with the time, its playback, and the traces. `now` is in s."""

    def __init__(self, server: viser.ViserServer, look: Look, refresh: Callable[..., None]) -> None:
        """Build the panel. `refresh` is called with the stale parts, "plots" or "scene"."""
        self._server, self._look, self._refresh = server, look, refresh
        self.now = float(look.time[0])
        self._magnified: viser.GuiDropdownHandle[str] | None = None
        panel = server.gui.add_panel()
        with panel.add_tab("time"):
            self._build()
        panel.dock_left()
        panel.set_width(WIDTH)

    def _build(self) -> None:
        look, gui = self._look, self._server.gui
        # The look begins with the sensor whose gap is largest.
        worst = max(look.nominal.percent, key=lambda name: look.nominal.percent[name])
        start, end = float(look.time[0]), float(look.time[-1])
        self._scrubber = gui.add_slider(
            "time, s",
            min=start,
            max=end,
            step=10.0 ** math.floor(math.log10((end - start) / 1000.0)),
            initial_value=start,
            marks=((start, f"{start:.4g}"), (end, f"{end:.4g}")),
        )
        self._scrubber.on_update(self._on_scrubbed)
        self._play = gui.add_checkbox("play", False)
        self._play.on_update(lambda _: self._refresh())
        self._rate = gui.add_dropdown("how fast", tuple(RATES))
        self._sensor = gui.add_dropdown("sensor", look.sensors, initial_value=worst)
        self._stretch = gui.add_dropdown("shown", tuple(STRETCHES), initial_value=WHOLE)
        for chosen in (self._sensor, self._stretch):
            chosen.on_update(lambda _: self._refresh("plots"))
        twins = {"described twin": DESCRIBED, "this twin": TWIN}
        self._plots = Plots(self._server, twins, start, end)
        if not look.predicts_motion:
            gui.add_html(
                note("this twin moves as measured: what it predicts are forces, so it has no ghost")
            )
            return
        self._magnified = gui.add_dropdown("gap in the picture", tuple(MAGNIFIED))
        self._magnified.on_update(lambda _: self._refresh("scene"))
        gui.add_html(note("solid: the machine as measured; orange: the twin's prediction"))

    def _on_scrubbed(self, event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
        if event.client_id is not None:  # by a user, not by the playback
            self.now = float(event.target.value)
            self._refresh("plots", "scene")

    @property
    def plays(self) -> bool:
        """Whether the recording plays: a user asked for it, and a browser is connected."""
        # Without a browser nobody sees it play, and drawing would use a core for nothing.
        return self._play.value and bool(self._server.get_clients())

    @property
    def tick(self) -> int:
        """Tick of the present time."""
        time = self._look.time
        return min(round((self.now - time[0]) / (time[1] - time[0])), len(time) - 1)

    @property
    def magnify(self) -> float:
        """Factor by which the ghost's distance is magnified."""
        return 1.0 if self._magnified is None else MAGNIFIED[self._magnified.value]

    def advance(self, seconds: float) -> None:
        """Advance the playback at the chosen rate; after the end it begins again."""
        start, end = float(self._look.time[0]), float(self._look.time[-1])
        then = self.now + RATES[self._rate.value] * seconds
        self.now = then if then <= end else start

    def draw(self, prediction: Prediction) -> None:
        """Draw the traces of a prediction, and the mark of the present time."""
        look, sensor = self._look, self._sensor.value
        row = look.sensors.index(sensor)
        measured, nominal = look.measured[row], look.nominal.signals[row]
        self._plots.name(
            sensor,
            look.units[row],
            float(np.max(np.abs(measured))),
            float(np.max(np.abs(measured - nominal))),
        )
        part = _window(look.time, self.now, STRETCHES[self._stretch.value])
        predicted = [nominal[part], prediction.signals[row][part]]
        self._plots.draw(look.time[part], measured[part], predicted, self.now)
        # The slider follows the playback; while it is dragged, the user sets it.
        if self.plays:
            self._scrubber.value = self.now


def _window(time: Array, now: float, length: float) -> slice:
    """Return the ticks of a stretch about a time, moved to lie within the test."""
    if length >= time[-1] - time[0]:
        return slice(0, len(time))
    start = min(max(now - 0.5 * length, float(time[0])), float(time[-1]) - length)
    # At least two ticks, or there would be no line to draw.
    first, last = np.searchsorted(time, [start, start + length])
    return slice(int(first), max(int(last), int(first) + 2))
