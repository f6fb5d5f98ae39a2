"""The physics of machines made of joints: sliders and hinges that are measured or driven."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from rigtwin.components.plant import Plant, plant_of
from rigtwin.description.configuration import Configuration, flatten
from rigtwin.description.machine import Machine
from rigtwin.description.overlooked import overlooked
from rigtwin.description.physics import Columns, Physics, TwinTest
from rigtwin.description.replay import ReplayOf
from rigtwin.description.settings import Nothing
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Inputs, RecordedTest

if TYPE_CHECKING:
    from rigtwin.description.mechanism import Mechanism
    from rigtwin.diagnosis.evidence import Evidence
    from rigtwin.diagnosis.gap import Level
    from rigtwin.diagnosis.residual import Residual
    from rigtwin.hardware.daq.signals import Signals
    from rigtwin.hardware.daq.table import ChannelTable
    from rigtwin.hardware.daq.wired import Wired
    from rigtwin.hardware.session.custom_controller import CustomController
    from rigtwin.hardware.session.test import AnyTest
    from rigtwin.models.model import Model
    from rigtwin.render.curves import Curve
    from rigtwin.simulation.experiment import Experiment
    from rigtwin.simulation.runner import RunResult
    from rigtwin.studies.tuning.run import Run

LONGEST_DELAY = 1e-3
"""Upper bound on the sampling delay of a sensor that responds to a command, s."""
EXCITATION_PERIOD = 4e-3
"""Shortest sampling period of synthetic excitation for models without integration over time, s."""


# Imports within the methods keep the start of a command fast: each needs few of these packages.
class IndependentJoints(Physics):
    """Joints that do not act on each other, each replayed on its own."""

    name = "independent joints"
    title = "a machine of joints that do not act on each other"
    longest_delay = LONGEST_DELAY
    least_period: ClassVar[float] = 0.0
    """Shortest sampling period of synthetic excitation, s."""

    def claims(self, types: Mapping[str, type], replays: Sequence[ReplayOf]) -> bool:
        return True

    def assemble(self, values: Mapping[str, Any]) -> Plant:
        return plant_of(values)

    def configure(self, machine: Machine) -> Configuration:
        settings = Nothing() if machine.control is None else machine.control.settings
        road: Any = Nothing()
        return Configuration(
            plant=machine.plant, controller=settings, safety=machine.limits, road=road
        )

    def list_overlooked(
        self, mechanism: Mechanism, components: Mapping[str, Any], replays: Sequence[ReplayOf]
    ) -> tuple[str, ...]:
        return overlooked(mechanism, components, tuple(replays))

    def split(self, machine: Machine) -> tuple[Machine, ...]:
        from rigtwin.joints.parts import parts

        return parts(machine)

    def model(
        self, machine: Machine, inputs: Inputs, configuration: Configuration, steps: int
    ) -> Model[Any]:
        from rigtwin.models.independent import IndependentModel
        from rigtwin.models.joint import JointModel

        joints = [
            JointModel(machine, replay, inputs, configuration, steps) for replay in machine.replays
        ]
        # A single joint needs no index for its disturbances.
        return joints[0] if len(joints) == 1 else IndependentModel(joints)

    def record(
        self,
        path: Path,
        machine: Machine,
        test: TwinTest,
        progress: Callable[[int], object] = lambda _ticks: None,
    ) -> RunResult:
        from rigtwin.models.machine_twin import run_machine

        result = run_machine(
            path,
            machine,
            test.experiment,
            test.configuration,
            test.demands,
            test.seed,
            effects=test.effects,
            controller=test.controller,
        )
        # The whole test is simulated in one piece.
        progress(result.ticks)
        return result

    def simulate(
        self, machine: Machine, name: str, configuration: Configuration, demands: Any, seed: int
    ) -> RecordedTest:
        from rigtwin.models.machine_twin import simulate_machine

        # Without limits, the motion shows how far the machine would go.
        unlimited: Any = Nothing()
        configuration = configuration._replace(safety=unlimited)
        columns, _ = simulate_machine(machine, configuration, demands, seed)
        period = configuration.timing.period
        ticks = next(len(signal) for names in columns.values() for signal in names.values())
        return RecordedTest(
            path=Path(name),
            machine=machine.name,
            experiment=name,
            period=period,
            time=np.arange(ticks) * period,
            columns=columns,
            controller=flatten(configuration).get("controller", {}),
        )

    def excite(self, machine: Machine) -> Iterator[RecordedTest]:
        from rigtwin.joints.excitation import excite

        return excite(machine, self.reach, self.least_period)

    def demand_motions(
        self, machine: Machine, configuration: Configuration, seed: int
    ) -> Mapping[str, Array] | None:
        from rigtwin.joints.excitation import GENTLE_HIGHEST, GENTLE_SHARE, demand_multisines

        return demand_multisines(
            machine, self.reach, configuration, GENTLE_SHARE, GENTLE_HIGHEST, [seed, 23]
        )

    def reach(self, machine: Machine, channel: tuple[str, str]) -> tuple[float, float] | None:
        """Return middle and half width of the range of a channel's demand; None if unknown."""
        from rigtwin.joints.excitation import reach_of_replay

        return reach_of_replay(machine, channel)

    def residuals(
        self, evidence: Evidence, progress: Callable[[str], object]
    ) -> tuple[dict[str, Residual], dict[str, str]]:
        from rigtwin.diagnosis.compare import signal_residuals

        return signal_residuals(evidence), {}

    def levels(
        self, evidence: Evidence, plant: Plant, corrected: Configuration
    ) -> tuple[dict[str, Level], Level | None]:
        from rigtwin.diagnosis.levels import signal_levels

        return signal_levels(evidence, plant), None

    def signals(self, machine: Machine) -> Signals:
        from rigtwin.hardware.daq.signals import signals_of

        return signals_of(machine)

    def terminals(
        self, machine: Machine, configuration: Configuration, table: ChannelTable, seed: int
    ) -> Wired:
        from rigtwin.hardware.daq.machine_terminals import MachineTerminals

        return MachineTerminals(machine, configuration, table, seed)

    def plan(
        self,
        machine: Machine,
        experiment: Experiment,
        configuration: Configuration,
        seed: int,
        table: ChannelTable,
        effects: Sequence[str],
        controller: CustomController | None,
    ) -> AnyTest:
        from rigtwin.hardware.session.test import MachineTest

        demands = experiment.demands(configuration, seed)
        name = experiment.name
        return MachineTest(machine, name, configuration, demands, seed, table, effects, controller)

    def joint_positions(
        self, machine: Machine, columns: Columns, period: float
    ) -> dict[str, Array]:
        from rigtwin.joints.positions import joint_positions

        return joint_positions(machine, columns, period)

    def curves(self, machine: Machine, recording: RecordedTest) -> list[Curve]:
        from rigtwin.render.curves import Curve
        from rigtwin.render.style import COLOURS

        curves = []
        for component in machine.components.values():
            if component.channel is not None and recording.has(*component.channel):
                topic, name = component.channel
                colour = COLOURS["measured" if topic == "/sensor" else "commanded"]
                axis = f"{name}, {component.unit or '1'}"
                curves.append(Curve(axis, "", colour, recording.column(topic, name)))
        return curves

    def figures(self, machine: Machine, job: Run, demands: Any) -> dict[str, float]:
        from rigtwin.studies.tuning.run import figures_of_joints

        return figures_of_joints(machine, job, demands)


