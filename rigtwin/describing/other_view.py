"""The same log seen otherwise: as another kind of test.

A motion that forces drive cannot be predicted where small errors grow: cogging catches a carriage
in another valley, and a joint that only a controller holds drifts away. Along the measured motion,
inverse dynamics predict the forces at every moment, whatever happened before.

A column "tau" may hold the measured force or the commanded one. Along the motion a commanded force
that the actuator never gave is no force of any law, but it predicts the motion once the actuator's
limit is known.

Position commands of a model without damping are taken for actuators that follow them whatever the
load. A single servo that gives way to its load is seen better as a servo.

A log of servos may hold their commands and their forces. Play before the position sensor, or a
force that is sampled between two commands, contradicts inverse dynamics, but not the motion that
the commands cause. Where the forces show no gap, the servos that give them may have one.
"""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.describing.described import Described, describe_log
from rigtwin.describing.log import STATED
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.reading import Reading
from rigtwin.describing.replay_kind import are_servos, may_be_servos
from rigtwin.description.coupling import are_coupled
from rigtwin.description.implied import FORCES, INVERSE, POSITIONS, SERVOS
from rigtwin.description.joint_elements import actuator_on
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError

MOST = 0.5
"""Least share of the gap that an answer in another view must close to take the place of the first
answer. Forces that are taken as measured are doubted below the same share."""
ENOUGH = 0.8
"""Share of the gap from which a motion predicted from forces is not doubted. It is the share that
an explained gap needs as well."""


@dataclass(frozen=True)
class OtherView:
    """Another kind of test as which a log can be judged.

    Attributes
    ----------
    test
        Kind of the test.
    below
        Share of the gap below which the first answer must stay for this view to be tried.
    least
        Share of the gap that the answer of this view must close to take the place of the first;
        None where it must leave less of the same signals, as the nominal twins differ.
    reason
        Why the log is judged so, for a note.
    of_commands
        Whether the view is for logs whose forces are those of commands; others are for the rest.
    """

    test: str
    below: float
    least: float | None
    reason: str
    of_commands: bool = False


VIEWS = {
    FORCES: (
        OtherView(
            INVERSE,
            ENOUGH,
            MOST,
            "judged by the forces along the measured motion, as the motion predicted from the "
            "forces departs from the measured one",
        ),
    ),
    INVERSE: (
        OtherView(
            SERVOS,
            1.0,
            1.0,
            "judged by the motion that the commands cause, as no model explains the forces along "
            "the measured motion; --test inverse-dynamics judges these",
        ),
        # A motion drifts away from any prediction, and an effect that bounds it closes most of such
        # a gap. So forces count as commands only where these explain everything.
        OtherView(
            FORCES,
            MOST,
            1.0,
            "the logged forces are taken as commands, as no model explains them as forces along "
            "the measured motion; --test inverse-dynamics takes them as measured",
        ),
        OtherView(
            FORCES,
            ENOUGH,
            MOST,
            "judged by the motion that the commands cause, as no model explains them as forces "
            "along the measured motion; --test inverse-dynamics judges these",
            of_commands=True,
        ),
    ),
    POSITIONS: (
        OtherView(
            SERVOS,
            1.0,
            None,
            "judged as servos that give way to their load, which leaves less of the motion; "
            "--test position-commands judges them as actuators that do not",
        ),
    ),
}
"""Kind of a test → the views in which the same log may be judged, in the order of trial."""
DRIVES = OtherView(
    SERVOS,
    1.0,
    1.0,
    "judged by the motion that the servos' commands cause, as the forces along the measured motion "
    "show no gap; --test inverse-dynamics judges these alone",
)
"""View that judges the servos of a machine whose forces show no gap."""


def describe_otherwise(described: Described, view: OtherView) -> Described | None:
    """Describe a machine from its model and a log as for another kind of test.

    Parameters
    ----------
    described
        Machine described from its model and a log.
    view
        The other kind of test.

    Returns
    -------
    Described or None
        None where the owner of the log stated what the log is, or where it cannot be such a test.
    """
    reading = described.reading
    if described.test or reading.velocities or reading.idle:
        return None
    mechanism = Mechanism(described.machine.model)
    if view.test == FORCES:
        are_commands = _are_commands(reading)
        if view.of_commands != are_commands:
            return None
        if not are_commands and not _may_be_commands(described, mechanism):
            return None
    if view.test == SERVOS and reading.kind.test == POSITIONS:
        # Servos of a whole arm whose damping is unknown take minutes, a single one takes seconds.
        if len(reading.joints) > 1 or not may_be_servos(mechanism, reading.joints):
            return None
    elif view.test == SERVOS and not are_servos(mechanism, reading.joints):
        return None
    try:
        return describe_log(described.machine.model, described.log, described.stated, view.test)
    except RigtwinError:
        # The log lacks the force or the command of some joint.
        return None


def _are_commands(reading: Reading) -> bool:
    """Return whether the forces of a log are those of commands."""
    forces = [s for s in reading.signals if s.quantity is JointQuantity.FORCE]
    return bool(forces) and all(signal.from_command for signal in forces)


def _may_be_commands(described: Described, mechanism: Mechanism) -> bool:
    """Return whether the forces of a log may be commands that predict the motion.

    Coupled joints that measured forces push drift away within seconds, and show nothing.
    """
    reading = described.reading
    forces = [s for s in reading.signals if s.commands or s.quantity is JointQuantity.FORCE]
    are_assumed = all(signal.why != STATED for signal in forces)
    are_driven = all(actuator_on(mechanism, joint) is not None for joint in reading.joints)
    return are_assumed and are_driven and not are_coupled(mechanism, list(reading.joints))
