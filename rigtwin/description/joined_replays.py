"""Reader of a replay of coupled joints: all with prescribed motion, or some free to move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rigtwin.description.component_tables import PUSHING, SENSED, Components
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import Mistakes, suggest
from rigtwin.description.replay import ReplayOf, Row
from rigtwin.errors import RigtwinError

MOVERS = (*PUSHING, "position actuator", "position sensor")
"""Types of component that can move a machine with free joints."""


class JoinedReplays:
    """Reader of replays of coupled joints; the machine's components are read before."""

    def __init__(self, mechanism: Mechanism, components: Components, mistakes: Mistakes) -> None:
        self._mechanism, self._components, self._mistakes = mechanism, components, mistakes

    def read_moved(
        self, where: str, name: str, table: Mapping[str, Any], movers: list[str], rows: list[Row]
    ) -> ReplayOf | None:
        """Return a replay whose joints all move as their position sensors measured.

        Such a replay predicts forces by inverse dynamics. The result is None for a replay with
        mistakes, which are noted.

        Parameters
        ----------
        where
            Place in the description, for messages.
        name
            Name of the replay.
        table
            Table of the replay.
        movers
            Components that move the joints.
        rows
            Observed signals.
        """
        known, types = self._components.by_name, self._components.types
        before = len(self._mistakes)
        joints = [known[mover].joint for mover in movers]
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
            if row.kind != "force" or known[row.name].joint not in joints:
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
        """Return a replay with free joints, whose motion forward dynamics predict.

        The arguments are those of `read_moved`; the key `free` of the table names the free joints.
        """
        before = len(self._mistakes)
        free = self._read_free(where, table["free"])
        if free is None:
            return None
        prescribed = self._prescribed_joints(where, movers, free)
        self._check_ties(where, free, prescribed)
        # Joints that equalities tie to moving ones move too, and may be observed and pushed.
        moving = {*free, *prescribed}
        moving |= {tie.joint for tie in self._mechanism.ties_of(moving)[0]}
        self._check_signals(where, movers, rows, moving, check_movers=len(self._mistakes) == before)
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
            joints=[*free, *prescribed],
            free=tuple(free),
        )

    def _read_free(self, where: str, free: object) -> list[str] | None:
        """Return the free joints of a replay; None where they are no joints of the model."""
        known = self._mechanism.names("joint")
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
                self._mistakes.note(where, f"free: joint {joint} is listed twice; expected it once")
        return free

    def _prescribed_joints(
        self, where: str, movers: Sequence[str], free: Sequence[str]
    ) -> list[str]:
        """Return the joints whose motion a mover prescribes; note movers that do not fit."""
        known, types = self._components.by_name, self._components.types
        prescribed: list[str] = []
        for mover in movers:
            if types[mover] not in MOVERS:
                self._mistakes.note(
                    where,
                    f"moved_by {mover}, which is a {types[mover]}; where joints are free, expected "
                    "force actuators, servos, position actuators or position sensors",
                )
            elif not known[mover].acts_on:
                self._mistakes.note(where, f"moved_by {mover}: it acts on no joint")
            elif types[mover] not in PUSHING:
                joint = known[mover].joint
                if not joint or joint in free or joint in prescribed:
                    role = "is of no single joint" if not joint else f"prescribes joint {joint}"
                    wrong = ", which is free" if joint in free else " a second time" * bool(joint)
                    self._mistakes.note(where, f"moved_by {mover}: it {role}{wrong}")
                prescribed.append(joint)
        return prescribed

    def _check_signals(
        self,
        where: str,
        movers: Sequence[str],
        rows: Sequence[Row],
        moving: set[str],
        check_movers: bool,
    ) -> None:
        """Note observed signals of joints that stand still, and forces on such joints.

        check_movers: whether to check the forces, which needs joints without mistakes.
        """
        known, types = self._components.by_name, self._components.types
        for row in rows:
            if row.kind == "command" or not {j for j, _ in known[row.name].acts_on} & moving:
                check_movers = False
                self._mistakes.note(
                    where,
                    f"{row.name} cannot be observed; expected sensors of "
                    f"{', '.join(sorted(moving))}",
                )
        for mover in movers if check_movers else ():
            joints = [joint for joint, _ in known[mover].acts_on]
            if types[mover] in PUSHING and joints and not moving.intersection(joints):
                self._mistakes.note(
                    where,
                    f"moved_by {mover}: it pushes {', '.join(joints)}, which stands still; "
                    f"expected a joint that moves: {', '.join(sorted(moving))}",
                )

    def _note_no_joints(self, where: str, unknown: list[str], known: list[str]) -> None:
        """Note names that are no joints, in one line that also covers what follows from them."""
        components = [name for name in unknown if name in self._components.by_name]
        quoted = ", ".join(map(repr, unknown))
        # Writing a component's name where its joint's is expected is the usual mistake.
        joints = {name: self._components.by_name[name].joint for name in components}
        hints = ", ".join(f"{joint} (of {name})" for name, joint in joints.items() if joint)
        hint = f"expected joints of the MJCF: {hints}" if hints else suggest(unknown[0], known)
        noun = "components" if len(components) == len(unknown) else "no joints"
        if len(unknown) == 1:
            noun = "a component" if components else "no joint"
        self._mistakes.note(
            where, f"free: {quoted} {'is' if len(unknown) == 1 else 'are'} {noun}; {hint}"
        )

    def _check_ties(self, where: str, free: Sequence[str], prescribed: Sequence[str]) -> None:
        """Note free joints that an equality ties to a joint that moves by itself."""
        moving: list[str] = [*filter(None, prescribed)]
        # Independent joints come first, so that the message asks to leave out the joint that the
        # MJCF declares dependent.
        dependent = {tie.joint for tie in self._mechanism.ties()}
        for joint in sorted(dict.fromkeys(free), key=dependent.__contains__):
            ordered, _ = self._mechanism.ties_of(moving)
            led = {tie.joint: tie.to for tie in ordered}
            if joint in led:
                self._mistakes.note(
                    where,
                    f"free: an equality ties {joint} to {led[joint]}, so it follows {led[joint]}; "
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
        """Return the replay; None if its first joint is neither a hinge nor a slide."""
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
