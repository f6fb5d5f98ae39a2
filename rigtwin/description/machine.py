"""A machine as its description gives it: components with nominal values and tolerances, and how
recordings replay them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from rigtwin.components import Effect, candidates
from rigtwin.components.quantity import Quantity
from rigtwin.description.changes import override
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import Control
from rigtwin.description.model_checks import list_files
from rigtwin.description.physics import Physics, physics_named
from rigtwin.description.prior import ModelPrior
from rigtwin.description.settings import Nothing
from rigtwin.description.tolerance import Tolerance
from rigtwin.errors import RigtwinError
from rigtwin.recording import Recording

FORM = {"position": 0.003, "velocity": 0.003, "force": 0.01, "command": 0.01}
"""Kind of signal → share of it that no model is held to, where a description does not say: of
forces less is known."""
OWN = "own"
"""Of a recording's controller settings: that it was none that the machine describes."""
TURNING = {
    "m": "rad",
    "N": "Nm",
    "kg": "kg m^2",
    "Ns/m": "Nms/rad",
    "N/m": "Nm/rad",
    "m/s": "rad/s",
    "m/s^2": "rad/s^2",
    "N/s": "Nm/s",
    "m/N": "rad/Nm",
    "Ns^2/m^2": "Nms^2/rad^2",
}
"""Unit of a joint that slides → that of one that turns."""


@dataclass(frozen=True)
class Component:
    """One component. element: what of the MJCF it is, with that name; joint: the joint that it
    belongs to; channel: where recordings hold its signal, topic and field; unit: of that signal;
    kinds: of effects that it may have, None for all; acts_on: joints that a force along its
    own coordinate acts on, how far that goes for each unit of theirs; turns: is it an angle?"""

    name: str
    element: str
    mjcf: str
    joint: str
    channel: tuple[str, str] | None = None
    unit: str = ""
    kinds: frozenset[str] | None = None
    acts_on: tuple[tuple[str, float], ...] = ()
    turns: bool = False


@dataclass(frozen=True)
class Row:
    """One observed signal. kind: position, velocity, force or command; name: its component's, or
    the command's."""

    name: str
    kind: str
    channel: tuple[str, str]
    unit: str


@dataclass(frozen=True)
class Joint:
    """What the MJCF says of a replay's joint. inertia: kg, or kg m² if it turns, `armature` of it
    included, which turns with the motor alone and has no weight; gravity: load N or Nm at each of
    `positions`, over its range; rest: where its spring is slack."""

    name: str
    turns: bool
    inertia: float
    positions: tuple[float, ...]
    gravity: tuple[float, ...]
    rest: float
    armature: float = 0.0

    @property
    def goes_round(self) -> bool:
        """Whether its range is a whole turn, after which all is as before."""
        whole = self.positions[-1] - self.positions[0]
        return self.turns and math.isclose(whole, 2.0 * math.pi)


@dataclass(frozen=True)
class ReplayOf:
    """How a joint is replayed, or several that act on each other: then `joint` is the first of
    them. moved_by: the components whose signals move it: a position sensor prescribes its motion, a
    position actuator its motion through that actuator, a force actuator pushes it. closed: whether
    the controller commands that actuator, or the recording does; band: Hz up to which its signals
    are judged, None for all that is measured; rotor: the component that the joint's motor turns;
    free: joints that nothing prescribes, which go as the forces on them have it."""

    name: str
    joint: Joint
    moved_by: tuple[str, ...]
    rows: tuple[Row, ...]
    guide: str | None
    mass: str | None
    closed: bool
    band: float | None = None
    rotor: str | None = None
    free: tuple[str, ...] = ()


