"""A log as it is read: its clock, the kind of its test, and which column is which signal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigtwin.describing.checks import motion_band
from rigtwin.describing.clock import Clock, find_clock
from rigtwin.describing.command_signals import (
    commanded_force,
    force_command,
    gives_commands,
    no_force,
    position_command,
)
from rigtwin.describing.corrections import read_corrections
from rigtwin.describing.force_signals import (
    check_forces,
    force_signals,
    offer_remaining_command,
)
from rigtwin.describing.force_suggestions import suggest_forces
from rigtwin.describing.formulas import read_formula
from rigtwin.describing.hardly_moving import joints_at_rest
from rigtwin.describing.log import Log
from rigtwin.describing.match import Match
from rigtwin.describing.matching import match_columns
from rigtwin.describing.position_signals import ask_positions, position_signals
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.question import Question, enumerate_names, option
from rigtwin.describing.references import withdraw_references
from rigtwin.describing.replay_kind import ReplayKind, choose_kind, free_swing, passive_joints
from rigtwin.describing.resting import note_resting
from rigtwin.describing.schedule_signals import ScheduleColumn, schedule_columns
from rigtwin.describing.servo_forces import come_from_servos
from rigtwin.describing.signal import LogSignal
from rigtwin.describing.slots import Slots
from rigtwin.describing.velocity_signals import integrate, joints_by_velocity, velocity_signals
from rigtwin.description.coupling import are_coupled
from rigtwin.description.implied import FORCES, INVERSE
from rigtwin.description.joint_elements import actuator_on, movable_joints, swinging
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.numerics.arrays import Array

FEWEST = 50
"""Rows of a log from which anything can be concluded."""


@dataclass(frozen=True)
class Reading:
    """Everything that was concluded from a log and a model.

    Parameters
    ----------
    clock
        Time base.
    kind
        Kind of the test.
    joints
        Joints that take part.
    signals
        Signals of the recording, with their sources.
    unused
        Column → why it is not used.
    notes
        Assumptions that belong to no single signal.
    idle
        Joints whose actuator does nothing throughout.
    velocities
        Joints whose velocity was measured in place of their position.
    resting
        Joints that hardly move, whose forces are not judged.
    schedules
        Columns that friction or a force may follow.
    band
        Frequency up to which forces are judged, Hz; None where all is judged.
    """

    clock: Clock
    kind: ReplayKind
    joints: tuple[str, ...]
    signals: tuple[LogSignal, ...]
    unused: Mapping[str, str]
    notes: tuple[str, ...] = ()
    idle: tuple[str, ...] = ()
    velocities: tuple[str, ...] = ()
    resting: tuple[str, ...] = ()
    schedules: tuple[ScheduleColumn, ...] = ()
    band: float | None = None


def read_log(
    mechanism: Mechanism, columns: Columns, stated: Mapping[str, str], test: str = ""
) -> Reading:
    """Conclude what the columns of a log are.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    columns
        Columns of the log.
    stated
        Statements of the log's owner, see `read_corrections`.
    test
        Kind of the test as the owner states it; empty to conclude it.

    Raises
    ------
    Question
        If two readings are possible; all questions at once.
    """
    if columns.rows < FEWEST:
        raise RigtwinError(f"it has {columns.rows} rows; expected at least {FEWEST}")
    log, matches = _open(mechanism, columns, stated)
    motions = _without_followers(log, _motions(log))
    values = {joint: _position(log, signal) for joint, signal in motions.items()}
    kind, resting, movers = _choose_movers(log, test, list(motions.values()), values)
    joints = list(motions)
    signals = [*motions.values(), *movers]
    # Only forces can be held against inverse dynamics.
    if kind.test in (INVERSE, FORCES):
        signals = check_forces(log, signals, values)
    note_resting(log, joints, kind.test)
    if log.questions or log.clock is None:
        raise _all_questions(log, signals)
    velocities = [s.joint for s in motions.values() if s.quantity is JointQuantity.VELOCITY]
    if kind.test != INVERSE:
        measured = "velocities" if velocities else "positions"
        log.notes.append(f"{measured} have the signs of the log")
    idle = [signal.joint for signal in movers if not np.any(log.values(signal))]
    moving = {joint: place for joint, place in values.items() if joint not in resting}
    band = _band(log, kind.test, moving)
    unused = _unused(log, signals, matches)
    schedules = schedule_columns(log, joints, {*log.columns.values} - {*unused})
    return Reading(
        clock=log.clock,
        kind=kind,
        joints=tuple(joints),
        signals=tuple(signals),
        unused={name: why for name, why in unused.items() if name not in _names(schedules)},
        notes=tuple(log.notes),
        idle=tuple(idle) if kind.test == FORCES else (),
        velocities=tuple(velocities),
        resting=resting,
        schedules=schedules,
        band=band,
    )


def _names(schedules: Sequence[ScheduleColumn]) -> list[str]:
    return [schedule.column for schedule in schedules]


def _motions(log: Log) -> dict[str, LogSignal]:
    """The measured positions by joint, or velocities where the log holds no position."""
    joints = log.slots.joints(JointQuantity.POSITION, movable_joints(log.mechanism))
    if joints:
        motions = position_signals(log, joints)
    else:
        motions = velocity_signals(log, joints_by_velocity(log))
        if not motions and not log.questions:
            ask_positions(log)
    if not motions:
        raise _all_questions(log, ())
    return motions


def _without_followers(log: Log, motions: Mapping[str, LogSignal]) -> dict[str, LogSignal]:
    """Leave out joints that follow another one by an equality and that nothing drives.

    Inverse dynamics of several joints know no equalities: there, a joint without a force has to be
    asked for.
    """

    def has_force(joint: str) -> bool:
        forces = (JointQuantity.FORCE, JointQuantity.CURRENT)
        return any(log.slots.has(joint, quantity) for quantity in forces)

    leaders = [j for j in motions if has_force(j) or actuator_on(log.mechanism, j) is not None]
    if len(leaders) > 1 and all(has_force(joint) for joint in leaders):
        return dict(motions)
    followers = {tie.joint for tie in log.mechanism.ties_of(leaders)[0]}
    return {joint: signal for joint, signal in motions.items() if joint not in followers}


def _position(log: Log, signal: LogSignal) -> Array:
    """Position of a joint, SI, shape (rows,): measured, or by its velocity from zero on."""
    if signal.quantity is JointQuantity.POSITION or log.clock is None:
        return log.values(signal)
    return integrate(log.values(signal), log.time())


def _choose_movers(
    log: Log, test: str, signals: Sequence[LogSignal], positions: Mapping[str, Array]
) -> tuple[ReplayKind, tuple[str, ...], list[LogSignal]]:
    """The kind of the test, joints that hardly move, and the forces or commands that are needed."""
    joints = list(positions)
    withdraw_references(log, positions)
    offer_remaining_command(log, positions)
    forces, still = force_signals(log, positions)
    resting = joints_at_rest(log, positions)
    # Stiction may hold any force of a joint that rests, so none has to be known.
    known = joints if forces and {*forces, *resting} == {*joints} else list(forces)
    by_servos = len(forces) == len(joints) and come_from_servos(log, positions, forces)
    try:
        placed = all(signal.quantity is JointQuantity.POSITION for signal in signals)
        kind = choose_kind(
            log.mechanism,
            log.slots,
            joints,
            known,
            list(still),
            placed,
            test,
            by_servos,
            by_commands=gives_commands(log, joints, forces),
        )
    except Question as question:
        before = len(log.questions)
        # A suggestion by the data is worth more than the general question, which follows where
        # there is none.
        suggest_forces(log, joints, positions, forces)
        swing = free_swing(log.mechanism, log.slots, joints, log.columns.refused)
        if len(log.questions) > before or swing is None:
            if len(log.questions) == before:
                log.questions.append(str(question))
            raise _all_questions(log, signals) from None
        kind = swing
    resting = resting if kind.test == INVERSE else ()
    log.notes += [
        f"{joint}: it hardly moves, so that stiction may hold any force, which is not judged"
        for joint in resting
    ]
    moving = {joint: place for joint, place in positions.items() if joint not in resting}
    movers = _movers(log, kind.test, moving, forces, still)
    if log.questions:
        raise _all_questions(log, signals)
    return kind, resting, list(movers.values())


def _open(
    mechanism: Mechanism, columns: Columns, stated: Mapping[str, str]
) -> tuple[Log, list[Match]]:
    """The log with its clock and the columns that it offers; a question can be open."""
    corrections = read_corrections(stated, mechanism, columns)
    # The log is read on with an open question: all questions come at once.
    clock, questions = None, []
    try:
        clock = find_clock(columns, corrections.time)
    except Question as question:
        questions.append(str(question))
    skipped = [clock.column] if clock is not None else []
    matches, unused = match_columns(mechanism, columns, skipped)
    unused |= columns.refused
    slots = Slots(columns, matches, corrections)
    log = Log(mechanism, columns, corrections, slots, clock, questions, unused=unused)
    return log, matches


def _all_questions(log: Log, signals: Sequence[LogSignal]) -> Question:
    """All open questions in one, with what was assumed so far."""
    # Several joints can raise the same question.
    text = "; and ".join(dict.fromkeys(log.questions))
    assumed = [f"{s.key} from {s.column}, {s.assumed[0]}" for s in signals if s.assumed]
    return Question(f"{text}; assumed so far: {enumerate_names(assumed, 2)}" if assumed else text)


def _movers(
    log: Log,
    test: str,
    positions: Mapping[str, Array],
    forces: Mapping[str, LogSignal],
    still: Mapping[str, LogSignal],
) -> dict[str, LogSignal]:
    """Forces or commands that the test needs, by joint."""
    movers: dict[str, LogSignal] = {}
    free = swinging(log.mechanism, list(positions)) if test == FORCES else []
    passive = passive_joints(log.mechanism, list(positions))
    passive = passive if passive < set(positions) else set()
    for joint, position in positions.items():
        mover: LogSignal | None = None
        if test == INVERSE:
            mover = forces.get(joint) or commanded_force(log, joint)
            if mover is None and joint in passive:
                mover = replace(no_force(joint), quantity=JointQuantity.FORCE)
            if mover is None:
                log.questions.append(
                    f"no measured force of joint {joint}; say {option(f'{joint}.force', 'COLUMN')}"
                )
        elif joint in free:
            mover = no_force(joint)
        elif actuator_on(log.mechanism, joint) is not None:
            mover = (
                force_command(log, joint, {**forces, **still}, position)
                if test == FORCES
                else position_command(log, joint, positions)
            )
        if mover is not None:
            movers[joint] = mover
    return movers


def _band(log: Log, test: str, positions: Mapping[str, Array]) -> float | None:
    """Frequency up to which forces are judged, of joints that are replayed together."""
    # Independent joints find their band on their own, by their inertia's share of the force.
    if test != INVERSE or not are_coupled(log.mechanism, list(positions)):
        return None
    band = motion_band(log.time(), positions)
    log.notes.append(f"forces are judged up to {band:g} Hz, by the motion of the joints")
    return band


def _unused(log: Log, signals: Sequence[LogSignal], matches: Sequence[Match]) -> dict[str, str]:
    """Columns that are not used, and why."""
    used = {log.time_column}
    for signal in signals:
        if signal.formula:
            used |= set(read_formula(signal.formula, log.columns.values).names.values())
        else:
            used.add(signal.column)
    unused = dict(log.unused)
    for match in matches:
        unused.setdefault(match.column, f"the test does not need the {match.quantity.value}")
    return {column: why for column, why in unused.items() if column not in used}
