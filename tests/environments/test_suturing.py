"""Contract of every registered environment: the API, repeatable bits, and a policy that does the task."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from ligature.environments import SuturingEnv, make_vec
from ligature.model.frames import frame, inverse, pose7_matrix
from ligature.robots.poses import rotation_vector

IDS = sorted(name for name in gymnasium.registry if name.startswith("ligature/"))


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("action", ["cartesian", "joint"])
@pytest.mark.filterwarnings("ignore:.*is not within the observation space.*", "ignore:.*infinity.*", "ignore:.*Box.*")
def test_an_environment_passes_the_checker(name: str, action: str) -> None:
    env = gymnasium.make(name, action=action).unwrapped
    check_env(env, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("name", IDS)
def test_two_episodes_with_one_seed_are_the_same_to_the_bit(name: str) -> None:
    env = gymnasium.make(name)
    rolls = []
    for _ in range(2):
        observation, _ = env.reset(seed=7)
        rng = np.random.default_rng(3)
        seen = [observation]
        for _ in range(15):
            observation, reward, *_ = env.step(rng.uniform(-1, 1, 7).astype(np.float32))
            seen.append(np.append(observation, reward))
        rolls.append(np.concatenate(seen))
    env.close()
    assert (rolls[0] == rolls[1]).all()


def test_other_seeds_begin_otherwise() -> None:
    env = SuturingEnv("reach")
    targets = [env.reset(seed=seed)[0][30:33] for seed in (1, 2)]
    env.close()
    assert np.linalg.norm(targets[0] - targets[1]) > 1e-4


@pytest.mark.parametrize("reward", ["dense", "sparse"])
def test_going_straight_to_the_target_reaches_it(reward: str) -> None:
    env = SuturingEnv("reach", reward=reward)
    observation, info = env.reset(seed=5)
    base = env.base_rotation
    total, done, steps = 0.0, False, 0
    first = info["distance"]
    while not done and steps < 150:
        way = base.T @ (observation[30:33] - observation[27:30])
        action = np.zeros(7, dtype=np.float32)
        action[:3] = np.clip(way / 0.001, -1, 1)
        observation, gained, done, cut, info = env.step(action)
        total, steps = total + gained, steps + 1
        assert not cut
    env.close()
    assert done and info["is_success"]
    assert total == pytest.approx(1.0 + (100.0 * first if reward == "dense" else 0.0), abs=1e-9)


def test_images_are_what_the_camera_sees() -> None:
    env = SuturingEnv("reach", observation="image", render_mode="rgb_array")
    observation, _ = env.reset(seed=1)
    assert observation.shape == (84, 84, 3)
    assert observation.dtype == np.uint8
    assert observation.std() > 10
    assert env.render().shape == (480, 640, 3)
    env.close()


@pytest.mark.parametrize("task", ["insert", "puncture"])
def test_turning_the_needle_along_its_arc_inserts_it(task: str) -> None:
    """A policy that turns the hand about the middle of the throw's circle, by the actions that an agent has."""
    env = SuturingEnv(task)
    observation, info = env.reset(seed=3)
    goal, first, total, done, angle = env.goal, info["distance"], 0.0, False, -0.4
    base = frame(env.base_rotation, env.base_position)
    T_arc_tool = inverse(pose7_matrix(observation[14:21]) @ goal.arc.T_body_arc) @ base @ pose7_matrix(env.setpoint)
    for _ in range(150):
        wanted = inverse(base) @ goal.throw.arc_at(angle, goal.arc) @ T_arc_tool
        now = pose7_matrix(env.setpoint)
        action = np.zeros(7)
        action[:3] = (wanted - now)[:3, 3] / 0.001
        action[3:6] = rotation_vector(now[:3, :3].T @ wanted[:3, :3]) / 0.05
        largest = np.abs(action).max()
        action, angle = (action / largest, angle) if largest > 1.0 else (action, angle + 0.03)
        observation, gained, done, _, info = env.step(action.astype(np.float32))
        total += gained
        if done:
            break
    env.close()
    assert done and info["is_success"]
    assert total == pytest.approx(1.0 + 100.0 * first, abs=1e-9)


def test_a_needle_that_is_not_driven_is_not_in() -> None:
    env = SuturingEnv("insert")
    _, info = env.reset(seed=3)
    first = info["distance"]
    for _ in range(20):
        *_, done, _, info = env.step(np.array([0, 0, 0, 0, 0, 0, 1], dtype=np.float32))
        assert not done
    env.close()
    assert 0.0 < info["distance"] < 2.0 * first
    assert not info["is_success"]


def test_both_kinds_of_observation_come_together() -> None:
    env = SuturingEnv("reach", observation="both", size=(32, 24))
    observation, _ = env.reset(seed=1)
    env.close()
    assert env.observation_space.contains(observation)
    assert observation["image"].shape == (24, 32, 3)
    assert observation["state"].shape == (34,)


def test_what_the_arm_refuses_is_reported_and_the_episode_goes_on() -> None:
    env = SuturingEnv("reach")
    env.reset(seed=1)
    up = np.array([0, 0, 1, 0, 0, 0, 0], dtype=np.float32)
    infos = [env.step(up)[4] for _ in range(120)]
    observation = env.step(np.full(7, np.nan, dtype=np.float32))[0]
    env.close()
    assert np.isfinite(observation).all()
    assert not infos[0]["refused"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"task": "knit"}, "task must be one of reach, pick, insert, puncture"),
        ({"action": "torque"}, "action must be one of cartesian, joint"),
        ({"arm": "MTML"}, "'MTML' is not a PSM"),
        ({"arm": "PSM9"}, "no arm is called 'PSM9'"),
    ],
)
def test_wrong_options_are_reported_with_the_right_ones(wrong: dict[str, str], message: str) -> None:
    with pytest.raises((ValueError, KeyError), match=message):
        SuturingEnv(**wrong)  # type: ignore[arg-type]


def test_environments_run_side_by_side_in_processes() -> None:
    envs = gymnasium.vector.AsyncVectorEnv([lambda: SuturingEnv("reach")] * 2)
    observations, _ = envs.reset(seed=[1, 2])
    assert observations.shape == (2, 34)
    observations, *_ = envs.step(np.zeros((2, 7), dtype=np.float32))
    envs.close()
    assert np.isfinite(observations).all()


def test_environments_of_a_vector_are_single_ones_to_the_bit() -> None:
    envs, actions = make_vec("reach", 2), np.random.default_rng(4).uniform(-1, 1, (2, 7)).astype(np.float32)
    first, _ = envs.reset(seed=[1, 2])
    then, *_ = envs.step(actions)
    envs.close()
    single = SuturingEnv("reach")
    for k, seed in enumerate((1, 2)):
        assert (single.reset(seed=seed)[0] == first[k]).all()
        assert (single.step(actions[k])[0] == then[k]).all()
    single.close()


def test_a_vector_has_at_least_one_environment() -> None:
    with pytest.raises(ValueError, match="n is a number of environments, at least 1, not 0"):
        make_vec("reach", 0)


def test_an_environment_simulates_the_arm_of_its_task_alone() -> None:
    env = SuturingEnv("pick")
    scene = env._simulation.scene
    env.close()
    assert [arm.name for arm in scene.arms] == ["PSM1"]
    assert not any("psm2" in body.identity.identifier for body in scene.bodies)
    assert scene.rods, "the needle has its thread"
