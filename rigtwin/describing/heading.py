"""The name of a column, taken apart into words."""

from __future__ import annotations

import re
from dataclasses import dataclass

from rigtwin.describing.quantity import (
    COMMANDED,
    COUNTS,
    MEASURED,
    RATES,
    UNIT_WORDS,
    WORDS,
    JointQuantity,
    quantity_of_unit,
)
from rigtwin.errors import RigtwinError
from rigtwin.importing.units import unit_of

GREEK = {"θ": "theta", "τ": "tau", "φ": "phi", "ω": "omega", "ϕ": "phi"}
"""Letters that columns are named by."""
SHORT = {"th": "theta", "ph": "phi"}
"""Short forms of those letters' names."""
PREFIXES = {
    "i": "current",
    "iq": "iq",
    "tau": "tau",
    "trq": "torque",
    "torque": "torque",
    "force": "force",
    "pos": "pos",
    "vel": "vel",
    "speed": "speed",
    "angle": "angle",
    "theta": "theta",
    "th": "theta",
    "omega": "omega",
}
"""Beginning of a word → word that it stands for."""
SUFFIXES = frozenset(["ref", "cmd", "des", "set", "meas", "act", "fb", "target"])
"""What may follow such a beginning in the same word."""
UNITS_WITH_CAPITALS = {
    "N": "newton",
    "mN": "millinewton",
    "kN": "kilonewton",
    "mNm": "mnm",
    "kNm": "knm",
    "Ncm": "ncm",
    "mA": "ma",
}
"""Unit whose capitals count → word by which it is known here."""
_CAPITALS = re.compile(r"(?<=[_\s(\[])(mNm|kNm|Ncm|mN|kN|mA|N)(?=[)\]]?(?:[_\s]\d+)?$)")
"""Unit with capitals at the end of a name, where only the number of a joint may follow it."""
_AMPERES = re.compile(r"^[iI][_\s](?:(.*)[_\s])?A$")
"""Name of a current, such as I_x_A: the symbol, the joint and the unit."""
PRECEDENCE = (
    JointQuantity.OTHER,
    JointQuantity.VOLTAGE,
    JointQuantity.CURRENT,
    JointQuantity.FORCE,
    JointQuantity.VELOCITY,
    JointQuantity.POSITION,
)
"""Order in which the words of quantities decide: a "position error" is no position."""

SAID_BY_UNITS = (JointQuantity.CURRENT, JointQuantity.FORCE, JointQuantity.VELOCITY)
"""Quantities that a unit states for certain. A velocity "in degrees" may be one in degrees a
second."""
SAID_BY_WORDS = (*SAID_BY_UNITS, JointQuantity.POSITION)
"""Quantities that a unit may state instead of a word."""


@dataclass(frozen=True)
class Meaning:
    """Meaning of words of a heading that name no joint.

    Parameters
    ----------
    quantity
        Quantity that the words, or else the unit, state. None if they state none.
    commanded
        Whether the words say that the column was commanded.
    unknown
        Words without a meaning here.
    """

    quantity: JointQuantity | None
    commanded: bool
    unknown: tuple[str, ...]


def split_words(name: str) -> tuple[str, ...]:
    """Return the words and numbers of a name, in lower case.

    Words end at signs, at a capital after a lower-case letter, and between letters and digits:
    `leftElbow.pos[3]` has the words left, elbow, pos, 3.

    Parameters
    ----------
    name
        Name of a column, joint, actuator or sensor.
    """
    # Spaces about the word: θ1 has the words theta and 1.
    for letter, word in GREEK.items():
        name = name.replace(letter, f" {word} ")
    name = _AMPERES.sub(r"current \1 amp", name)
    # Before words are parted at capitals, mNm is a word. A capital N at the end is a unit too:
    # shaker_N has the words shaker, newton.
    name = _CAPITALS.sub(lambda match: UNITS_WITH_CAPITALS[match[0]], name)
    name = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    words: list[str] = re.findall(r"[a-z]+|\d+", name.lower())
    parts = [part for word in words for part in _part_prefix(word)]
    return tuple(SHORT.get(word, word) for word in parts)


def _part_prefix(word: str) -> tuple[str, ...]:
    """Return the two words that a name joins without a sign, such as current and ref of iref."""
    for prefix in sorted(PREFIXES, key=len, reverse=True):
        if word.startswith(prefix) and word[len(prefix) :] in SUFFIXES:
            return PREFIXES[prefix], word[len(prefix) :]
    return (word,)


def read_words(words: tuple[str, ...], unit: str) -> Meaning:
    """Return what the words of a heading mean that name no joint.

    Parameters
    ----------
    words
        Words without those of a joint's name.
    unit
        Unit that the file states for the column; empty if it states none.
    """
    # The current in a motor's q axis is often called i_q.
    if "i" in words and "q" in words:
        words = ("iq", *(word for word in words if word not in ("i", "q")))
    commanded = any(word in COMMANDED for word in words)
    quantity = None
    if stated_unit(words) in RATES.values():
        unit = unit or stated_unit(words)
        words = tuple(word for word in words if word not in ("per", "s"))
    # q_dot and theta dot are derivatives, although q and theta are positions.
    if "dot" in words:
        quantity = JointQuantity.VELOCITY
    elif "ddot" in words:
        quantity = JointQuantity.OTHER
    else:
        quantity = next((q for q in PRECEDENCE if WORDS[q] & _without_adjective(words)), None)
    if quantity is None:
        quantity = _quantity_by_unit(words, unit)
    # A unit says more than a word: a "moment" in A is a current, and "phi" in rad/s a velocity.
    elif unit and quantity in SAID_BY_WORDS:
        stated = _quantity_by_unit((), unit)
        quantity = stated if stated in SAID_BY_UNITS else quantity
    known = COMMANDED | COUNTS | MEASURED | frozenset(UNIT_WORDS) | {"dot", "ddot"}
    known |= frozenset().union(*WORDS.values())
    unknown = tuple(word for word in words if word not in known and not word.isdigit())
    return Meaning(quantity, commanded, unknown)


def _without_adjective(words: tuple[str, ...]) -> set[str]:
    """Words without "current" where it is an adjective, as in "current position"."""
    # The letter q is no position here: a motor has a current in its q axis.
    quantities = (JointQuantity.POSITION, JointQuantity.VELOCITY, JointQuantity.FORCE)
    others = frozenset().union(*(WORDS[quantity] for quantity in quantities)) - {"q"}
    return set(words) - {"current"} if others & set(words) else set(words)


def stated_unit(words: tuple[str, ...]) -> str:
    """Return the unit that a heading's words state; empty if they state none.

    Parameters
    ----------
    words
        All words of the heading.
    """
    # A slash is no part of a name that programs accept: vel_deg_s is in deg/s.
    ends = [word for word in words if not word.isdigit() and word != "per"]
    if ends[-1:] == ["s"] and ends[-2:-1] and (rate := RATES.get(ends[-2])):
        return rate
    # The unit stands last, as in position_deg.
    return next((UNIT_WORDS[word] for word in reversed(words) if word in UNIT_WORDS), "")


def _quantity_by_unit(words: tuple[str, ...], unit: str) -> JointQuantity | None:
    text = unit or stated_unit(words)
    if not text:
        return None
    try:
        return quantity_of_unit(unit_of(text)[0])
    except RigtwinError:
        return None