class PrescribedJoints(IndependentJoints):
    """Joints that act on each other and move as measured: inverse dynamics."""

    name = "prescribed joints"
    title = "a machine of joints that act on each other, each moved as measured"
    # Inverse dynamics gives the same forces when time is reversed.
    reversible = True
    lacks_stops = True
    least_period = EXCITATION_PERIOD

    def claims(self, types: Mapping[str, type], replays: Sequence[ReplayOf]) -> bool:
        return any(len(replay.moved_by) > 1 and not replay.free for replay in replays)

    def model(
        self, machine: Machine, inputs: Inputs, configuration: Configuration, steps: int
    ) -> Model[Any]:
        from rigtwin.models.inverse_dynamics import InverseDynamicsModel

        return InverseDynamicsModel(machine, machine.replays[0], inputs)

    def reach(self, machine: Machine, channel: tuple[str, str]) -> tuple[float, float] | None:
        from rigtwin.joints.excitation import reach_of_component

        return reach_of_component(machine, channel)

    def base_parameters(self, machine: Machine) -> tuple[Mapping[str, float], ...]:
        from rigtwin.joints.base_parameters import find_base_parameters

        return find_base_parameters(machine)


class FreeJoints(PrescribedJoints):
    """Joints that act on each other, some of which are free to move: forward dynamics."""

    name = "free joints"
    title = "a machine of joints that act on each other, some of them free to move"
    reversible = False
    compounds = True
    longest_delay = LONGEST_DELAY
    least_period = 0.0

    def claims(self, types: Mapping[str, type], replays: Sequence[ReplayOf]) -> bool:
        return any(replay.free for replay in replays)

    def split(self, machine: Machine) -> tuple[Machine, ...]:
        return (machine,)

    def model(
        self, machine: Machine, inputs: Inputs, configuration: Configuration, steps: int
    ) -> Model[Any]:
        from rigtwin.models.forward_dynamics import ForwardDynamicsModel

        return ForwardDynamicsModel(machine, machine.replays[0], inputs, configuration, steps)

    def base_parameters(self, machine: Machine) -> tuple[Mapping[str, float], ...]:
        return ()
