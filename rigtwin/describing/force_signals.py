"""The measured forces at the joints, and whether they have a sign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigtwin.describing.checks import Slope, force_slopes, is_magnitude, unforced_share
from rigtwin.describing.log import STATED, Log
from rigtwin.describing.match import MOTOR_CURRENT, REMAINING, UNNAMED, Match
from rigtwin.describing.quantity import SI, JointQuantity
from rigtwin.describing.question import Question, ask, enumerate_names, option
from rigtwin.describing.replay_kind import MOVING, takes_force
from rigtwin.describing.signal import LogSignal
from rigtwin.describing.units import Unit, actuator_constant, force_unit
from rigtwin.description.joint_elements import actuator_on
from rigtwin.importing.units import unit_of
from rigtwin.numerics.arrays import Array

NEAR_GEAR = 2.0
"""Factor within which the ratio of two forces may differ from the gear of the model's actuator."""
USED, WITHIN = 0.3, 1.02
"""Shares of a control's limit between which the largest current makes use of its range."""
SLOPE_LOW, SLOPE_HIGH = 0.2, 5.0
"""Measured force for each unit of the model's; beyond, its unit or a gear is in doubt."""
SLOPE_HIGHEST = 25.0
"""Measured force for each unit of the model's beyond which even a unit that the file states is in
doubt. A link may weigh several times what the model says; a torque before a gear would be smaller
than the model's."""
SHOWN = 0.5
"""Share of a force that the model must explain for its scale or sign to be judged."""
UNFORCED = 0.5
"""Largest share of the motion in which a magnitude of a force is zero."""
MOTIONS = (JointQuantity.POSITION, JointQuantity.VELOCITY)
"""Quantities that are no force."""
COMMANDS = (*MOVING, JointQuantity.VELOCITY_COMMAND, JointQuantity.VOLTAGE)
"""Quantities of a command or a force, at least one of which says what moves a joint."""


def force_signals(
    log: Log, positions: Mapping[str, Array]
) -> tuple[dict[str, LogSignal], dict[str, LogSignal]]:
    """Return the measured forces that have a sign, and those that are zero throughout, by joint.

    Parameters
    ----------
    log
        The log. Questions, notes and unused columns are added to it.
    positions
        Joint → position, SI, shape (rows,).
    """
    forces: dict[str, LogSignal] = {}
    still: dict[str, LogSignal] = {}
    for joint in positions:
        if log.slots.has(joint, JointQuantity.FORCE):
            signal = force_signal(log, joint)
        else:
            signal = _motor_current(log, joint, positions)
        if signal is None:
            continue
        if np.any(log.values(signal)):
            forces[joint] = signal
        else:
            still[joint] = signal
    # One logger writes all forces in one way, so they are judged together.
    if _are_magnitudes(log, forces, positions):
        names = [signal.column for signal in forces.values()]
        log.unused |= dict.fromkeys(names, "a magnitude without a sign, not the force")
        log.notes.append(
            f"{enumerate_names(names)}: not used; they never change their sign and return to 0, so "
            "they are magnitudes"
        )
        forces = {}
    return forces, still


def force_signal(log: Log, joint: str) -> LogSignal | None:
    """Return the logged force at a joint; None where a question is open.

    Parameters
    ----------
    log
        The log.
    joint
        Joint whose force it offers.
    """
    if log.slots.stated(joint, JointQuantity.FORCE) is not None:
        return log.stated_signal(joint, JointQuantity.FORCE)
    general = log.stated.units.get(JointQuantity.FORCE)
    try:
        match = log.slots.match(joint, JointQuantity.FORCE)
        unit = (
            Unit(general)
            if general is not None
            else force_unit(log.mechanism, log.columns, match.column, joint)
        )
    except Question as question:
        log.questions.append(str(question))
        return None
    return LogSignal(
        joint=joint,
        quantity=JointQuantity.FORCE,
        column=match.column,
        unit=unit.name,
        why=match.why,
        assumed=(unit.assumed,) if unit.assumed else (),
        scale=unit.scale,
    )


