"""The texts of a description and of a map, TOML with comments, to be read and edited."""

from __future__ import annotations

import json
from collections.abc import Sequence

from rigtwin.describing.formulas import read_formula
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.reading import Reading
from rigtwin.describing.schedule_signals import ScheduleColumn
from rigtwin.describing.signal import LogSignal
from rigtwin.description.implied import FORCES, INVERSE, TESTS
from rigtwin.description.joint_elements import (
    actuator_name,
    identifier,
    movable_joints,
    sensor_name,
)
from rigtwin.description.mechanism import Mechanism
from rigtwin.importing.columns import Columns


def channel_of(mechanism: Mechanism, signal: LogSignal) -> str:
    """Return the channel that holds a signal in recordings.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    signal
        LogSignal of a log.
    """
    if not signal.commands:
        return f"/sensor.{sensor_name(mechanism, signal.joint, signal.quantity.value)}"
    return f"/command.{actuator_name(mechanism, signal.joint)}"


def write_description(
    mechanism: Mechanism, reading: Reading, name: str, model: str, log: str
) -> str:
    """Return the text of a description.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    reading
        Conclusions from the log.
    name
        Name of the machine.
    model
        Path of the model, as seen from the description.
    log
        Name of the log, for a comment.
    """
    kind = reading.kind
    alternatives = ", ".join(test for test in TESTS if test != kind.test)
    lines = [
        f"# {name}, described from its model and the log {log}. docs/machines.md lists all keys.",
        "",
        "[machine]",
        f"name = {_quote(name)}",
        f"model = {_quote(model)}",
        'nominal = "rough"      # or "known", where the values of the model were measured',
        "",
        "[[replays]]",
        f"test = {_quote(kind.test)}      # {TESTS[kind.test]}",
        f"# because {kind.why}; also possible: {alternatives}",
    ]
    if list(reading.joints) != movable_joints(mechanism):
        lines.append(f"joints = [{', '.join(map(_quote, reading.joints))}]")
    if reading.velocities:
        lines.append(f"velocities = [{', '.join(map(_quote, reading.velocities))}]")
    if reading.resting:
        lines.append(f"resting = [{', '.join(map(_quote, reading.resting))}]")
    if reading.band is not None:
        lines.append(
            f"band = {reading.band!r}            # Hz; above it forces are ripple or noise"
        )
    tables = _tables(mechanism, reading)
    if tables:
        lines += ["", "[components]", *tables]
    lines += [
        "",
        "# Components follow from the test. A table of a component states what differs, e.g.:",
    ]
    lines += _examples(mechanism, reading)
    return "\n".join(lines) + "\n"


def _tables(mechanism: Mechanism, reading: Reading) -> list[str]:
    """Tables of the components of which the log says more than the test."""
    tables = [
        # A command of zero shows nothing of its actuator; a stated factor is not to be estimated
        # again.
        f"{actuator_name(mechanism, joint)} = {{ effects = [] }}    # its command is 0 throughout"
        for joint in reading.idle
    ]
    tables += [
        f"{sensor_name(mechanism, signal.joint, 'force')} = {{ effects = [] }}    "
        "# its factor was stated"
        for signal in reading.signals
        if signal.quantity is JointQuantity.FORCE and signal.formula
    ]
    # Commands are held from row to row. About a row, the mean of the force is that of the held
    # command before it and the one after it: it acts half a row later than it is recorded.
    half = 0.5 * (reading.clock.resample or reading.clock.period)
    tables += [
        f"{sensor_name(mechanism, signal.joint, 'force')} = {{ delay = {-half!r} }}    "
        "# s; half a row, as its command is held"
        for signal in reading.signals
        if signal.from_command and not signal.formula
    ]
    # Only where the motion is given can a force follow a channel.
    if reading.kind.test == INVERSE:
        tables += [_schedule(schedule) for schedule in reading.schedules if schedule.joint]
    return tables


def _schedule(schedule: ScheduleColumn) -> str:
    """Table of a component whose forces follow a column."""
    keys = [f"joint = {_quote(schedule.joint)}", 'type = "schedule"']
    keys += [f"unit = {_quote(schedule.unit)}"] if schedule.unit else []
    return f"{schedule.name} = {{ {', '.join(keys)} }}    # forces may follow it"


