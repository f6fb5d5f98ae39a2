"""What is to be done in a session: a test of the suspension rig, or of a described machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from controllers import Commands, Measurements, update
from rigtwin.description.configuration import Configuration, flatten
from rigtwin.description.effects import apply_effects
from rigtwin.description.limits import HIGH, LOW, limited_signals
from rigtwin.description.machine import OWN, Machine
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.machine_terminals import MachineTerminals
from rigtwin.hardware.daq.signals import reach_of
from rigtwin.hardware.daq.table import ChannelTable, StuckLimit, require_ranges, require_reach
from rigtwin.hardware.daq.terminals import Terminals
from rigtwin.hardware.machine_operation import MachineOperation
from rigtwin.hardware.rig_operation import RigOperation, Update
from rigtwin.hardware.session.own_controller import OwnController, OwnUpdate, make_own
from rigtwin.hardware.session.recorder import RIG_LAYOUT, Layout, layout_of
from rigtwin.models.commanding import Command, command_by_function
from rigtwin.models.demands import check_demands, list_wanted
from rigtwin.models.machine_twin import command_of
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Recording
from rigtwin.simulation.peaks import Peak, peaks


@dataclass(frozen=True)
class Test:
    """A test of the suspension rig.

    Parameters
    ----------
    experiment : str
        Its name.
    configuration : Configuration
        Of rig, controller and clocks.
    demands : Array
        Columns of controllers.Demand, shape (ticks, 3).
    seed : int
        Of the twin's noise.
    table : ChannelTable
        Of the card.
    effects : sequence of str
        Of the twin, as `--effect` takes them; none on a real rig.
    own : OwnController, optional
        One's own instead of the rig's.
    """

    __test__ = False  # not one of pytest's

    experiment: str
    configuration: Configuration
    demands: Array
    seed: int
    table: ChannelTable
    effects: Sequence[str] = ()
    own: OwnController | None = None

    machine_name = "suspension-rig"
    layout = RIG_LAYOUT

    @property
    def period(self) -> float:
        return self.configuration.timing.period

    @property
    def ticks(self) -> int:
        return len(self.demands)

    @property
    def controller_settings(self) -> dict[str, Any]:
        """What a recording says of the controller: of one's own only where the test started."""
        told: dict[str, Any] = flatten(self.configuration)["controller"]
        if self.own is None:
            return told
        return {OWN: True, **{name: told[name] for name in ("start", "preload")}}

    def updating(self) -> Update:
        """The controller of one session."""
        return update if self.own is None else OwnUpdate(self.own, self.configuration)

    @property
    def card_configuration(self) -> Configuration:
        """The configuration with the limits that the card's table adds.

        Raises
        ------
        RigtwinError
            Where a limit does not fit the card's lines.
        """
        require_ranges(self.table, self.configuration.safety)
        return self.configuration._replace(safety=self.table.tighten(self.configuration.safety))

    def operation(self, updating: Update | None = None) -> RigOperation:
        """The test for a session to run. updating: the controller; the test's by default."""
        return RigOperation(self.card_configuration, self.demands, updating or self.updating())

    def terminals(self) -> Terminals:
        """Builds the twin at the card's terminals, wired as the table says."""
        return Terminals(
            apply_effects(self.configuration, list(self.effects)), self.table, self.seed
        )

    def list_demands(self) -> bytes:
        """What is demanded, so that it is known again."""
        return np.ascontiguousarray(self.demands).tobytes()

    def require_limits(self) -> None:
        """The rig always has them."""

    def predict_peaks(self, recording: Recording) -> tuple[Peak, ...]:
        """How near to every limit a session came."""
        commands, measurements = (
            np.column_stack([recording.column(topic, name) for name in names])
            for topic, names in (("/command", Commands._fields), ("/sensor", Measurements._fields))
        )
        return peaks(commands, measurements, self.card_configuration)


