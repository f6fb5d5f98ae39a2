"""Match the columns of a log with quantities of joints, by the names of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigtwin.describing.heading import Meaning, read_words, split_words, stated_unit
from rigtwin.describing.joint_names import QUANTITY_WORDS, Alias, list_aliases, read_abbreviations
from rigtwin.describing.match import NUMBERED, REMAINING, UNNAMED, Match
from rigtwin.describing.numbered_columns import (
    counted_from_zero,
    families_of,
    number_of,
    order_joints,
)
from rigtwin.describing.quantity import ANGULAR, AXIAL, COORDINATES, MEASURED, JointQuantity
from rigtwin.describing.question import enumerate_names
from rigtwin.describing.stacked_states import split_state
from rigtwin.description.joint_elements import actuator_on, movable_joints
from rigtwin.description.mechanism import Mechanism
from rigtwin.importing.columns import Columns
from rigtwin.importing.units import is_unit, unit_of
from rigtwin.numerics.arrays import Array


def match_columns(
    mechanism: Mechanism, columns: Columns, skipped: Sequence[str] = ()
) -> tuple[list[Match], dict[str, str]]:
    """Match the columns of a log with the joints of a model.

    Parameters
    ----------
    mechanism
        The compiled MJCF or URDF.
    columns
        Columns of the log.
    skipped
        Columns that are something else, such as the time.

    Returns
    -------
    list of Match
        One for each column that names a joint and a quantity.
    dict
        Every other column → why it is not used.
    """
    aliases, joints = list_aliases(mechanism), movable_joints(mechanism)
    leading = _leading(mechanism, joints)
    matches: list[Match] = []
    unused: dict[str, str] = {}
    numbered: dict[str, tuple[str, ...]] = {}
    written = _spell_out([name for name in _distinct(columns) if name not in skipped], aliases)
    by_name = _match_names(written, columns, aliases, len(joints))
    for column, words in written.items():
        unit, named = columns.units.get(column, ""), by_name[column]
        if len(named) == 1:
            matches += named
        elif named:
            owners = enumerate_names([match.joint for match in named])
            unused[column] = f"its name fits joints {owners} alike"
        # Two numbers could be the joint and something else, such as a sample: no match.
        elif sum(word.isdigit() for word in words) == 1:
            numbered[column] = words
        elif (match := _by_kind(mechanism, column, words, unit, leading)) is not None:
            matches.append(match)
        else:
            unused[column] = UNNAMED
    for family in families_of(numbered).values():
        ordered = sorted(family, key=lambda column: number_of(numbered[column]))
        state = split_state(ordered, columns.values, joints)
        matched, reason = (
            (state, "") if state else _by_number(family, numbered, columns.units, joints)
        )
        matches += matched
        unused |= {column: reason for column in family} if reason else {}
    if (match := _remaining(columns, leading, matches, unused)) is not None:
        matches.append(match)
        del unused[match.column]
    useless = {
        match.column: why for match in matches if (why := _useless(mechanism, match, columns))
    }
    return [match for match in matches if match.column not in useless], unused | useless


def _spell_out(names: Sequence[str], aliases: Sequence[Alias]) -> dict[str, tuple[str, ...]]:
    """Return the words of each column's name, with abbreviations of joints' names spelt out."""
    headings = {name: split_words(name) for name in names}
    abbreviated = read_abbreviations(list(headings.values()), aliases)
    return {
        column: tuple(abbreviated.get(word, word) for word in heading)
        for column, heading in headings.items()
    }


def _useless(mechanism: Mechanism, match: Match, columns: Columns) -> str:
    """Return why a column that names a joint is not used; empty where it is."""
    meaning = read_words(split_words(match.column), columns.units.get(match.column, ""))
    if match.quantity is JointQuantity.OTHER:
        return "no test needs this quantity"
    if _is_supply(mechanism, match, meaning):
        return "a voltage, and the model's actuator takes a position"
    return ""


def _is_supply(mechanism: Mechanism, match: Match, meaning: Meaning) -> bool:
    """Return whether a column holds a voltage where an actuator takes a position."""
    actuator = actuator_on(mechanism, match.joint)
    is_command = match.quantity is JointQuantity.COMMAND and actuator is not None
    is_voltage = meaning.quantity is JointQuantity.VOLTAGE
    return is_command and is_voltage and mechanism.positions(actuator or "")


def _leading(mechanism: Mechanism, joints: Sequence[str]) -> list[str]:
    """Joints without those that only follow a driven one by an equality, as a counterweight does.

    A column without the name of a joint is not taken for that of a follower.
    """
    driven = [joint for joint in joints if actuator_on(mechanism, joint) is not None]
    followers = {tie.joint for tie in mechanism.ties_of(driven)[0]}
    return [joint for joint in joints if joint not in followers]


def _distinct(columns: Columns) -> list[str]:
    """Names of columns; of joined files that name a column twice, the longer name is left out."""
    # Joined files share the array of a column that both hold, so its identity tells.
    names: dict[int, str] = {}
    for name, values in columns.values.items():
        known = names.get(id(values))
        if known is None or len(name) < len(known):
            names[id(values)] = name
    return [name for name in columns.values if name in set(names.values())]


def _match_names(
    written: Mapping[str, tuple[str, ...]],
    columns: Columns,
    aliases: Sequence[Alias],
    joints: int,
) -> dict[str, list[Match]]:
    """Column → its best matches by a name of the model; none where its number is a place."""
    by_alias = {
        column: _by_alias(column, words, columns.units.get(column, ""), aliases)
        for column, words in written.items()
    }
    return by_alias | {column: [] for column in counted_from_zero(written, by_alias, joints)}


def _by_alias(
    column: str, words: tuple[str, ...], unit: str, aliases: Sequence[Alias]
) -> list[Match]:
    """Best matches by a name of a joint, an actuator or a sensor within the column's name; several
    of different joints where they are equally good."""
    best: tuple[float, ...] = ()
    path = split_words(column.rpartition("/")[0])
    matches: dict[str, Match] = {}
    for alias in aliases:
        at = _place(alias.words, words)
        exact = alias.words == words
        if at is None or (not exact and alias.quantity and set(alias.words) <= QUANTITY_WORDS):
            continue  # A sensor that is named "force" is meant by "force" alone.
        # The rest of the heading says which quantity of that joint it is.
        meaning = read_words(words[:at] + words[at + len(alias.words) :], unit)
        quantity, why = meaning.quantity, f"named as {alias.name}"
        if exact and alias.quantity is not None and not meaning.commanded:
            quantity = alias.quantity
        elif meaning.commanded:
            quantity = _commanded(quantity)
        elif quantity is None:
            quantity = alias.quantity or JointQuantity.POSITION
            if alias.quantity in (None, JointQuantity.COMMAND):
                quantity = JointQuantity.POSITION
                why += ", taken as the position"
        # More unknown words than known ones: the joint's name stands in it by chance. A part of the
        # name, or a name in the path before the last slash, is enough only where all other words
        # have a meaning. Unknown words of the path do not count: they say where a signal is from.
        strange = [word for word in meaning.unknown if word not in path]
        in_path = at + len(alias.words) <= len(path)
        if len(strange) > (0 if alias.is_part or in_path else len(alias.words)):
            continue
        # Fewer unknown words decide first, then the longer name: "left elbow" before "elbow".
        quality = (-len(meaning.unknown), len(alias.words), float(exact))
        rank = 2.0 + exact - 0.1 * len(meaning.unknown) - 0.5 * alias.is_part
        # What the joint itself does is measured behind the gear.
        rank -= alias.gear != 1.0
        match = Match(column, alias.joint, quantity, why, rank, alias.gear)
        if quality > best:
            best, matches = quality, {match.joint: match}
        elif quality == best:
            matches.setdefault(match.joint, match)
    return list(matches.values())


def _commanded(quantity: JointQuantity | None) -> JointQuantity:
    if quantity is JointQuantity.FORCE:
        return JointQuantity.FORCE_COMMAND
    # A voltage that is commanded is the control, whatever the model's actuator makes of it.
    if quantity in (None, JointQuantity.POSITION, JointQuantity.VOLTAGE):
        return JointQuantity.COMMAND
    if quantity is JointQuantity.VELOCITY:
        return JointQuantity.VELOCITY_COMMAND
    if quantity is JointQuantity.CURRENT:
        return JointQuantity.CURRENT_COMMAND
    return JointQuantity.OTHER


def _place(inner: tuple[str, ...], outer: tuple[str, ...]) -> int | None:
    """Where words stand together within others."""
    for at in range(len(outer) - len(inner) + 1):
        if outer[at : at + len(inner)] == inner:
            return at
    return None


def _by_kind(
    mechanism: Mechanism, column: str, words: tuple[str, ...], unit: str, joints: Sequence[str]
) -> Match | None:
    """A quantity without a joint's name, of the only joint that it can belong to."""
    meaning = read_words(words, unit)
    quantity = _commanded(meaning.quantity) if meaning.commanded else meaning.quantity
    rank = 1.0 - 0.1 * len(meaning.unknown)
    if AXIAL & set(words):
        return None
    if quantity is not None:
        kind, owners = _owners(mechanism, quantity, words, unit, joints)
    elif len(told := set(words) - MEASURED) == 1 and told <= COORDINATES:
        # Of "position" and "x", the first one says more clearly what it is.
        quantity, rank = JointQuantity.POSITION, 0.6
        kind, owners = "slide", [joint for joint in joints if not mechanism.turns(joint)]
    else:
        return None
    if len(owners) != 1:
        return None
    return Match(column, owners[0], quantity, f"the model has one {kind}", rank)


