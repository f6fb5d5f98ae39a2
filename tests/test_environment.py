"""The rig as a dm_env environment."""

from __future__ import annotations

import sys
import unittest

import numpy as np
import pytest
from dm_env import StepType, test_utils

from experiments import find
from experiments.environment import environment
from rigtwin.description.changes import override
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError
from rigtwin.simulation.runner import simulate
from rigtwin.simulation.trip import Trip
from rigtwin.studies.actions import ActionSchedule, Actuators
from rigtwin.studies.environment import Environment, Reward


def short(name: str, seconds: float = 0.5, **changes: dict[str, object]) -> Configuration:
    return override(find(name).configuration, {"timing": {"duration": seconds}, **changes})


@pytest.fixture(scope="module")
def control():
    """dm_control's package, loaded for drawing without a display."""
    with pytest.MonkeyPatch.context() as patch:
        if sys.platform == "linux":
            patch.setenv("MUJOCO_GL", "egl")
        return pytest.importorskip("dm_control.mujoco", exc_type=ImportError)


@pytest.fixture(scope="module")
def rendering(control) -> None:
    try:
        control.Physics.from_xml_string("<mujoco/>").render(8, 8)
    except Exception as error:  # each kind of OpenGL raises its own
        pytest.skip(f"no rendering here: {error}")


def made(name: str, **options) -> Environment:
    return Environment(short(name), find(name).demands, **options)


class TestScheduleConforms(test_utils.EnvironmentTestMixin, unittest.TestCase):
    def make_object_under_test(self, **_):
        return made("active")


class TestActuatorsConform(test_utils.EnvironmentTestMixin, unittest.TestCase):
    def make_object_under_test(self, **_):
        return made("drop", actions=Actuators())


@pytest.mark.parametrize("name", ["semi-active", "friction-road", "beam-active", "imposed"])
def test_at_rest_it_is_the_compiled_loop_to_the_bit(name):
    configuration = short(name, computer={"missed_ticks": 0.02})
    env = Environment(configuration, find(name).demands, seed=5, interval=1)
    ran = simulate(configuration, find(name).demands(configuration, 5), 5)
    step = env.reset()
    for tick in range(len(ran.commands)):
        step = env.step(env.rest())
        assert np.array_equal(step.observation["sensors"], ran.measurements[tick]), tick
        assert np.array_equal(step.observation["commands"], ran.commands[tick]), tick
    assert step.step_type == StepType.LAST
    assert step.discount == 1.0


def test_an_agent_that_commands_what_the_controller_did_meets_the_same_rig():
    configuration = short("active", 1.0)
    ran = simulate(configuration, find("active").demands(configuration, 3), 3)
    env = Environment(
        configuration, find("active").demands, seed=3, actions=Actuators(), interval=1
    )
    env.reset()
    for tick, commands in enumerate(ran.commands):
        step = env.step(commands[[1, 3]])
        assert np.array_equal(step.observation["sensors"], ran.measurements[tick])


def test_each_episode_has_a_road_of_its_own_and_the_same_seed_the_same():
    def totals(seed: int) -> list[float]:
        env = made("active", seed=seed, interval=50)
        steps = []
        for _ in range(2):
            step, total = env.reset(), 0.0
            while not step.last():
                step = env.step(env.rest())
                total += step.reward
            steps.append(total)
        return steps

    first, again, next_one = totals(0), totals(0), totals(1)
    assert first == again
    assert first[0] != first[1]
    assert first[1] == next_one[0]


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
    ran = simulate(short("drop"), find("drop").demands(short("drop"), 0), 0)
    env.reset()
    # (preload − weight) / stiffness: where the spring carries the body.
    sag = (200.0 - 25.0 * 9.81) / 1000.0
    for tick in range(100):
        step = env.step(env.rest())
        assert step.reward == pytest.approx(-(((ran.truth[tick, 2] - sag) / 0.01) ** 2), rel=1e-12)
    ride = Environment(
        short("drop"), find("drop").demands, reward=Reward(1.0, np.inf, np.inf), interval=100
    )
    ride.reset()
    cost = np.sum((np.diff(ran.truth[:100, 1], 2) / 1e-6) ** 2) / 100
    assert ride.step(ride.rest()).reward == pytest.approx(-cost, rel=1e-9)


@pytest.mark.slow
def test_an_agent_can_do_something_about_it():
    """More skyhook, as preload against the body's velocity, costs less."""

    def total(gain: float) -> float:
        env = Environment(
            short("passive", 3.0), find("passive").demands, reward=Reward(travel=np.inf)
        )
        step, reward = env.reset(), 0.0
        while not step.last():
            velocity = step.observation["controller"][4]
            step = env.step(np.array([50.0, np.clip(200.0 - gain * velocity, 100.0, 300.0)]))
            reward += step.reward
        return reward

    assert total(300.0) > total(0.0)


