"""Division of a machine into independent parts: no effect of one part changes another's signals.

Friction at one joint of an arm changes the torque of that joint alone, so its search needs no other
joint. Components that couple joints keep them in one part.
"""

from __future__ import annotations

from dataclasses import replace

from rigtwin.description.component import Component
from rigtwin.description.machine import Machine
from rigtwin.description.replay import ReplayOf, Row


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
    moved = [replay for replay in machine.replays if component.name in replay.moved_by]
    if moved:
        # Another motion of one joint changes the forces of all joints that act on each other.
        searched = any(effect.searched for effect in effects)
        return {row.name for replay in moved for row in replay.rows if searched}
    names = {row.name for row in machine.rows}
    if component.element == "sensor" and component.name in names:
        return {component.name}
    joints = {component.joint, *(joint for joint, _ in component.acts_on)}
    # A body's inertia, and a sensor that is not a signal itself, act on all signals of a replay.
    shared = component.element in ("body", "sensor")
    return {
        row.name
        for replay in machine.replays
        for row in replay.rows
        if joints & (_joints_of(machine, replay) if shared else _joint_of(machine, replay, row))
    }


def _joints_of(machine: Machine, replay: ReplayOf) -> set[str | None]:
    """Return the joints that a replay moves or observes."""
    components = [machine.components[name] for name in replay.moved_by]
    moved = {joint for component in components for joint, _ in component.acts_on}
    return moved.union(*(_joint_of(machine, replay, row) for row in replay.rows))


def _joint_of(machine: Machine, replay: ReplayOf, row: Row) -> set[str | None]:
    """Return the joint of a signal; a signal computed from several is that of its replay."""
    component = machine.components.get(row.name)
    return {replay.joint.name if component is None else component.joint}


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
            if any(row.name in signals for row in replay.rows)
        ),
        components={
            name: component if name in doubted else replace(component, kinds=no_kinds)
            for name, component in machine.components.items()
        },
        tolerances=tuple(t for t in machine.tolerances if t.group in doubted | signals),
    )
