"""A user's controller in a session, identified so that a dry run is valid for it alone."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from controllers import Commands, Controller, Demand, Measurements
from controllers.mil import MilState
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.simulation.loop import Tick, TickController, check_commands

ControllerFactory = Callable[[Configuration], TickController | Callable[..., Any]]
"""Function that makes a controller for a test's settings: an object with a method `tick`, or a
function."""


@dataclass(frozen=True)
class CustomController:
    """Controller in place of the machine's.

    Attributes
    ----------
    make
        Function that makes a new controller for each session.
    identity
        Name of the function, and a digest of its source.
    """

    make: ControllerFactory
    identity: str


def custom_controller(make: ControllerFactory) -> CustomController:
    """Identify a user's controller.

    Parameters
    ----------
    make
        Function or class of a test's configuration.

    Raises
    ------
    RigtwinError
        If the object cannot be called.
    """
    if not callable(make):
        raise RigtwinError(f"controller {make!r:.60}: expected a function of the configuration")
    name = f"{getattr(make, '__module__', '')}.{getattr(make, '__qualname__', repr(make))}"
    # The digest covers the whole module, since a controller depends on what stands beside it.
    try:
        source = inspect.getsource(inspect.getmodule(make) or make)
    # Controllers from a prompt or a C extension have no source; their name has to do.
    except (OSError, TypeError):
        source = name
    return CustomController(make, f"{name} {hashlib.sha256(source.encode()).hexdigest()[:16]}")


def make_tick(controller: CustomController, configuration: Configuration) -> Callable[..., Any]:
    """Make a new controller, and return its function of a tick.

    Raises
    ------
    RigtwinError
        If the controller cannot be made, or is neither a function nor has a method `tick`.
    """
    try:
        made: Any = controller.make(configuration)
    except Exception as error:
        # An error's text may have several lines; a message has one.
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise RigtwinError(
            f"controller {controller.identity}: it cannot be made: {reason}"
        ) from error
    tick = getattr(made, "tick", made)
    if not callable(tick):
        raise RigtwinError(
            f"controller {controller.identity}: made {made!r:.40}; "
            "expected a function, or a method tick"
        )
    return tick


class CustomUpdate:
    """Update function of a session with a user's controller.

    The session's call before the test is not passed on, because the controller may count its calls.
    """

    def __init__(self, controller: CustomController, configuration: Configuration) -> None:
        self._tick: Tick = make_tick(controller, configuration)
        self._tried = False

    def __call__(
        self, _: Controller, state: MilState, measured: Measurements, demand: Demand
    ) -> tuple[MilState, Commands]:
        """Return the commands of a tick, and the state unchanged."""
        if not self._tried:
            self._tried = True
            return state, Commands(0.0, 0.0, 0.0, 0.0)
        return state, check_commands(self._tick(measured, demand))