def _motor_current(log: Log, joint: str, positions: Mapping[str, Array]) -> LogSignal | None:
    """Return the current of a joint's motor as its force; None where that is not evident.

    The gear of a motor whose control is a current is its force constant. It is taken for that where
    the model's inverse dynamics explain the current, with a constant near the gear. Where they
    explain little of any current, one that makes use of the control's range is taken for it.
    """
    actuator = actuator_on(log.mechanism, joint)
    columns = log.slots.columns(joint, JointQuantity.CURRENT)
    if actuator is None or log.mechanism.positions(actuator) or len(columns) != 1:
        return None
    # What the actuator was told is its control, whatever current then flowed.
    if not takes_force(log.mechanism, joint) or log.slots.has(joint, JointQuantity.COMMAND):
        return None
    constant = actuator_constant(log.mechanism, actuator)
    slope = slope_of(log, joint, positions, log.columns.values[columns[0]])
    if constant in (0.0, 1.0):
        return None
    unit = log.columns.units.get(columns[0], "") or "A"
    si = SI[JointQuantity.FORCE][log.mechanism.turns(joint)]
    assumed = f"times the gear of the model's actuator, {constant:g} {si}/A"
    if slope is not None and slope.explained >= SHOWN:
        ratio = abs(slope.slope * constant * unit_of(unit)[1])
        if not 1.0 / NEAR_GEAR < ratio < NEAR_GEAR:
            return None
    else:
        low, high = log.mechanism.command_limits(actuator)
        current = unit_of(unit)[1] * log.columns.values[columns[0]]
        known = np.abs(current[np.isfinite(current)])
        used = float(np.max(known, initial=0.0)) / max(-low, high)
        if not USED < used <= WITHIN:
            return None
        assumed += f"; its control may be {low:g} to {high:g}, which the current makes use of"
    return LogSignal(
        joint=joint,
        quantity=JointQuantity.FORCE,
        column=columns[0],
        unit=unit,
        scale=constant,
        why=MOTOR_CURRENT,
        assumed=(assumed,),
    )


def check_forces(
    log: Log, signals: Sequence[LogSignal], positions: Mapping[str, Array]
) -> list[LogSignal]:
    """Return signals with the signs of forces as the model's inverse dynamics have them.

    Parameters
    ----------
    log
        The log. Questions about units and gears are added to it.
    signals
        Signals of the recording.
    positions
        Joint → position, SI, shape (rows,).
    """
    checked = [s for s in signals if s.quantity not in MOTIONS and _is_force(log, s)]
    values = {s.joint: log.values(s) for s in checked}
    # A force of zero has no slope.
    values = {joint: each for joint, each in values.items() if np.any(each)}
    slopes = force_slopes(log.mechanism, log.time(), positions, values)
    return [
        signal
        if signal not in checked or signal.joint not in slopes
        else _check_force(log, signal, slopes[signal.joint])
        for signal in signals
    ]


def _is_force(log: Log, signal: LogSignal) -> bool:
    """Whether a force follows from a signal alone, and not from the motion as well."""
    return not signal.commands or takes_force(log.mechanism, signal.joint)


def offer_remaining_command(log: Log, positions: Mapping[str, Array]) -> None:
    """Offer the only column without a meaning as the command of the only joint's actuator.

    The model must explain that column as the force that moves the joint, and its size.

    Parameters
    ----------
    log
        The log, to whose slots the column is added.
    positions
        Joint → position, SI, shape (rows,).
    """
    joints = list(positions)
    actuator = actuator_on(log.mechanism, joints[0]) if len(joints) == 1 else None
    if actuator is None or log.mechanism.positions(actuator):
        return
    joint, unnamed = joints[0], [name for name, why in log.unused.items() if why == UNNAMED]
    if len(unnamed) != 1 or any(log.slots.has(joint, quantity) for quantity in COMMANDS):
        return
    slope = slope_of(log, joint, positions, log.columns.values[unnamed[0]])
    ratio = slope.slope * actuator_constant(log.mechanism, actuator) if slope else 0.0
    if slope is not None and slope.explained > SHOWN and SLOPE_LOW < ratio < SLOPE_HIGH:
        log.slots.offer(Match(unnamed[0], joint, JointQuantity.COMMAND, REMAINING, 0.5))
        del log.unused[unnamed[0]]


def _are_magnitudes(
    log: Log, forces: Mapping[str, LogSignal], positions: Mapping[str, Array]
) -> bool:
    """Whether the logger writes forces without their signs: all of them, if none is stated."""
    if any(signal.why == STATED for signal in forces.values()):
        return False
    values = {joint: log.values(signal) for joint, signal in forces.items()}
    if not values or not all(is_magnitude(v, positions[j]) for j, v in values.items()):
        return False
    # A hand or a hoist that pushes to one side lets go, and the joints move on.
    if np.median([unforced_share(v, positions[j]) for j, v in values.items()]) > UNFORCED:
        return False
    slopes = [slope_of(log, joint, positions, each) for joint, each in values.items()]
    # Inverse dynamics that explain a force show its sign, whatever its minimum is.
    return all(slope is None or slope.explained < SHOWN for slope in slopes)


