"""Dependence of named values on a declared one, in words."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.diagnosis.finding import Confounded
from rigtwin.diagnosis.units import write
from rigtwin.diagnosis.words import enumerate_words

EXACT = 0.1
"""Difference of an exponent from ±1 below which a value counts as proportional."""


def describe_confounded(entry: Confounded) -> str:
    """Describe how the named values depend on a declared one, by the exponents' size.

    Parameters
    ----------
    entry
        Declared value, and the exponents of the named values.

    Returns
    -------
    str
        Clause for a terminal, such as "these values hold if mass@carriage is 2 kg, ...".
    """
    proportional = [str(name) for name, power in entry.exponents if abs(power - 1.0) < EXACT]
    inverse = [str(name) for name, power in entry.exponents if abs(power + 1.0) < EXACT]
    clauses = []
    if proportional:
        clauses.append(f"{enumerate_words(proportional)} {_is(proportional)} proportional to it")
    if inverse:
        clauses.append(f"{enumerate_words(inverse)} {_is(inverse)} inversely proportional to it")
    for name, power in entry.exponents:
        if abs(abs(power) - 1.0) >= EXACT:
            clauses.append(f"{name} changes by {power:+.2g} % with each percent of it")
    declared = write(entry.value, entry.unit)
    return (
        f"these values hold if {entry.assumed} is {declared}, which the data do not show: "
        f"{enumerate_words(clauses)}"
    )


def _is(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"
