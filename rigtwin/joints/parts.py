"""Division of a machine into independent parts: no effect of one part changes another's signals.

Friction at one joint of an arm changes the torque of that joint alone, so its search needs no other
joint. Components that couple joints keep them in one part.
"""

from __future__ import annotations

from dataclasses import replace

from rigtwin.description.machine import Component, Machine


def parts(machine: Machine) -> tuple[Machine, ...]:
    """Divide a machine into parts with disjoint signals and the components that change them.

    Parameters
    ----------
    machine
        Description of the machine.

    Returns
    -------
    tuple of Machine
        Parts in the order of their first signals, or the machine itself if it cannot be divided.
    """
    # Connected components: a component of the machine merges all groups of signals that it changes.
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
    """Return the signals that an effect of a component may change."""
    effects = [effect for effect in machine.effects() if effect.group == component.name]
    if not effects:
        return set()
    if component.name in {mover for replay in machine.replays for mover in replay.moved_by}:
        # Another motion of one joint changes the forces of all joints.
        return {row.name for row in machine.rows if any(effect.searched for effect in effects)}
    if component.element == "body":
        return {row.name for row in machine.rows}
    if component.element == "sensor":
        return {component.name}
    joints = {joint for joint, _ in component.acts_on}
    return {row.name for row in machine.rows if machine.components[row.name].joint in joints}


def _only(machine: Machine, signals: set[str]) -> Machine:
    """Return the machine with these signals alone; no other component can have an effect."""
    doubted = {
        name
        for name, component in machine.components.items()
        if _changes(machine, component) & signals
    }
    no_kinds: frozenset[str] = frozenset()
    return replace(
        machine,
        replays=tuple(
            replace(replay, rows=tuple(row for row in replay.rows if row.name in signals))
            for replay in machine.replays
        ),
        components={
            name: component if name in doubted else replace(component, kinds=no_kinds)
            for name, component in machine.components.items()
        },
        tolerances=tuple(t for t in machine.tolerances if t.group in doubted | signals),
    )
