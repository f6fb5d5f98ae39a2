"""The rig as a dm_env environment."""

from __future__ import annotations

import unittest

import numpy as np
import pytest
from dm_env import StepType, test_utils

from experiments import find
from rigtwin.errors import RigtwinError
from rigtwin.machine.configuration import Configuration, overridden
from rigtwin.simulation.runner import simulated
from rigtwin.simulation.safety import Trip
from rigtwin.studies.environment import Actuators, Environment, Reward, Schedule, environment


def short(name: str, seconds: float = 0.5, **changes: dict[str, object]) -> Configuration:
    return overridden(find(name).configuration, {"timing": {"duration": seconds}, **changes})


def made(name: str, **options) -> Environment:
    return Environment(short(name), find(name).demands, **options)


class TestScheduleConforms(test_utils.EnvironmentTestMixin, unittest.TestCase):
    def make_object_under_test(self, **_):
        return made("active")


class TestActuatorsConform(test_utils.EnvironmentTestMixin, unittest.TestCase):
    def make_object_under_test(self, **_):
        return made("drop", actions=Actuators())


@pytest.mark.parametrize("name", ["active", "semi-active", "friction-road", "beam-active", "imposed"])
def test_at_rest_it_is_the_compiled_loop_to_the_bit(name):
    configuration = short(name, 1.0, computer={"missed_ticks": 0.02})
    env = Environment(configuration, find(name).demands, seed=5, interval=1)
    ran = simulated(configuration, find(name).demands(configuration, 5), 5)
    step = env.reset()
    for tick in range(len(ran.commands)):
        step = env.step(env.rest())
        assert np.array_equal(step.observation["sensors"], ran.measurements[tick]), tick
        assert np.array_equal(step.observation["commands"], ran.commands[tick]), tick
    assert step.step_type == StepType.LAST
    assert step.discount == 1.0


def test_an_agent_that_commands_what_the_controller_did_meets_the_same_rig():
    configuration = short("active", 1.0)
    ran = simulated(configuration, find("active").demands(configuration, 3), 3)
    env = Environment(configuration, find("active").demands, seed=3, actions=Actuators(), interval=1)
    env.reset()
    for tick, commands in enumerate(ran.commands):
        step = env.step(commands[[1, 3]])
        assert np.array_equal(step.observation["sensors"], ran.measurements[tick])


def test_each_episode_has_a_road_of_its_own_and_the_same_seed_the_same():
    def totals(seed: int) -> list[float]:
        env = made("active", seed=seed, interval=50)
        found = []
        for _ in range(2):
            step, total = env.reset(), 0.0
            while not step.last():
                step = env.step(env.rest())
                total += step.reward
            found.append(total)
        return found

    one, again, next_one = totals(0), totals(0), totals(1)
    assert one == again
    assert one[0] != one[1]
    assert one[1] == next_one[0]


def test_a_trip_ends_an_episode_for_good():
    env = made("drop", actions=Actuators(), interval=5)
    env.reset()
    action = np.array([0.15, 10.0])
    while not (step := env.step(action)).last():
        pass
    assert env.trip != Trip.NONE
    assert step.discount == 0.0
    assert step.reward < -1000.0
    assert env.step(env.rest()).first()


def test_a_reward_is_what_it_says():
    only = Reward(ride=np.inf, road_holding=np.inf, travel=0.01)
    env = Environment(short("drop"), find("drop").demands, reward=only, interval=1)
    ran = simulated(short("drop"), find("drop").demands(short("drop"), 0), 0)
    env.reset()
    # (preload − weight) / stiffness: where the spring carries the body.
    sag = (200.0 - 25.0 * 9.81) / 1000.0
    for tick in range(100):
        step = env.step(env.rest())
        assert step.reward == pytest.approx(-(((ran.truth[tick, 2] - sag) / 0.01) ** 2), rel=1e-12)
    ride = Environment(short("drop"), find("drop").demands, reward=Reward(1.0, np.inf, np.inf), interval=100)
    ride.reset()
    cost = np.sum((np.diff(ran.truth[:100, 1], 2) / 1e-6) ** 2) / 100
    assert ride.step(ride.rest()).reward == pytest.approx(-cost, rel=1e-9)


def test_an_agent_can_do_something_about_it():
    """More skyhook, as preload against the body's velocity, costs less."""

    def total(gain: float) -> float:
        env = Environment(short("passive", 6.0), find("passive").demands, reward=Reward(travel=np.inf))
        step, found = env.reset(), 0.0
        while not step.last():
            velocity = step.observation["controller"][4]
            step = env.step(np.array([50.0, np.clip(200.0 - gain * velocity, 100.0, 300.0)]))
            found += step.reward
        return found

    assert total(300.0) > total(0.0)


@pytest.mark.parametrize(
    ("bounds", "says"),
    [
        ({"nothing": (0.0, 1.0)}, "expected a setting"),
        ({"skyhook": (0.0, 1.0)}, "expected a setting"),
        ({"kp": (1.0, 0.5)}, "low below high within 0 to 20"),
        ({"kp": (0.0, 50.0)}, "low below high within 0 to 20"),
        ({"kp": 3.0}, "expected its bounds"),
        ({}, "at least one setting"),
    ],
)
def test_mistakes_in_actions_are_said(bounds, says):
    with pytest.raises(RigtwinError, match=says):
        Schedule(bounds)


def test_mistakes_are_said():
    with pytest.raises(RigtwinError, match="unknown experiment"):
        environment("nothing")
    with pytest.raises(RigtwinError, match="interval 1 or more"):
        environment("drop", interval=0)
    env = environment("drop")
    env.reset()
    with pytest.raises(ValueError, match="suspension_damping"):
        env.step(np.array([1e6, 200.0]))
    with pytest.raises(ValueError, match="expected finite numbers"):
        env.step(np.array([np.nan, 200.0]))
    for name in ("car", "truck", "motorcycle", "boeing-707"):
        heavy = environment(name)
        heavy.action_spec().validate(heavy.rest())
