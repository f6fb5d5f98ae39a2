"""Kind of test of a log, concluded from its quantities and the model's actuators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rigtwin.describing.heading import read_words, split_words
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.question import ask, enumerate_names, option
from rigtwin.describing.slots import Slots
from rigtwin.description.coupling import are_coupled
from rigtwin.description.implied import FORCES, INVERSE, POSITIONS, SERVOS, TESTS
from rigtwin.description.joint_elements import actuator_on, movable_joints
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import suggest
from rigtwin.errors import RigtwinError

MOVING = (
    JointQuantity.FORCE,
    JointQuantity.CURRENT,
    JointQuantity.COMMAND,
    JointQuantity.FORCE_COMMAND,
    JointQuantity.CURRENT_COMMAND,
)
"""Quantities of what moves a joint."""


@dataclass(frozen=True)
class ReplayKind:
    """Kind of the test that a log is of.

    Parameters
    ----------
    test
        One of the kinds that a description knows.
    why
        Reason, as printed with the kind.
    """

    test: str
    why: str


def choose_kind(
    mechanism: Mechanism,
    slots: Slots,
    joints: Sequence[str],
    measured: Sequence[str],
    still: Sequence[str],
    placed: bool,
    stated: str = "",
    by_servos: bool = False,
    by_commands: bool = True,
) -> ReplayKind:
    """Choose the kind of test.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    slots
        Columns that the log offers.
    joints
        Joints that the log describes.
    measured
        Joints whose force was measured, with its sign.
    still
        Joints whose force is zero throughout.
    placed
        Whether the log holds positions, and not velocities alone.
    stated
        Kind of test that the owner of the log states; empty without one.
    by_servos
        Whether the measured forces are those that the model's servos give.
    by_commands
        Whether the model's actuators give the forces of the commands, at once and unlimited.

    Raises
    ------
    Question
        If the quantities of the log fit no test.
    """
    if stated:
        return ReplayKind(_read_stated(stated), "as stated")
    commanded = slots.joints(JointQuantity.COMMAND, joints)
    if by_servos and placed:
        return ReplayKind(SERVOS, "the measured forces are those of the model's servos")
    # Measured forces come first: they need no model of the actuators.
    if len(measured) == len(joints) and placed:
        beside = " (position commands are there too: --test servos)" if commanded else ""
        return ReplayKind(INVERSE, f"the force at every joint was measured{beside}")
    # Every command goes to an actuator that takes a position.
    if commanded and placed and all(_takes_position(mechanism, joint) for joint in commanded):
        return _position_test(mechanism, commanded)
    kind = _kind_by_commands(mechanism, slots, joints, measured, still, placed and by_commands)
    if kind is not None:
        return kind
    raise _question(mechanism, joints, measured, commanded)


def _kind_by_commands(
    mechanism: Mechanism,
    slots: Slots,
    joints: Sequence[str],
    measured: Sequence[str],
    still: Sequence[str],
    are_forces: bool,
) -> ReplayKind | None:
    """Return the kind of a test that commands drive; None where a joint lacks one.

    `are_forces` says whether commanded forces can be held against those along the motion.
    """
    pushed = [joint for joint in joints if _is_pushed(mechanism, slots, joint, (*measured, *still))]
    # Joints without an actuator move freely; all others must be pushed by something known.
    if pushed and all(actuator_on(mechanism, j) is None or j in pushed for j in joints):
        if set(pushed) <= set(still):
            return ReplayKind(FORCES, "the force is 0 throughout: the joints swing freely")
        if any(mechanism.falls_with_speed(actuator_on(mechanism, j) or "") for j in pushed):
            return ReplayKind(FORCES, "the actuators' commands are in the log")
        # Small errors of the forces make the predicted motion of an arm run away.
        together = len(joints) > 1 and are_coupled(mechanism, joints)
        if together and are_forces and _forces_are_known(mechanism, joints):
            why = "the actuators take forces, and those of every joint are in the log"
            return ReplayKind(INVERSE, why)
        return ReplayKind(FORCES, "the actuators take forces, and those are in the log")
    return None


def passive_joints(mechanism: Mechanism, joints: Sequence[str]) -> set[str]:
    """Return the joints at which no force can act: no actuator pulls, and no equality ties them.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    joints
        Joints that the log describes.
    """
    acts_on = [mechanism.acts_on("actuator", name) for name in mechanism.names("actuator")]
    # What pulls at a site or through a spatial tendon may pull at any joint.
    if not all(acts_on):
        return set()
    pulled = {joint for along in acts_on for joint, _ in along}
    tied = {joint for tie in mechanism.ties() for joint in (tie.joint, tie.to)}
    return set(joints) - pulled - tied


def _forces_are_known(mechanism: Mechanism, joints: Sequence[str]) -> bool:
    """Return whether the forces of actuators at joints are those at all joints of a model.

    No other joint moves, but for those that follow them, and no actuator pulls at several joints.
    The force at a passive joint is zero.
    """
    followers = {tie.joint for tie in mechanism.ties_of(joints)[0]}
    driven = [joint for joint in joints if joint not in passive_joints(mechanism, joints)]
    actuators = [actuator_on(mechanism, joint) for joint in driven]
    single = all(name and len(mechanism.acts_on("actuator", name)) == 1 for name in actuators)
    return single and set(movable_joints(mechanism)) - followers <= set(joints)


def _read_stated(stated: str) -> str:
    """Return the kind of test that the owner of a log states, however it is spelt."""
    wanted = stated.replace("-", " ").replace("_", " ").strip().lower()
    if wanted not in TESTS:
        raise RigtwinError(f"--test {stated}: {suggest(stated, TESTS)}")
    return wanted


def free_swing(
    mechanism: Mechanism, slots: Slots, joints: Sequence[str], refused: Mapping[str, str]
) -> ReplayKind | None:
    """Return the kind of a free swing; None where something may move the joints.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    slots
        Columns that the log offers.
    joints
        Joints whose position the log holds.
    refused
        Column → why it cannot be read as numbers.

    Raises
    ------
    RigtwinError
        If a column is named as a force or a command and cannot be read.
    """
    # A URDF cannot hold actuators, so that their absence says nothing.
    if mechanism.model.nactuator or mechanism.is_urdf:
        return None
    if any(slots.joints(quantity, joints) for quantity in MOVING):
        return None
    for column, why in refused.items():
        meaning = read_words(split_words(column), "")
        if meaning.commanded or meaning.quantity in MOVING:
            raise RigtwinError(f"column {column!r}: {why}")
    return ReplayKind(FORCES, "the model has no actuator: the joints swing freely")


def _is_pushed(mechanism: Mechanism, slots: Slots, joint: str, measured: Sequence[str]) -> bool:
    """Return whether the log holds what the actuator of a joint does."""
    if not actuator_on(mechanism, joint):
        return False
    quantities = command_quantities(mechanism, joint)
    return (joint in measured and takes_force(mechanism, joint)) or any(
        slots.has(joint, quantity) for quantity in quantities
    )


def command_quantities(mechanism: Mechanism, joint: str) -> tuple[JointQuantity, ...]:
    """Return the quantities that can be the command of a joint's actuator that takes no position.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    joint
        Joint with an actuator.
    """
    actuator = actuator_on(mechanism, joint) or ""
    if actuator and mechanism.positions(actuator):
        return (JointQuantity.FORCE_COMMAND,)
    if mechanism.is_dc_motor(actuator):
        return JointQuantity.COMMAND, JointQuantity.VOLTAGE
    if mechanism.falls_with_speed(actuator):
        # Back EMF makes a force fall with speed, so the control may be a voltage.
        return JointQuantity.VELOCITY_COMMAND, JointQuantity.COMMAND, JointQuantity.VOLTAGE
    # The control of a model's motor may be a current, with its torque constant as the gear.
    return JointQuantity.FORCE_COMMAND, JointQuantity.COMMAND, JointQuantity.CURRENT_COMMAND


def takes_force(mechanism: Mechanism, joint: str) -> bool:
    """Return whether the force of a joint's actuator follows from its command alone.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    joint
        Joint with an actuator.
    """
    return not mechanism.falls_with_speed(actuator_on(mechanism, joint) or "")


def _takes_position(mechanism: Mechanism, joint: str) -> bool:
    actuator = actuator_on(mechanism, joint)
    return actuator is not None and mechanism.positions(actuator)


def are_servos(mechanism: Mechanism, joints: Sequence[str]) -> bool:
    """Return whether the model has a servo with damping at every joint.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    joints
        Joints that take part.
    """
    placed = all(_takes_position(mechanism, joint) for joint in joints)
    return placed and _position_test(mechanism, joints).test == SERVOS


def may_be_servos(mechanism: Mechanism, joints: Sequence[str]) -> bool:
    """Return whether the model has the gains of a servo at every joint.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    joints
        Joints that take part.
    """
    return all(mechanism.servo(actuator_on(mechanism, joint) or "") for joint in joints)


def _position_test(mechanism: Mechanism, joints: Sequence[str]) -> ReplayKind:
    """Servos where the model says how they are damped; else actuators without a model inside."""
    for joint in joints:
        servo = mechanism.servo(actuator_on(mechanism, joint) or "")
        damped = mechanism.friction("joint", joint)
        if servo is None:
            return ReplayKind(POSITIONS, f"the actuator of {joint} has a gear, so it is no servo")
        if not servo["damping_gain"] and not damped["viscous"] and not damped["coulomb"]:
            return ReplayKind(
                POSITIONS,
                f"the model says nothing of the damping of {joint}, so it is no servo's model",
            )
    return ReplayKind(SERVOS, "the model's position actuators are damped, so they model servos")


def _question(
    mechanism: Mechanism, joints: Sequence[str], measured: Sequence[str], commanded: Sequence[str]
) -> RigtwinError:
    pulling = [
        a for a in mechanism.names("actuator") if mechanism.tendon_of("actuator", a) is not None
    ]
    if pulling and not measured and any(actuator_on(mechanism, j) is None for j in joints):
        return RigtwinError(
            f"actuator {pulling[0]} pulls a tendon; without a written description only a motor, or "
            "a servo without a gear, on a fixed tendon whose joints have no other actuator is "
            "understood: see docs/machines.md, joints that are free"
        )
    if not measured and not commanded:
        joint = joints[0]
        answers = [option(f"{joint}.force", "COLUMN"), option(f"{joint}.command", "COLUMN")]
        if actuator_on(mechanism, joint):
            answers.append(option(f"{joint}.command", "0") + " if nothing pushes")
        elif mechanism.is_urdf:
            answers.append("--test force-commands if nothing pushes")
        return ask(
            "no column is a measured force or a command, so nothing says what moves "
            f"{enumerate_names(list(joints))}",
            *answers,
        )
    if commanded and not measured:
        missing = [j for j in commanded if actuator_on(mechanism, j) is None]
        if missing:
            return RigtwinError(
                f"joint {missing[0]} has a command in the log and no actuator in the model; add "
                f'<position joint="{missing[0]}"/> or <motor joint="{missing[0]}"/> to the model'
            )
    known = measured or commanded
    lacking = [joint for joint in joints if joint not in known]
    if not lacking:
        # Measured forces do not say what such an actuator was told.
        moved = [joint for joint in joints if not takes_force(mechanism, joint)] or list(joints)
        return ask(
            f"no column is the command of the actuator on {enumerate_names(moved)}, and without "
            "the position the measured force does not suffice",
            option(f"{moved[0]}.command", "COLUMN"),
            option(f"{moved[0]}.position", "COLUMN"),
        )
    return ask(
        f"the log holds forces or commands of {enumerate_names(list(known))} and none of "
        f"{enumerate_names(lacking)}",
        *(option(f"{joint}.force", "COLUMN") for joint in lacking[:1]),
        *(option(f"{joint}.position", "none") + " if it rests" for joint in lacking[:1]),
    )
