"""Every effect at a size that is felt."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

NOTICEABLE = {
    "coulomb@rail": "90",
    "viscous@rail": "400",
    "stribeck@rail": "30",
    "asymmetry@rail": "30",
    "backlash@rail": "0.002",
    "coulomb@motor": "24",
    "viscous@motor": "60",
    "stribeck@motor": "12",
    "asymmetry@motor": "12",
    "load_friction@motor": "0.05",
    "backlash@motor": "0.002",
    "mass@carriage": "40",
    "stiffness@tyre": "42000",
    "damping@tyre": "500",
    "hardening@tyre": "60",
    "gain@motor": "1.05",
    "lag@motor": "0.005",
    "delay@motor": "0.005",
    "saturation@motor": "1.5",
    "deadband@motor": "0.1",
    "rate_limit@motor": "5",
    "cogging@motor": "10",
    "gain@cylinder": "1.05",
    "lag@cylinder": "0.01",
    "delay@cylinder": "0.005",
    "saturation@cylinder": "0.008",
    "deadband@cylinder": "0.001",
    "rate_limit@cylinder": "0.03",
    "compliance@cylinder": "1e-6",
    "backlash@cylinder": "0.002",
    "gain@lvdt": "1.05",
    "offset@lvdt": "0.001",
    "drift@lvdt": "0.0005",
    "drift@load_cell": "5",
    "lag@lvdt": "0.01",
    "delay@lvdt": "0.01",
    "hum@lvdt": "0.001",
    "noise@lvdt": "0.0003",
    "quantisation@lvdt": "0.0005",
    "gain@load_cell": "1.05",
    "offset@load_cell": "10",
    "lag@load_cell": "0.01",
    "delay@load_cell": "0.01",
    "hum@load_cell": "30",
    "noise@load_cell": "10",
    "quantisation@load_cell": "5",
    "delay@controller": "0.005",
    "missed_ticks@controller": "0.1",
}


def text(name: str) -> str:
    """The effect as `--effect` takes it."""
    kind, _, component = name.partition("@")
    for ending in ("cylinder", "lvdt"):
        component = ending if component.endswith(ending) else component
    return f"{name}={NOTICEABLE[f'{kind}@{component}']}"


ALIKE = {
    "structure_lvdt": "suspension_lvdt",
    "ground_lvdt": "suspension_lvdt",
    "structure_cylinder": "ground_cylinder",
}
"""Component → another one of the same sort."""


def once_a_sort(names: Sequence[str]) -> list[object]:
    """Parameters of a test: what the same kind shows at another component of the sort is left to
    the slow tests."""

    def repeats(name: str) -> bool:
        kind, _, component = name.partition("@")
        return f"{kind}@{ALIKE.get(component)}" in names

    return [pytest.param(name, marks=pytest.mark.slow if repeats(name) else ()) for name in names]


def once_a_component(names: Sequence[str]) -> list[object]:
    """Parameters of a test: the first kind of every component; the others are left to the slow
    tests."""
    first = {name.partition("@")[2]: name for name in reversed(names)}
    return [
        pytest.param(name, marks=() if name in first.values() else pytest.mark.slow)
        for name in names
    ]
