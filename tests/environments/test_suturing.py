"""Contract of every registered environment: the API, repeatable bits, and a policy that does the task."""

from __future__ import annotations

import copy
import pickle  # noqa: TID251 (what processes exchange)
import re
from collections.abc import Iterator
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.seeding import np_random
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ligature.environments import MAX_STEPS, SuturingEnv, env_id, make_vec, suturing
from ligature.environments.actions import AHEAD_ANGLE, AHEAD_JOINTS, AHEAD_LENGTH, STEP_LENGTH
from ligature.environments.goals import GOALS
from ligature.model.frames import frame, inverse, pose7_matrix
from ligature.robots.poses import rotation_vector

from tests.conftest import ROOT

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
            observation, reward, *_ = env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32))
            seen.append(np.append(observation, reward))
        rolls.append(np.concatenate(seen))
    env.close()
    assert (rolls[0] == rolls[1]).all()


def test_other_seeds_begin_otherwise() -> None:
    env = SuturingEnv("reach")
    targets = [env.reset(seed=seed)[0][30:33] for seed in (1, 2)]
    env.close()
    assert np.linalg.norm(targets[0] - targets[1]) > 1e-4


@pytest.mark.parametrize(
    "task", ["insert", "puncture", "hand_over", "pull_through", "suture", "first_throw", "knot_tie"]
)
def test_hands_have_arrived_where_an_episode_begins(task: str) -> None:
    env = SuturingEnv(task)
    for seed in range(6):
        env.reset(seed=seed)
        for reading in env.readings:
            way = inverse(pose7_matrix(reading.tip)) @ pose7_matrix(reading.setpoint)
            assert np.linalg.norm(way[:3, 3]) < 5e-5
            assert np.linalg.norm(rotation_vector(way[:3, :3])) < 2e-3
    env.close()


def test_pull_through_begins_at_any_of_its_starts_the_same_at_each_visit() -> None:
    env, fresh = SuturingEnv("pull_through"), SuturingEnv("pull_through")
    goal, seen = env.goal, {}
    for seed in range(10):
        first, _ = env.reset(seed=seed)
        seen[int(np_random(seed)[0].integers(goal.starts))] = goal.reached(), seed, first
    further = [seen[start][0] for start in sorted(seen)]
    assert len(further) >= 5 and (np.diff(further) > 0.0).all()
    for _, seed, first in reversed(seen.values()):  # in another order, and again by the one that was elsewhere since
        assert (fresh.reset(seed=seed)[0] == first).all() and (env.reset(seed=seed)[0] == first).all()
    env.close()
    fresh.close()


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


POSES = ((7, 14), (14, 21), (41, 48))
"""Where an observation has poses: tip, needle, set-point."""


@settings(max_examples=6, deadline=None)
@given(task=st.sampled_from(["reach", "pick", "insert"]), seed=st.integers(0, 2**31))
def test_what_is_observed_does_not_leap(task: str, seed: int) -> None:
    """Quaternions have two signs; the wrong one is farther than 1.4. A needle that falls turns by 0.3 in an action."""
    env, rng = SuturingEnv(task), np.random.default_rng(seed)
    starts = []
    for start in range(3):
        before, _ = env.reset(seed=seed % 1000 + start)
        starts.append(before)
        for _ in range(40):
            now, *_ = env.step(rng.uniform(-1, 1, 7).astype(np.float32))
            for first, last in POSES:
                assert np.linalg.norm(now[first:last] - before[first:last]) < 1.0, (first, task)
            before = now
    env.close()
    for first, _ in (POSES[0], POSES[2]):
        quaternions = np.array([start[first + 3 : first + 7] for start in starts])
        assert (quaternions @ quaternions[0] > 0.0).all()


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
    for _ in range(190):
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
    if task == "puncture":
        assert info["punctures"] >= 2 and 0.0 < info["tissue_peak_force"] < 5.0 and 0.0 < info["tissue_force"] < 5.0
    else:
        assert "punctures" not in info
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
    assert observation["state"].shape == (52,)


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
        ({"arm": "MTML"}, "'MTML' is not a PSM; choose one of PSM1, PSM2"),
        ({"arm": "PSM9"}, "unknown arm 'PSM9'"),
        ({"arm": ("PSM1", "PSM2")}, "reach is done by 1 arm, such as PSM1, not by PSM1, PSM2"),
        ({"task": "hand_over", "arm": "PSM1"}, "hand_over is done by 2 arms, such as PSM1, PSM2, not by PSM1"),
    ],
)
def test_wrong_options_are_reported_with_the_right_ones(wrong: dict[str, str], message: str) -> None:
    with pytest.raises((ValueError, KeyError), match=message):
        SuturingEnv(**wrong)  # type: ignore[arg-type]


