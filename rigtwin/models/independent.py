"""Model of joints that do not act on each other: one `JointModel` for each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.components.scales import Motion
from rigtwin.models.joint import JointModel
from rigtwin.models.model import Form, Model
from rigtwin.numerics.arrays import Array


class IndependentModel(Model[Plant]):
    """Models of all joints of one recording, with their rows one after another.

    An entry of a disturbance is `number:entry`, with the joint's number and its own entry.
    """

    def __init__(self, joints: Sequence[JointModel]) -> None:
        self._joints = tuple(joints)
        self.every = joints[0].every

    def predict(self, plant: Plant) -> Array:
        return np.concatenate([each.predict(plant) for each in self._joints])

    def predict_true(self, plant: Plant) -> Array:
        return np.concatenate([each.predict_true(plant) for each in self._joints])

    def predict_disturbed(self, plant: Plant, entry: str, amount: Array) -> Array:
        number, _, joint_entry = entry.partition(":")
        return np.concatenate(
            [
                each.predict_disturbed(plant, joint_entry, amount)
                if place == int(number)
                else each.predict(plant)
                for place, each in enumerate(self._joints)
            ]
        )

    def _index_of(self, component: str) -> int:
        return next((n for n, each in enumerate(self._joints) if component in each.components()), 0)

    def components(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for each in self._joints for name in each.components()))

    def forms(self, component: str, plant: Plant) -> list[Form]:
        number = self._index_of(component)
        return [
            Form(each.name, f"{number}:{each.entry}", each.signal)
            for each in self._joints[number].forms(component, plant)
        ]

    def disturbance_size(self, entry: str) -> float:
        number, _, joint_entry = entry.partition(":")
        return self._joints[int(number)].disturbance_size(joint_entry)

    def motion(self, component: str, plant: Plant) -> Motion:
        return self._joints[self._index_of(component)].motion(component, plant)

    def missing_force(self, plant: Plant) -> Array | None:
        parts = [each.missing_force(plant) for each in self._joints]
        known = [part for part in parts if part is not None]
        return np.concatenate(known) if known else None

    def propagated_noise(self, plant: Plant) -> Array | None:
        parts = [each.propagated_noise(plant) for each in self._joints]
        if all(part is None for part in parts):
            return None
        ticks = next(part.shape[1] for part in parts if part is not None)
        rows = [len(each.rows) for each in self._joints]
        return np.concatenate(
            [
                np.zeros((n, ticks)) if part is None else part
                for n, part in zip(rows, parts, strict=True)
            ]
        )

    @property
    def effort(self) -> float:
        return sum(each.effort for each in self._joints)

    @property
    def has_linear_starts(self) -> bool:
        return any(each.has_linear_starts for each in self._joints)

    def halve_steps(self) -> IndependentModel:
        return IndependentModel([each.halve_steps() for each in self._joints])

    def double_steps(self) -> IndependentModel:
        return IndependentModel([each.double_steps() for each in self._joints])

    def thin(self, longest: float) -> IndependentModel:
        thinned = [each.thin(longest) for each in self._joints]
        # The rows of all joints are stacked into one array, so they need the same ticks.
        same_ticks = len({each.every for each in thinned}) == 1
        return IndependentModel(thinned) if same_ticks else self
