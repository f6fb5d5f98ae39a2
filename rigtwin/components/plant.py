"""The plant: all components of a machine by name, a NamedTuple of their parameters."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeVar

if TYPE_CHECKING:
    from rigtwin.components.computer import Computer, Mains


class Plant(Protocol):
    """Components by name: any NamedTuple of components that has a `computer` and the `mains`.

    Which others there are follows from a machine's description. A component is itself a NamedTuple
    whose fields carry `Quantity(unit, low, high, source)`.
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
    """A plant of components by name, which other processes can be given."""
    made = namedtuple("Plant", list(components))  # type: ignore[misc]
    made.__reduce__ = lambda plant: (plant_of, (plant._asdict(),))  # type: ignore[method-assign, assignment]
    return made(**components)


def with_parameters(plant: P, group: str, changes: Mapping[str, float]) -> P:
    """The plant with other values of one component's parameters."""
    return plant._replace(**{group: getattr(plant, group)._replace(**changes)})
