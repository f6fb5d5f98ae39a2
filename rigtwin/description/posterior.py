"""Posterior of a machine after a diagnosis: the corrected twin, the uncertainty of its values, and
the alternative explanations.

The TOML file of a calibrated twin stores it in the table `posterior`, beside the values that `run`
and `compare` take.
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
"""Half width of a 95 % interval of the normal distribution, in standard deviations."""

Changes = Mapping[str, Mapping[str, object]]
"""Component → parameter → value."""


@dataclass(frozen=True)
class Alternative:
    """Alternative explanation of the same recording.

    Attributes
    ----------
    effect
        Name of the effect.
    probability
        Posterior probability of the explanation, 0 to 1.
    changes
        Values of the twin corrected by this explanation.
    """

    effect: str
    probability: float
    changes: Changes


@dataclass(frozen=True)
class Posterior:
    """Posterior of a machine.

    Attributes
    ----------
    changes
        Values of the corrected twin.
    intervals
        `component.parameter` → 95 % interval of an estimated value, in its unit.
    probability
        Posterior probability of the explanation, 0 to 1.
    alternatives
        Alternative explanations, the most probable first.
    """

    changes: Changes
    intervals: Mapping[str, tuple[float, float]]
    probability: float
    alternatives: tuple[Alternative, ...]

    def at_best(self, configuration: Configuration) -> Configuration:
        """Return the configuration of the corrected twin."""
        return override(configuration, self.changes)

    def draw(self, configuration: Configuration, random: np.random.Generator) -> Configuration:
        """Return a configuration with values drawn from their posterior.

        Every estimated value has a split normal distribution about its estimate: its standard
        deviation on either side is that side of the 95 % interval divided by 1.96. Values stop at
        the parameter's bounds.

        Parameters
        ----------
        configuration
            Nominal configuration; it is not modified.
        random
            Generator of random numbers.
        """
        configuration = self.at_best(configuration)
        for key, (low, high) in self.intervals.items():
            estimate, amount = value_of(configuration, key), random.standard_normal() / NORMAL_95
            configuration = shift_within(
                configuration, key, amount * (high - estimate if amount > 0.0 else estimate - low)
            )
        return configuration


def value_of(configuration: Configuration, key: str) -> float:
    """Return the value of a setting. key: `group.name`."""
    group, _, name = key.partition(".")
    return float(groups(configuration)[group]._asdict()[name])


def shift_within(configuration: Configuration, key: str, amount: float) -> Configuration:
    """Return a configuration with one number shifted, but not beyond its bounds.

    Parameters
    ----------
    configuration
        Configuration to start from; it is not modified.
    key
        Setting, `group.name`.
    amount
        Increase of the number, in its unit.
    """
    group, _, name = key.partition(".")
    meaning = fields(type(groups(configuration)[group]))[name]
    assert isinstance(meaning, Quantity)
    value = value_of(configuration, key) + amount
    return override(configuration, {group: {name: min(max(value, meaning.low), meaning.high)}})


def format_toml(posterior: Posterior) -> list[str]:
    """Return the lines of the table `posterior` in TOML."""
    # repr() keeps all digits, so that a twin read again is identical to the bit.
    lines = [
        f"[{POSTERIOR}]",
        f"probability = {posterior.probability!r}",
        "",
        f"[{POSTERIOR}.intervals]",
    ]
    lines += [f'"{key}" = [{low!r}, {high!r}]' for key, (low, high) in posterior.intervals.items()]
    for alternative in posterior.alternatives:
        lines += [
            "",
            f"[[{POSTERIOR}.otherwise]]",
            f'effect = "{alternative.effect}"',
            f"probability = {alternative.probability!r}",
        ]
        lines += [
            f"changes.{group}.{name} = {value!r}"
            for group, values in alternative.changes.items()
            for name, value in values.items()
        ]
    return lines


def load_posterior(path: Path, base: Configuration | None = None) -> Posterior:
    """Return the posterior in a calibrated twin's file.

    Parameters
    ----------
    path
        File of the calibrated twin. Without a table `posterior`, its values count as certain.
    base
        Described settings of the machine. Defaults to those of the suspension rig.

    Returns
    -------
    Posterior
        Corrected values, their intervals and the alternative explanations.

    Raises
    ------
    RigtwinError
        If the file cannot be read or has a mistake. The message names the file.
    """
    nominal = Configuration() if base is None else base
    return read_toml(path, lambda tables: _parse(tables, nominal))


def _parse(tables: Mapping[str, Any], nominal: Configuration) -> Posterior:
    """Return the posterior in the tables of a calibrated twin's file."""
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
    intervals, alternatives = table.get("intervals", {}), table.get("otherwise", [])
    if not isinstance(intervals, Mapping):
        raise RigtwinError(
            f"{POSTERIOR}.intervals = {intervals!r}: expected a "
            "table of component.parameter = [low, high]"
        )
    if not isinstance(alternatives, list) or not all(
        isinstance(alternative, Mapping) for alternative in alternatives
    ):
        raise RigtwinError(f"{POSTERIOR}.otherwise: expected tables, [[{POSTERIOR}.otherwise]]")
    return Posterior(
        changes,
        {key: _interval(configuration, key, ends) for key, ends in intervals.items()},
        _probability(table.get("probability", 1.0)),
        tuple(_alternative(alternative, nominal) for alternative in alternatives),
    )


def _with(nominal: Configuration, where: str, changes: Changes) -> Configuration:
    """Return a configuration with changes, which may concern components alone."""
    # The same checks as for any other file: bounds, names and types.
    configuration = override(nominal, changes)
    for group in changes:
        if group not in configuration.plant._fields:
            raise RigtwinError(
                f"{where} changes {group}; a machine is described by "
                f"{', '.join(configuration.plant._fields)} alone"
            )
    return configuration


def _probability(value: object) -> float:
    """Return a probability; raise RigtwinError for any other value."""
    # bool is an int in Python, but true is no probability.
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
        raise RigtwinError(f"{POSTERIOR}: probability = {value!r}; expected 0 to 1")
    return float(value)


def _interval(configuration: Configuration, key: str, ends: object) -> tuple[float, float]:
    """Return the interval of a parameter, which must contain the parameter's value."""
    group, _, name = key.partition(".")
    components = configuration.plant._asdict()
    known = fields(type(components[group])) if group in components else {}
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
        estimate = value_of(configuration, key)
        raise RigtwinError(
            f"{POSTERIOR}.intervals: {key} = {ends!r}; expected "
            f"[low, high] about its value, {estimate:g}"
        )
    return low, high


def _alternative(table: Mapping[str, Any], nominal: Configuration) -> Alternative:
    """Return the alternative explanation in a table `[[posterior.otherwise]]`."""
    changes = table.get("changes", {})
    if not isinstance(table.get("effect"), str) or not isinstance(changes, Mapping):
        raise RigtwinError(
            f"{POSTERIOR}.otherwise: expected effect, probability and "
            f"changes, found {', '.join(table) or 'nothing'}"
        )
    effect = str(table["effect"])
    # The name is printed in tables and messages of one line.
    if not effect.isprintable():
        raise RigtwinError(
            f"{POSTERIOR}.otherwise: effect = {effect!r}; expected a name of one line"
        )
    _with(nominal, f"{POSTERIOR}.otherwise {effect}", changes)
    return Alternative(effect, _probability(table.get("probability", 0.0)), changes)
