"""The physics of a kind of machine: everything that depends on what a machine is built of.

A kind is a subclass of `Physics` and one call of `register`. The rest of the package asks
`machine.physics` and never which kind it is.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array
from rigtwin.recording import Inputs, RecordedTest

if TYPE_CHECKING:
    from rigtwin.components.plant import Plant
    from rigtwin.description.machine import Machine
    from rigtwin.description.mechanism import Mechanism
    from rigtwin.description.replay import ReplayOf
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

Columns = Mapping[str, Mapping[str, Array]]
"""Topic → field → values, shape (ticks,)."""


@dataclass(frozen=True)
class TwinTest:
    """A test to be run on a twin.

    Attributes
    ----------
    experiment : str
        Name of the test.
    configuration : Configuration
        Settings that the operator knows.
    demands
        Demanded signals, see `Experiment`.
    seed : int
        Seed of the sensor noise.
    effects : sequence of str
        Hidden effects: simulated, but not stored in the recording's settings.
    effects_from : float
        Time from which the effects act, s.
    controller
        Function of measurements and demands that replaces the machine's controller.
    """

    experiment: str
    configuration: Configuration
    demands: Any
    seed: int
    effects: Sequence[str] = ()
    effects_from: float = 0.0
    controller: Any = None


class Physics(ABC):
    """One kind of machine.

    Attributes
    ----------
    name : str
        Name of the kind, stored with the machine.
    title : str
        Noun phrase for such a machine, for messages.
    replayed_whole : bool
        Whether a replay covers the whole machine instead of one joint.
    declares_limits : bool
        Whether a description may declare the limits that end a test.
    delays_effects : bool
        Whether effects may begin during a test.
    compares_controller : bool
        Whether a comparison may change the controller's settings.
    reversible : bool
        Whether the model fits a recording equally well when time runs backwards.
    lacks_stops : bool
        Whether the model leaves out the stops at the ends of the joints' ranges.
    compounds : bool
        Whether motions of several joints integrate the effects, so that one effect may resemble
        several others together. The search then begins with the regular effects, and ends with
        the rare ones.
    has_contacts : bool
        Whether the model has the contacts of the MJCF.
    longest_delay : float
        Largest sampling delay of an observed signal, s.
    card : Path or None
        Channel table of the card that such a machine is shipped with.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    replayed_whole: ClassVar[bool] = False
    declares_limits: ClassVar[bool] = True
    delays_effects: ClassVar[bool] = False
    compares_controller: ClassVar[bool] = True
    reversible: ClassVar[bool] = False
    lacks_stops: ClassVar[bool] = False
    compounds: ClassVar[bool] = False
    has_contacts: ClassVar[bool] = False
    longest_delay: ClassVar[float] = math.inf

    @property
    def card(self) -> Path | None:
        """Channel table of the card that such a machine is shipped with."""
        return None

    # Description: which machines are of this kind, and how their plant is assembled.

    @abstractmethod
    def claims(self, types: Mapping[str, type], replays: Sequence[ReplayOf]) -> bool:
        """Return whether components of these types, replayed like this, are of this kind.

        Parameters
        ----------
        types
            Name → type of each component.
        replays
            Replays of the description; empty before they are read.
        """

    @abstractmethod
    def assemble(self, values: Mapping[str, Any]) -> Plant:
        """Return the plant made of these components. values: name → component."""

    @abstractmethod
    def configure(self, machine: Machine) -> Configuration:
        """Return the settings of the machine's twin as described."""

    @abstractmethod
    def list_overlooked(
        self, mechanism: Mechanism, components: Mapping[str, Any], replays: Sequence[ReplayOf]
    ) -> tuple[str, ...]:
        """Return a line for each feature of the MJCF that the models ignore."""

    def split(self, machine: Machine) -> tuple[Machine, ...]:
        """Return the machine as parts whose effects change no signal of another part."""
        return (machine,)

    # Model and twin: how a machine of this kind is simulated.

    @abstractmethod
    def model(
        self, machine: Machine, inputs: Inputs, configuration: Configuration, steps: int
    ) -> Model[Any]:
        """Return the fastest model of the machine under these inputs.

        Parameters
        ----------
        machine
            Machine to model.
        inputs
            Signals that drive it.
        configuration
            Settings of the test.
        steps
            Integration steps per tick.
        """

    @abstractmethod
    def record(
        self,
        path: Path,
        machine: Machine,
        test: TwinTest,
        progress: Callable[[int], object] = lambda _ticks: None,
    ) -> RunResult:
        """Run a test on the twin and record it.

        Parameters
        ----------
        path
            File to write.
        machine
            Machine to simulate.
        test
            Test to run: experiment, settings, demands and effects.
        progress
            Called with the ticks done since its last call.
        """

    @abstractmethod
    def simulate(
        self, machine: Machine, name: str, configuration: Configuration, demands: Any, seed: int
    ) -> RecordedTest:
        """Return the recording that a test without limits would make, in memory."""

    @abstractmethod
    def excite(self, machine: Machine) -> Iterator[RecordedTest]:
        """Yield recordings of the twin under rich motions within the joints' ranges."""

    def demand_motions(
        self, machine: Machine, configuration: Configuration, seed: int
    ) -> Mapping[str, Array] | None:
        """Return demands that move every joint richly and gently; None where a range is unknown.

        Parameters
        ----------
        machine
            Machine that is to move.
        configuration
            Settings, whose timing gives the ticks.
        seed
            Seed of the motions.

        Returns
        -------
        dict or None
            Channel `/topic.field` → values, shape (ticks,).
        """
        return None

    def base_parameters(self, machine: Machine) -> tuple[Mapping[str, float], ...]:
        """Return the sums of inertial parameters of which only the sum is observable."""
        return ()

    # Diagnosis: how the gap between recording and twin is measured.

    @abstractmethod
    def residuals(
        self, evidence: Evidence, progress: Callable[[str], object]
    ) -> tuple[dict[str, Residual], dict[str, str]]:
        """Return the residual of each replay of the first recording, and why others are missing."""

    @abstractmethod
    def levels(
        self, evidence: Evidence, plant: Plant, corrected: Configuration
    ) -> tuple[dict[str, Level], Level | None]:
        """Return the gap of each replay and of the closed loop before and after a correction.

        Parameters
        ----------
        evidence
            Recordings, about their nominal plant.
        plant
            Corrected plant.
        corrected
            Settings of the corrected twin.
        """

    def energy_error(
        self, recording: RecordedTest, configuration: Configuration, known: bool = False
    ) -> EnergyError | None:
        """Return the energy that a hybrid test's loop puts in, or None for other tests.

        Parameters
        ----------
        recording
            Test to judge.
        configuration
            Its settings.
        known
            Whether the settings hold for a custom controller too.
        """
        return None

    def advise_controller(self, described: Plant, corrected: Plant) -> dict[str, Any]:
        """Return controller settings that the corrected plant asks for."""
        return {}

    def find_compensator(
        self, recording: RecordedTest, configuration: Configuration
    ) -> Calibration:
        """Return the settings of a friction compensator that a recording asks for.

        Raises
        ------
        RigtwinError
            If such a machine has no friction compensator.
        """
        raise RigtwinError(
            f"{recording.path}: it is of machine {recording.machine!r}; {self.title} has no "
            "friction compensator to calibrate"
        )

    # Card and sessions: how a machine of this kind is connected and led through a test.

    @abstractmethod
    def signals(self, machine: Machine) -> Signals:
        """Return the signals that a card's channel table connects."""

    @abstractmethod
    def terminals(
        self, machine: Machine, configuration: Configuration, table: ChannelTable, seed: int
    ) -> Wired:
        """Return the twin wired to the terminals of the virtual card."""

    @abstractmethod
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
        """Return the test of a session.

        Parameters
        ----------
        machine
            Machine under test.
        experiment
            Experiment with the demands of the test.
        configuration
            Settings of the test.
        seed
            Seed of the excitation and of the twin's noise.
        table
            Channel table of the card.
        effects
            Effects of the twin on the virtual card.
        controller
            Custom controller; None for the machine's own.
        """

    # Pictures

    def scene(self, machine: Machine) -> Path:
        """Return the MJCF to draw."""
        return machine.model

    @abstractmethod
    def joint_positions(
        self, machine: Machine, columns: Columns, period: float
    ) -> dict[str, Array]:
        """Return joint → position at every tick, m or rad; joints without a signal are left out."""

    def require_motion(self, recording: RecordedTest) -> None:  # noqa: B027
        """Raise RigtwinError if a channel that pictures need is missing."""

    def deflection(self, recording: RecordedTest) -> Array | None:
        """Return the shape of flexible parts at every tick, or None if there are none."""
        return None

    @abstractmethod
    def curves(self, machine: Machine, recording: RecordedTest) -> list[Curve]:
        """Return the curves to draw under the scene."""

    # Tuning

    def measures(self) -> dict[str, Measure]:
        """Return the measures that every study of such a machine knows, by name."""
        return {}

    @abstractmethod
    def figures(self, machine: Machine, job: Run, demands: Any) -> dict[str, float]:
        """Return the measures of one run of a tuning study, by name."""


