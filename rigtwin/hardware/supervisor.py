"""The states of a session on a rig, and the only ways between them.

idle → armed → ramping → running → stopping → stopped | faulted

From armed on, `stopping` can be reached from every state, and nothing but `stopping` leads out of
motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from rigtwin.errors import RigtwinError


class Phase(IntEnum):
    """What the rig may do.

    IDLE, STOPPED, FAULTED: motor without force, no pressure. ARMED: pressure, nothing moves.
    """

    IDLE = 0
    ARMED = 1
    RAMPING = 2
    RUNNING = 3
    STOPPING = 4
    STOPPED = 5
    FAULTED = 6


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
    """Why a session leaves a state.

    name: one word, for programs; reason: one line, for the operator; fault: whether it must not go
    on as if nothing had been.
    """

    name: str
    reason: str
    fault: bool = True


COMPLETED = Cause("completed", "completed", fault=False)


@dataclass(frozen=True)
class Transition:
    """One step between states. time: s since the start of the test, negative before it."""

    time: float
    before: Phase
    after: Phase
    cause: Cause

    def record(self) -> dict[str, str]:
        """What a recording keeps of it."""
        return {
            "time": f"{self.time:.6f}",
            "from": self.before.name.lower(),
            "to": self.after.name.lower(),
            "cause": self.cause.name,
            "reason": self.cause.reason,
        }


class Supervisor:
    """Where a session stands. told: called with every transition when it is made."""

    def __init__(self, told: Callable[[Transition], object] = lambda _: None) -> None:
        self.phase, self.transitions, self._told = Phase.IDLE, list[Transition](), told

    def go(self, phase: Phase, cause: Cause, time: float) -> None:
        """Makes a transition. Raises RigtwinError for one that does not exist."""
        if phase not in NEXT[self.phase]:
            ways = " or ".join(after.name.lower() for after in NEXT[self.phase])
            raise RigtwinError(
                f"no way from {self.phase.name.lower()} to {phase.name.lower()}; only to {ways}"
            )
        transition = Transition(time, self.phase, phase, cause)
        self.phase = phase
        self.transitions.append(transition)
        self._told(transition)
