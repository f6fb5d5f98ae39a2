"""A described machine: components with nominal values and tolerances, and the replays that compare
them with recordings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from rigtwin.components import Effect, candidates
from rigtwin.components.plant import parameter_of, select
from rigtwin.components.quantity import Quantity
from rigtwin.description.changes import override
from rigtwin.description.component import Component
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import Control
from rigtwin.description.model_checks import list_files
from rigtwin.description.physics import Physics, physics_named
from rigtwin.description.prior import ModelPrior
from rigtwin.description.replay import ReplayOf, Row
from rigtwin.description.settings import Nothing
from rigtwin.description.tolerance import Tolerance
from rigtwin.errors import RigtwinError
from rigtwin.recording import RecordedTest

FORM = {"position": 0.003, "velocity": 0.003, "force": 0.01, "command": 0.01}
"""Kind of signal → default model error, as a share of the signal. Forces are modelled less
accurately than motions."""
OWN = "own"
"""Entry of a recording's controller settings that marks a custom controller."""
CHANNEL = "unit of the channel"
"""Unit of a recorded channel in the units of declared parameters."""
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
    "N/m^3": "Nm/rad^3",
    "Ns^2/m^2": "Nms^2/rad^2",
}
"""Unit of a quantity at a slide → its unit at a hinge."""


@dataclass(frozen=True)
class Machine:
    """Machine as its description defines it.

    Attributes
    ----------
    name
        Name of the machine, which its recordings carry.
    title
        Title, for messages and reports.
    path
        Path of the description.
    model
        Path of the MJCF or URDF.
    plant
        NamedTuple of the components with their nominal values.
    kind
        Name of the machine's physics.
    components
        Component name → component.
    tolerances
        Declared tolerances of parameters.
    replays
        Replays that compare the machine with a recording.
    control
        Described controller; None without one.
    prior
        Belief in the nominal values.
    form
        Model error as a share of a signal; None for the default of the signal's kind.
    sources
        `component.parameter` → source of its value.
    parameter_settings
        `component.parameter` → controller setting whose recorded value is the parameter's value.
    experiments
        Name of the Python module with the experiments, or their tables in the description.
    limits
        Settings of the limits that end a test, a NamedTuple.
    next_tests
        Tests that a diagnosis may propose.
    overlooked
        Features of the MJCF that the models ignore, one line per feature.
    excluded
        Names of effects that are not searched for.
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
    parameter_settings: Mapping[str, str] = field(default_factory=dict, repr=False)
    experiments: str | Mapping[str, Any] = field(default_factory=dict, repr=False)
    limits: Any = field(default_factory=Nothing)
    next_tests: tuple[str, ...] = ()
    overlooked: tuple[str, ...] = ()
    excluded: frozenset[str] = frozenset()

    @property
    def physics(self) -> Physics:
        """Physics of the machine: everything that depends on its kind."""
        return physics_named(self.kind)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that define the machine: the description, the model and its included files."""
        return (self.path, *list_files(self.model))

    @property
    def configuration(self) -> Configuration:
        """Settings of the twin as described."""
        return self.physics.configure(self)

    def configuration_of(
        self, recording: RecordedTest, base: Configuration | None = None
    ) -> Configuration:
        """Return the settings of the twin of a recording.

        Parameters
        ----------
        recording
            Recording whose timing and controller settings the twin takes over.
        base
            Settings to start from. Defaults to the described ones.

        Raises
        ------
        RigtwinError
            If the recording has settings that the machine lacks.
        """
        start = self.configuration if base is None else base
        period = recording.period
        # The timestep divides the recording's period, and is at most the described one.
        # The small number keeps a quotient of exactly n from becoming n + 1 by rounding.
        steps = max(1, math.ceil(period / start.timing.timestep - 1e-9))
        duration = max(recording.ticks * period, 0.01)
        changes: dict[str, dict[str, object]] = {
            "timing": {"period": period, "duration": duration, "timestep": period / steps}
        }
        # Settings of another machine do not apply here. That the machines differ is reported by the
        # callers.
        applies = recording.machine == self.name
        recorded = {n: value for n, value in recording.controller.items() if applies and n != OWN}
        if recorded and self.control is not None:
            changes["controller"] = recorded
        for parameter, setting in self.parameter_settings.items():
            group, _, name = parameter.partition(".")
            # A base with a changed component has priority over the operator's note of its value.
            unchanged = select(start.plant, [group]) == select(self.plant, [group])
            if setting in recorded and unchanged:
                changes.setdefault(group, {})[name] = recorded[setting]
        try:
            return override(start, changes)
        except RigtwinError as error:
            raise RigtwinError(f"{recording.path}: {error}") from None

    def components_of(self, *types: type) -> list[Component]:
        """Return the components of any of these types, in the order of the description."""
        return [known for known in self.components.values() if known.component_type in types]

    @property
    def rows(self) -> tuple[Row, ...]:
        """All observed signals, in the order of the replays."""
        return tuple(row for replay in self.replays for row in replay.rows)

    @property
    def units(self) -> dict[str, str]:
        """Channel of a component, as `/topic.field` → unit."""
        return {
            ".".join(c.channel): c.unit for c in self.components.values() if c.channel is not None
        }

    def form_of(self, row: Row) -> float:
        """Return the model error of an observed signal, as a share of the signal."""
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
            # With one actuator the two delays would be the same effect under two names.
            if effect.group == "computer" and len(movers) < 2:
                continue
            if effect.name in self.excluded:
                continue
            if effect.kind.needs and not parameter_of(self.plant, effect.group, effect.kind.needs):
                continue
            known = self.components.get(effect.group)
            if known is None or known.kinds is None or effect.kind.name in known.kinds:
                yield effect

    def excluding(self, names: Iterable[str]) -> Machine:
        """Return the machine without some of its effects, which a diagnosis then does not search.

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
        """Return the declared tolerance of a parameter; None without one.

        A parameter without a declared tolerance takes that of its synonym in `SYNONYMS`.
        """
        for name in (parameter, SYNONYMS.get(parameter)):
            for tolerance in self.tolerances:
                if (tolerance.group, tolerance.parameter) == (group, name):
                    return tolerance
        return None

    def unit(self, group: str, quantity: Quantity) -> str:
        """Return the unit of a component's parameter, with angular units at a hinge."""
        component = self.components.get(group)
        unit = quantity.unit
        if component is None:
            return unit
        if "unit of the command" in unit:
            unit = unit.replace("unit of the command", component.unit or "1")
        if unit == CHANNEL:
            return component.unit or "unit"
        unit, per, _ = unit.partition(f" per {CHANNEL}")
        # Parameters are declared for slides; at a hinge the same number is in angular units.
        turned = TURNING.get(unit, unit) if component.turns else unit
        return f"{turned}/{component.unit or 'unit'}" if per else turned


SYNONYMS = {"gain": "constant", "lag": "delay"}
"""Parameter → parameter with the same effect, whose declared tolerance covers both."""
