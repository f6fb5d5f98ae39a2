"""A log as it is read: its clock, the kind of its test, and which column is which signal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigtwin.describing.checks import Slope, follows, force_slopes, is_magnitude
from rigtwin.describing.clock import Clock, find_clock
from rigtwin.describing.corrections import Corrections, read_corrections
from rigtwin.describing.formulas import formula_values, read_formula
from rigtwin.describing.matching import match_columns
from rigtwin.describing.quantity import SI, Quantity
from rigtwin.describing.question import Question, ask, enumerate_names, option
from rigtwin.describing.replay_kind import ReplayKind, choose_kind
from rigtwin.describing.signal import Signal
from rigtwin.describing.slots import Slots
from rigtwin.describing.units import (
    Unit,
    actuator_constant,
    command_unit,
    force_unit,
    position_units,
)
from rigtwin.description.implied import FORCES, INVERSE, actuator_on, movable_joints
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError
from rigtwin.importing.columns import Columns
from rigtwin.importing.units import unit_of
from rigtwin.numerics.arrays import Array

SLOPE_LOW, SLOPE_HIGH = 0.2, 5.0
"""Measured force for each unit of the model's; beyond, its unit or a gear is in doubt."""
SHOWN = 0.5
"""Share of a force that the model must explain for its scale or sign to be judged."""
OPPOSED = -0.5
"""Correlation of a command and a position below which the command's sign is turned."""


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
        What else was assumed, one a sentence.
    idle
        Joints whose actuator does nothing throughout.
    """

    clock: Clock
    kind: ReplayKind
    joints: tuple[str, ...]
    signals: tuple[Signal, ...]
    unused: Mapping[str, str]
    notes: tuple[str, ...] = ()
    idle: tuple[str, ...] = field(default=())


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
        What the owner of the log states, see `read_corrections`.
    test
        Kind of the test as the owner states it; empty to conclude it.

    Raises
    ------
    Question
        If two readings are possible; all questions at once.
    """
    return _Reader(mechanism, columns, read_corrections(stated, mechanism, columns), test).read()