def slope_of(log: Log, joint: str, positions: Mapping[str, Array], force: Array) -> Slope | None:
    """Return the regression of a column on the force that the model needs.

    Parameters
    ----------
    log
        The log.
    joint
        Joint at which the force acts.
    positions
        Joint → position, SI, shape (rows,).
    force
        Column in any unit, shape (rows,).

    Returns
    -------
    Slope or None
        None where time is unknown.
    """
    if log.clock is None or not np.isfinite(force).all() or len(force) != len(positions[joint]):
        return None
    return force_slopes(log.mechanism, log.time(), positions, {joint: force}).get(joint)


def _factor(log: Log, joint: str, ratio: float) -> float:
    """Factor from a column to the force that the model needs, for a question.

    It is the gear of the model's actuator where that is near the inverse of `ratio`.
    """
    return _fitting_gear(log, joint, ratio) or 1.0 / ratio


def _fitting_gear(log: Log, joint: str, ratio: float) -> float | None:
    """Gear of the model's actuator where it is near the inverse of `ratio`; None otherwise."""
    actuator = actuator_on(log.mechanism, joint)
    # The constant of a position actuator is its gain, and no gear.
    if (
        actuator is None
        or log.mechanism.positions(actuator)
        or not takes_force(log.mechanism, joint)
    ):
        return None
    gear = actuator_constant(log.mechanism, actuator)
    return gear if gear > 1.0 and 1.0 / NEAR_GEAR < gear * ratio < NEAR_GEAR else None


def _check_force(log: Log, signal: LogSignal, slope: Slope) -> LogSignal:
    """The signal with its sign checked; a question is added where its scale is in doubt."""
    stated = signal.why == STATED
    if slope.explained < SHOWN and signal.quantity is JointQuantity.CURRENT_COMMAND:
        log.questions.append(
            f"column {signal.column!r} is a current, and the model explains "
            f"{100.0 * slope.explained:.0f} % of it; is it the control of the model's actuator? "
            f"say {option(signal.key, signal.column)}, or {option(signal.key, 'COLUMN')}"
        )
    if slope.explained < SHOWN:
        share = f"{100.0 * slope.explained:.0f} %"
        text = f"sign and scale not confirmed: the model explains {share} of it"
        return replace(signal, assumed=(*signal.assumed, text))
    constant = 1.0
    if signal.quantity is not JointQuantity.FORCE:
        actuator = actuator_on(log.mechanism, signal.joint) or ""
        # A command is in the actuator's unit: control times constant is the force that the model's
        # is compared with.
        constant = actuator_constant(log.mechanism, actuator) or 1.0
    ratio = slope.slope * constant
    # Friction and errors of the model change the slope by less than this; an unknown gear or unit
    # by more.
    is_clear = SLOPE_LOW < abs(ratio) < SLOPE_HIGH
    has_unit = signal.quantity is JointQuantity.FORCE and not signal.assumed
    is_possible = is_clear or (has_unit and SLOPE_LOW < abs(ratio) < SLOPE_HIGHEST)
    gear = _fitting_gear(log, signal.joint, abs(ratio))
    # A unit that is stated for all forces leaves their signs open, but not their scale.
    is_doubtful = not stated and signal.quantity not in log.stated.units and not is_possible
    forces = (JointQuantity.FORCE, JointQuantity.FORCE_COMMAND)
    if is_doubtful and gear is not None and signal.quantity in forces:
        text = f"before the gear of the model's actuator: times {gear:g}"
        signal = replace(signal, scale=gear * signal.scale, assumed=(*signal.assumed, text))
        ratio, is_clear = ratio * gear, True
    elif is_doubtful:
        question = ask(
            f"column {signal.column!r} is {abs(ratio):.3g} times the force that the model needs at "
            f"{signal.joint}; is it in another unit, or before a gear?",
            option(signal.key, f"{_factor(log, signal.joint, ratio):.4g} * {signal.column}"),
            option(signal.key, f"{signal.column} [{signal.unit}]") + " if it is right",
        )
        log.questions.append(str(question))
    if ratio < 0.0 and not stated:
        text = f"sign turned, as the model needs the opposite ({ratio:.2g} times the model's)"
        return replace(signal, sign=-signal.sign, assumed=(*signal.assumed, text))
    if ratio < 0.0:
        log.notes.append(f"{signal.key}: the model needs the opposite sign")
        return signal
    by = f"{'' if is_clear else 'not '}confirmed by inverse dynamics"
    return replace(signal, checked=f"{by} ({ratio:.2g} times the model's)")
