"""What is known of a rig after a diagnosis: the corrected twin, how sure each of its values is, and
what else it could be.

A calibrated twin's TOML has this as its table `posterior`, beside the values that `run` and
`compare` take.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controllers.quantity import Quantity, fields
from rigtwin.description.changes import POSTERIOR, override, read_toml, values_of
from rigtwin.description.configuration import Configuration, groups
from rigtwin.errors import RigtwinError

NORMAL_95 = 1.959964
"""Standard deviations from the middle to the end of a 95 % interval."""

Changes = Mapping[str, Mapping[str, object]]
"""Component → parameter → value."""


@dataclass(frozen=True)
class Otherwise:
    """Another explanation of the same recording: its name, its probability, and its twin's
    values."""

    effect: str
    probability: float
    changes: Changes


@dataclass(frozen=True)
class Posterior:
    """changes: the corrected twin's values; intervals: `component.parameter` → 95 % interval of
    those that were found; probability: of this explanation; otherwise: the others, the likeliest
    first."""

    changes: Changes
    intervals: Mapping[str, tuple[float, float]]
    probability: float
    otherwise: tuple[Otherwise, ...]

    def at_best(self, configuration: Configuration) -> Configuration:
        """The corrected twin."""
        return override(configuration, self.changes)

    def draw(self, configuration: Configuration, random: np.random.Generator) -> Configuration:
        """A twin as it may be: each value found normal about what was found, either side as wide as
        its interval, cut off at its bounds."""
        configuration = self.at_best(configuration)
        for key, (low, high) in self.intervals.items():
            there, amount = value_of(configuration, key), random.standard_normal() / NORMAL_95
            configuration = shift_within(
                configuration, key, amount * (high - there if amount > 0.0 else there - low)
            )
        return configuration


def value_of(configuration: Configuration, key: str) -> float:
    """The number `group.name`."""
    group, _, name = key.partition(".")
    return float(getattr(groups(configuration)[group], name))


def shift_within(configuration: Configuration, key: str, amount: float) -> Configuration:
    """The configuration with a number `group.name` higher by an amount, or at the bound next to
    that."""
    group, _, name = key.partition(".")
    meaning = fields(type(groups(configuration)[group]))[name]
    assert isinstance(meaning, Quantity)
    value = value_of(configuration, key) + amount
    return override(configuration, {group: {name: min(max(value, meaning.low), meaning.high)}})


def format_toml(posterior: Posterior) -> list[str]:
    """The table's lines in TOML. Full precision, so that a twin read again is the same to the
    bit."""
    lines = [
        f"[{POSTERIOR}]",
        f"probability = {posterior.probability!r}",
        "",
        f"[{POSTERIOR}.intervals]",
    ]
    lines += [f'"{key}" = [{low!r}, {high!r}]' for key, (low, high) in posterior.intervals.items()]
    for other in posterior.otherwise:
        lines += [
            "",
            f"[[{POSTERIOR}.otherwise]]",
            f'effect = "{other.effect}"',
            f"probability = {other.probability!r}",
        ]
        lines += [
            f"changes.{group}.{name} = {value!r}"
            for group, own in other.changes.items()
            for name, value in own.items()
        ]
    return lines


def load_posterior(path: Path, base: Configuration | None = None) -> Posterior:
    """A calibrated twin. Without a table `posterior` its values are taken as certain.

    Parameters
    ----------
    path
        Its file.
    base
        The machine's settings as described; the suspension rig's by default.

    Returns
    -------
    Posterior
        What is known of it.

    Raises
    ------
    RigtwinError
        Naming file and fault.
    """
    nominal = Configuration() if base is None else base
    return read_toml(path, lambda tables: _parse(tables, nominal))


def _parse(tables: Mapping[str, Any], nominal: Configuration) -> Posterior:
    changes = values_of(tables)
    configuration = _with(nominal, "it", changes)
    table = tables.get(POSTERIOR, {})
    if not isinstance(table, Mapping):
        raise RigtwinError(
            f"{POSTERIOR} = {table!r}: expected a table, as rigtwin diagnose --save-twin writes it"
        )
    for key in table:
        if key not in ("probability", "intervals", "otherwise"):
            raise RigtwinError(
                f"unknown {POSTERIOR}.{key}; there are probability, intervals, otherwise"
            )
    intervals, others = table.get("intervals", {}), table.get("otherwise", [])
    if not isinstance(intervals, Mapping):
        raise RigtwinError(
            f"{POSTERIOR}.intervals = {intervals!r}: expected a "
            "table of component.parameter = [low, high]"
        )
    if not isinstance(others, list) or not all(isinstance(other, Mapping) for other in others):
        raise RigtwinError(f"{POSTERIOR}.otherwise: expected tables, [[{POSTERIOR}.otherwise]]")
    return Posterior(
        changes,
        {key: _interval(configuration, key, ends) for key, ends in intervals.items()},
        _probability(table.get("probability", 1.0)),
        tuple(_otherwise(other, nominal) for other in others),
    )


def _with(nominal: Configuration, where: str, changes: Changes) -> Configuration:
    """A machine with changes, which must be of its components alone."""
    configuration = override(nominal, changes)
    for group in changes:
        if group not in configuration.plant._fields:
            raise RigtwinError(
                f"{where} changes {group}; a machine is described by "
                f"{', '.join(configuration.plant._fields)} alone"
            )
    return configuration


def _probability(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
        raise RigtwinError(f"{POSTERIOR}: probability = {value!r}; expected 0 to 1")
    return float(value)


def _interval(configuration: Configuration, key: str, ends: object) -> tuple[float, float]:
    group, _, name = key.partition(".")
    known = (
        fields(type(getattr(configuration.plant, group)))
        if group in configuration.plant._fields
        else {}
    )
    if not isinstance(known.get(name), Quantity):
        raise RigtwinError(
            f"{POSTERIOR}.intervals: unknown parameter {key!r}; "
            "expected component.parameter of the machine"
        )
    try:
        low, high = (float(end) for end in ends if not isinstance(end, bool | str))  # type: ignore[union-attr]
    except (TypeError, ValueError, OverflowError):
        low = high = math.nan
    if not (
        math.isfinite(low) and math.isfinite(high) and low <= value_of(configuration, key) <= high
    ):
        there = value_of(configuration, key)
        raise RigtwinError(
            f"{POSTERIOR}.intervals: {key} = {ends!r}; expected "
            f"[low, high] about its value, {there:g}"
        )
    return low, high


def _otherwise(table: Mapping[str, Any], nominal: Configuration) -> Otherwise:
    changes = table.get("changes", {})
    if not isinstance(table.get("effect"), str) or not isinstance(changes, Mapping):
        raise RigtwinError(
            f"{POSTERIOR}.otherwise: expected effect, probability and "
            f"changes, found {', '.join(table) or 'nothing'}"
        )
    effect = str(table["effect"])
    if not effect.isprintable():
        raise RigtwinError(
            f"{POSTERIOR}.otherwise: effect = {effect!r}; expected a name of one line"
        )
    _with(nominal, f"{POSTERIOR}.otherwise {effect}", changes)
    return Otherwise(effect, _probability(table.get("probability", 0.0)), changes)
