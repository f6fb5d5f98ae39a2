"""Tests of a session: a test of the suspension rig, or of a described machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controllers import Commands, Measurements, update
from rigtwin.description.catalogue import own_description
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
from rigtwin.hardware.session.custom_controller import CustomController, CustomUpdate, make_tick
from rigtwin.hardware.session.recorder import RIG_LAYOUT, TickLayout, layout_of
from rigtwin.models.commanding import Command, command_by_function
from rigtwin.models.demands import check_demands, list_wanted
from rigtwin.models.machine_twin import command_of
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.simulation.peaks import Peak, peaks


@dataclass(frozen=True)
class Test:
    """Test of the suspension rig.

    Parameters
    ----------
    experiment : str
        Name of the experiment.
    configuration : Configuration
        Settings of rig, controller and clocks.
    demands : Array
        Demands, shape (ticks, 3), in the order of `controllers.Demand`.
    seed : int
        Seed of the twin's noise.
    table : ChannelTable
        Channel table of the card.
    effects : sequence of str
        Effects of the twin, as `--effect` takes them; empty on a real rig.
    controller : CustomController, optional
        Controller in place of the rig's.
    """

    __test__ = False  # pytest would collect the class by its name

    experiment: str
    configuration: Configuration
    demands: Array
    seed: int
    table: ChannelTable
    effects: Sequence[str] = ()
    controller: CustomController | None = None

    machine_name = "suspension-rig"
    description = None
    layout = RIG_LAYOUT

    @property
    def period(self) -> float:
        return self.configuration.timing.period

    @property
    def ticks(self) -> int:
        return len(self.demands)

    @property
    def controller_settings(self) -> dict[str, Any]:
        """Settings of the controller as recorded; of a user's, only where the test starts."""
        settings: dict[str, Any] = flatten(self.configuration)["controller"]
        if self.controller is None:
            return settings
        # The machine's other settings did not act, and would mislead a reader of the recording.
        return {OWN: True, **{name: settings[name] for name in ("start", "preload")}}

    def updating(self) -> Update:
        """Return the controller of one session."""
        if self.controller is None:
            return update
        return CustomUpdate(self.controller, self.configuration)

    @property
    def card_configuration(self) -> Configuration:
        """Configuration with the limits that the channel table adds.

        Raises
        ------
        RigtwinError
            If a limit exceeds a line's range.
        """
        require_ranges(self.table, self.configuration.safety)
        return self.configuration._replace(safety=self.table.tighten(self.configuration.safety))

    def operation(self, updating: Update | None = None) -> RigOperation:
        """Return the operation of the test. `updating` replaces the test's controller."""
        return RigOperation(self.card_configuration, self.demands, updating or self.updating())

    def terminals(self) -> Terminals:
        """Build the twin at the card's terminals, wired as the table says."""
        return Terminals(
            apply_effects(self.configuration, list(self.effects)), self.table, self.seed
        )

    def list_demands(self) -> bytes:
        """Return the demands as bytes, for a session's key."""
        return np.ascontiguousarray(self.demands).tobytes()

    def require_limits(self) -> None:
        """Do nothing: the rig always has limits."""

    def predict_peaks(self, recording: RecordedTest) -> tuple[Peak, ...]:
        """Return how near a session came to every limit."""
        commands, measurements = (
            np.column_stack([recording.column(topic, name) for name in names])
            for topic, names in (("/command", Commands._fields), ("/sensor", Measurements._fields))
        )
        return peaks(commands, measurements, self.card_configuration)


@dataclass(frozen=True)
class MachineTest:
    """Test of a described machine.

    Parameters
    ----------
    machine : Machine
        Machine under test.
    experiment, configuration, seed, table, effects, controller
        See `Test`.
    demands : mapping
        Demands of the experiment by channel.
    """

    machine: Machine
    experiment: str
    configuration: Configuration
    demands: Mapping[str, Array]
    seed: int
    table: ChannelTable
    effects: Sequence[str] = ()
    controller: CustomController | None = None

    @property
    def machine_name(self) -> str:
        return self.machine.name

    @property
    def description(self) -> Path | None:
        """Description of the machine; None for a shipped one."""
        return own_description(self.machine)

    @property
    def period(self) -> float:
        return self.configuration.timing.period

    @property
    def ticks(self) -> int:
        return next((len(signal) for signal in self.demands.values()), self.configuration.ticks)

    @property
    def layout(self) -> TickLayout:
        demanded, _ = self._plan()
        written = [signal.channel for signal in self.table.signals.outputs]
        return layout_of(self.table.signals, [c for c in demanded if c not in written])

    def _plan(self) -> tuple[dict[tuple[str, str], Array], list[str]]:
        """Return the demand of each channel, and the actuators that a controller commands."""
        wanted, outputs = list_wanted(self.machine, self.demands, self.controller)
        columns = check_demands(self.machine, wanted, self.demands)
        demanded = {
            (topic, name): signal
            for topic, names in columns.items()
            for name, signal in names.items()
        }
        return demanded, outputs

    @property
    def controller_settings(self) -> dict[str, Any]:
        if self.controller is not None:
            return {OWN: True}
        return flatten(self.configuration).get("controller", {})

    def operation(self) -> MachineOperation:
        """Return the operation of the test. Raise RigtwinError if a limit exceeds a line."""
        safety, signals = self.configuration.safety._asdict(), self.table.signals
        # A line must carry the larger of both limits.
        limits = {
            s.name: (f"safety.{s.name}", max(abs(safety[s.name + LOW]), abs(safety[s.name + HIGH])))
            for s in (*signals.inputs, *signals.outputs)
            if s.name + LOW in safety
        }
        require_reach(self.table, limits)
        demanded, outputs = self._plan()
        # Demands are grouped by topic, as a controller takes them.
        columns: dict[str, dict[str, Array]] = {}
        for (topic, name), signal in demanded.items():
            columns.setdefault(topic, {})[name] = signal
        command: Command | None = None
        if self.controller is not None:
            tick = make_tick(self.controller, self.configuration)
            command = command_by_function(tick, columns)
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
        """Build the twin at the card's terminals, wired as the table says."""
        actual = apply_effects(self.configuration, list(self.effects))
        return MachineTerminals(self.machine, actual, self.table, self.seed)

    def list_demands(self) -> bytes:
        """Return the demands as bytes, for a session's key."""
        return b"".join(
            name.encode() + np.ascontiguousarray(signal).tobytes()
            for name, signal in sorted(self.demands.items())
        )

    def predict_peaks(self, recording: RecordedTest) -> tuple[Peak, ...]:
        """Return how near a session came to every limit."""
        limited = limited_signals(self.machine, self.configuration, recording.columns)
        return tuple(
            Peak(limit.name, *limit.nearest(signal), limit.unit) for limit, signal in limited
        )

    def require_limits(self) -> None:
        """Raise RigtwinError unless every command has limits, which alone protect the machine."""
        for signal in self.table.signals.outputs:
            low, high = reach_of(self.configuration, signal.name)
            if not np.isfinite([low, high]).all():
                raise RigtwinError(
                    f"{self.machine_name}: {signal.name} has no limits; a machine is moved only "
                    f"within limits of its commands: [limits] {signal.name} = [low, high]"
                )


AnyTest = Test | MachineTest
"""Test of any machine; picklable. `operation` raises RigtwinError if a limit exceeds a line's
range."""
