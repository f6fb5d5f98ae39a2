"""Page of a look: the machine and its twin, traces, sliders, a fit, and the corrected twin saved.

Three threads share the work, so that a user who drags a slider never waits for an earlier request.
The server's threads note requests, one thread predicts and fits the latest request, one draws.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from rigtwin.errors import RigtwinError
from rigtwin.looking.controls import Controls
from rigtwin.looking.local_server import LocalServer, stop_server
from rigtwin.looking.look import Look
from rigtwin.looking.prediction import Prediction
from rigtwin.looking.scene import Scene
from rigtwin.looking.starting_point import StartingPoint, from_document
from rigtwin.looking.texts import describe_errors, describe_fit, describe_starting_point, note
from rigtwin.looking.timeline import Timeline
from rigtwin.numerics.arrays import Array

FRAME = 1.0 / 30.0
"""Time between two pictures while the recording plays, in s."""
PLOTTED = 4
"""Number of pictures between two updates of the plots' time mark."""


class Page:
    """A look at a recording in the browsers of this computer, until the page is closed.

    Attributes
    ----------
    url
        Address of the page.
    saved_to
        File that the save button writes.
    """

    def __init__(
        self, server: LocalServer, look: Look, start: StartingPoint | None, saved_to: Path
    ) -> None:
        """Open the page on a server without content, which the page stops.

        `start` are the effects and suspects the sliders begin with; None for the described twin.
        """
        self._look, self.saved_to = look, saved_to
        self._server = server
        self.url = server.url
        self._wake = threading.Condition()
        self._closed = False
        self._failure: BaseException | None = None
        self._job: Callable[[], None] | None = None
        self._moved = True
        self._prediction = look.nominal
        # Everything is drawn once at the beginning.
        self._stale = {"text", "plots", "scene"}
        self._measured = look.positions()
        self._predicted = self._measured
        try:
            self._build(start)
        except BaseException:
            stop_server(self._server)
            raise
        self._threads = [
            # Daemons: a prediction that hangs must not keep the program alive.
            threading.Thread(target=self._guard, args=(work,), daemon=True)
            for work in (self._predict, self._draw)
        ]
        for thread in self._threads:
            thread.start()

    def _build(self, start: StartingPoint | None) -> None:
        look, gui = self._look, self._server.gui
        self._scene = Scene(self._server, look.machine, look.predicts_motion, self._measured)
        gui.main_panel.dock_right()
        self._errors = gui.add_html("")
        self._status = gui.add_html("" if start is None else describe_starting_point(start))
        self._fit_button = gui.add_button(
            "fit what is ticked", hint="finds the values that explain the recording best"
        )
        self._fit_button.on_click(lambda _: self._ask(self._fit))
        self._diagnose_button = gui.add_button(
            "diagnose", hint="searches all effects, and takes into the twin what it finds"
        )
        self._diagnose_button.on_click(lambda _: self.diagnose())
        self._reset_button = gui.add_button("back to the described twin")
        self._reset_button.on_click(lambda _: self._ask(self._reset))
        self._save_button = gui.add_button(
            "write the corrected twin", hint=f"writes {self.saved_to}, for --config"
        )
        self._save_button.on_click(lambda _: self._ask(self._save))
        values = {} if start is None else start.values
        suspects = {} if start is None else start.suspects
        self._controls = Controls(
            self._server,
            look,
            {**values, **suspects},
            "found" if values else "suspects",
            self._on_moved,
        )
        self._controls.set(values)
        self._timeline = Timeline(self._server, look, self._refresh)
        # A new tab may have been opened while nothing changed.
        self._server.on_client_connect(lambda _: self._refresh())

    @property
    def values(self) -> dict[str, tuple[float, ...]]:
        """Values of the effects that are in the twin now."""
        return self._controls.values

    @property
    def prediction(self) -> Prediction:
        """Prediction that the page shows; for a moment it may lag behind `values`."""
        return self._prediction

    def add_note(self, text: str) -> None:
        """Add a remark on the recording."""
        self._status.content = note(text) + self._status.content

    def diagnose(self) -> None:
        """Request a diagnosis, as the page's button does. What it finds is taken into the twin."""
        self._ask(self._diagnose)

    def wait(self) -> None:
        """Wait until the page is closed. Raise the error that stopped it, if any."""
        while not self._closed:
            with self._wake:
                # Short waits, because a wait without timeout cannot be interrupted on Windows.
                self._wake.wait(0.5)
        if self._failure is not None:
            raise self._failure

    def close(self) -> None:
        """Close the page in all browser tabs. A running fit is waited for only a moment."""
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
        """Run a thread's work; hand an error to the thread that waits for the page."""
        try:
            work()
        except BaseException as error:
            with self._wake:
                if not self._closed:
                    self._failure, self._closed = error, True
                self._wake.notify_all()

    def _refresh(self, *parts: str) -> None:
        """Mark parts of the page as stale, and wake the drawing thread."""
        with self._wake:
            self._stale |= set(parts)
            self._wake.notify_all()

    def _on_moved(self) -> None:
        """Request a prediction; several requests before it begins become one."""
        with self._wake:
            self._moved = True
            self._wake.notify_all()

    def _ask(self, job: Callable[[], None]) -> None:
        """Request a job. While one runs, further requests are dropped, as for a double click."""
        with self._wake:
            if self._job is None:
                self._job = job
                self._wake.notify_all()

    def _predict(self) -> None:
        """Predict the latest request, until the page is closed."""
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._moved or self._job or self._closed)
                if self._closed:
                    return
                # The flag is cleared before the prediction: a move during it requests the next one.
                job, self._moved = self._job, False
            # Outside the lock, so that users can go on dragging during a prediction.
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
        """Show a new prediction."""
        moved = self._look.positions(prediction) if self._look.predicts_motion else self._measured
        # Both change together, so that no picture shows one twin's errors and another's motion.
        with self._wake:
            self._prediction, self._predicted = prediction, moved
        self._refresh("text", "plots", "scene")

    def _fit(self) -> None:
        """Fit the ticked effects."""
        names = list(self._controls.values)
        if not names:
            self._status.content = note("tick what is to be fitted, or move its slider")
            return
        begun = time.monotonic()
        # A fit starts from the present values, which must not change meanwhile.
        with self._busy(f"fitting {' and '.join(names)}"):
            fitted = self._look.fit(names)
        if self._closed:
            return
        self._controls.set(
            {
                effect.name: value
                for effect, value in zip(fitted.effects, fitted.values, strict=True)
            }
        )
        self._status.content = describe_fit(fitted, time.monotonic() - begun)

    def _diagnose(self) -> None:
        """Diagnose the recording, and take the effects that it finds into the twin."""
        with self._busy("diagnosing"):
            answer = self._look.diagnose()
        if self._closed:
            return
        found = from_document(answer.document(), self._look, str(self._look.recording.path))
        self._controls.set(found.values)
        self._status.content = describe_starting_point(found)

    @contextmanager
    def _busy(self, work: str) -> Iterator[None]:
        """Lock all controls and show the time while something is worked out."""
        begun, done = time.monotonic(), threading.Event()

        def tell() -> None:
            while not done.wait(0.5) and not self._closed:
                self._status.content = note(f"{work}: {time.monotonic() - begun:.0f} s")

        buttons = (
            self._fit_button,
            self._diagnose_button,
            self._reset_button,
            self._save_button,
        )
        self._controls.lock(True)
        for button in buttons:
            button.disabled = True
        self._status.content = note(work)
        teller = threading.Thread(target=tell, daemon=True)
        teller.start()
        try:
            yield
        finally:
            done.set()
            teller.join()
            if not self._closed:
                self._controls.lock(False)
                for button in buttons:
                    button.disabled = False

    def _reset(self) -> None:
        """Take all effects out of the twin."""
        self._controls.set({})
        self._status.content = ""

    def _save(self) -> None:
        """Write the corrected twin."""
        path = self._look.save(self.saved_to, self._controls.values)
        self._status.content = note(f"the corrected twin is in {path}; use it with --config")

    def _draw(self) -> None:
        """Draw what is stale, until the page is closed."""
        frame, last = 0, None
        while True:
            with self._wake:
                if self._timeline.plays:
                    self._wake.wait(FRAME)
                else:
                    self._wake.wait_for(lambda: self._stale or self._closed or self._timeline.plays)
                if self._closed:
                    return
                # Taken over at once, so that requests during drawing are kept for the next round.
                stale, self._stale = self._stale, set()
                prediction, predicted = self._prediction, self._predicted
            present = time.monotonic()
            if self._timeline.plays:
                self._timeline.advance(0.0 if last is None else present - last)
                frame, last = frame + 1, present
                # Plots cost more than the scene, and their mark may move in larger steps.
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
        """Pose the machine and its ghost at the present time."""
        tick = self._timeline.tick
        self._scene.draw(
            {joint: float(values[tick]) for joint, values in self._measured.items()},
            {joint: float(values[tick]) for joint, values in predicted.items()},
            self._timeline.magnify,
        )
