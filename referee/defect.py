"""Defects of the referee's rig, and how their sizes are drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from referee.reference_rig import Law, run_quiet
from referee.reference_truth import Array, Truth

Random = np.random.Generator
Change = Callable[[Truth, Law], tuple[Truth, Law]]
"""Function that adds a defect to a rig and its controller."""
SENSORS = ("ground_lvdt", "structure_lvdt", "suspension_lvdt", "load_cell")
MATERIAL = 1.0
"""Smallest material defect: rms change of some sensor, in units of its white noise."""


@dataclass(frozen=True)
class Defect:
    """A defect.

    Attributes
    ----------
    kind, component : str
        Name in the vocabulary of the reports, or one outside it.
    value, nominal : float
        Defective and nominal value of the first parameter, as a report would give them.
    inside : bool
        Whether the reports know this kind.
    change : callable
        Function that adds the defect to a rig and to the controller's true settings.
    """

    kind: str
    component: str
    value: float
    nominal: float
    inside: bool
    change: Change = field(repr=False)


DefectMaker = Callable[[], Defect]


def replace_fields(path: str, **values: float) -> Change:
    """Return a change of fields of the rig, or of its part `path`."""

    def change(truth: Truth, law: Law) -> tuple[Truth, Law]:
        if not path:
            return truth._replace(**values), law
        part = truth._asdict()[path]
        return truth._replace(**{path: part._replace(**values)}), law

    return change


def log_uniform(random: Random, low: float, high: float) -> float:
    """Draw a number between two bounds, uniform in its logarithm."""
    # Sizes span decades: a uniform draw would hardly ever give a small one.
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def either_sign(random: Random, low: float, high: float) -> float:
    """Draw a magnitude as `log_uniform`, with a random sign."""
    return log_uniform(random, low, high) * float(random.choice([-1.0, 1.0]))


def single_defect(
    kind: str, component: str, nominal: float, path: str, name: str, draw: Callable[[], float]
) -> DefectMaker:
    """Return a function that draws a defect of one number.

    Parameters
    ----------
    kind, component, nominal
        Kind, component and nominal value, as in `Defect`.
    path, name
        Part of the rig, empty for the rig itself, and its field that takes the value.
    draw
        Function that draws the value.
    """

    def defect() -> Defect:
        value = draw()
        change = replace_fields(path, **{name: value})
        return Defect(kind, component, value, nominal, True, change)

    return defect


def effect_size(rig: Truth, law: Law, defect: Defect, commands: Array) -> float:
    """Return the size of a defect: the largest rms change of a sensor, in units of its white noise.

    Both rigs run under the same commands. Defects without a signal of their own, such as noise,
    count as infinitely large.
    """
    if defect.kind in ("hum", "noise", "quantisation", "missed_ticks") or defect.kind.startswith(
        "setting"
    ):
        return float("inf")
    defective, true_law = defect.change(rig, law)
    # Without noise on either side, the difference is the defect's alone.
    change = run_quiet(defective, true_law, commands) - run_quiet(rig, law, commands)
    parts = rig._asdict()
    noise = np.array([parts[name].white for name in SENSORS])
    return float(np.max(np.sqrt(np.mean(change**2, axis=0)) / noise))


def summary(defect: Defect, size: float) -> dict[str, Any]:
    """Return the entry of a defect in the key."""
    return {
        "kind": defect.kind,
        "component": defect.component,
        "value": defect.value,
        "nominal": defect.nominal if np.isfinite(defect.nominal) else None,
        "inside": defect.inside,
        "size": size if np.isfinite(size) else None,
        "material": bool(size >= MATERIAL),
    }
