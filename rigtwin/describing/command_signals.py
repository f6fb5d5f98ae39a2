"""The commands of the joints' actuators: positions, or forces."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigtwin.describing.checks import follows
from rigtwin.describing.heading import split_words, stated_unit
from rigtwin.describing.log import STATED, Log
from rigtwin.describing.match import MOTOR_CURRENT
from rigtwin.describing.quantity import SI, JointQuantity
from rigtwin.describing.question import Question, option
from rigtwin.describing.replay_kind import command_quantities, takes_force
from rigtwin.describing.signal import LogSignal
from rigtwin.describing.units import (
    PERCENT,
    Unit,
    actuator_constant,
    command_unit,
    largest_control,
)
from rigtwin.description.implied import FORCES, MOVERS
from rigtwin.description.joint_elements import actuator_on
from rigtwin.description.mechanism import Mechanism
from rigtwin.importing.units import is_unit, unit_of
from rigtwin.numerics.arrays import Array

SPAN = 0.05
"""Time over which the rate of a position is taken, s."""
OPPOSED = -0.5
"""Correlation of a command and a position below which the command's sign is turned."""


def position_command(log: Log, joint: str, positions: Mapping[str, Array]) -> LogSignal | None:
    """Return the command of a position actuator; None where a question is open.

    Parameters
    ----------
    log
        The log. Questions are added to it.
    joint
        Joint that the actuator moves.
    positions
        Joint → its position, SI, shape (rows,).
    """
    key = f"{joint}.command"
    if not log.slots.has(joint, JointQuantity.COMMAND):
        log.questions.append(
            f"no column is the command of joint {joint}; say {option(key, 'COLUMN')}"
        )
        return None
    source = log.slots.stated(joint, JointQuantity.COMMAND)
    # The owner has stated all of it: nothing is left to conclude.
    if source is not None and (source.formula or source.unit):
        return log.stated_signal(joint, JointQuantity.COMMAND)
    return _following_command(log, joint, JointQuantity.COMMAND, travel(log, joint, positions))


def travel(log: Log, joint: str, positions: Mapping[str, Array]) -> Array:
    """Return the position of a joint's actuator, SI, shape (rows,): of the joint, or of a tendon.

    Parameters
    ----------
    log
        The log.
    joint
        Joint that the actuator moves.
    positions
        Joint → its position, SI, shape (rows,).
    """
    along = log.mechanism.acts_on("actuator", actuator_on(log.mechanism, joint) or "")
    if not all(name in positions for name, _ in along):
        return positions[joint]
    return np.asarray(sum(ratio * positions[name] for name, ratio in along))


def force_command(
    log: Log, joint: str, measured: Mapping[str, LogSignal], position: Array
) -> LogSignal | None:
    """Return the command of an actuator that pushes, as the actuator takes it.

    Parameters
    ----------
    log
        The log. Questions are added to it.
    joint
        Joint that the actuator pushes.
    measured
        Joint → measured force, which can take the place of a command.
    position
        Position of the joint, SI, shape (rows,).
    """
    for quantity in command_quantities(log.mechanism, joint):
        if log.slots.has(joint, quantity):
            if quantity is JointQuantity.VELOCITY_COMMAND:
                return _following_command(log, joint, quantity, _velocity(position, log.time()))
            return _control(log, joint, quantity)
    # Without any command, the measured force itself is what pushes the model's joint.
    if takes_force(log.mechanism, joint) and joint in measured:
        control = _as_control(log, measured[joint])
        return replace(control, quantity=JointQuantity.FORCE_COMMAND)
    log.questions.append(
        f"no column is the command of joint {joint}; say "
        f"{option(f'{joint}.command', 'COLUMN')} or {option(f'{joint}.command', '0')}"
    )
    return None


def _following_command(
    log: Log, joint: str, quantity: JointQuantity, motion: Array
) -> LogSignal | None:
    """The command that a motion follows; None where a question is open.

    Its unit and its sign are told by the motion: a position in SI, or a velocity.
    """
    # A column that its owner assigned keeps the sign that the owner gave.
    is_stated = log.slots.stated(joint, quantity) is not None
    measured = JointQuantity.POSITION if quantity is JointQuantity.COMMAND else quantity
    actuator = actuator_on(log.mechanism, joint) or ""
    si = SI[measured][log.mechanism.is_angle(log.mechanism.acts_on("actuator", actuator))]
    try:
        column, why, sign = _source(log, joint, quantity)
        general = log.stated.units.get(quantity)
        unit = (
            Unit(general)
            if general is not None
            else command_unit(log.columns, column, motion, si, f"{joint}.command")
        )
    except Question as question:
        log.questions.append(str(question))
        return None
    assumed = [unit.assumed] if unit.assumed else []
    # A joint follows its command, late but in the same direction.
    if not is_stated and follows(log.columns.values[column], motion) < OPPOSED:
        sign = -1.0
        assumed.append("sign turned, as the joint goes against it")
    return LogSignal(
        joint=joint,
        quantity=quantity,
        column=column,
        unit=unit.name,
        why=why,
        sign=sign,
        assumed=tuple(assumed),
    )


