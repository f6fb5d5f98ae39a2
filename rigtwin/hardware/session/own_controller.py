"""A controller of one's own in a session: known by what it is, so that a dry run holds for just
it."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from controllers import Commands, Controller, Demand, Measurements
from controllers.mil import State
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.simulation.loop import Tick, TickController, check_commands

Making = Callable[[Configuration], TickController | Callable[..., Any]]
"""Makes a new controller for a test of these settings: an object with a method `tick`, or a
function."""


@dataclass(frozen=True)
class OwnController:
    """make: a new one for each session; told: what it is, by name and by a digest of its source."""

    make: Making
    told: str


def own_controller(make: Making) -> OwnController:
    """A controller of one's own.

    Parameters
    ----------
    make
        A function or class of a test's configuration.

    Raises
    ------
    RigtwinError
        For anything that cannot be called.
    """
    if not callable(make):
        raise RigtwinError(f"controller {make!r:.60}: expected a function of the configuration")
    name = f"{getattr(make, '__module__', '')}.{getattr(make, '__qualname__', repr(make))}"
    try:
        source = inspect.getsource(inspect.getmodule(make) or make)
    except (OSError, TypeError):
        source = name
    return OwnController(make, f"{name} {hashlib.sha256(source.encode()).hexdigest()[:16]}")


def make_own(own: OwnController, configuration: Configuration) -> Callable[..., Any]:
    """A new controller: what it does in a tick.

    Raises RigtwinError if it cannot be made.
    """
    try:
        made: Any = own.make(configuration)
    except Exception as error:
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise RigtwinError(f"controller {own.told}: it cannot be made: {said}") from error
    tick = getattr(made, "tick", made)
    if not callable(tick):
        raise RigtwinError(
            f"controller {own.told}: made {made!r:.40}; expected a function, or a method tick"
        )
    return tick


class OwnUpdate:
    """It as a session asks for commands. It is not asked before the test begins: it may be one
    whose every answer counts."""

    def __init__(self, own: OwnController, configuration: Configuration) -> None:
        self._tick: Tick = make_own(own, configuration)
        self._tried = False

    def __call__(
        self, _: Controller, state: State, measured: Measurements, demand: Demand
    ) -> tuple[State, Commands]:
        """The commands of a tick; the state stays as it is."""
        if not self._tried:
            self._tried = True
            return state, Commands(0.0, 0.0, 0.0, 0.0)
        return state, check_commands(self._tick(measured, demand))