def _owners(
    mechanism: Mechanism,
    quantity: JointQuantity,
    words: tuple[str, ...],
    unit: str,
    joints: Sequence[str],
) -> tuple[str, Sequence[str]]:
    """Joints that a quantity can belong to, and the word for them."""
    if len(joints) == 1:
        return "joint", joints
    if quantity not in (JointQuantity.POSITION, JointQuantity.VELOCITY):
        return "actuator", [joint for joint in joints if actuator_on(mechanism, joint)]
    si = unit_of(stated)[0] if is_unit(stated := unit or stated_unit(words)) else ""
    if si in ("m", "m/s"):
        return "slide", [joint for joint in joints if not mechanism.turns(joint)]
    if si in ("rad", "rad/s") or ANGULAR & set(words):
        return "hinge", [joint for joint in joints if mechanism.turns(joint)]
    return "joint", joints


def _remaining(
    columns: Columns,
    joints: Sequence[str],
    matches: Sequence[Match],
    unused: Mapping[str, str],
) -> Match | None:
    """The position of the only joint without one, by elimination; None unless one column is left.

    Beside the positions of other joints, the column has to say that it is a position, and to share
    no word with a joint: q_hip_yaw is not that of hip_pitch.
    """
    placed = {match.joint for match in matches if match.quantity is JointQuantity.POSITION}
    lacking = [joint for joint in joints if joint not in placed]
    known = {word for joint in joints for word in split_words(joint)}

    def may_be_position(column: str) -> bool:
        meaning = read_words(split_words(column), columns.units.get(column, ""))
        is_position = meaning.quantity is JointQuantity.POSITION and not meaning.commanded
        return is_position and not known & set(meaning.unknown)

    left = [
        column
        for column, why in unused.items()
        if why == UNNAMED
        and _varies(columns.values[column])
        and (not placed or may_be_position(column))
    ]
    # With a force or a command beside it, what remains can only be what they move.
    moved = any(match.quantity is not JointQuantity.OTHER for match in matches)
    if len(lacking) != 1 or len(left) != 1 or not moved:
        return None
    return Match(left[0], lacking[0], JointQuantity.POSITION, REMAINING, 0.5)