@dataclass(frozen=True)
class Machine:
    """The whole description.

    plant: a NamedTuple of components with their nominal values; kind: name of its physics;
    prior: belief in the nominal values; form: share of a signal that no model is held
    to, None for the usual one; told: `component.parameter` → setting of the recording's controller
    that says its value; experiments: Python module that has them, or tables of the description;
    limits: settings of what ends a test, a NamedTuple;
    next_tests: those that a diagnosis may propose; overlooked: what of the MJCF is not taken into
    account, a line each; excluded: names of effects that are not searched for.
    """

    name: str
    title: str
    path: Path
    model: Path
    plant: Any = field(repr=False)
    kind: str
    components: Mapping[str, Component]
    tolerances: tuple[Tolerance, ...]
    replays: tuple[ReplayOf, ...]
    control: Control | None
    prior: ModelPrior
    form: float | None
    sources: Mapping[str, str] = field(default_factory=dict, repr=False)
    told: Mapping[str, str] = field(default_factory=dict, repr=False)
    experiments: str | Mapping[str, Any] = field(default_factory=dict, repr=False)
    limits: Any = field(default_factory=Nothing)
    next_tests: tuple[str, ...] = ()
    overlooked: tuple[str, ...] = ()
    excluded: frozenset[str] = frozenset()

    @property
    def physics(self) -> Physics:
        """Everything that depends on the kind of machine."""
        return physics_named(self.kind)

    @property
    def files(self) -> tuple[Path, ...]:
        """What it was read from: the description, the model and what that includes."""
        return (self.path, *list_files(self.model))

    @property
    def configuration(self) -> Configuration:
        """The settings of its twin as described."""
        return self.physics.configure(self)

    def configuration_of(
        self, recording: Recording, base: Configuration | None = None
    ) -> Configuration:
        """The settings of the twin of a recording: what the operator wrote down over `base`, by
        default the description's.

        Raises RigtwinError for settings that the machine does not have.
        """
        start = self.configuration if base is None else base
        period = recording.period
        steps = max(1, math.ceil(period / start.timing.timestep - 1e-9))
        duration = max(recording.ticks * period, 0.01)
        changes: dict[str, dict[str, object]] = {
            "timing": {"period": period, "duration": duration, "timestep": period / steps},
        }
        # Settings of another machine say nothing of this one; that it is another is said elsewhere.
        own = recording.machine == self.name
        given = {n: value for n, value in recording.controller.items() if own and n != OWN}
        if given and self.control is not None:
            changes["controller"] = given
        for parameter, setting in self.told.items():
            group, _, name = parameter.partition(".")
            # What the operator says is there is there, unless the twin was given another.
            if setting in given and getattr(start.plant, group) == getattr(self.plant, group):
                changes.setdefault(group, {})[name] = given[setting]
        try:
            return override(start, changes)
        except RigtwinError as error:
            raise RigtwinError(f"{recording.path}: {error}") from None

    @property
    def rows(self) -> tuple[Row, ...]:
        """All observed signals, replay by replay."""
        return tuple(row for replay in self.replays for row in replay.rows)

    @property
    def units(self) -> dict[str, str]:
        """Channel, as `/topic.field`, → unit, of the components' channels."""
        return {
            ".".join(c.channel): c.unit for c in self.components.values() if c.channel is not None
        }

    def form_of(self, row: Row) -> float:
        """Share of a signal that no model is held to."""
        return self.form if self.form is not None else FORM[row.kind]

    def effects(self) -> Iterator[Effect]:
        """Yield all effects that this machine can have.

        The delay that all commands share (`delay@controller`) differs from an actuator's own only
        where there are several actuators.
        """
        movers = {
            mover
            for replay in self.replays
            for mover in replay.moved_by
            if (channel := self.components[mover].channel) and channel[0] == "/command"
        }
        for effect in candidates(self.plant):
            if effect.group == "computer" and len(movers) < 2:
                continue
            if effect.name in self.excluded:
                continue
            known = self.components.get(effect.group)
            if known is None or known.kinds is None or effect.kind.name in known.kinds:
                yield effect

    def excluding(self, names: Iterable[str]) -> Machine:
        """The same machine, some of whose effects are not searched for.

        Parameters
        ----------
        names
            Effects such as `delay@motor`, or kinds such as `delay` at every component.

        Raises
        ------
        RigtwinError
            For a name that no effect of the machine has.
        """
        effects = list(self.effects())
        known = {effect.name for effect in effects}
        excluded = set(self.excluded)
        for name in names:
            meant = {e.name for e in effects if name in (e.name, e.kind.name)}
            if not meant:
                kinds = {effect.kind.name for effect in effects}
                close = get_close_matches(name, [*sorted(known), *sorted(kinds)], 1)
                hint = f"did you mean {close[0]!r}? " if close else ""
                raise RigtwinError(
                    f"cannot exclude {name!r}: {self.name} has no such effect; {hint}"
                    f"there are {', '.join(sorted(known))}"
                )
            excluded |= meant
        return replace(self, excluded=frozenset(excluded))

    def tolerance_of(self, group: str, parameter: str) -> Tolerance | None:
        """The declared tolerance of a parameter, or of one that means the same, if there is one."""
        for wanted in (parameter, SAME_AS.get(parameter)):
            for each in self.tolerances:
                if (each.group, each.parameter) == (group, wanted):
                    return each
        return None

    def unit(self, group: str, quantity: Quantity) -> str:
        """The unit of a component's parameter."""
        component = self.components.get(group)
        unit = quantity.unit
        if component is None:
            return unit
        if "unit of the command" in unit:
            unit = unit.replace("unit of the command", component.unit or "1")
        return TURNING.get(unit, unit) if component.turns else unit


SAME_AS = {"gain": "constant", "lag": "delay"}
"""Parameter → the one that has the same meaning and may have the declared tolerance."""