class _Reader:
    """Reads one log."""

    def __init__(
        self, mechanism: Mechanism, columns: Columns, stated: Corrections, test: str
    ) -> None:
        self._mechanism, self._columns = mechanism, columns
        self._stated, self._test = stated, test
        self._questions: list[str] = []
        self._notes: list[str] = []
        self._unused: dict[str, str] = {}

    def read(self) -> Reading:
        clock: Clock | None = None
        try:
            clock = find_clock(self._columns, self._stated.time)
        except Question as question:
            self._questions.append(str(question))
        skipped = [clock.column] if clock is not None else []
        matches, self._unused = match_columns(self._mechanism, self._columns, skipped)
        self._clock, self._slots = clock, Slots(self._columns, matches, self._stated)
        joints = self._joints()
        if not joints:
            self._ask_positions()
            raise self._all_questions()
        positions = self._positions(joints)
        if positions is None:
            raise self._all_questions()
        values = {joint: self.values(signal) for joint, signal in positions.items()}
        forces, still = self._forces(values)
        if self._questions:
            self._suggest_currents(joints, values, forces)
            raise self._all_questions()
        assert clock is not None
        try:
            kind = choose_kind(
                self._mechanism, self._slots, joints, list(forces), still, self._test
            )
        except Question as question:
            self._questions.append(str(question))
            self._suggest_currents(joints, values, forces)
            raise self._all_questions() from None
        movers = self._movers(kind.test, joints, values, forces, still)
        signals = [*positions.values(), *movers.values()]
        if kind.test in (INVERSE, FORCES):
            signals = self._with_checked_forces(signals, values)
        if self._questions:
            raise self._all_questions()
        idle = tuple(s.joint for s in movers.values() if not np.any(self.values(s)))
        self._list_unused(signals, matches)
        resting = [j for j in movable_joints(self._mechanism) if j not in joints]
        if resting:
            self._notes.append(
                f"{enumerate_names(resting)}: no column is the position, so it stays where the "
                "model has it"
            )
        return Reading(
            clock=clock,
            kind=kind,
            joints=tuple(joints),
            signals=tuple(signals),
            unused=self._unused,
            notes=tuple(self._notes),
            idle=idle if kind.test == FORCES else (),
        )

    def _all_questions(self) -> Question:
        return Question("; and ".join(dict.fromkeys(self._questions)))

    def _joints(self) -> list[str]:
        """Joints whose position the log offers, in the model's order."""
        return self._slots.joints(Quantity.POSITION, movable_joints(self._mechanism))

    def _ask_positions(self) -> None:
        """Ask for the position of the joints, of which no column is named."""
        joints = movable_joints(self._mechanism)
        if not joints:
            raise RigtwinError("the model has no hinge or slide with a name; expected one at least")
        names = [name for name in self._columns.values if name != self._time_column]
        self._questions.append(
            str(
                ask(
                    f"no column is named as the position of {enumerate_names(joints)}; the log has "
                    f"{enumerate_names(names, 30)}",
                    option(f"{joints[0]}.position", "COLUMN"),
                )
            )
        )

    @property
    def _time_column(self) -> str:
        return self._clock.column if self._clock is not None else ""

    def _positions(self, joints: Sequence[str]) -> dict[str, Signal] | None:
        """Positions with their units; None where a question is open."""
        stated, matched, why = {}, {}, {}
        for joint in joints:
            source = self._slots.stated(joint, Quantity.POSITION)
            if source is not None and (source.formula or source.unit):
                stated[joint] = self._stated_signal(joint, Quantity.POSITION)
                continue
            try:
                found = self._slots.match(joint, Quantity.POSITION) if source is None else None
            except Question as question:
                self._questions.append(str(question))
                continue
            matched[joint] = source.column if source is not None else found.column  # type: ignore[union-attr]
            why[joint] = "as stated" if source is not None else found.why  # type: ignore[union-attr]
        general = self._stated.units.get(Quantity.POSITION)
        try:
            units = (
                dict.fromkeys(matched, Unit(general))
                if general is not None
                else position_units(self._mechanism, self._columns, matched)
            )
        except Question as question:
            self._questions.append(str(question))
            return None
        signals = {}
        for joint in joints:
            if joint in stated:
                signals[joint] = stated[joint]
            elif joint in matched:
                unit, source = units[joint], self._slots.stated(joint, Quantity.POSITION)
                signals[joint] = Signal(
                    joint=joint,
                    quantity=Quantity.POSITION,
                    column=matched[joint],
                    formula="",
                    unit=unit.name,
                    sign=source.sign if source is not None else 1.0,
                    why=why[joint],
                    assumed=(unit.assumed,) if unit.assumed else (),
                )
        return signals if len(signals) == len(joints) else None

    def _stated_signal(self, joint: str, quantity: Quantity) -> Signal:
        """A signal whose source the owner of the log states."""
        source = self._slots.stated(joint, quantity)
        assert source is not None
        si = SI[Quantity.POSITION if quantity is Quantity.COMMAND else quantity]
        unit = source.unit or self._stated.units.get(quantity, "")
        assumed = ()
        if not unit and source.column:
            unit = self._columns.units.get(source.column, "")
            if not unit:
                unit = si[self._mechanism.turns(joint)]
                assumed = (f"{unit}, as nothing states another unit",)
        return Signal(
            joint=joint,
            quantity=quantity,
            column=source.column,
            formula=source.formula,
            unit=unit or "1",
            sign=source.sign,
            why="as stated",
            assumed=assumed,
        )

    def values(self, signal: Signal) -> Array:
        """Values of a signal in SI, shape (rows,); cells that hold no number are bridged."""
        period = self._clock.period if self._clock is not None else 1.0
        if signal.formula:
            formula = read_formula(signal.formula, self._columns.values)
            values = formula_values(formula, self._columns, period, signal.key)
        else:
            try:
                factor = unit_of(signal.unit)[1]
            except RigtwinError:
                factor = 1.0
            values = factor * self._columns.values[signal.column]
        known = np.isfinite(values)
        if not known.all() and known.any():
            rows = np.arange(len(values))
            values = np.interp(rows, rows[known], values[known])
        return signal.sign * signal.scale * values

    def _forces(self, positions: Mapping[str, Array]) -> tuple[dict[str, Signal], list[str]]:
        """Measured forces that have a sign, and joints whose force is zero throughout."""
        forces: dict[str, Signal] = {}
        still: list[str] = []
        for joint, place in positions.items():
            if not self._slots.has(joint, Quantity.FORCE):
                continue
            signal = self._force(joint, Quantity.FORCE)
            if signal is None:
                continue
            values = self.values(signal)
            if not np.any(values):
                still.append(joint)
            elif is_magnitude(values, place) and signal.why != "as stated":
                self._unused[signal.column] = "it has no sign: a magnitude, not the force"
                self._notes.append(f"{signal.column} is not used: a magnitude without a sign")
            else:
                forces[joint] = signal
        return forces, still

    def _force(self, joint: str, quantity: Quantity) -> Signal | None:
        if self._slots.stated(joint, quantity) is not None:
            return self._stated_signal(joint, quantity)
        try:
            match = self._slots.match(joint, quantity)
        except Question as question:
            self._questions.append(str(question))
            return None
        general = self._stated.units.get(Quantity.FORCE)
        unit = (
            Unit(general)
            if general is not None
            else force_unit(self._mechanism, self._columns, match.column, joint)
        )
        return Signal(
            joint=joint,
            quantity=quantity,
            column=match.column,
            formula="",
            unit=unit.name,
            sign=1.0,
            why=match.why,
            assumed=(unit.assumed,) if unit.assumed else (),
        )

    def _suggest_currents(
        self, joints: Sequence[str], positions: Mapping[str, Array], forces: Mapping[str, Signal]
    ) -> None:
        """Ask for the forces that currents, or columns without a meaning, could be."""
        lacking = [joint for joint in joints if joint not in forces]
        offers: dict[str, list[str]] = {
            joint: self._slots.columns(joint, Quantity.CURRENT) for joint in lacking
        }
        if len(joints) == 1 and not offers.get(joints[0]) and lacking:
            offers[joints[0]] = [
                name for name, why in self._unused.items() if why == "its name fits no joint"
            ]
        for joint, names in offers.items():
            for name in names[:3]:
                slope = self._slope(joint, positions, self._columns.values[name])
                if slope is not None and slope.explained > SHOWN:
                    factor = f"{1.0 / slope.slope:.4g}"
                    self._questions.append(
                        f"column {name!r} goes with the force that the model needs at {joint} "
                        f"({100.0 * slope.explained:.0f} %, {factor} "
                        f"{SI[Quantity.FORCE][self._mechanism.turns(joint)]} for each unit): is it "
                        f"that force? then say {option(f'{joint}.force', f'{factor} * {name}')} "
                        "with the factor that you know"
                    )
                elif self._slots.columns(joint, Quantity.CURRENT):
                    self._questions.append(
                        f"column {name!r} is a current; with the torque constant and the gear it is "
                        f"the force at the joint: say {option(f'{joint}.force', f'FACTOR * {name}')}"
                    )

    def _slope(self, joint: str, positions: Mapping[str, Array], force: Array) -> Slope | None:
        """Regression of a column on the force that the model needs; None where time is unknown."""
        known = np.isfinite(force)
        if self._clock is None or not known.all() or len(force) != len(positions[joint]):
            return None
        return force_slopes(self._mechanism, self._time(), positions, {joint: force}).get(joint)

    def _time(self) -> Array:
        assert self._clock is not None
        if not self._clock.column:
            return self._clock.period * np.arange(self._columns.rows)
        return unit_of(self._clock.unit)[1] * self._columns.values[self._clock.column]

    def _movers(
        self,
        test: str,
        joints: Sequence[str],
        positions: Mapping[str, Array],
        forces: Mapping[str, Signal],
        still: Sequence[str],
    ) -> dict[str, Signal]:
        """Forces or commands that the test needs, by joint."""
        movers: dict[str, Signal] = {}
        for joint in joints:
            if test == INVERSE:
                if joint not in forces:
                    self._questions.append(
                        f"no measured force of joint {joint}; "
                        f"say {option(f'{joint}.force', 'COLUMN')}"
                    )
                else:
                    movers[joint] = forces[joint]
            elif actuator_on(self._mechanism, joint) is None:
                continue
            elif test == FORCES:
                mover = self._force_command(joint, forces, still)
                if mover is not None:
                    movers[joint] = mover
            elif (mover := self._position_command(joint, positions[joint])) is not None:
                movers[joint] = mover
        return movers

    def _position_command(self, joint: str, position: Array) -> Signal | None:
        key = f"{joint}.command"
        if not self._slots.has(joint, Quantity.COMMAND):
            self._questions.append(
                f"no column is the command of joint {joint}; say {option(key, 'COLUMN')}"
            )
            return None
        source = self._slots.stated(joint, Quantity.COMMAND)
        if source is not None and (source.formula or source.unit):
            return self._stated_signal(joint, Quantity.COMMAND)
        try:
            match = self._slots.match(joint, Quantity.COMMAND) if source is None else None
            column = source.column if source is not None else match.column  # type: ignore[union-attr]
            general = self._stated.units.get(Quantity.COMMAND)
            si = SI[Quantity.POSITION][self._mechanism.turns(joint)]
            unit = (
                Unit(general)
                if general is not None
                else command_unit(self._columns, column, position, si, key)
            )
        except Question as question:
            self._questions.append(str(question))
            return None
        assumed = [unit.assumed] if unit.assumed else []
        sign = source.sign if source is not None else 1.0
        if source is None and follows(self._columns.values[column], position) < OPPOSED:
            sign = -1.0
            assumed.append("sign turned, as the position goes against it")
        return Signal(
            joint=joint,
            quantity=Quantity.COMMAND,
            column=column,
            formula="",
            unit=unit.name,
            sign=sign,
            why="as stated" if match is None else match.why,
            assumed=tuple(assumed),
        )

    def _force_command(
        self, joint: str, forces: Mapping[str, Signal], still: Sequence[str]
    ) -> Signal | None:
        """The command of an actuator that pushes, as the actuator takes it."""
        for quantity in (Quantity.FORCE_COMMAND, Quantity.COMMAND):
            if self._slots.has(joint, quantity):
                signal = self._control(joint, quantity)
                return signal
        if joint in forces or joint in still:
            signal = self._force(joint, Quantity.FORCE)
            assert signal is not None
            return replace(self._as_control(signal), quantity=Quantity.FORCE_COMMAND)
        self._questions.append(
            f"no column is the command of joint {joint}; say "
            f"{option(f'{joint}.command', 'COLUMN')} or {option(f'{joint}.command', '0')}"
        )
        return None

    def _control(self, joint: str, quantity: Quantity) -> Signal | None:
        """A command column: a force where its unit says so, else in the actuator's own unit."""
        source = self._slots.stated(joint, quantity)
        if source is not None and source.formula:
            return self._stated_signal(joint, quantity)
        try:
            column = source.column if source else self._slots.match(joint, quantity).column
        except Question as question:
            self._questions.append(str(question))
            return None
        why = "as stated" if source else self._slots.match(joint, quantity).why
        unit = (source.unit if source else "") or self._columns.units.get(column, "")
        assumed = () if unit else ("in the unit of the actuator's control",)
        signal = Signal(
            joint=joint,
            quantity=quantity,
            column=column,
            formula="",
            unit=unit or "1",
            sign=source.sign if source else 1.0,
            why=why,
            assumed=assumed,
        )
        return self._as_control(signal)

    def _as_control(self, signal: Signal) -> Signal:
        """A force as the control that makes the actuator give it."""
        constant = actuator_constant(
            self._mechanism, actuator_on(self._mechanism, signal.joint) or ""
        )
        if constant in (0.0, 1.0) or signal.unit == "1" or signal.formula:
            return signal
        return replace(
            signal,
            scale=1.0 / constant,
            assumed=(*signal.assumed, f"divided by the actuator's {constant:g} a unit"),
        )

    def _with_checked_forces(
        self, signals: Sequence[Signal], positions: Mapping[str, Array]
    ) -> list[Signal]:
        """Signals with the signs of forces as the model's inverse dynamics have them."""
        pushing = [s for s in signals if s.quantity is not Quantity.POSITION]
        values = {s.joint: self.values(s) for s in pushing}
        slopes = force_slopes(self._mechanism, self._time(), positions, values)
        checked = []
        for signal in signals:
            slope = slopes.get(signal.joint) if signal.quantity is not Quantity.POSITION else None
            if slope is None or not np.any(values[signal.joint]):
                checked.append(signal)
                continue
            checked.append(self._check_force(signal, slope))
        return checked

    def _check_force(self, signal: Signal, slope: Slope) -> Signal:
        stated = signal.why == "as stated"
        if slope.explained < SHOWN:
            text = (
                f"sign and scale not confirmed: the model explains "
                f"{100.0 * slope.explained:.0f} % of it"
            )
            return replace(signal, assumed=(*signal.assumed, text))
        constant = 1.0
        if signal.quantity is not Quantity.FORCE and signal.unit == "1":
            actuator = actuator_on(self._mechanism, signal.joint) or ""
            constant = actuator_constant(self._mechanism, actuator) or 1.0
        ratio = slope.slope * constant
        if not stated and not SLOPE_LOW < abs(ratio) < SLOPE_HIGH:
            factor = f"{1.0 / ratio:.4g}"
            self._questions.append(
                str(
                    ask(
                        f"column {signal.column!r} is {abs(ratio):.3g} times the force that the "
                        f"model needs at {signal.joint}; is it in another unit, or before a gear?",
                        option(signal.key, f"{factor} * {signal.column}"),
                        option(signal.key, f"{signal.column} [{signal.unit}]") + " if it is right",
                    )
                )
            )
        if ratio < 0.0 and not stated:
            text = f"sign turned, as the model needs the opposite (slope {ratio:.2g})"
            return replace(signal, sign=-signal.sign, assumed=(*signal.assumed, text))
        if stated and ratio < 0.0:
            self._notes.append(f"{signal.key}: the model needs the opposite sign")
        return replace(
            signal, checked=f"confirmed by inverse dynamics, {ratio:.2g} times the model's"
        )

    def _list_unused(self, signals: Sequence[Signal], matches: Sequence[object]) -> None:
        """Collect why columns are not used."""
        used = {self._time_column}
        for signal in signals:
            used |= {signal.column} if signal.column else set()
            if signal.formula:
                used |= set(read_formula(signal.formula, self._columns.values).names.values())
        for match in matches:
            column = match.column  # type: ignore[attr-defined]
            if column not in used:
                self._unused.setdefault(column, f"the test does not need {match.quantity.value}")  # type: ignore[attr-defined]
        self._unused = {name: why for name, why in self._unused.items() if name not in used}
