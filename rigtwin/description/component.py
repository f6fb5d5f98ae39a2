"""Component of a described machine."""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.components.sensors import MEASURES


@dataclass(frozen=True)
class Component:
    """One component of a described machine.

    Attributes
    ----------
    name
        Name in the description.
    component_type
        Type of its parameters, such as `Guide`.
    element
        Kind of MJCF element that the component stands for, such as `joint`.
    mjcf
        Name of that element in the MJCF.
    joint
        Joint that the component belongs to; empty if it belongs to several or none.
    channel
        Topic and field of its signal in recordings; None without a signal.
    unit
        Unit of the signal.
    kinds
        Kinds of effects that it may have; None for all kinds of its type.
    acts_on
        Joints on which a force along the component's coordinate acts, with the change of the
        coordinate per unit of the joint's position.
    turns
        Whether the coordinate is an angle.
    """

    name: str
    component_type: type
    element: str
    mjcf: str
    joint: str
    channel: tuple[str, str] | None = None
    unit: str = ""
    kinds: frozenset[str] | None = None
    acts_on: tuple[tuple[str, float], ...] = ()
    turns: bool = False

    @property
    def quantity(self) -> str:
        """Quantity that a sensor measures, as a row's kind; empty for all other components."""
        return MEASURES.get(self.component_type, "")