BUILT_IN = (
    "rigtwin.rig.physics:SuspensionRig",
    "rigtwin.joints.physics:FreeJoints",
    "rigtwin.joints.physics:PrescribedJoints",
    "rigtwin.joints.physics:IndependentJoints",
)
"""Shipped kinds as `module:class`, the most specific first. Their modules import this one, which
therefore names them instead of importing them."""
# The only module-level state: kinds that users register, in the order in which they are asked.
_registered: list[Physics] = []


def register(physics: Physics) -> None:
    """Add a kind of machine. Later registrations are asked first."""
    _registered.insert(0, physics)


def unregister(physics: Physics) -> None:
    """Remove a kind that was registered."""
    _registered.remove(physics)


@cache
def _load(entry: str) -> Physics:
    """Import a kind when it is first asked for, and keep it."""
    module, _, name = entry.partition(":")
    return getattr(import_module(module), name)()


def _kinds() -> Iterator[Physics]:
    """Yield all kinds in the order in which they are asked: registered ones first."""
    yield from _registered
    yield from map(_load, BUILT_IN)


def find_physics(types: Mapping[str, type], replays: Sequence[ReplayOf]) -> Physics:
    """Return the first kind that claims a machine, see `Physics.claims`.

    Parameters
    ----------
    types
        Component name → type.
    replays
        Replays of the description.
    """
    return next(kind for kind in _kinds() if kind.claims(types, replays))


def physics_named(name: str) -> Physics:
    """Return the kind with a name, as `Physics.name` states it."""
    for kind in _kinds():
        if kind.name == name:
            return kind
    raise RigtwinError(f"machine kind {name!r} is not registered here; call physics.register first")
