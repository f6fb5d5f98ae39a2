"""What a diagnosis asks of a machine's model: the signals that a recording should hold, for any
plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from rigtwin.components.effect import Motion
from rigtwin.components.plant import Plant
from rigtwin.numerics.arrays import Array

P = TypeVar("P", bound=Plant, contravariant=True)


@dataclass(frozen=True)
class Form:
    """One way to disturb a component freely. entry: where it enters, as `predict_disturbed` takes
    it; signal: shape (ticks,)."""

    name: str
    entry: str
    signal: Array


class Model(Protocol[P]):
    """A machine's model under one recording's inputs. Rows are the machine's observed signals, in
    their order."""

    every: int
    """Ticks of the recording from one that is predicted to the next."""

    @property
    def band(self) -> float:
        """Hz, up to which signals are predicted and judged; infinite for all."""
        ...

    def predict(self, plant: P) -> Array:
        """What the signals should be, noise apart, shape (rows, ticks)."""
        ...

    def predict_true(self, plant: P) -> Array:
        """What ideal sensors would read, shape (rows, ticks)."""
        ...

    def predict_disturbed(self, plant: P, entry: str, amount: Array) -> Array:
        """The same as `predict` with a disturbance, shape (ticks,), entering somewhere."""
        ...

    def components(self) -> Sequence[str]:
        """Components that can be disturbed freely."""
        ...

    def forms(self, component: str, plant: P) -> list[Form]:
        """Ways to disturb one of them."""
        ...

    def disturbance_size(self, entry: str) -> float:
        """rms of a disturbance that is small there."""
        ...

    def motion(self, component: str, plant: P) -> Motion:
        """What a component goes through."""
        ...

    def propagated_noise(self, plant: P) -> Array | None:
        """What the noise of the signals that drive the model makes of the observed ones, shape
        (rows, ticks); None if they are known exactly."""
        ...

    def undetermined(self) -> NDArray[np.bool_] | None:
        """Ticks at which the inputs do not determine what is observed, whatever the plant, shape
        (rows, ticks); None if there are none."""
        ...

    def missing_force(self, plant: P) -> Array | None:
        """What would have to act besides on a joint for it to go as it was measured to, N, shape
        (ticks,); None where nothing that goes by itself is observed."""
        ...

    def halve_steps(self) -> Model[P]:
        """With half the integration steps, if it can be."""
        ...

    def double_steps(self) -> Model[P]:
        """With twice the integration steps."""
        ...

    def thin(self, longest: float) -> Model[P]:
        """For a search: with ticks left out where nothing is integrated from one to the next, or
        with longer steps of integration; either at most so many s apart."""
        ...
