"""From a recording of a machine to its model under that recording's inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rigtwin.errors import RigtwinError
from rigtwin.machine.configuration import Configuration
from rigtwin.machine.machine import Machine
from rigtwin.models.joint import JointReplay
from rigtwin.models.predictor import Form, Motion, Predictor
from rigtwin.models.quarter_car import Reduced
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording


class Setup(NamedTuple):
    """What a described machine's twin is set to: its plant, and its controller's settings."""

    plant: Any
    settings: Mapping[str, float]


def predictor(machine: Machine, recording: Recording, setup: Configuration | Setup, steps: int) -> Predictor:
    """The machine's model under a recording's inputs. Raises RigtwinError if a channel is missing."""
    if isinstance(setup, Configuration):
        ground, structure, voltage = (recording.column("/command", name) for name in ("ground", "structure", "voltage"))
        return Reduced(ground, structure, voltage, setup, steps)
    replays = [JointReplay(machine, replay, recording, dict(setup.settings), steps) for replay in machine.replays]
    return replays[0] if len(replays) == 1 else Several(replays)


def setup_of(machine: Machine, recording: Recording, base: Setup) -> Setup:
    """The operator's settings of a recording over the description's. Raises RigtwinError for settings unknown there."""
    if machine.control is None:
        return base
    known = machine.control.formula.settings
    given: dict[str, float] = {}
    for name, value in recording.controller.items():
        if name not in known:
            there = ", ".join(known) or "none"
            raise RigtwinError(f"{recording.path}: unknown controller setting {name!r}; {machine.name} has {there}")
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise RigtwinError(f"{recording.path}: controller setting {name} = {str(value)[:40]}; expected a number")
        given[name] = float(value)
    return base._replace(settings={**base.settings, **given})


class Several:
    """Several replays of one recording, their rows one after another."""

    def __init__(self, replays: Sequence[JointReplay]) -> None:
        self._replays = tuple(replays)

    def sensed(self, plant: Any) -> Array:
        return np.concatenate([each.sensed(plant) for each in self._replays])

    def true(self, plant: Any) -> Array:
        return np.concatenate([each.true(plant) for each in self._replays])

    def disturbed(self, plant: Any, entry: str, amount: Array) -> Array:
        number, _, own = entry.partition(":")
        return np.concatenate(
            [
                each.disturbed(plant, own, amount) if place == int(number) else each.sensed(plant)
                for place, each in enumerate(self._replays)
            ]
        )

    def _of(self, component: str) -> int:
        return next((n for n, each in enumerate(self._replays) if component in each.places()), 0)

    def places(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for each in self._replays for name in each.places()))

    def forms(self, component: str, plant: Any) -> list[Form]:
        number = self._of(component)
        return [
            Form(each.name, f"{number}:{each.entry}", each.signal) for each in self._replays[number].forms(component, plant)
        ]

    def strength(self, entry: str) -> float:
        number, _, own = entry.partition(":")
        return self._replays[int(number)].strength(own)

    def motion(self, component: str, plant: Any) -> Motion:
        return self._replays[self._of(component)].motion(component, plant)

    def carried_noise(self, plant: Any) -> Array | None:
        parts = [each.carried_noise(plant) for each in self._replays]
        if all(part is None for part in parts):
            return None
        ticks = next(part.shape[1] for part in parts if part is not None)
        rows = [len(each.rows) for each in self._replays]
        return np.concatenate([np.zeros((n, ticks)) if part is None else part for n, part in zip(rows, parts, strict=True)])

    def coarser(self) -> Several:
        return Several([each.coarser() for each in self._replays])

    def finer(self) -> Several:
        return Several([each.finer() for each in self._replays])