def _velocity(position: Array, time: Array) -> Array:
    """Rate of a measured position over `SPAN`, which evens its noise out, shape (rows,)."""
    period = float(time[-1] - time[0]) / max(len(time) - 1, 1)
    # A short log keeps most of its rows.
    reach = min(max(round(0.5 * SPAN / max(period, 1e-9)), 1), len(time) // 8)
    inner = (position[2 * reach :] - position[: -2 * reach]) / (2.0 * reach * period)
    return np.pad(inner, reach, mode="edge")


def commanded_force(log: Log, joint: str) -> LogSignal | None:
    """Return the force that a command stands for; None where the actuator may give another one.

    Parameters
    ----------
    log
        The log. Questions are added to it.
    joint
        Joint that the actuator pushes.
    """
    actuator = actuator_on(log.mechanism, joint)
    if actuator is None or log.mechanism.positions(actuator):
        return None
    known = [q for q in command_quantities(log.mechanism, joint) if log.slots.has(joint, q)]
    if not known or not takes_force(log.mechanism, joint):
        return None
    signal, constant = _control(log, joint, known[0]), actuator_constant(log.mechanism, actuator)
    if signal is None or (signal.formula and constant != 1.0):
        return None
    si = SI[JointQuantity.FORCE][log.mechanism.turns(joint)]
    force = replace(
        signal,
        quantity=JointQuantity.FORCE,
        unit=si if signal.unit == "1" else signal.unit,
        scale=signal.scale * constant,
        from_command=True,
        assumed=(f"the command, times {constant:g}, taken as the force in {si}",),
    )
    return force if _is_given(log.mechanism, actuator, log.values(force)) else None


def gives_commands(log: Log, joints: Sequence[str], measured: Collection[str]) -> bool:
    """Return whether the log says what force each actuator of the model gives.

    It is measured, or the actuator gives that of its command, at once and unlimited.

    Parameters
    ----------
    log
        The log.
    joints
        Joints that the log describes. Those without an actuator move freely.
    measured
        Joints whose force is in the log.
    """
    used = {actuator_on(log.mechanism, joint) for joint in joints}
    # A further actuator, such as a second motor, would push the joints as well.
    if set(log.mechanism.names("actuator")) - used:
        return False
    driven = {joint for joint in joints if actuator_on(log.mechanism, joint) is not None}
    return all(commanded_force(log, joint) is not None for joint in driven - {*measured})


def _is_given(mechanism: Mechanism, actuator: str, forces: Array) -> bool:
    """Return whether an actuator gives the force of each command, at once and unlimited."""
    if mechanism.actuator_timing(actuator) or mechanism.actuator_obstacle(actuator, MOVERS[FORCES]):
        return False
    low, high = mechanism.command_limits(actuator)
    constant, most = mechanism.force_per_command(actuator)
    commands = forces / constant if constant else np.zeros(1)
    return bool(low <= commands.min() and commands.max() <= high and np.abs(forces).max() <= most)


def no_force(joint: str) -> LogSignal:
    """Return the command of a joint that nothing pushes: 0 throughout.

    Parameters
    ----------
    joint
        Joint that swings freely.
    """
    return LogSignal(
        joint=joint,
        quantity=JointQuantity.FORCE_COMMAND,
        column="",
        unit="",
        why="the model has no actuator for it",
        formula="0",
    )


def _source(log: Log, joint: str, quantity: JointQuantity) -> tuple[str, str, float]:
    """Column, reason and sign of a command."""
    source = log.slots.stated(joint, quantity)
    if source is not None:
        return source.column, STATED, source.sign
    match = log.slots.match(joint, quantity)
    return match.column, match.why, 1.0


def _control(log: Log, joint: str, quantity: JointQuantity) -> LogSignal | None:
    """A command column: a force where its unit says so, else in the actuator's own unit."""
    source = log.slots.stated(joint, quantity)
    if source is not None and source.formula:
        return log.stated_signal(joint, quantity)
    try:
        column, why, sign = _source(log, joint, quantity)
    except Question as question:
        log.questions.append(str(question))
        return None
    unit = (source.unit if source else "") or log.columns.units.get(column, "")
    if (
        is_unit(unit)
        and unit_of(unit)[0] == SI[JointQuantity.FORCE][not log.mechanism.turns(joint)]
    ):
        # A thrust in N is no torque of a hinge: what the actuator makes of it is its gear.
        unit = ""
    scale, assumed = 1.0, () if unit else ("in the unit of the actuator's control",)
    if quantity is JointQuantity.CURRENT_COMMAND:
        # The gear of such an actuator is a torque constant, so that its control is a current.
        stated = unit or stated_unit(split_words(column))
        scale = unit_of(stated)[1] if is_unit(stated) and unit_of(stated)[0] == "A" else 1.0
        unit, assumed = "", (f"{'A' if scale == 1.0 else stated} of the actuator's control",)
    if unit == PERCENT:
        most = largest_control(log.mechanism, actuator_on(log.mechanism, joint) or "")
        # Without a range, the control itself is 1 at 100 %, as the unit says.
        if most is not None:
            unit, scale = "", 0.01 * most
            assumed = (f"100 % is the largest control, {most:g}",)
    signal = LogSignal(
        joint=joint,
        quantity=quantity,
        column=column,
        unit=unit or "1",
        why=why,
        sign=sign,
        assumed=assumed,
        scale=scale,
    )
    return _as_control(log, signal)


def _as_control(log: Log, signal: LogSignal) -> LogSignal:
    """A force as the control that makes the actuator give it."""
    constant = actuator_constant(log.mechanism, actuator_on(log.mechanism, signal.joint) or "")
    if signal.why == MOTOR_CURRENT:
        # A motor's current is its control.
        return replace(signal, scale=1.0, assumed=("in the unit of the actuator's control",))
    # The log holds a force, but the recording's channel is the control: force = gear · gain ·
    # control.
    # A current or a voltage is the control of the actuator itself.
    is_force = is_unit(signal.unit) and unit_of(signal.unit)[0] in SI[JointQuantity.FORCE]
    is_control = constant in (0.0, 1.0) or not is_force or signal.formula
    if is_control or not takes_force(log.mechanism, signal.joint):
        return signal
    return replace(
        signal,
        scale=signal.scale / constant,
        assumed=(*signal.assumed, f"divided by the actuator's force of {constant:g} a unit"),
    )