def test_environments_run_side_by_side_in_processes() -> None:
    envs = gymnasium.vector.AsyncVectorEnv([lambda: SuturingEnv("reach")] * 2)
    observations, _ = envs.reset(seed=[1, 2])
    assert observations.shape == (2, 52)
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


def test_what_takes_no_part_in_a_task_neither_moves_nor_is_there() -> None:
    env = SuturingEnv("reach", max_steps=None)
    needle, observation = env.needle, env.reset(seed=1)[0]
    start, middle = observation[14:21], env.goal.scenery.needle_points(env.simulation.state["body_pose"][0])[1]
    for _ in range(120):
        way = env.base_rotation.T @ (middle - observation[27:30]) / STEP_LENGTH
        way /= max(float(np.abs(way).max()), 1.0)
        observation, *_ = env.step(np.append(way, np.zeros(4)).astype(np.float32))
    assert np.linalg.norm(observation[27:30] - middle) < 0.008, "the tool presses on the needle"
    assert (observation[14:21] == start).all() and not observation[21:27].any()
    assert env.simulation.scene.bodies[needle].static and not env.simulation.scene.rods
    env.close()


# --- nothing is left of before ----------------------------------------------------------------

EPISODES = st.lists(st.tuples(st.integers(0, 2**31), st.integers(0, 40)), max_size=3)


def rolled_out(env: SuturingEnv, seed: int, steps: int) -> tuple[np.ndarray, str]:
    """What an episode of random actions shows, the jaw closing as often as not, and the state at its end."""
    rng, seen = np.random.default_rng(seed), [env.reset(seed=seed)[0]]
    for _ in range(steps):
        action = rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)
        action[6] = -1.0 if seed % 2 else action[6]
        seen.append(env.step(action)[0])
    return np.array(seen), env.simulation.state_hash(clock=False)


@pytest.fixture(
    scope="module",
    params=[
        "reach", "pick", "insert", "hand_over", "pull_through", "peg_transfer", "suture",
        pytest.param("first_throw", marks=pytest.mark.slow), pytest.param("knot_tie", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def used(request: pytest.FixtureRequest) -> Iterator[SuturingEnv]:
    """An environment that all examples use in turn."""
    env = SuturingEnv(request.param, max_steps=None)
    yield env
    env.close()


@settings(max_examples=3)
@given(before=EPISODES, seed=st.integers(0, 2**31), steps=st.integers(1, 25))
def test_a_used_environment_is_a_fresh_one_to_the_bit(
    used: SuturingEnv, before: list[tuple[int, int]], seed: int, steps: int
) -> None:
    """Whatever it did before, in whatever contacts and grasps, and whenever it was reset."""
    for earlier in before:
        rolled_out(used, *earlier)
    suturing._STARTS.clear()
    fresh = SuturingEnv(used._options["task"], max_steps=None)
    (seen, digest), (expected, right) = rolled_out(used, seed, steps), rolled_out(fresh, seed, steps)
    fresh.close()
    assert np.array_equal(seen, expected)
    assert digest == right


# --- set-points -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def soft() -> Iterator[SuturingEnv]:
    """A needle in hand above soft tissue: something to press into."""
    env = SuturingEnv("puncture", max_steps=None)
    yield env
    env.close()


def ahead_of(env: SuturingEnv) -> tuple[float, float]:
    """How far the set-point is ahead of the tip: metres and radians."""
    ahead = inverse(pose7_matrix(env.arm.local_measured_cp())) @ pose7_matrix(env.setpoint)
    return float(np.linalg.norm(ahead[:3, 3])), float(np.linalg.norm(rotation_vector(ahead[:3, :3])))


WAYS = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6)


@settings(max_examples=6)
@example(way=[0.0, 0.0, 0.0, 0.0, 1.0, 1.0])  # the wrist comes to its limit, beyond which other joints have that pose
@given(way=WAYS)
def test_no_push_winds_the_set_point_up(soft: SuturingEnv, way: list[float]) -> None:
    """Whatever way an arm pushes for a second: its set-point stays where the arm can be seen to follow."""
    soft.reset(seed=3)
    for _ in range(50):
        soft.step(np.array([*way, 0.0], dtype=np.float32))
        length, angle = ahead_of(soft)
        # between the bound and the reading the arm moves on, at most as far as an action goes
        assert length <= AHEAD_LENGTH + 0.002 and angle <= AHEAD_ANGLE + 0.1


def test_pressing_into_tissue_is_bounded_and_reported(soft: SuturingEnv) -> None:
    observation, _ = soft.reset(seed=3)
    down = np.append(soft.base_rotation.T @ np.array([0.0, 0.0, -1.0]), np.zeros(4)).astype(np.float32)
    infos = []
    for _ in range(60):
        observation, *_, info = soft.step(down)
        infos.append(info["bounded"])
    assert not infos[0] and infos[-1]
    assert ahead_of(soft)[0] < AHEAD_LENGTH + 0.002
    for _ in range(12):
        observation, *_, info = soft.step(-down)
    assert not info["bounded"], "the way back begins at once"


def test_joint_actions_are_bounded_too() -> None:
    env = SuturingEnv("puncture", action="joint", max_steps=None)
    env.reset(seed=3)
    for _ in range(60):
        env.step(np.array([0, 0, 1, 0, 0, 0, 0], dtype=np.float32))
        ahead = np.abs(env.arm.setpoint_js().position - env.arm.measured_js().position)
        assert (ahead <= 1.5 * AHEAD_JOINTS).all()
    env.close()


def test_the_set_point_is_observed(soft: SuturingEnv) -> None:
    soft.reset(seed=3)
    rng = np.random.default_rng(0)
    for _ in range(5):
        observation, *_ = soft.step(rng.uniform(-1, 1, 7).astype(np.float32))
        assert (observation[41:48] == soft.setpoint).all()
        assert observation[48] == soft.arm.jaw.setpoint_js().position[0]
        assert (observation[34:40] == soft.arm.measured_js().velocity).all()


# --- keeping a moment -----------------------------------------------------------------------

ACTIONS = np.random.default_rng(6).uniform(-1, 1, (12, 14)).astype(np.float32)


def rolled(env: gymnasium.Env) -> np.ndarray:
    """Observations and rewards of the same actions, and the start of the episode after them."""
    seen = [np.append(*env.step(action)[:2]) for action in ACTIONS[:, : env.action_space.shape[0]]]
    return np.array([*seen, np.append(env.reset()[0], 0.0)])


SLOW = [
    pytest.param(task, marks=pytest.mark.slow)
    for task in ("pick", "pull_through", "peg_transfer", "suture", "first_throw", "knot_tie")
]


@pytest.mark.parametrize("task", ["reach", "insert", "hand_over", *SLOW])
def test_what_was_saved_goes_on_to_the_bit_and_copies_go_on_alike(task: str) -> None:
    env = SuturingEnv(task)
    env.reset(seed=4)
    for action in ACTIONS[:, : env.action_space.shape[0]]:
        env.step(action)
    state = env.save()
    first = rolled(env)
    env.restore(state)
    assert (rolled(env) == first).all()
    for duplicate in (copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))):
        env.restore(state)
        other = duplicate(env)
        assert (rolled(other) == rolled(env)).all()
        other.close()
    env.close()


