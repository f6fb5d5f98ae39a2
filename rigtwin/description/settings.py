"""Groups of settings besides the plant and the controller: safety limits, timing and the road."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Mapping
from typing import Annotated, NamedTuple

from rigtwin.components.quantity import Quantity


class Safety(NamedTuple):
    """Limits of raw measurements and commands that end a test, and the ramps of a session.

    The source of a field states its meaning and how the value was chosen.
    """

    structure: Annotated[float, Quantity("m", 1e-3, 10.0, "trip of the lab: |structure_lvdt|")] = (
        0.15
    )
    force: Annotated[float, Quantity("N", 1.0, 1e7, "trip of the lab: |load_cell|")] = 1500.0
    travel: Annotated[float, Quantity("m", 1e-3, 10.0, "the motor's stroke: |suspension_lvdt|")] = (
        0.21
    )
    ground: Annotated[
        float, Quantity("m", 1e-3, 10.0, "|ground_lvdt| and its command; assumed stroke")
    ] = 0.25
    velocity: Annotated[
        float, Quantity("m/s", 1e-3, 100.0, "of travel over 10 ticks; half the motor's 4.4 m/s")
    ] = 2.2
    lvdt_rate: Annotated[
        float, Quantity("m/s", 1e-3, 1e3, "change of an LVDT in a tick; 3 times the experiments'")
    ] = 2.0
    force_rate: Annotated[
        float,
        Quantity("N/s", 1.0, 1e9, "change of the load cell in a tick; 3 times the experiments'"),
    ] = 3e5
    command_rate: Annotated[
        float, Quantity("m/s", 1e-3, 1e3, "position commands; 7 times what the cylinders follow")
    ] = 2.0
    voltage_rate: Annotated[
        float, Quantity("V/s", 1.0, 1e6, "4 times the experiments'; less than force_rate shows")
    ] = 2500.0
    following: Annotated[
        float, Quantity("m", 1e-4, 100.0, "cylinder off its command; 1.6 times the experiments'")
    ] = 0.06
    following_force: Annotated[
        float, Quantity("N", 1.0, 1e8, "load cell off its demand; 2.6 times the experiments'")
    ] = 400.0
    stuck: Annotated[
        float,
        Quantity("tick", 3.0, 1e9, "same reading in a row; a card's channel table says how many"),
    ] = 1e9
    wheel: Annotated[
        float, Quantity("m", 1e-4, 1e9, "wheel off the ground plate; a card's channel table says")
    ] = 1e9
    motor: Annotated[
        float,
        Quantity("N", 1.0, 1e9, "load cell off the voltage's force; a card's channel table says"),
    ] = 1e9
    hysteresis: Annotated[
        float, Quantity("1", 0.0, 0.9, "share of a limit to be back inside before arming")
    ] = 0.1
    missed: Annotated[
        float, Quantity("tick", 0.0, 1e6, "that may be missed in a row; a fifth of all")
    ] = 3.0
    ramp: Annotated[float, Quantity("s", 0.05, 600.0, "cosine to the start of a test and back")] = (
        2.0
    )
    hold: Annotated[
        float, Quantity("s", 0.0, 600.0, "cylinders hold after a stop before pressure is taken off")
    ] = 0.5


class Timing(NamedTuple):
    """Duration, control period and integration step of a test."""

    duration: Annotated[float, Quantity("s", 0.01, 86_400.0, "the experiment")] = 20.0
    period: Annotated[float, Quantity("s", 1e-4, 0.1, "1 kHz, assumed")] = 1e-3
    timestep: Annotated[
        float, Quantity("s", 1e-5, 0.01, "integration step, docs/architecture.md")
    ] = 2.5e-4


class Road(NamedTuple):
    """Pseudo-random road with the spectral density S(n) = roughness / n^exponent of its wavenumber
    n, thesis Eq. 6.3; `lowest`, `highest` and `spacing` are the excited frequencies at `speed`."""

    roughness: Annotated[
        float, Quantity("m^2/(cycle/m)", 0.0, 1e-2, "motorway, thesis Eq. 6.3")
    ] = 7e-8
    exponent: Annotated[float, Quantity("1", 0.0, 5.0, "thesis Eq. 6.3")] = 2.5
    speed: Annotated[float, Quantity("m/s", 0.1, 150.0, "thesis §6.3")] = 25.0 / 3.6
    lowest: Annotated[float, Quantity("Hz", 1e-3, 50.0, "thesis §6.3.2")] = 0.02
    highest: Annotated[float, Quantity("Hz", 1e-3, 50.0, "thesis §6.3.2")] = 1.6
    spacing: Annotated[
        float, Quantity("Hz", 1e-3, 50.0, "the lowest frequency where not given")
    ] = 0.02


class Nothing(NamedTuple):
    """Group without settings, in the place of one that a machine lacks."""


def settings_of(values: Mapping[str, float], source: str) -> tuple[float, ...]:
    """Return numbers as a group of settings without bounds.

    Parameters
    ----------
    values
        Name → number.
    source
        Source of the values, for listings.

    Returns
    -------
    tuple
        NamedTuple with a field for every number, whose annotation allows any number.
    """
    meaning = Quantity("1", -1e300, 1e300, source)
    return group_of({name: (value, meaning) for name, value in values.items()})


def group_of(values: Mapping[str, tuple[float, Quantity]]) -> tuple[float, ...]:
    """Return numbers with their quantities as a group of settings.

    Parameters
    ----------
    values
        Name → number and quantity.

    Returns
    -------
    tuple
        NamedTuple with an annotated field for every number. It can be pickled.
    """
    nominal = [value for value, _ in values.values()]
    group_type = namedtuple("Settings", list(values), defaults=nominal)  # type: ignore[misc]
    meanings = {name: meaning for name, (_, meaning) in values.items()}
    group_type.__annotations__ = {
        name: Annotated[float, meaning] for name, meaning in meanings.items()
    }
    # A class made at run time cannot be imported by a worker process, so a pickle holds the values
    # and makes the class again.
    group_type.__reduce__ = lambda group: (  # type: ignore[method-assign, assignment]
        group_of,
        ({name: (value, meanings[name]) for name, value in group._asdict().items()},),
    )
    return group_type()
