"""Plant: the parameters of all components of a machine, by name, in a NamedTuple."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeVar

if TYPE_CHECKING:
    from rigtwin.components.computer import Computer, Mains


class Plant(Protocol):
    """Protocol of a plant: a NamedTuple of components, among them `computer` and `mains`.

    The machine's description decides which other components it has. A component is itself a
    NamedTuple whose fields carry `Quantity(unit, low, high, source)`.
    """

    @property
    def _fields(self) -> tuple[str, ...]: ...

    @property
    def computer(self) -> Computer: ...

    @property
    def mains(self) -> Mains: ...

    def _asdict(self) -> dict[str, Any]: ...

    def _replace(self, **components: Any) -> Self: ...


P = TypeVar("P", bound=Plant)


def plant_of(components: Mapping[str, Any]) -> Any:
    """Return a plant of these components, by name; it can be pickled."""
    # The class is made at run time, so a process that unpickles a plant has to make it again.
    plant_type = namedtuple("Plant", list(components))  # type: ignore[misc]
    plant_type.__reduce__ = lambda plant: (plant_of, (plant._asdict(),))  # type: ignore[method-assign, assignment]
    return plant_type(**components)


def with_parameters(plant: P, group: str, changes: Mapping[str, float]) -> P:
    """Return a plant with changed parameters of one component, named `group`."""
    return plant._replace(**{group: getattr(plant, group)._replace(**changes)})
