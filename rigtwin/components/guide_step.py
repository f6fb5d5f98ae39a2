"""Guide with all that one step of its motion needs, as compiled code takes it."""

from __future__ import annotations

from typing import NamedTuple

from rigtwin.components.dry_friction import Friction, friction
from rigtwin.components.guide import Guide


class GuideStep(NamedTuple):
    """Guide with all that one step of its motion needs."""

    guide: Guide  # Parameters of the guide.
    dry_friction: Friction  # Dry friction of the guide.
    spring: float  # Stiffness in series with the dry friction, N/m.
    rest: float  # Position at which the guide's own spring is slack, m.
    step: float  # Length of the step, s.
    share: float  # Share by which viscous friction relaxes in the step.


def guide_step_of(guide: Guide, spring: float, rest: float, step: float) -> GuideStep:
    """Return a guide with all that one step of its motion needs.

    Parameters
    ----------
    guide
        Parameters of the guide.
    spring
        Stiffness in series with the dry friction, N/m.
    rest
        Position at which the guide's own spring is slack, m.
    step
        Length of the step, s.
    """
    # Implicit Euler step of T·F' = d·v − F: stable for any relaxation T, and exact for T = 0.
    return GuideStep(guide, friction(guide), spring, rest, step, step / (guide.relaxation + step))
