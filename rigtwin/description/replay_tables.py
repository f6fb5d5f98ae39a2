"""The replays of a description: which joint each is about, what moves it, and what is observed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rigtwin.description.component_tables import MOVING, PUSHING, SENSED, WHOLE, Components
from rigtwin.description.control import Control, FormulaControl
from rigtwin.description.joined_replays import JoinedReplays
from rigtwin.description.machine import Joint, ReplayOf, Row
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import Mistakes, near
from rigtwin.description.physics import Physics
from rigtwin.description.tolerance import Tolerance
from rigtwin.errors import RigtwinError

TICKS_LATE = 0.5
"""Tolerance of the time of a sample, ticks."""


class Replays:
    """Reads the replays of a machine whose components and controller are known."""

    def __init__(
        self,
        mechanism: Mechanism,
        components: Components,
        control: Control | None,
        mistakes: Mistakes,
    ) -> None:
        self._mechanism, self._components, self._control, self._mistakes = (
            mechanism,
            components,
            control,
            mistakes,
        )

    def read(self, given: object) -> tuple[ReplayOf, ...]:
        if (
            not isinstance(given, list)
            or not given
            or not all(isinstance(each, Mapping) for each in given)
        ):
            self._mistakes.note(
                "",
                "it has no [[replays]]; expected one that says what "
                "moves the joint and what is observed",
            )
            return ()
        found = []
        for number, table in enumerate(given, start=1):
            replay = self._replay(f"[[replays]] {table.get('name', number)}", table, number)
            if replay is not None:
                found.append(replay)
        names = [row.name for replay in found for row in replay.rows]
        for name in dict.fromkeys(name for name in names if names.count(name) > 1):
            self._mistakes.note("[[replays]]", f"{name} is observed by two replays; expected one")
        return tuple(found)

    def _replay(self, where: str, table: Mapping[str, Any], number: int) -> ReplayOf | None:
        before = len(self._mistakes)
        self._mistakes.unknown(where, table, ("name", "moved_by", "observe", "band", "free"))
        movers = table.get("moved_by", [])
        movers = [movers] if isinstance(movers, str) else movers
        known = [
            name
            for name, kind in self._components.types.items()
            if kind in MOVING or SENSED.get(kind) in ("position", "velocity")
        ]
        if not isinstance(movers, list) or not movers:
            said = "is missing" if "moved_by" not in table else "is no name"
            there = ", ".join(known) or "there is none"
            self._mistakes.note(
                where,
                f"moved_by {said}; expected an actuator or a sensor of the motion: {there}",
            )
            movers = []
        for mover in dict.fromkeys(map(str, movers)):
            if movers.count(mover) > 1:
                self._mistakes.note(where, f"moved_by: {mover} stands there twice")
        for mover in movers:
            if mover not in known:
                self._mistakes.note(
                    where,
                    f"moved_by {mover!r} is no actuator or sensor "
                    f"of the motion; {near(mover, known)}",
                )
        rows = [
            row
            for name in self._read_observed(where, table)
            if (row := self._row(where, name, movers)) is not None
        ]
        if len(self._mistakes) > before:
            return None
        quarter_car = self._components.physics().replayed_whole
        joint_name = "" if quarter_car else self._components.found[movers[0]].joint
        name = str(table.get("name", f"replay {number}"))
        if not quarter_car and ("free" in table or len(movers) > 1):
            joined = JoinedReplays(self._mechanism, self._components, self._mistakes)
            read = joined.read_coupled if "free" in table else joined.read_moved
            return read(where, name, table, movers, rows)
        if "band" in table:
            self._mistakes.note(
                where, "band is for joints that move together; this replay moves one"
            )
        if not joint_name and not quarter_car:
            self._mistakes.note(
                where, f"{movers[0]} acts on no joint of its own; expected one that does"
            )
            return None
        try:
            joint = (
                self._mechanism.joint(joint_name)
                if joint_name
                else Joint("", False, 0.0, (-1.0, 1.0), (0.0, 0.0), 0.0)
            )
        except RigtwinError as error:
            self._mistakes.note(where, str(error))
            return None
        at = {
            kind: [
                n
                for n, t in self._components.types.items()
                if t == kind and self._components.found[n].joint == joint_name
            ]
            for kind in ("mass", "guide", "rotor")
        }
        for kind, names in at.items():
            if len(names) > 1:
                self._mistakes.note(
                    where,
                    f"joint {joint_name} has {len(names)} components of type {kind}; expected one",
                )
        if not quarter_car:
            for row in rows:
                other = self._components.found.get(row.name)
                if other is not None and other.joint != joint_name:
                    self._mistakes.note(
                        where,
                        f"{row.name} is of joint {other.joint or 'none'}, "
                        f"{movers[0]} moves {joint_name}",
                    )
        closed = self._closes(movers[0])
        if self._components.types[movers[0]] in PUSHING and not at["mass"]:
            self._mistakes.note(
                where,
                f"{movers[0]} pushes joint {joint_name}, whose mass "
                "is no component; add one of type mass",
            )
        if self._components.types[movers[0]] in PUSHING and not at["guide"]:
            self._mistakes.note(
                where,
                f"{movers[0]} pushes joint {joint_name}, which "
                "is no component; add one of type guide",
            )
        return ReplayOf(
            name=name,
            joint=joint,
            moved_by=tuple(movers),
            rows=tuple(rows),
            guide=at["guide"][0] if at["guide"] else None,
            mass=at["mass"][0] if at["mass"] else None,
            closed=closed,
            rotor=at["rotor"][0] if at["rotor"] else None,
        )

    def physics(self, replays: tuple[ReplayOf, ...]) -> Physics:
        """Return the physics of the machine; note components that do not fit it."""
        physics = self._components.physics(replays)
        if physics.replayed_whole:
            return physics
        together = [replay for replay in replays if replay.free or len(replay.moved_by) > 1]
        if together and len(replays) > 1:
            self._mistakes.note(
                f"[[replays]] {together[0].name}",
                "its joints act on each other; expected no replay beside it",
            )
        if not together and any(
            component.element == "tendon" for component in self._components.found.values()
        ):
            self._mistakes.note(
                "[components]",
                "a tendon couples joints; expected one replay, moved by all their sensors",
            )
        for name, kind in self._components.types.items():
            if kind in (("mass",) if together else WHOLE):
                self._mistakes.note(
                    f"[components.{name}] type",
                    f"{kind!r}: where joints {'act' if together else 'do not act'} on each other, "
                    f"expected {'body' if together else 'mass'!r} for what moves",
                )
        return physics

    def _closes(self, mover: str) -> bool:
        """Whether the described controller commands it, and can be run along."""
        control, channel = self._control, self._components.found[mover].channel
        return isinstance(control, FormulaControl) and channel == ("/command", control.output)

    def _read_observed(self, where: str, table: Mapping[str, Any]) -> list[str]:
        observed = table.get("observe", [])
        if (
            not isinstance(observed, list)
            or not observed
            or not all(isinstance(each, str) for each in observed)
        ):
            said = "is missing" if "observe" not in table else f"= {str(observed)[:40]!r}"
            self._mistakes.note(
                where, f"observe {said}; expected a list of sensors, or of the controller's command"
            )
            return []
        return observed

    def _row(self, where: str, name: str, movers: list[str]) -> Row | None:
        control = self._control
        known = self._components.found.get(name)
        sensors = [each for each, kind in self._components.types.items() if kind in SENSED]
        if (
            known is not None
            and self._components.types[name] in SENSED
            and known.channel is not None
        ):
            if name in movers:
                self._mistakes.note(
                    where, f"{name} moves the joint, so it cannot be observed there too"
                )
                return None
            return Row(name, SENSED[self._components.types[name]], known.channel, known.unit)
        if control is not None and name in control.outputs:
            unit = next(
                c.unit for c in self._components.found.values() if c.channel == ("/command", name)
            )
            return Row(name, "command", ("/command", name), unit or "1")
        there = [*sensors, *(control.outputs if control else ())]
        self._mistakes.note(
            where, f"observe: {name!r} is no sensor or controller's command; {near(name, there)}"
        )
        return None

    def tolerate_timing(self, replays: tuple[ReplayOf, ...]) -> None:
        """Declare how well the time of a sample is known, in ticks of the recording.

        Forces that are compared with those that a measured motion takes may be held or averaged
        over a tick. What answers to a command is late against that command, so that one tolerance
        for each sensor is enough.
        """
        declared = {(each.group, each.parameter) for each in self._components.tolerances}
        for replay in replays:
            # Of joints that move together only what is observed is timed: against all of them.
            longest = self._components.physics(replays).longest_delay
            for name in (row.name for row in replay.rows if row.kind != "command"):
                # What is in one loop with the controller was sampled with it.
                if (name, "delay") not in declared and not replay.closed:
                    self._components.tolerances.append(
                        Tolerance(name, "delay", TICKS_LATE, ticks=True, longest=longest)
                    )
