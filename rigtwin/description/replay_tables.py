"""Reader of a description's replays: moved joint, moving components and observed signals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rigtwin.components import Guide
from rigtwin.components.guide import may_be_soft
from rigtwin.description.component_tables import MOVING, PUSHING, SENSED, WHOLE, Components
from rigtwin.description.control import Control, FormulaControl
from rigtwin.description.joined_replays import JoinedReplays
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import Mistakes, suggest
from rigtwin.description.physics import Physics
from rigtwin.description.replay import Joint, ReplayOf, Row
from rigtwin.description.tolerance import SOFTNESS, Tolerance
from rigtwin.errors import RigtwinError

TICKS_LATE = 0.5
"""Default tolerance of the sampling time of a signal, ticks."""
HELD = 5e-3
"""Largest sampling delay of a force against a measured motion, s: half a tick of a controller of
100 Hz. A log of fewer rows may come from a faster controller."""
NO_JOINT = Joint("", False, 0.0, (-1.0, 1.0), (0.0, 0.0), 0.0)
"""Joint of a replay that covers a whole machine."""


class Replays:
    """Reader of a machine's replays; its components and controller are read before."""

    def __init__(
        self,
        mechanism: Mechanism,
        components: Components,
        control: Control | None,
        mistakes: Mistakes,
    ) -> None:
        self._mechanism = mechanism
        self._components = components
        self._control = control
        self._mistakes = mistakes

    def read(self, tables: object) -> tuple[ReplayOf, ...]:
        """Return the replays without mistakes; note the mistakes of the rest.

        Parameters
        ----------
        tables
            Value of `replays` in the description; a list of tables is expected.
        """
        if (
            not isinstance(tables, list)
            or not tables
            or not all(isinstance(table, Mapping) for table in tables)
        ):
            self._mistakes.note(
                "",
                "it has no [[replays]]; expected one that says what "
                "moves the joint and what is observed",
            )
            return ()
        replays = []
        for number, table in enumerate(tables, start=1):
            replay = self._replay(f"[[replays]] {table.get('name', number)}", table, number)
            if replay is not None:
                replays.append(replay)
        # A signal that is observed twice would count twice in the likelihood.
        names = [row.name for replay in replays for row in replay.rows]
        for name in dict.fromkeys(name for name in names if names.count(name) > 1):
            self._mistakes.note("[[replays]]", f"{name} is observed by two replays; expected one")
        return tuple(replays)

    def _replay(self, where: str, table: Mapping[str, Any], number: int) -> ReplayOf | None:
        """Return the replay of one table, or None if it has mistakes, which are noted."""
        before = len(self._mistakes)
        self._mistakes.unknown(where, table, ("name", "moved_by", "observe", "band", "free"))
        if not isinstance(table.get("name", ""), str):
            self._mistakes.note(where, f"name = {table['name']}: expected a text, in quotes")
        movers = self._read_movers(where, table)
        rows = [
            row
            for name in self._read_observed(where, table)
            if (row := self._row(where, name, movers)) is not None
        ]
        # The checks below look up movers and rows, so they need both without mistakes.
        if len(self._mistakes) > before:
            return None
        name = str(table.get("name", f"replay {number}"))
        # Several movers, or free joints, make one replay of joints that act on each other.
        coupled = "free" in table or len(movers) > 1
        if coupled and not self._components.physics().replayed_whole:
            joined = JoinedReplays(self._mechanism, self._components, self._mistakes)
            read = joined.read_coupled if "free" in table else joined.read_moved
            return read(where, name, table, movers, rows)
        return self._single_replay(where, name, table, movers, rows)

    def _read_movers(self, where: str, table: Mapping[str, Any]) -> list[str]:
        """Return the components that move a replay; note names of no component."""
        movers = table.get("moved_by", [])
        movers = [movers] if isinstance(movers, str) else movers
        known = [
            name
            for name, kind in self._components.types.items()
            if kind in MOVING or SENSED.get(kind) in ("position", "velocity")
        ]
        if not isinstance(movers, list) or not movers:
            problem = "is missing" if "moved_by" not in table else "is no name"
            names = ", ".join(known) or "there is none"
            self._mistakes.note(
                where,
                f"moved_by {problem}; expected an actuator or a sensor of the motion: {names}",
            )
            return []
        for mover in dict.fromkeys(map(str, movers)):
            if movers.count(mover) > 1:
                self._mistakes.note(where, f"moved_by: {mover} is listed twice")
        for mover in movers:
            if mover not in known:
                self._mistakes.note(
                    where,
                    f"moved_by {mover!r} is no actuator or sensor "
                    f"of the motion; {suggest(mover, known)}",
                )
        return movers

    def _single_replay(
        self, where: str, name: str, table: Mapping[str, Any], movers: list[str], rows: list[Row]
    ) -> ReplayOf | None:
        """Return the replay of one joint, or of a machine that is replayed as a whole."""
        whole = self._components.physics().replayed_whole
        joint_name = "" if whole else self._components.by_name[movers[0]].joint
        if "band" in table:
            self._mistakes.note(
                where, "band is for joints that move together; this replay moves one"
            )
        if not joint_name and not whole:
            self._mistakes.note(
                where, f"{movers[0]} acts on no joint of its own; expected one that does"
            )
            return None
        try:
            joint = self._mechanism.joint(joint_name) if joint_name else NO_JOINT
        except RigtwinError as error:
            self._mistakes.note(where, str(error))
            return None
        parts = self._parts_of(where, joint_name)
        if not whole:
            for row in rows:
                sensor = self._components.by_name.get(row.name)
                if sensor is not None and sensor.joint != joint_name:
                    self._mistakes.note(
                        where,
                        f"{row.name} is of joint {sensor.joint or 'none'}, "
                        f"{movers[0]} moves {joint_name}",
                    )
        # Forward dynamics need the mass and the friction of the pushed joint.
        if self._components.types[movers[0]] in PUSHING and not parts["mass"]:
            self._mistakes.note(
                where,
                f"{movers[0]} pushes joint {joint_name}, whose mass "
                "is no component; add one of type mass",
            )
        if self._components.types[movers[0]] in PUSHING and not parts["guide"]:
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
            guide=parts["guide"],
            mass=parts["mass"],
            closed=self._closes(movers[0]),
            rotor=parts["rotor"],
        )

    def _parts_of(self, where: str, joint: str) -> dict[str, str | None]:
        """Return type → component of a joint's mass, guide and rotor; note several of one type."""
        parts: dict[str, str | None] = {}
        for kind in ("mass", "guide", "rotor"):
            names = [
                name
                for name, known in self._components.types.items()
                if known == kind and self._components.by_name[name].joint == joint
            ]
            if len(names) > 1:
                self._mistakes.note(
                    where, f"joint {joint} has {len(names)} components of type {kind}; expected one"
                )
            parts[kind] = names[0] if names else None
        return parts

    def _check_schedules(self, replays: Iterable[ReplayOf]) -> None:
        """Note schedules at joints whose motion no sensor prescribes: only there are they known."""
        components = self._components
        measured = {
            components.by_name[mover].joint
            for replay in replays
            for mover in replay.moved_by
            if components.types[mover] in SENSED
        }
        for name, kind in components.types.items():
            if kind in ("schedule", "warming") and components.by_name[name].joint not in measured:
                self._mistakes.note(
                    f"[components.{name}]",
                    f"type {kind!r} goes with a joint that moves as measured; expected a replay "
                    f"of joint {components.by_name[name].joint} that is moved_by a sensor",
                )

    def physics(self, replays: tuple[ReplayOf, ...]) -> Physics:
        """Return the physics of the machine; note components that do not fit it."""
        physics = self._components.physics(replays)
        self._check_schedules(replays)
        if physics.replayed_whole:
            return physics
        together = [replay for replay in replays if replay.free or len(replay.moved_by) > 1]
        if together and len(replays) > 1:
            self._mistakes.note(
                f"[[replays]] {together[0].name}",
                "its joints act on each other; expected no replay beside it",
            )
        # A tendon's force depends on several joints, of which a single replay knows one.
        if not together and any(
            component.element == "tendon" for component in self._components.by_name.values()
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
        """Return whether the described controller commands a component, so that it is simulated."""
        control, channel = self._control, self._components.by_name[mover].channel
        # Python controllers are replayed on their own, from recorded inputs.
        return isinstance(control, FormulaControl) and channel == ("/command", control.output)

    def _read_observed(self, where: str, table: Mapping[str, Any]) -> list[str]:
        """Return the names of the observed signals; an empty list for anything but texts."""
        observed = table.get("observe", [])
        if (
            not isinstance(observed, list)
            or not observed
            or not all(isinstance(name, str) for name in observed)
        ):
            problem = "is missing" if "observe" not in table else f"= {str(observed)[:40]!r}"
            self._mistakes.note(
                where,
                f"observe {problem}; expected a list of sensors, or of the controller's command",
            )
            return []
        return observed

    def _row(self, where: str, name: str, movers: list[str]) -> Row | None:
        """Return the observed signal of a sensor or a controller's command; None for any other."""
        control = self._control
        known = self._components.by_name.get(name)
        sensors = [sensor for sensor, kind in self._components.types.items() if kind in SENSED]
        if (
            known is not None
            and self._components.types[name] in SENSED
            and known.channel is not None
        ):
            # Its measured motion is the input: predicting it would be a comparison with itself.
            if name in movers:
                self._mistakes.note(
                    where, f"{name} moves the joint, so it cannot be observed there too"
                )
                return None
            return Row(name, SENSED[self._components.types[name]], known.channel, known.unit)
        if control is not None and name in control.outputs:
            channel = ("/command", name)
            units = [c.unit for c in self._components.by_name.values() if c.channel == channel]
            if not units:
                # The missing actuator has a mistake of its own.
                return None
            unit = units[0]
            return Row(name, "command", ("/command", name), unit or "1")
        observable = [*sensors, *(control.outputs if control else ())]
        self._mistakes.note(
            where,
            f"observe: {name!r} is no sensor or controller's command; {suggest(name, observable)}",
        )
        return None

    def tolerate_timing(self, replays: tuple[ReplayOf, ...]) -> None:
        """Declare a tolerance of the sampling time of every observed sensor, in ticks.

        A recorded force may be held or averaged over a tick, compared with the force that the
        measured motion requires. A response is late against its command. In both cases a delay of
        the sensor describes the shift, so that one tolerance per sensor is enough.
        """
        declared = {(known.group, known.parameter) for known in self._components.tolerances}
        for replay in replays:
            # Forces are timed against the measured motion. What answers to a command is late.
            kinds = [self._components.types[name] for name in replay.moved_by]
            prescribed = bool(kinds) and all(kind in SENSED for kind in kinds)
            physics = self._components.physics(replays)
            longest = HELD if prescribed else physics.longest_delay
            for name in (row.name for row in replay.rows if row.kind != "command"):
                # A sensor inside a simulated loop is sampled together with the controller.
                if (name, "delay") not in declared and not replay.closed:
                    self._components.tolerances.append(
                        Tolerance(
                            name,
                            "delay",
                            TICKS_LATE,
                            ticks=True,
                            longest=longest,
                            is_declared=False,
                        )
                    )

    def tolerate_softness(self, replays: tuple[ReplayOf, ...]) -> None:
        """Allow dry friction to be soft, as MuJoCo simulates it, or sharp, as Coulomb has it.

        The difference matters along measured motions, where friction follows from their direction.
        """
        movers = [self._components.types[name] for replay in replays for name in replay.moved_by]
        if not movers or not all(kind in SENSED for kind in movers):
            return
        declared = {(known.group, known.parameter) for known in self._components.tolerances}
        for name, nominal in self._components.values.items():
            # Only friction that the model states can have been simulated by it. With that of a real
            # machine, which is weaker at low speeds, softness would trade size for shape.
            soft = isinstance(nominal, Guide) and may_be_soft(nominal)
            if soft and (name, SOFTNESS) not in declared:
                self._components.tolerances.append(
                    Tolerance(name, SOFTNESS, 1.0, is_declared=False)
                )
