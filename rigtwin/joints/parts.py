"""A machine in parts that share nothing: what can be wrong with one changes no signal of another.

Friction at one joint of an arm changes the torque of that joint alone, so a search for it need not
know of the others; what couples joints keeps them together.
"""

from __future__ import annotations

from dataclasses import replace

from rigtwin.description.machine import Component, Machine


def parts(machine: Machine) -> tuple[Machine, ...]:
    """The machine as several, each of some of its signals and of the components that change them.

    Parameters
    ----------
    machine
        As it is described.

    Returns
    -------
    tuple of Machine
        In the order of their first signals; the machine itself where it does not fall apart.
    """
    groups = [{row.name} for row in machine.rows]
    for component in machine.components.values():
        changed = _changes(machine, component)
        touched = [group for group in groups if group & changed]
        if len(touched) > 1:
            groups = [group for group in groups if group not in touched]
            groups.append(set().union(*touched))
    if len(groups) == 1:
        return (machine,)
    order = [row.name for row in machine.rows]
    groups.sort(key=lambda group: min(order.index(name) for name in group))
    return tuple(_only(machine, group) for group in groups)


def _changes(machine: Machine, component: Component) -> set[str]:
    """The signals that an effect of a component may change."""
    effects = [effect for effect in machine.effects() if effect.group == component.name]
    if not effects:
        return set()
    if component.name in {mover for replay in machine.replays for mover in replay.moved_by}:
        # A joint that moves otherwise than measured takes other forces of all.
        return {row.name for row in machine.rows if any(effect.searched for effect in effects)}
    if component.element == "body":
        return {row.name for row in machine.rows}
    if component.element == "sensor":
        return {component.name}
    joints = {joint for joint, _ in component.acts_on}
    return {row.name for row in machine.rows if machine.components[row.name].joint in joints}


def _only(machine: Machine, signals: set[str]) -> Machine:
    """The machine of these signals: all else is beyond doubt."""
    own = {
        name
        for name, component in machine.components.items()
        if _changes(machine, component) & signals
    }
    nothing: frozenset[str] = frozenset()
    return replace(
        machine,
        replays=tuple(
            replace(replay, rows=tuple(row for row in replay.rows if row.name in signals))
            for replay in machine.replays
        ),
        components={
            name: component if name in own else replace(component, kinds=nothing)
            for name, component in machine.components.items()
        },
        tolerances=tuple(t for t in machine.tolerances if t.group in own | signals),
    )
