"""The page of a look: the machine and its twin, traces, sliders, a fit, and the twin saved.

Three threads share the work, so that whoever drags never waits for what was dragged before: the
server's take down what is asked for, one predicts and fits what was asked for last, one draws.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from rigtwin.errors import RigtwinError
from rigtwin.looking.controls import Controls
from rigtwin.looking.given import Given
from rigtwin.looking.local_server import LocalServer, stop_server
from rigtwin.looking.look import Look
from rigtwin.looking.prediction import Prediction
from rigtwin.looking.scene import Scene
from rigtwin.looking.texts import describe_errors, describe_fit, describe_given, note
from rigtwin.looking.timeline import Timeline
from rigtwin.numerics.arrays import Array

FRAME = 1.0 / 30.0
"""s, from one picture to the next while time runs."""
PLOTTED = 4
"""Every so many of them the plots' mark moves too."""


class Page:
    """A look at a recording in the browsers of this computer, until it is closed.

    url: where it is; saved_to: what the save button writes.
    """

    def __init__(
        self, server: LocalServer, look: Look, given: Given | None, saved_to: Path
    ) -> None:
        """server: with nothing on it yet; the page stops it."""
        self._look, self.saved_to = look, saved_to
        self._server = server
        self.url = server.url
        self._wake = threading.Condition()
        self._closed = False
        self._failure: BaseException | None = None
        self._job: Callable[[], None] | None = None
        self._moved = True
        self._prediction = look.nominal
        self._stale = {"text", "plots", "scene"}
        self._measured = look.positions()
        self._predicted = self._measured
        try:
            self._build(given)
        except BaseException:
            stop_server(self._server)
            raise
        self._threads = [
            threading.Thread(target=self._guard, args=(work,), daemon=True)
            for work in (self._predict, self._draw)
        ]
        for thread in self._threads:
            thread.start()

    def _build(self, given: Given | None) -> None:
        look, gui = self._look, self._server.gui
        self._scene = Scene(self._server, look.machine, look.predicts_motion)
        gui.main_panel.dock_right()
        self._errors = gui.add_html("")
        self._status = gui.add_html("" if given is None else describe_given(given))
        self._fit_button = gui.add_button(
            "fit what is ticked", hint="finds the values that explain the recording best"
        )
        self._fit_button.on_click(lambda _: self._ask(self._fit))
        self._reset_button = gui.add_button("back to the described twin")
        self._reset_button.on_click(lambda _: self._ask(self._reset))
        self._save_button = gui.add_button(
            "write the corrected twin", hint=f"writes {self.saved_to}, for --config"
        )
        self._save_button.on_click(lambda _: self._ask(self._save))
        values = {} if given is None else given.values
        self._controls = Controls(self._server, look, values, self._on_moved)
        self._controls.set(values)
        self._timeline = Timeline(self._server, look, self._refresh)
        self._server.on_client_connect(lambda _: self._refresh())

    @property
    def values(self) -> dict[str, tuple[float, ...]]:
        """Of the effects that are in the twin now."""
        return self._controls.values

    @property
    def prediction(self) -> Prediction:
        """What the page shows of the twin with these effects, or a moment ago with others."""
        return self._prediction

    def add_note(self, text: str) -> None:
        """Says one thing more about the recording."""
        self._status.content = note(text) + self._status.content

    def wait(self) -> None:
        """Returns when the page is closed. Raises what went wrong in it."""
        while not self._closed:
            with self._wake:
                # In short: a wait without an end cannot be interrupted everywhere.
                self._wake.wait(0.5)
        if self._failure is not None:
            raise self._failure

    def close(self) -> None:
        """Ends the page in all its tabs; a fit that is running is waited for no longer than a
        moment."""
        with self._wake:
            self._closed = True
            self._wake.notify_all()
        for thread in self._threads:
            thread.join(timeout=1.0)
        stop_server(self._server)

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _guard(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:  # whoever waits for the page is told
            with self._wake:
                if not self._closed:
                    self._failure, self._closed = error, True
                self._wake.notify_all()

    def _refresh(self, *parts: str) -> None:
        with self._wake:
            self._stale |= set(parts)
            self._wake.notify_all()

    def _on_moved(self) -> None:
        with self._wake:
            self._moved = True
            self._wake.notify_all()

    def _ask(self, job: Callable[[], None]) -> None:
        """One thing at a time: what is asked for while another is done is not done."""
        with self._wake:
            if self._job is None:
                self._job = job
                self._wake.notify_all()

    def _predict(self) -> None:
        """What was asked for last, until the page is closed."""
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._moved or self._job or self._closed)
                if self._closed:
                    return
                job, self._moved = self._job, False
            try:
                if job is not None:
                    job()
                self._take(self._look.predict(self._controls.values))
            except RigtwinError as error:
                self._status.content = note(str(error))
            finally:
                if job is not None:
                    with self._wake:
                        self._job = None

    def _take(self, prediction: Prediction) -> None:
        moved = self._look.positions(prediction) if self._look.predicts_motion else self._measured
        with self._wake:
            self._prediction, self._predicted = prediction, moved
        self._refresh("text", "plots", "scene")

    def _fit(self) -> None:
        names = list(self._controls.values)
        if not names:
            self._status.content = note("tick what is to be fitted, or move its slider")
            return
        begun, done = time.monotonic(), threading.Event()

        def tell() -> None:
            while not done.wait(0.5) and not self._closed:
                seconds = time.monotonic() - begun
                self._status.content = note(f"fitting {' and '.join(names)}: {seconds:.0f} s")

        buttons = (self._fit_button, self._reset_button, self._save_button)
        self._controls.lock(True)
        for button in buttons:
            button.disabled = True
        self._status.content = note(f"fitting {' and '.join(names)}")
        teller = threading.Thread(target=tell, daemon=True)
        teller.start()
        try:
            fitted = self._look.fit(names)
        finally:
            done.set()
            teller.join()
            if not self._closed:
                self._controls.lock(False)
                for button in buttons:
                    button.disabled = False
        if self._closed:
            return
        self._controls.set(
            {
                effect.name: value
                for effect, value in zip(fitted.effects, fitted.values, strict=True)
            }
        )
        self._status.content = describe_fit(fitted, self._look, time.monotonic() - begun)

    def _reset(self) -> None:
        self._controls.set({})
        self._status.content = ""

    def _save(self) -> None:
        path = self._look.save(self.saved_to, self._controls.values)
        self._status.content = note(f"the corrected twin is in {path}; use it with --config")

    def _draw(self) -> None:
        """What is no longer so, until the page is closed."""
        frame, last = 0, None
        while True:
            with self._wake:
                if self._timeline.plays:
                    self._wake.wait(FRAME)
                else:
                    self._wake.wait_for(lambda: self._stale or self._closed or self._timeline.plays)
                if self._closed:
                    return
                stale, self._stale = self._stale, set()
                prediction, predicted = self._prediction, self._predicted
            here = time.monotonic()
            if self._timeline.plays:
                self._timeline.advance(0.0 if last is None else here - last)
                frame, last = frame + 1, here
                stale |= {"scene"} if frame % PLOTTED else {"scene", "plots"}
            else:
                last = None
            if "text" in stale:
                self._errors.content = describe_errors(self._look, prediction)
            if "plots" in stale:
                self._timeline.draw(prediction)
            if "scene" in stale:
                self._pose(predicted)

    def _pose(self, predicted: Mapping[str, Array]) -> None:
        tick = self._timeline.tick
        self._scene.draw(
            {joint: float(values[tick]) for joint, values in self._measured.items()},
            {joint: float(values[tick]) for joint, values in predicted.items()},
            self._timeline.magnify,
        )