def test_a_copy_of_a_made_environment_steps() -> None:
    env = gymnasium.make("ligature/Reach-v0")
    env.reset(seed=1)
    env.step(ACTIONS[0, :7])
    other = copy.deepcopy(env)
    a, b = env.step(ACTIONS[1, :7])[0], other.step(ACTIONS[1, :7])[0]
    env.close()
    other.close()
    assert np.isfinite(b).all()
    assert a == pytest.approx(b, abs=1e-6)


def test_a_shallow_copy_is_refused_with_what_to_do() -> None:
    env = SuturingEnv("reach")
    with pytest.raises(TypeError, match=r"use copy\.deepcopy, or save and restore"):
        copy.copy(env)
    env.close()


def test_a_state_of_another_task_is_refused() -> None:
    reach, pick = SuturingEnv("reach"), SuturingEnv("pick")
    reach.reset(seed=1)
    with pytest.raises(ValueError, match="the state has task='reach', not 'pick'"):
        pick.restore(reach.save())
    with pytest.raises(RuntimeError, match=r"call reset\(\) before save\(\)"):
        pick.save()
    with pytest.raises(RuntimeError, match=r"call reset\(\) before step\(\)"):
        pick.step(ACTIONS[0, :7])
    reach.close()
    pick.close()


@pytest.mark.parametrize("state", [None, {}, "saved"])
def test_what_is_no_state_is_refused(soft: SuturingEnv, state: object) -> None:
    with pytest.raises(TypeError, match="restore what 'save' returned"):
        soft.restore(state)  # type: ignore[arg-type]


def test_options_of_reset_are_refused() -> None:
    env = SuturingEnv("reach")
    with pytest.raises(ValueError, match="reset takes no options, but got 'difficulty'"):
        env.reset(options={"difficulty": 3})
    env.reset(options={})
    env.close()


@pytest.mark.parametrize("task", sorted(GOALS))
def test_the_specification_has_the_length_of_episodes(task: str) -> None:
    assert gymnasium.spec(env_id(task)).max_episode_steps == GOALS[task].steps
    assert (
        task in ("hand_over", "pull_through", "peg_transfer", "suture", "first_throw", "knot_tie")
        or GOALS[task].steps == MAX_STEPS
    )