@dataclass(frozen=True)
class MachineTest:
    """A test of a described machine.

    Parameters
    ----------
    machine : Machine
        Its description.
    experiment, configuration, seed, table, effects, own
        As of a `Test`.
    demands : mapping
        What its experiment demands, by channel.
    """

    machine: Machine
    experiment: str
    configuration: Configuration
    demands: Mapping[str, Array]
    seed: int
    table: ChannelTable
    effects: Sequence[str] = ()
    own: OwnController | None = None

    @property
    def machine_name(self) -> str:
        return self.machine.name

    @property
    def period(self) -> float:
        return self.configuration.timing.period

    @property
    def ticks(self) -> int:
        return next((len(signal) for signal in self.demands.values()), self.configuration.ticks)

    @property
    def layout(self) -> Layout:
        demanded, _ = self._plan()
        written = [signal.channel for signal in self.table.signals.outputs]
        return layout_of(self.table.signals, [c for c in demanded if c not in written])

    def _plan(self) -> tuple[dict[tuple[str, str], Array], list[str]]:
        """What is demanded of each channel, and actuators that a controller commands."""
        wanted, outputs = list_wanted(self.machine, self.demands, self.own)
        columns = check_demands(self.machine, wanted, self.demands)
        demanded = {
            (topic, name): signal
            for topic, names in columns.items()
            for name, signal in names.items()
        }
        return demanded, outputs

    @property
    def controller_settings(self) -> dict[str, Any]:
        return {OWN: True} if self.own else flatten(self.configuration).get("controller", {})

    def operation(self) -> MachineOperation:
        """The test for a session to run."""
        safety, signals = self.configuration.safety._asdict(), self.table.signals
        limits = {
            s.name: (f"safety.{s.name}", max(abs(safety[s.name + LOW]), abs(safety[s.name + HIGH])))
            for s in (*signals.inputs, *signals.outputs)
            if s.name + LOW in safety
        }
        require_reach(self.table, limits)
        demanded, outputs = self._plan()
        columns: dict[str, dict[str, Array]] = {}
        for (topic, name), signal in demanded.items():
            columns.setdefault(topic, {})[name] = signal
        command: Command | None = None
        if self.own is not None:
            command = command_by_function(make_own(self.own, self.configuration), columns)
        elif outputs:
            command = command_of(self.machine, self.configuration, columns)
        alive = self.table.plausible
        return MachineOperation(
            machine=self.machine,
            configuration=self.configuration,
            signals=signals,
            demands=demanded,
            outputs=outputs,
            command=command,
            stuck=alive.stuck if isinstance(alive, StuckLimit) else 0.0,
        )

    def terminals(self) -> MachineTerminals:
        """Builds the twin at the card's terminals, wired as the table says."""
        actual = apply_effects(self.configuration, list(self.effects))
        return MachineTerminals(self.machine, actual, self.table, self.seed)

    def list_demands(self) -> bytes:
        """What is demanded, so that it is known again."""
        return b"".join(
            name.encode() + np.ascontiguousarray(signal).tobytes()
            for name, signal in sorted(self.demands.items())
        )

    def predict_peaks(self, recording: Recording) -> tuple[Peak, ...]:
        """How near to every limit a session came."""
        found = limited_signals(self.machine, self.configuration, recording.columns)
        return tuple(
            Peak(limit.name, *limit.nearest(signal), limit.unit) for limit, signal in found
        )

    def require_limits(self) -> None:
        """Raises RigtwinError unless all that is commanded has limits: without them nothing keeps a
        machine from harm."""
        for signal in self.table.signals.outputs:
            low, high = reach_of(self.configuration, signal.name)
            if not np.isfinite([low, high]).all():
                raise RigtwinError(
                    f"{self.machine_name}: {signal.name} has no limits; a machine is moved only "
                    f"within limits of its commands: [limits] {signal.name} = [low, high]"
                )


AnyTest = Test | MachineTest
"""Picklable. An `operation` raises RigtwinError where a limit does not fit the card's lines."""