@pytest.mark.usefixtures("control")
def test_its_physics_is_the_rig_that_runs():
    env = Environment(short("drop", carriage={"mass": 40.0}), find("drop").demands, seed=3)
    assert env.physics.named.data.qpos["ground"] == 0.0
    first = env.reset()
    assert env.seed == 3, "to look at the rig takes no episode away"
    assert env.physics.model.body("carriage").mass == 40.0
    assert env.physics.named.data.qpos["carriage"] < 0.0, "the tyre carries the preload"
    before = env.physics
    step = env.step(env.rest())
    assert before is env.physics
    assert env.physics.time() == pytest.approx(env.control_timestep())
    assert env.physics.named.data.qpos["structure"] == pytest.approx(
        step.observation["sensors"][1], abs=1e-3
    )
    env.reset()
    assert env.physics is not before
    assert env.physics.time() == 0.0
    assert not np.array_equal(first.observation["sensors"], step.observation["sensors"])


@pytest.mark.usefixtures("control")
def test_a_push_moves_the_rig():
    def travel(push: float) -> float:
        env = made("drop", interval=100)
        env.reset()
        env.physics.named.data.xfrc_applied["carriage", 0] = push
        return float(env.step(env.rest()).observation["sensors"][2])

    assert travel(500.0) < travel(0.0) - 0.001


@pytest.mark.filterwarnings("ignore:.*DISPLAY")
@pytest.mark.usefixtures("control")
@pytest.mark.parametrize("name", ["drop", "active"])
def test_the_viewer_runs_it_and_pauses_change_nothing(name):
    from dm_control.viewer.runtime import Runtime, State

    configuration = short(name, 0.5, ground_cylinder={"compliance": 1e-6})
    seen, changes, paused = [], [], False
    env = Environment(configuration, find(name).demands, seed=5)

    def policy(step):
        seen.append((step.observation, env.physics.data.qpos.copy()))
        return env.rest()

    runtime = Runtime(env, policy)
    runtime.on_physics_changed += lambda: changes.append(env.seed)
    runtime.on_error += lambda message: pytest.fail(message)
    runtime.tick(0.02, paused=False)
    while runtime.state == State.RUNNING:
        paused = not paused
        runtime.tick(0.02, paused)
    assert runtime.state == State.STOPPED
    assert runtime.get_time() == pytest.approx(0.5)
    different = Environment(configuration, find(name).demands, seed=5)
    step = different.reset()
    for observation, position in seen:
        assert all(
            np.array_equal(observation[kind], step.observation[kind]) for kind in observation
        )
        assert np.array_equal(position, different.physics.data.qpos)
        step = different.step(different.rest())
    assert step.last()
    runtime.restart()
    runtime.tick(0.02, paused=False)
    assert changes == [6], "the viewer learns of each new rig"


@pytest.mark.usefixtures("rendering")
def test_pictures_are_of_the_rig_now():
    from dm_control.suite.wrappers import pixels

    view = {"height": 120, "width": 240, "camera_id": "side"}
    env = pixels.Wrapper(made("drop", interval=125), pixels_only=False, render_kwargs=view)
    plain = made("drop", interval=125)
    expected = plain.reset()
    step = env.reset()
    pictures = []
    while not step.last():
        for kind, value in expected.observation.items():
            assert np.array_equal(step.observation[kind], value)
        pictures.append(step.observation["pixels"].astype(float))
        env.observation_spec()["pixels"].validate(step.observation["pixels"])
        step, expected = env.step(plain.rest()), plain.step(plain.rest())
    assert np.std(pictures[0]) > 20, "the picture is not blank"
    assert np.mean(np.abs(pictures[-1] - pictures[0])) > 0.1, "nothing moves"


@pytest.mark.usefixtures("control")
def test_noise_on_actions_comes_of_the_seed():
    from dm_control.suite.wrappers import action_noise

    def run(scale: float, seed: int = 2) -> np.ndarray:
        env = action_noise.Wrapper(made("drop", seed=seed, actions=Actuators()), scale=scale)
        env.reset()
        return np.array([env.step(env.rest()).observation["commands"][[1, 3]] for _ in range(5)])

    quiet, noisy = run(0.0), run(0.001)
    assert np.array_equal(quiet, np.tile(made("drop", actions=Actuators()).rest(), (5, 1)))
    assert np.array_equal(noisy, run(0.001))
    assert not np.array_equal(noisy, run(0.001, seed=3))
    voltage = noisy[:, 1] - quiet[:, 1]
    assert 0.0 < np.std(voltage) < 0.1
    assert len(set(voltage)) == 5


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
        ActionSchedule(bounds)


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
