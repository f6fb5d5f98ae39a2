"""Check boxes and sliders of the candidate effects on a page."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping

import viser

from rigtwin.looking.knob import Knob, knob_of
from rigtwin.looking.look import Look

FEW = 8
"""Largest number of sliders with which all folders are open."""


class Controls:
    """Selection of the twin's effects, and their values. Every browser tab shows the same."""

    def __init__(
        self,
        server: viser.ViserServer,
        look: Look,
        first: Mapping[str, Iterable[float]],
        title: str,
        changed: Callable[[], object],
    ) -> None:
        """Build the controls.

        Parameters
        ----------
        server
            Server of the page.
        look
            Look at the recording.
        first
            Effects listed before all others, with the values of their sliders. They are not ticked.
        title
            Title of their folder.
        changed
            Function called when a user moves a control.
        """
        self._look, self._changed = look, changed
        # viser calls handlers on threads of its own; `set` runs on the predicting thread.
        self._lock = threading.RLock()
        # A dictionary serves as an ordered set: effects stay in the order in which they were
        # chosen.
        self._ticked: dict[str, None] = {}
        self._values = {
            name: [slider.nominal if n == 0 else slider.start for n, slider in enumerate(sliders)]
            for name, sliders in look.sliders.items()
        }
        self._values.update({name: list(values) for name, values in first.items()})
        self._title = title
        self._knobs = {
            name: [knob_of(slider) for slider in sliders] for name, sliders in look.sliders.items()
        }
        self._ticks: dict[str, viser.GuiCheckboxHandle] = {}
        self._handles: dict[str, list[viser.GuiSliderHandle[float]]] = {}
        # A slider has finitely many positions: values start on the nearest one.
        for name, knobs in self._knobs.items():
            self._values[name] = [
                knob.value(knob.position(value))
                for knob, value in zip(knobs, self._values[name], strict=True)
            ]
        for title, names, opened in self._folders(tuple(first)):
            with server.gui.add_folder(title, expand_by_default=opened):
                for name in names:
                    # The folder is named after the component, so the effect's kind is enough.
                    full = title != look.effects[name].component
                    self._add(server, name, name if full else look.effects[name].kind.name)

    def _folders(self, first: tuple[str, ...]) -> list[tuple[str, list[str], bool]]:
        """Return each folder's title, effects, and whether it is open."""
        # Effects of the diagnosis or the first look come first, in an open folder.
        folders = [(self._title, list(first), True)] if first else []
        by_component: dict[str, list[str]] = {}
        for name, effect in self._look.effects.items():
            if name not in first:
                by_component.setdefault(effect.component, []).append(name)
        few = sum(len(knobs) for knobs in self._knobs.values()) <= FEW
        return [*folders, *((title, names, few) for title, names in by_component.items())]

    def _add(self, server: viser.ViserServer, name: str, label: str) -> None:
        effect = self._look.effects[name]
        tick = server.gui.add_checkbox(label, False, hint=effect.kind.meaning)
        # Bound as an argument of the call, not of the loop: each box keeps its own effect.
        tick.on_update(lambda event: self._on_tick(name, event))
        self._ticks[name] = tick
        self._handles[name] = []
        for number, knob in enumerate(self._knobs[name]):
            slider = server.gui.add_slider(
                knob.label(self._values[name][number]),
                min=knob.low,
                max=knob.high,
                step=knob.step,
                initial_value=knob.position(self._values[name][number]),
                marks=((knob.low, knob.ends[0]), (knob.high, knob.ends[1])),
                hint=f"{effect.kind.meaning}; the twin's own value: {knob.slider.nominal:.4g} "
                f"{knob.slider.unit}",
            )
            slider.on_update(
                lambda event, number=number, knob=knob: self._on_slider(name, number, knob, event)
            )
            self._handles[name].append(slider)

    @property
    def values(self) -> dict[str, tuple[float, ...]]:
        """Values of the effects that are in the twin."""
        with self._lock:
            return {name: tuple(self._values[name]) for name in self._ticked}

    def set(self, values: Mapping[str, Iterable[float]]) -> None:
        """Put these effects into the twin, and take all others out."""
        with self._lock:
            # A copy of the names: unticking changes the dictionary.
            for name in [name for name in self._ticked if name not in values]:
                self._untick(name)
            for name, numbers in values.items():
                self._values[name] = list(numbers)
                self._tick(name)
                for handle, knob, value in zip(
                    self._handles[name], self._knobs[name], self._values[name], strict=True
                ):
                    handle.value = knob.position(value)
                    handle.label = knob.label(value)

    def lock(self, locked: bool) -> None:
        """Lock or unlock all controls."""
        for name, tick in self._ticks.items():
            tick.disabled = locked
            for handle in self._handles[name]:
                handle.disabled = locked

    def _tick(self, name: str) -> None:
        # Two effects that set the same parameter exclude each other.
        active = [effect for effect in self._ticked if effect != name]
        for rival in self._look.clashing(name, active):
            self._untick(rival)
        self._ticked[name] = None
        self._ticks[name].value = True

    def _untick(self, name: str) -> None:
        self._ticked.pop(name, None)
        self._ticks[name].value = False

    def _on_tick(self, name: str, event: viser.GuiEvent[viser.GuiCheckboxHandle]) -> None:
        if event.client_id is None:
            return  # set by the program, not by a user
        with self._lock:
            (self._tick if event.target.value else self._untick)(name)
        self._changed()

    def _on_slider(
        self,
        name: str,
        number: int,
        knob: Knob,
        event: viser.GuiEvent[viser.GuiSliderHandle[float]],
    ) -> None:
        if event.client_id is None:
            return
        with self._lock:
            value = knob.value(event.target.value)
            self._values[name][number] = value
            # On a logarithmic scale only the label shows the value itself.
            event.target.label = knob.label(value)
            self._tick(name)
        self._changed()