def _examples(mechanism: Mechanism, reading: Reading) -> list[str]:
    """Commented tables of components, of the first joint."""
    joint = reading.joints[0]
    turns = mechanism.turns(joint)
    unit, damping = ("Nm", "Nms/rad") if turns else ("N", "Ns/m")
    lines = []
    if reading.kind.test == INVERSE:
        force = sensor_name(mechanism, joint, "force")
        lines += [
            f"# [components.{identifier(joint)}]",
            f"# viscous = {{ value = 0.0, tolerance = 0.1 }}    # {damping}",
            f"# [components.{force}]",
            f"# white = 0.01           # {unit} rms, noise",
        ]
    elif reading.kind.test == FORCES:
        lines += [
            f"# [components.{identifier(joint)}]",
            '# effects = ["coulomb", "viscous", "offset"]    # those that are possible',
        ]
    else:
        lines += [
            f"# [components.{actuator_name(mechanism, joint)}]",
            '# effects = ["delay", "lag", "deadband"]    # those that are possible',
        ]
    lines += [
        f"# [components.{sensor_name(mechanism, joint, 'position')}]",
        '# effects = ["offset"]   # the zero of the encoder is in doubt',
    ]
    return lines


def write_map(
    mechanism: Mechanism,
    columns: Columns,
    reading: Reading,
    name: str,
    log: str,
    episode: str = "",
) -> str:
    """Return the text of the map of a log.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    columns
        Columns of the log.
    reading
        Conclusions from the log.
    name
        Name of the machine.
    log
        Name of the log, for a comment.
    episode
        Column that numbers the tests of the log; empty for a log of one test.
    """
    clock = reading.clock
    lines = [
        f"# Columns of {log} as the channels of machine {name}. docs/machines.md lists all keys.",
        f"machine = {_quote(name)}",
        f"experiment = {_quote(log)}",
        "",
        "[time]",
    ]
    if clock.column:
        lines += [
            f"column = {_quote(clock.column)}",
            f"unit = {_quote(clock.unit)}             # {clock.why}",
        ]
    else:
        lines.append(f"period = {clock.period!r}")
    if clock.resample is not None:
        lines.append(f"resample = {clock.resample!r}      # s; the rows are uneven in time")
    if episode:
        lines += ["", "[episodes]", f"column = {_quote(episode)}"]
    channels, named = [], {}
    for schedule in reading.schedules:
        text = f'{{ column = {_quote(schedule.column)}, unit = "1" }}'
        channels.append(f'"/sensor.{schedule.name}" = {text}')
    for signal in reading.signals:
        text, used = _source(signal, columns)
        named |= used
        remarks = "; ".join([signal.why, *signal.assumed])
        channels.append(f"{_quote(channel_of(mechanism, signal))} = {text}    # {remarks}")
    if named:
        lines += ["", "[columns]", *(f"{plain} = {text}" for plain, text in named.items())]
    lines += ["", "[channels]", *channels]
    if reading.unused:
        lines += ["", "# Columns that are not used:"]
        lines += [f"# {column}: {why}" for column, why in reading.unused.items()]
    return "\n".join(lines) + "\n"


def _source(signal: LogSignal, columns: Columns) -> tuple[str, dict[str, str]]:
    """The table of a channel, and the columns that its formula names."""
    if signal.formula:
        stated = read_formula(signal.formula, columns.values)
        if stated.constant is not None:
            return f"{{ constant = {stated.constant!r} }}", {}
        used = {plain: f"{{ column = {_quote(column)} }}" for plain, column in stated.names.items()}
        return f"{{ formula = {_quote(stated.text)} }}", used
    keys = [f"column = {_quote(signal.column)}", f"unit = {_quote(signal.unit)}"]
    keys += ["sign = -1"] if signal.sign < 0.0 else []
    keys += [f"scale = {signal.scale!r}"] if signal.scale != 1.0 else []
    keys += [f"wrap = {signal.wrap!r}"] if signal.wrap is not None else []
    return f"{{ {', '.join(keys)} }}", {}


def _quote(text: str) -> str:
    # JSON's strings are TOML's basic strings; letters with accents stay readable.
    return json.dumps(text, ensure_ascii=False)


def table_rows(mechanism: Mechanism, reading: Reading) -> list[Sequence[str]]:
    """Return the table of what was taken for what: signal, source, unit and reasons.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    reading
        Conclusions from the log.
    """
    clock = reading.clock
    rows: list[Sequence[str]] = [("what", "read from", "unit", "as channel", "because")]
    source = clock.column or f"every {clock.period:g} s"
    rows.append(("time", source, clock.unit, "", clock.why))
    for signal in reading.signals:
        remarks = [signal.why, *signal.assumed, *([signal.checked] if signal.checked else [])]
        unit = "" if signal.formula else signal.unit
        channel = channel_of(mechanism, signal)
        rows.append((signal.key, signal.source, unit, channel, "; ".join(remarks)))
    for schedule in reading.schedules:
        channel, reason = f"/sensor.{schedule.name}", f"forces at {schedule.joint or 'a joint'}"
        rows.append(("may be followed", schedule.column, "", channel, reason))
    # Unused columns come last: a reader looks for a column that should have been used.
    rows += [("not used", column, "", "", why) for column, why in reading.unused.items()]
    return rows
