"""Rich motions of a machine's joints within their ranges, simulated by its twin."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from rigtwin.components import ForceActuator, component_of
from rigtwin.description.component import Component
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.replay import Joint
from rigtwin.errors import RigtwinError
from rigtwin.models.demands import demanded_channels
from rigtwin.numerics.arrays import Array
from rigtwin.recording import RecordedTest
from rigtwin.signals.excitation import multisine

SECONDS = 8.0
"""Duration of each motion, s."""
REACHES = (0.3, 0.08)
"""rms of the motions, as shares of half a joint's range."""
BAND = (0.15, 12.0)
"""Frequency band of the motions, Hz."""
GENTLE_SHARE, GENTLE_HIGHEST = 0.15, 2.5
"""Gentle motions: rms as a share of half a joint's range, and highest frequency, Hz. With these,
joints stay within their range and drives within their force."""
SLOPE = 1.0
"""Exponent n of the amplitudes, which are proportional to frequency^−n."""
Reach = tuple[float, float]
"""Middle and half width of a range, SI."""


def excite(
    machine: Machine, reach: Callable[[Machine, tuple[str, str]], Reach | None], least_period: float
) -> Iterator[RecordedTest]:
    """Yield recordings of multisines that no limit ends; none if a range is unknown.

    Parameters
    ----------
    machine
        Machine to simulate.
    reach
        Function that returns the range of a channel's demand, or None if it is unknown.
    least_period
        Shortest permitted period of the ticks, s.
    """
    timing = machine.configuration.timing._replace(duration=SECONDS)
    timing = timing._replace(period=max(timing.period, least_period))
    configuration = machine.configuration._replace(timing=timing)
    for number, share in enumerate(REACHES, 1):
        # Fixed seeds: every call must find the same effects observable.
        demands = demand_multisines(machine, reach, configuration, share, BAND[1], [number, 17])
        if demands is None:
            return
        name = f"multisine {number}"
        try:
            yield machine.physics.simulate(machine, name, configuration, demands, number)
        except RigtwinError:
            # A motion that diverges shows nothing: the series ends here.
            return


def demand_multisines(
    machine: Machine,
    reach: Callable[[Machine, tuple[str, str]], Reach | None],
    configuration: Configuration,
    share: float,
    highest: float,
    seed: Sequence[int],
) -> dict[str, Array] | None:
    """Return a multisine for each demanded channel; None if a range is unknown.

    Parameters
    ----------
    machine
        Machine that is to move.
    reach
        Function that returns the range of a channel's demand, or None if it is unknown.
    configuration
        Settings, whose timing gives the ticks.
    share
        rms of each motion, as a share of half its range.
    highest
        Highest frequency, Hz.
    seed
        Seed of the phases.
    """
    period = configuration.timing.period
    time = np.arange(configuration.ticks) * period
    random = np.random.default_rng(seed)
    demands = {}
    for channel in demanded_channels(machine):
        size = reach(machine, channel)
        if size is None:
            return None
        wave = multisine(
            time,
            lowest=BAND[0],
            # Differentiating twice needs several samples per wave.
            highest=min(highest, 0.2 / period),
            spacing=BAND[0],
            slope=SLOPE,
            rms=1.0,
            random=random,
        )
        middle, half = size
        demands[".".join(channel)] = middle + share * half * wave
    return demands


def reach_of_component(machine: Machine, channel: tuple[str, str]) -> Reach | None:
    """Return the range of the demand of a component's channel: of its joint, or of its force."""
    moved = next((c for c in machine.components.values() if c.channel == channel), None)
    if moved is None:
        # The description states no range for the other inputs of a controller.
        return None
    joint = Mechanism(machine.model).joint(moved.joint or moved.acts_on[0][0])
    return _reach(machine, moved, joint)


def reach_of_replay(machine: Machine, channel: tuple[str, str]) -> Reach | None:
    """Return the range of the demand of a channel that moves a replay: of its joint, or force."""
    for replay in machine.replays:
        joint, mover = replay.joint, machine.components[replay.moved_by[0]]
        if channel == mover.channel:
            return _reach(machine, mover, joint)
        if replay.closed:
            return _range(joint)
    return None


def _reach(machine: Machine, mover: Component, joint: Joint) -> Reach:
    """Return the range of the command of a force actuator, or of a joint's position."""
    if mover.component_type is not ForceActuator:
        return _range(joint)
    constant = component_of(machine.plant, mover.name, ForceActuator).constant
    return 0.0, _gentle_force(joint) / abs(constant)


def _gentle_force(joint: Joint) -> float:
    """Return half the weight; without weight, the force of an oscillation of 1 Hz, N or Nm."""
    _, half = _range(joint)
    # Force of the oscillation: m·ω²·x with ω = 2π/s and x half the range.
    weight = 0.5 * max(np.abs(joint.gravity))
    return weight or joint.inertia * (2.0 * math.pi) ** 2 * half


def _range(joint: Joint) -> tuple[float, float]:
    """Return middle and half width of a range about the joint's rest, clipped to its positions."""
    low, high = joint.positions[0], joint.positions[-1]
    middle = min(max(joint.rest, low), high)
    return middle, max(min(high - middle, middle - low), 0.25 * (high - low))