def _varies(values: Array) -> bool:
    """Whether a column holds at least two different numbers; texts are NaN."""
    numbers = values[np.isfinite(values)]
    return len(numbers) > 0 and float(np.ptp(numbers)) > 0.0


def _by_number(
    family: Sequence[str],
    numbered: Mapping[str, tuple[str, ...]],
    units: Mapping[str, str],
    joints: Sequence[str],
) -> tuple[list[Match], str]:
    """Columns numbered in the order of the joints, or as the joints' own names are."""
    numbers = {column: number_of(numbered[column]) for column in family}
    # The family is numbered as a whole, so one column more or less than joints fits none.
    order = order_joints(sorted(numbers.values()), joints)
    first = family[0]
    rest = tuple(word for word in numbered[first] if not word.isdigit())
    meaning = read_words(rest, units.get(first, ""))
    quantity = _commanded(meaning.quantity) if meaning.commanded else meaning.quantity
    if quantity is None and not meaning.unknown and set(rest) <= MEASURED:
        quantity = JointQuantity.POSITION
    if quantity is None or len(meaning.unknown) > 1:
        return [], UNNAMED
    if order is None:
        listed = ", ".join(map(str, sorted(numbers.values())))
        return [], f"numbered {listed}, and the model has {len(joints)} joints"
    rank = 1.0 - 0.1 * len(meaning.unknown)
    return [
        Match(column, order[number], quantity, NUMBERED, rank) for column, number in numbers.items()
    ], ""
