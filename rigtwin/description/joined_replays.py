"""A replay of joints that act on each other: all moved as measured, or some free to move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rigtwin.description.component_tables import PUSHING, SENSED, Components
from rigtwin.description.machine import ReplayOf, Row
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import Mistakes, near
from rigtwin.errors import RigtwinError

MOVERS = (*PUSHING, "position actuator", "position sensor")
"""Types of component that move a machine some of whose joints are free."""


class JoinedReplays:
    """Reads such replays of a machine whose components are known."""

    def __init__(self, mechanism: Mechanism, components: Components, mistakes: Mistakes) -> None:
        self._mechanism, self._components, self._mistakes = mechanism, components, mistakes

    def read_moved(
        self, where: str, name: str, table: Mapping[str, Any], movers: list[str], rows: list[Row]
    ) -> ReplayOf | None:
        """Of joints that all move, each as its position sensor measured."""
        found, types = self._components.found, self._components.types
        before = len(self._mistakes)
        joints = [found[mover].joint for mover in movers]
        for mover, joint in zip(movers, joints, strict=True):
            if SENSED.get(types[mover]) != "position" or not joint:
                self._mistakes.note(
                    where,
                    f"moved by {len(movers)} components, {mover} among them, which is a "
                    f"{types[mover]}{'' if joint else ' of no joint'}; where joints act on each "
                    "other, expected a position sensor of each, or free = [...] with the joints "
                    "that nothing prescribes",
                )
            elif joints.count(joint) > 1:
                self._mistakes.note(where, f"joint {joint} is moved by two sensors; expected one")
        for row in rows:
            if row.kind != "force" or found[row.name].joint not in joints:
                self._mistakes.note(
                    where,
                    f"{row.name} cannot be observed where all joints move as measured; expected "
                    f"sensors of the force on {', '.join(filter(None, joints))}",
                )
        if len(self._mistakes) > before:
            return None
        return self._put_together(
            where=where, name=name, table=table, movers=movers, rows=rows, joints=joints, free=()
        )

    def read_coupled(
        self, where: str, name: str, table: Mapping[str, Any], movers: list[str], rows: list[Row]
    ) -> ReplayOf | None:
        """Of joints some of which nothing prescribes."""
        found, types, before = self._components.found, self._components.types, len(self._mistakes)
        free, known = table["free"], self._mechanism.names("joint")
        if not isinstance(free, list) or not free or not all(isinstance(j, str) for j in free):
            self._mistakes.note(
                where,
                f"free = {str(free)[:40]!r}: expected a list of joints that nothing prescribes",
            )
            return None
        if unknown := [joint for joint in dict.fromkeys(free) if joint not in known]:
            self._note_no_joints(where, unknown, known)
            return None
        for joint in dict.fromkeys(free):
            if free.count(joint) > 1:
                self._mistakes.note(where, f"free: {joint} stands there twice")
        held = []
        for mover in movers:
            if types[mover] not in MOVERS:
                self._mistakes.note(
                    where,
                    f"moved_by {mover}, which is a {types[mover]}; where joints are free, expected "
                    "force actuators, servos, position actuators or position sensors",
                )
            elif not found[mover].acts_on:
                self._mistakes.note(where, f"moved_by {mover}: it acts on no joint")
            elif types[mover] not in PUSHING:
                joint = found[mover].joint
                if not joint or joint in free or joint in held:
                    said = "is of no single joint" if not joint else f"prescribes joint {joint}"
                    wrong = ", which is free" if joint in free else " a second time" * bool(joint)
                    self._mistakes.note(where, f"moved_by {mover}: it {said}{wrong}")
                held.append(joint)
        moving = {*free, *held}
        self._check_ties(where, free, held)
        moving |= {tie.joint for tie in self._mechanism.ties_of(moving)[0]}
        for row in rows:
            if row.kind == "command" or not {j for j, _ in found[row.name].acts_on} & moving:
                self._mistakes.note(
                    where,
                    f"{row.name} cannot be observed; expected sensors of "
                    f"{', '.join(sorted(moving))}",
                )
        for mover in movers if len(self._mistakes) == before else ():
            acted = [joint for joint, _ in found[mover].acts_on]
            if types[mover] in PUSHING and acted and not moving.intersection(acted):
                self._mistakes.note(
                    where,
                    f"moved_by {mover}: it pushes {', '.join(acted)}, which stands still; expected "
                    f"a joint that moves: {', '.join(sorted(moving))}",
                )
        if "band" in table:
            self._mistakes.note(where, "band is for joints that all move as measured")
        if len(self._mistakes) > before:
            return None
        return self._put_together(
            where=where,
            name=name,
            table=table,
            movers=movers,
            rows=rows,
            joints=[*free, *held],
            free=tuple(free),
        )

    def _note_no_joints(self, where: str, unknown: list[str], known: list[str]) -> None:
        """Notes names that are no joints, once for all that follows from them."""
        components = [name for name in unknown if name in self._components.found]
        said = ", ".join(map(repr, unknown))
        joints = {name: self._components.found[name].joint for name in components}
        of = ", ".join(f"{joint} (of {name})" for name, joint in joints.items() if joint)
        hint = f"expected joints of the MJCF: {of}" if of else near(unknown[0], known)
        what = "components" if len(components) == len(unknown) else "no joints"
        if len(unknown) == 1:
            what = "a component" if components else "no joint"
        self._mistakes.note(
            where, f"free: {said} {'is' if len(unknown) == 1 else 'are'} {what}; {hint}"
        )

    def _check_ties(self, where: str, free: Sequence[str], held: Sequence[str]) -> None:
        """Notes free joints that equalities tie to another joint that moves anyway."""
        moving: list[str] = [*filter(None, held)]
        # The joint that the MJCF makes dependent is the one to leave out.
        dependent = {tie.joint for tie in self._mechanism.ties()}
        for joint in sorted(dict.fromkeys(free), key=dependent.__contains__):
            ordered, _ = self._mechanism.ties_of(moving)
            led = {tie.joint: tie.to for tie in ordered}
            if joint in led:
                self._mistakes.note(
                    where,
                    f"free: an equality ties {joint} to {led[joint]}, so it goes with that; "
                    f"leave {joint} out",
                )
            else:
                moving.append(joint)

    def _put_together(
        self,
        where: str,
        name: str,
        table: Mapping[str, Any],
        movers: Sequence[str],
        rows: Sequence[Row],
        joints: Sequence[str],
        free: tuple[str, ...],
    ) -> ReplayOf | None:
        try:
            first = next(self._mechanism.joint(joint) for joint in joints)
        except RigtwinError as error:
            self._mistakes.note(where, str(error))
            return None
        return ReplayOf(
            name=name,
            joint=first,
            moved_by=tuple(movers),
            rows=tuple(rows),
            guide=None,
            mass=None,
            closed=False,
            band=self._mistakes.number(f"{where} band", table["band"], 0.1, 1e4)
            if "band" in table
            else None,
            free=free,
        )
