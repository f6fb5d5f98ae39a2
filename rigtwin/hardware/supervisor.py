"""States of a session on a rig, and the permitted transitions.

idle → armed → ramping → running → stopping → stopped | faulted

From `armed` on, `stopping` can be reached from every state. Motion ends only through `stopping`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from rigtwin.errors import RigtwinError


class Phase(IntEnum):
    """State of a session.

    IDLE, STOPPED and FAULTED: motor without force, no pressure. ARMED: pressure, but no motion.
    """

    IDLE = 0
    ARMED = 1
    RAMPING = 2
    RUNNING = 3
    STOPPING = 4
    STOPPED = 5
    FAULTED = 6


# Every pair not listed is forbidden: a state machine that is wrong must fail, not move the rig.
NEXT = {
    Phase.IDLE: (Phase.ARMED, Phase.FAULTED),
    Phase.ARMED: (Phase.RAMPING, Phase.STOPPING),
    Phase.RAMPING: (Phase.RUNNING, Phase.STOPPING),
    Phase.RUNNING: (Phase.STOPPING,),
    Phase.STOPPING: (Phase.STOPPED, Phase.FAULTED),
    Phase.STOPPED: (Phase.IDLE,),
    Phase.FAULTED: (Phase.IDLE,),
}


@dataclass(frozen=True)
class Cause:
    """Cause of a transition.

    Attributes
    ----------
    name
        One word, for programs.
    reason
        One line, for the operator.
    fault
        Whether the operator must act before the next session.
    """

    name: str
    reason: str
    fault: bool = True


COMPLETED = Cause("completed", "completed", fault=False)


@dataclass(frozen=True)
class Transition:
    """Transition between two states. `time` is in s since the start of the test."""

    time: float
    before: Phase
    after: Phase
    cause: Cause

    def record(self) -> dict[str, str]:
        """Return the transition as a recording stores it."""
        return {
            "time": f"{self.time:.6f}",
            "from": self.before.name.lower(),
            "to": self.after.name.lower(),
            "cause": self.cause.name,
            "reason": self.cause.reason,
        }


class Supervisor:
    """State of a session. `on_transition` is called with every transition."""

    def __init__(self, on_transition: Callable[[Transition], object] = lambda _: None) -> None:
        self.phase, self.transitions = Phase.IDLE, list[Transition]()
        self._on_transition = on_transition

    def go(self, phase: Phase, cause: Cause, time: float) -> None:
        """Make a transition. Raise RigtwinError if it is not permitted."""
        if phase not in NEXT[self.phase]:
            ways = " or ".join(after.name.lower() for after in NEXT[self.phase])
            raise RigtwinError(
                f"no way from {self.phase.name.lower()} to {phase.name.lower()}; only to {ways}"
            )
        transition = Transition(time, self.phase, phase, cause)
        self.phase = phase
        # The state changes before anybody is informed, so that a failing observer cannot hold it
        # back.
        self.transitions.append(transition)
        self._on_transition(transition)
