"""Plant: the parameters of all components of a machine, by name, in a NamedTuple.

A plant is a NamedTuple because compiled code reads the suspension rig's as one, and because its
components serve as keys of remembered motions. Code names the components of that rig as fields
(`RigPlant`). The components of a described machine have the names that its TOML gives them, so no
code can name them. Models reach them through four functions, and nowhere else:

- `component_of`: one component, of the type that the caller expects (checked);
- `select`: several components, as a key;
- `parameter_of`: one parameter, as effects and tolerances name it;
- `with_parameters`: the plant with other values of a component.

The type of a component is a property of the machine, not of a plant's values: code that asks for
it reads `rigtwin.description.machine.Component`.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterable, Mapping
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
C = TypeVar("C")


def plant_of(components: Mapping[str, Any]) -> Any:
    """Return a plant of these components, by name; it can be pickled."""
    # The class is made at run time, so a process that unpickles a plant has to make it again.
    plant_type = namedtuple("Plant", list(components))  # type: ignore[misc]
    plant_type.__reduce__ = lambda plant: (plant_of, (plant._asdict(),))  # type: ignore[method-assign, assignment]
    return plant_type(**components)


def component_of(plant: Plant, name: str, *types: type[C]) -> C:
    """Return the component of a plant with a name.

    Parameters
    ----------
    plant
        Plant with the component.
    name
        Name of the component.
    *types
        Types that the caller can work with.

    Raises
    ------
    TypeError
        If the component has another type.
    """
    component = getattr(plant, name)
    if not isinstance(component, types):
        expected = " or ".join(each.__name__ for each in types)
        raise TypeError(f"{name} is a {type(component).__name__}; expected a {expected}")
    return component


def select(plant: Plant, names: Iterable[str]) -> tuple[Any, ...]:
    """Return the components of a plant with these names, in their order."""
    return tuple(getattr(plant, name) for name in names)


def parameter_of(plant: Plant, group: str, name: str) -> float:
    """Return the value of a parameter of the component `group`, in the parameter's unit."""
    return float(getattr(getattr(plant, group), name))


def with_parameters(plant: P, group: str, changes: Mapping[str, float]) -> P:
    """Return a plant with changed parameters of one component, named `group`."""
    (component,) = select(plant, [group])
    return plant._replace(**{group: component._replace(**changes)})