def test_episodes_of_made_environments_are_cut_where_the_specification_has_it() -> None:
    env = gymnasium.make("ligature/Reach-v0", max_episode_steps=3)
    assert env.spec is not None and env.spec.max_episode_steps == 3
    env.reset(seed=1)
    assert [env.step(np.zeros(7, dtype=np.float32))[3] for _ in range(3)] == [False, False, True]
    env.close()
    with pytest.raises(ValueError, match="gymnasium.make has 'max_episode_steps'"):
        gymnasium.make("ligature/Reach-v0", max_steps=3)


VIEWS = (
    "base_position", "base_rotation", "needle_force", "readings", "setpoint", "tool_position", "tool_positions",
)  # fmt: skip
"""What an environment reports of now."""


@pytest.mark.parametrize("task", sorted(GOALS))
def test_info_has_the_keys_that_the_documents_list(task: str) -> None:
    """The same at a reset and a step; of soft tissue where there is some."""
    text = (ROOT / "docs" / "learning.md").read_text()
    table = text[text.index("| key of `info` |") :].partition("\n\n")[0]
    listed = [
        (name, "soft tissue" in row) for row in table.splitlines() for name in re.findall(r"`(\w+)`", row.split("|")[1])
    ]
    env = SuturingEnv(task, randomise={})
    _, begun = env.reset(seed=1)
    *_, then = env.step(np.zeros(env.action_space.shape))
    soft = bool(env.simulation.scene.tissues)
    env.close()
    expected = {name for name, of_tissue in listed if soft or not of_tissue} - {"info"}
    assert set(begun) == expected and set(then) == expected - {"randomisation"}
    assert (begun["refused"], begun["bounded"]) == ("", False)


def test_a_closed_environment_reports_that_whatever_is_asked_of_it() -> None:
    env = SuturingEnv("reach", render_mode="rgb_array")
    env.reset(seed=1)
    state = env.save()
    env.close()
    env.close()
    still = np.zeros(7)
    for ask in (
        lambda: env.step(still), env.reset, env.save, env.render, lambda: env.restore(state),
        lambda: copy.deepcopy(env), lambda: pickle.dumps(env), env.true_state,
        *(partial(getattr, env, name) for name in VIEWS),
    ):  # fmt: skip
        with pytest.raises(RuntimeError, match="the environment is closed: make another one"):
            ask()


NO_ACTIONS = [
    np.zeros(6), np.zeros(8), np.zeros((1, 7)), 0.0, None, ["a"] * 7, {}, [[0.0]] * 7, [10**400] * 7,
    *(np.zeros(7, kind) for kind in ("c16", "M8[s]", "m8[s]", "S1", "U1", "V4", [("x", "f4")])),
]  # fmt: skip


@pytest.mark.parametrize("action", NO_ACTIONS)
def test_what_is_no_action_is_rejected(action: object) -> None:
    env = SuturingEnv("reach")
    env.reset(seed=1)
    with pytest.raises(ValueError, match="an action is 7 numbers"):
        env.step(action)
    env.close()


def test_an_action_is_its_numbers_whatever_their_type() -> None:
    """Lists, whole numbers and halves; beyond -1 and 1 counts as these, NaN as 0."""
    env, found = SuturingEnv("reach"), []
    plain = np.array([1, -1, 0, 1, 0, 0, -1])
    far = np.array([np.inf, -7.0, np.nan, 1.0, 0.0, np.nan, -np.inf])
    for action in (
        plain,
        plain.tolist(),
        plain.astype(np.float32),
        plain.astype(np.float16),
        plain.astype(np.int8),
        far,
    ):
        env.reset(seed=4)
        observations = [env.step(action)[0] for _ in range(5)]
        found.append(np.array(observations))
    env.close()
    assert all((each == found[0]).all() for each in found)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"size": (0, 84)}, ValueError, "size is a width and a height in pixels"),
        ({"size": (84,)}, ValueError, "size is a width and a height in pixels"),
        ({"size": "84"}, ValueError, "size is a width and a height in pixels"),
        ({"size": (84, 10**6)}, ValueError, "size is a width and a height in pixels, 1 to 16384 each"),
        ({"arm": 5}, TypeError, "arm is 5; it must be the name of an arm, or a list of names"),
        ({"observation": "image", "camera": None}, KeyError, "'None' does not name exactly one camera"),
        ({"max_steps": 0}, ValueError, "max_steps is a number of actions, at least 1"),
        ({"max_steps": 1.5}, ValueError, "max_steps is a number of actions, at least 1"),
        ({"render_mode": "human"}, ValueError, "render_mode must be None or rgb_array"),
        ({"camera": "nope"}, KeyError, "'nope' does not name exactly one camera; choose one of"),
        ({"observation": "image", "camera": "far"}, KeyError, "'far' does not name exactly one camera; choose one of"),
    ],
)
def test_options_that_cannot_be_are_rejected_at_once(options: dict, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        SuturingEnv("reach", **options)
