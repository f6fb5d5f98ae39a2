"""The interface through which a diagnosis asks for predictions, whatever the machine."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from rigtwin.components.plant import Plant
from rigtwin.components.scales import Motion
from rigtwin.numerics.arrays import Array

P = TypeVar("P", bound=Plant, contravariant=True)


@dataclass(frozen=True)
class Form:
    """One shape of an unmodelled disturbance of a component.

    Attributes
    ----------
    name : str
        Description of the shape.
    entry : str
        Place where it enters, as `Model.predict_disturbed` takes it.
    signal : Array
        The shape over time, shape (ticks,).
    """

    name: str
    entry: str
    signal: Array


class Model(ABC, Generic[P]):
    """A machine's model under the inputs of one recording.

    A kind of machine implements `predict`, `predict_true` and `motion`; everything else has a
    default. Rows of predictions are the machine's observed signals, in their order.
    """

    every: int = 1
    """Ticks of the recording from one predicted tick to the next."""

    @property
    def band(self) -> float:
        """Highest frequency at which signals are predicted and judged, Hz."""
        return math.inf

    @abstractmethod
    def predict(self, plant: P) -> Array:
        """Return the signals without noise, shape (rows, ticks)."""

    @abstractmethod
    def predict_true(self, plant: P) -> Array:
        """Return what ideal sensors would read, shape (rows, ticks)."""

    @abstractmethod
    def motion(self, component: str, plant: P) -> Motion:
        """Return the motion that a component goes through."""

    def components(self) -> Sequence[str]:
        """Return the components on which a free disturbance may act."""
        return ()

    def forms(self, component: str, plant: P) -> list[Form]:
        """Return the shapes of a free disturbance of one component."""
        return []

    def predict_disturbed(self, plant: P, entry: str, amount: Array) -> Array:
        """Return `predict` with a disturbance, shape (ticks,), that enters at `entry`."""
        raise NotImplementedError(f"{type(self).__name__} has no disturbances")

    def disturbance_size(self, entry: str) -> float:
        """Return the rms of a disturbance that counts as small at `entry`."""
        return 1.0

    def propagated_noise(self, plant: P) -> Array | None:
        """Return what the noise of the inputs adds to the predictions, shape (rows, ticks).

        None if the inputs are known exactly.
        """
        return None

    def undetermined(self) -> NDArray[np.bool_] | None:
        """Return the ticks at which the inputs do not determine the signals, shape (rows, ticks).

        None if there are none.
        """
        return None

    def missing_force(self, plant: P) -> Array | None:
        """Return the residual force required to reproduce the measured motion, N, shape (ticks,).

        None where no free motion is observed.
        """
        return None

    def notes(self) -> tuple[str, ...]:
        """Return what a reader has to know of the way in which signals are predicted."""
        return ()

    def halve_steps(self) -> Model[Any]:
        """Return the model with half the integration steps, or itself if it integrates nothing."""
        return self

    def double_steps(self) -> Model[Any]:
        """Return the model with twice the integration steps, or itself if it integrates nothing."""
        return self

    @property
    def effort(self) -> float:
        """Estimated processor time of one prediction, s.

        It is counted from the integration steps and not measured, so that a search that ends after
        a given effort gives the same answer on every computer.
        """
        return 0.0

    @property
    def has_linear_starts(self) -> bool:
        """Whether predictions are corrected to first order for errors of the initial state."""
        return False

    def near(self, plant: P) -> Model[Any]:
        """Return the model for predictions of plants that resemble one.

        Initial states that are fitted are then sought from those of that plant on.
        """
        return self

    def thin(self, longest: float) -> Model[Any]:
        """Return a coarser model for a search.

        Parameters
        ----------
        longest
            Longest time from one predicted tick or integration step to the next, s.
        """
        return self
