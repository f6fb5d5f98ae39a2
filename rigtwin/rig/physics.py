"""The physics of the suspension rig: a quarter car between two hydraulic cylinders."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigtwin.components import RigPlant
from rigtwin.components.gas_spring import GasSpring
from rigtwin.components.plant import Plant
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import OWN, Machine
from rigtwin.description.physics import Columns, Physics, TwinTest
from rigtwin.description.replay import ReplayOf
from rigtwin.description.settings import Nothing
from rigtwin.errors import RigtwinError
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
    from rigtwin.simulation.energy import EnergyError
    from rigtwin.simulation.experiment import Experiment
    from rigtwin.simulation.runner import RunResult
    from rigtwin.studies.friction_spikes import Calibration
    from rigtwin.studies.tuning.measures import Measure
    from rigtwin.studies.tuning.run import Run

EXCITATION = 4.0
"""Duration of a made-up test, s."""
SURROUNDINGS = ("computer", "mains")
"""Parts of the plant that no description lists."""
TYPES = {n: type(part) for n, part in RigPlant()._asdict().items() if n not in SURROUNDINGS}
"""Components of the rig by name; a description may leave out the gas spring."""


# Imports within the methods keep the start of a command fast: each needs few of these packages.
class SuspensionRig(Physics):
    """A wheel on a rail between a cylinder that plays the road and one that plays the body."""

    name = "suspension rig"
    title = "a quarter car between two hydraulic cylinders"
    replayed_whole = True
    declares_limits = False
    delays_effects = True
    compares_controller = False
    has_contacts = True
    # What answers to a command is late against it: one delay for each sensor is enough.
    longest_delay = 1e-3

    @property
    def card(self) -> Path:
        from rigtwin.hardware.daq import CARD

        return CARD

    def claims(self, types: Mapping[str, type], replays: Sequence[ReplayOf]) -> bool:
        # The gas spring is optional: the real rig runs without it.
        return {"gas_spring": GasSpring} | dict(types) == TYPES

    def assemble(self, values: Mapping[str, Any]) -> Plant:
        return RigPlant(**values)

    def configure(self, machine: Machine) -> Configuration:
        settings = Nothing() if machine.control is None else machine.control.settings
        return Configuration(plant=machine.plant, controller=settings)

    def list_overlooked(
        self, mechanism: Mechanism, components: Mapping[str, Any], replays: Sequence[ReplayOf]
    ) -> tuple[str, ...]:
        return ()

    def model(
        self, machine: Machine, inputs: Inputs, configuration: Configuration, steps: int
    ) -> Model[Any]:
        from rigtwin.models.quarter_car import QuarterCarModel

        return QuarterCarModel.of(inputs, configuration, steps)

    def record(
        self,
        path: Path,
        machine: Machine,
        test: TwinTest,
        progress: Callable[[int], object] = lambda _ticks: None,
    ) -> RunResult:
        from rigtwin.description.catalogue import own_description
        from rigtwin.simulation.runner import record

        return record(
            path,
            test.experiment,
            test.configuration,
            test.demands,
            test.seed,
            progress=progress,
            effects=test.effects,
            effects_from=test.effects_from,
            machine=machine.name,
            controller=test.controller,
            description=own_description(machine),
        )

    def simulate(
        self, machine: Machine, name: str, configuration: Configuration, demands: Any, seed: int
    ) -> RecordedTest:
        from rigtwin.rig.simulated import simulate_recording

        return simulate_recording(machine.name, name, configuration, demands, seed)

    def excite(self, machine: Machine) -> Iterator[RecordedTest]:
        from rigtwin.simulation.experiment import find_experiment

        for name in machine.next_tests[:1]:
            test = find_experiment(machine, name)
            timing = test.configuration.timing._replace(duration=EXCITATION)
            configuration = test.configuration._replace(timing=timing, plant=machine.plant)
            for seed in (1, 2):
                demands = test.demands(configuration, seed)
                yield self.simulate(machine, name, configuration, demands, seed)

    def residuals(
        self, evidence: Evidence, progress: Callable[[str], object]
    ) -> tuple[dict[str, Residual], dict[str, str]]:
        from rigtwin.rig.levels import replay_residuals

        return replay_residuals(evidence, progress)

    def levels(
        self, evidence: Evidence, plant: Plant, corrected: Configuration
    ) -> tuple[dict[str, Level], Level | None]:
        from rigtwin.rig.levels import compute_levels

        return compute_levels(evidence, plant, corrected)

    def energy_error(
        self, recording: RecordedTest, configuration: Configuration, known: bool = False
    ) -> EnergyError | None:
        from rigtwin.simulation.energy import measure_energy

        # `known`: a user's controller that contains the rig's models at these settings.
        return measure_energy(recording, configuration, known)

    def advise_controller(self, described: Plant, corrected: Plant) -> dict[str, Any]:
        from rigtwin.components.cylinder import told_settings

        assert isinstance(described, RigPlant)
        assert isinstance(corrected, RigPlant)
        # A controller that compensates the plate's delay has to know the corrected one.
        before, after = (
            told_settings(plant.structure_cylinder, plant.computer.delay)
            for plant in (described, corrected)
        )
        return {name: value for name, value in after.items() if value != before[name]}

    def find_compensator(
        self, recording: RecordedTest, configuration: Configuration
    ) -> Calibration:
        from rigtwin.studies.friction_spikes import find_compensator

        return find_compensator(recording, configuration.controller)

    def signals(self, machine: Machine) -> Signals:
        from rigtwin.hardware.daq.signals import RIG

        return RIG

    def terminals(
        self, machine: Machine, configuration: Configuration, table: ChannelTable, seed: int
    ) -> Wired:
        from rigtwin.hardware.daq.terminals import Terminals

        return Terminals(configuration, table, seed)

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
        from rigtwin.hardware.session.test import Test

        if machine.plant != RigPlant():
            raise RigtwinError(f"{machine.name}: sessions run the nominal suspension rig")
        demands = experiment.demands(configuration, seed)
        return Test(experiment.name, configuration, demands, seed, table, effects, controller)

    def scene(self, machine: Machine) -> Path:
        from rigtwin.simulation.mechanics import SCENE

        return Path(str(SCENE))

    def joint_positions(
        self, machine: Machine, columns: Columns, period: float
    ) -> dict[str, Array]:
        from rigtwin.rig.pictures import joint_positions

        return joint_positions(columns, period)

    def require_motion(self, recording: RecordedTest) -> None:
        for channel in ("structure_lvdt", "suspension_lvdt"):
            recording.column("/sensor", channel)

    def deflection(self, recording: RecordedTest) -> Array | None:
        from rigtwin.simulation.structure_motion import recorded_wing

        # A custom controller does not say how its beams bend.
        return None if OWN in recording.controller else recorded_wing(recording)

    def curves(self, machine: Machine, recording: RecordedTest) -> list[Curve]:
        from rigtwin.rig.pictures import list_curves

        return list_curves(recording)

    def measures(self) -> dict[str, Measure]:
        from rigtwin.studies.tuning.measures import MEASURES

        return dict(MEASURES)

    def figures(self, machine: Machine, job: Run, demands: Any) -> dict[str, float]:
        from rigtwin.simulation.runner import simulate
        from rigtwin.studies.tuning.run import figures

        return figures(job, simulate(job.configuration, demands, job.seed))
