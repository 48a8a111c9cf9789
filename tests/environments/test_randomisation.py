"""Randomised episodes: drawn within their ranges, alike for one seed, in force, and refused where they are invalid."""

from __future__ import annotations

import copy
import pickle  # noqa: TID251 (what processes exchange)
import re
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ligature.bundle import SCENES
from ligature.environments import Randomisation, SuturingEnv
from ligature.environments.experts import EXPERTS
from ligature.environments.goals import GOALS
from ligature.environments.hand import Hand
from ligature.environments.randomisation import BOUNDS, PHYSICS, Drawn, things_of
from ligature.environments.variation import Channel, varied
from ligature.model.load import load
from ligature.model.scene import Scene

from tests.conftest import ROOT

DELAYS = ("action_delay", "observation_delay")


def ranges(name: str, most: float = np.inf) -> st.SearchStrategy[list[float]]:
    """Ranges that are allowed, a part of them of one value."""
    bound = BOUNDS[name]
    least, highest = bound.least, min(bound.most, most)
    values = st.integers(int(least), int(highest)) if bound.whole else st.floats(least, highest)
    return st.tuples(values, values).map(sorted)


CONFIGURATIONS = st.fixed_dictionaries({}, optional={name: ranges(name) for name in BOUNDS})


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load(SCENES / "suturing_small" / "launch.yaml", (0, 1, 2))


def numbers(value: Any) -> list[float]:
    """All numbers of what was drawn under one name."""
    if isinstance(value, dict):
        return [number for each in value.values() for number in numbers(each)]
    return list(value) if isinstance(value, tuple) else [value]


@settings(max_examples=60)
@given(config=CONFIGURATIONS, seed=st.integers(0, 2**32))
def test_what_is_drawn_lies_in_its_range_and_follows_from_the_seed(
    scene: Scene, config: dict[str, list[float]], seed: int
) -> None:
    found = Randomisation.of(config)
    assert found is not None
    drawn = found.draw(scene, np.random.default_rng(seed))
    assert drawn == found.draw(scene, np.random.default_rng(seed))
    assert set(drawn.as_dict()) == {*config, "noise_seed"}
    for name, (low, high) in config.items():
        values = numbers(getattr(drawn, name))
        assert values and all(low <= value <= high for value in values), name
        if name in DELAYS:
            assert isinstance(getattr(drawn, name), int)


@settings(max_examples=40)
@given(config=CONFIGURATIONS)
def test_ranges_come_back_from_a_file(tmp_path_factory: pytest.TempPathFactory, config: dict[str, list[float]]) -> None:
    path = tmp_path_factory.mktemp("ranges") / "randomise.yaml"
    path.write_text(yaml.safe_dump(config) if config else "{}")
    found = Randomisation.of(path)
    assert found == Randomisation.of(config) and found is not None
    assert Randomisation.of(found.as_dict()) == found == Randomisation.of(str(path))


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"masses": [1, 2]}, "randomise: unknown key 'masses'; choose one of light, light_shift"),
        ({"mass": 1.0}, r"mass must be a pair \[low, high\] of numbers from 0.2 to 5 \(times\), not 1.0"),
        ({"mass": [1.0, 2.0, 3.0]}, r"mass must be a pair .* not \[1.0, 2.0, 3.0\]"),
        ({"mass": "ab"}, "mass must be a pair .* not 'ab'"),
        ({"mass": [2.0, 1.0]}, "2 is above 1: write the lower one first"),
        ({"mass": [0.0, 1.0]}, "mass must be .* from 0.2 to 5 .* not 0 to 1"),
        ({"mass": [1.0, float("nan")]}, "nan is not"),
        ({"mass": [True, 2]}, "True is not"),
        (
            {"position_noise": ["1e-3", 0.01]},
            "'1e-3' is not; YAML reads it as text: write a decimal point, as in 1.0e-3",
        ),
        ({"action_delay": [0.5, 2]}, "action_delay must be a pair .* of whole numbers from 0 to 25 .* 0.5 is not"),
        ({"mass": [1, 10**400]}, r"mass must be a pair .*, but 10+\.\.\.0+ is not"),
        ({"mass": None}, r"mass must be a pair \[low, high\] of numbers from 0.2 to 5 \(times\), not None"),
        ([1, 2], "randomise must be ranges by name or a YAML file of them, not list"),
    ],
)
def test_invalid_ranges_are_refused(config: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SuturingEnv("reach", randomise=config)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mass: [1, 2]\nlight: [1, 1]\n\n'mass': [0.5, 2]", "line 4: 'mass' is already in line 1; keep one of them"),
        ("mass:", r"mass must be a pair \[low, high\] .*, not None"),
        ("[1, 2", "cannot be read"),
        ("- 1", "must hold ranges by name"),
        (None, "cannot be read: .*No such file"),
    ],
)
def test_invalid_files_are_refused(tmp_path: Path, text: str | None, message: str) -> None:
    path = tmp_path / "randomise.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=message):
        Randomisation.of(path)


# --- in force -------------------------------------------------------------------------------


@settings(max_examples=20)
@given(config=st.fixed_dictionaries({name: ranges(name) for name in PHYSICS}), seed=st.integers(0, 2**32))
def test_the_scene_has_what_was_drawn(scene: Scene, config: dict[str, list[float]], seed: int) -> None:
    drawn = Randomisation(**config).draw(scene, np.random.default_rng(seed))  # type: ignore[arg-type]
    found, size = varied(scene, drawn), drawn.needle_size
    needle = scene.needles[0].body
    assert drawn.mass and drawn.friction and size
    for name, bodies in things_of(scene):
        for index in bodies:
            before, after = scene.bodies[index], found.bodies[index]
            grown = size**3 if index == needle else 1.0
            assert after.mass == pytest.approx(before.mass * drawn.mass.get(name, 1.0) * grown)
            assert after.friction == pytest.approx(before.friction * drawn.friction[name])
    arc = found.needles[0].arc
    assert arc.radius == pytest.approx(size * scene.needles[0].arc.radius)
    assert arc.length == pytest.approx(size * scene.needles[0].arc.length)


@pytest.mark.parametrize("size", [0.8, 1.0, 1.2])
def test_a_thread_hangs_on_a_needle_of_any_size(scene: Scene, size: float) -> None:
    """The two frames of the joint between them meet, in the world and in the parent, as they did before."""

    def gaps(given: Scene) -> list[np.ndarray]:
        found = []
        for index in given.rods[0].anchors:
            joint = given.joints[index]
            parent, child = given.bodies[joint.parent], given.bodies[joint.child]
            at = parent.T_world_body @ parent.T_body_inertial @ joint.T_parent_a
            other = child.T_world_body @ child.T_body_inertial @ joint.T_child_b
            zero = parent.T_world_body @ joint.T_parent_child_zero @ child.T_body_inertial @ joint.T_child_b
            found += [other[:3, 3] - at[:3, 3], zero[:3, 3] - at[:3, 3]]
        return found

    found = varied(scene, Drawn(needle_size=size))
    assert len(found.rods[0].anchors) == 1
    for now, before in zip(gaps(found), gaps(scene), strict=True):
        assert now == pytest.approx(before, abs=1e-9)


def test_nothing_drawn_changes_nothing(scene: Scene) -> None:
    """Bodies, joints and needles as before: factors of 1 have the same bits."""
    found = varied(scene, Drawn(needle_size=1.0, mass={}, friction={}))
    for before, after in zip(scene.bodies, found.bodies, strict=True):
        assert (after.mass, after.friction) == (before.mass, before.friction)
        assert (after.T_world_body == before.T_world_body).all() and (after.inertia == before.inertia).all()


CHEAP = {name: bound for name, bound in BOUNDS.items() if name not in PHYSICS}
SOME = st.fixed_dictionaries({}, optional={name: ranges(name, 6.0) for name in CHEAP})
ACTIONS = np.random.default_rng(8).uniform(-1, 1, (8, 7)).astype(np.float32)


def rolled(env: SuturingEnv) -> np.ndarray:
    """Observations and rewards of the same actions, and the start of the episode after them."""
    seen = [np.append(*env.step(action)[:2]) for action in ACTIONS]
    return np.array([*seen, np.append(env.reset()[0], 0.0)])


@settings(max_examples=3, deadline=None)
@given(config=SOME, seed=st.integers(0, 2**31))
def test_one_seed_is_one_episode_that_can_be_kept(config: dict[str, list[float]], seed: int) -> None:
    """Two environments are alike to the bit; one that goes on from a moment does so with what is on its way."""
    envs = [SuturingEnv("reach", randomise=config) for _ in range(2)]
    starts = [env.reset(seed=seed) for env in envs]
    assert (starts[0][0] == starts[1][0]).all()
    assert starts[0][1]["randomisation"] == starts[1][1]["randomisation"]
    for action in ACTIONS:
        first, second = (env.step(action) for env in envs)
        assert (first[0] == second[0]).all() and first[1] == second[1]
    state = envs[0].save()
    expected = rolled(envs[0])
    assert envs[0].restore(state) == pytest.approx(first[0])
    for duplicate in (copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))):
        envs[0].restore(state)
        other = duplicate(envs[0])
        np.testing.assert_allclose(rolled(other), expected, atol=1e-12)  # a restore may turn what stands by a last bit
        other.close()
    for env in envs:
        env.close()


def test_another_world_in_each_episode_can_be_kept_too() -> None:
    """Masses and the needle differ: an environment in the next episode goes back to the one before, to the bit."""
    ranges = {"mass": [0.7, 1.4], "friction": [0.8, 1.2], "needle_size": [0.9, 1.1]}
    env = SuturingEnv("pick", randomise=ranges)
    _, info = env.reset(seed=5)
    drawn = info["randomisation"]
    env.step(ACTIONS[0])
    state = env.save()
    first = [env.step(action)[0] for action in ACTIONS]
    mass = env.simulation.scene.bodies[env.needle].mass
    _, info = env.reset()
    assert info["randomisation"]["mass"] != drawn["mass"]
    assert env.simulation.scene.bodies[env.needle].mass != mass
    env.restore(state)
    assert env.randomisation == drawn
    np.testing.assert_allclose([env.step(action)[0] for action in ACTIONS], first, atol=1e-12)
    env.close()


@settings(max_examples=30)
@given(names=st.lists(st.sampled_from(sorted(BOUNDS)), min_size=1, max_size=6))
def test_a_file_that_states_a_range_twice_is_refused(
    tmp_path_factory: pytest.TempPathFactory, names: list[str]
) -> None:
    path = tmp_path_factory.mktemp("twice") / "randomise.yaml"
    path.write_text("".join(f"{name}: [{BOUNDS[name].most:g}, {BOUNDS[name].most:g}]\n" for name in names))
    if len(set(names)) == len(names):
        assert Randomisation.of(path) is not None
    else:
        with pytest.raises(ValueError, match=f"{path} .*line .* is already in line .*; keep one of them"):
            Randomisation.of(path)


def test_the_size_of_a_needle_is_drawn_where_there_is_one() -> None:
    """Nor is anything drawn for masses where no body is free."""
    for task, expected in (("peg_transfer", {"mass"}), ("pick", {"mass", "needle_size"}), ("reach", {"needle_size"})):
        env = SuturingEnv(task, randomise={"needle_size": [0.9, 1.1], "mass": [1.0, 2.0]})
        drawn = env.reset(seed=1)[1]["randomisation"]
        env.close()
        assert set(drawn) == expected | {"noise_seed"}


def test_the_documents_list_the_limits_of_all_ranges() -> None:
    text = (ROOT / "docs" / "learning.md").read_text()
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]+ to [^|]+ \| [^|]+) \|$", text, re.M))
    assert rows == {
        name: f"{'whole numbers from ' * bound.whole}{bound.least:g} to {bound.most:g} | {bound.unit}"
        for name, bound in BOUNDS.items()
    }


def test_a_state_of_other_ranges_is_refused_with_those_that_differ() -> None:
    envs = [
        SuturingEnv("reach", randomise={"light": [1, 1], "exposure": [0, 1], **more})
        for more in ({}, {"light": [1, 2]})
    ]
    envs[0].reset(seed=1)
    with pytest.raises(ValueError) as error:
        envs[1].restore(envs[0].save())
    assert str(error.value) == "the state has randomise with light=[1.0, 1.0], not light=[1.0, 2.0]"
    for env in envs:
        env.close()


def test_without_ranges_nothing_is_drawn() -> None:
    """The same bits as an environment that knows nothing of it, whatever ``randomise`` is called."""
    plain, none, empty = SuturingEnv("reach"), SuturingEnv("reach", randomise=None), SuturingEnv("reach", randomise={})
    first, info = plain.reset(seed=3)
    assert (none.reset(seed=3)[0] == first).all() and "randomisation" not in info and plain.randomisation == {}
    assert set(empty.reset(seed=3)[1]["randomisation"]) == {"noise_seed"}
    for env in (plain, none, empty):
        env.close()


@pytest.mark.parametrize("delay", [0, 3])
def test_actions_arrive_late_by_as_many_as_were_drawn(delay: int) -> None:
    env = SuturingEnv("reach", randomise={"action_delay": [delay, delay]})
    env.reset(seed=2)
    begin, up = env.setpoint, np.array([0, 0, 1, 0, 0, 0, 0], dtype=np.float32)
    moved = []
    for _ in range(6):
        env.step(up)
        moved.append(round(float(np.linalg.norm(env.setpoint[:3] - begin[:3])) / 0.001))
    env.close()
    assert moved == [max(k + 1 - delay, 0) for k in range(6)]


@pytest.mark.parametrize("delay", [1, 4])
def test_observations_come_late_and_rewards_do_not(delay: int) -> None:
    env, late = SuturingEnv("reach", randomise={}), SuturingEnv("reach", randomise={"observation_delay": [delay] * 2})
    seen = [env.reset(seed=2)[0]]
    found = [late.reset(seed=2)[0]]
    for action in ACTIONS:
        now, then = env.step(action), late.step(action)
        seen.append(now[0])
        found.append(then[0])
        assert now[1] == then[1]
    env.close()
    late.close()
    for k, observation in enumerate(found):
        assert (observation[:30] == seen[max(k - delay, 0)][:30]).all()


@settings(max_examples=10)
@given(seed=st.integers(0, 2**31), arms=st.integers(1, 2))
def test_noise_has_the_spread_that_was_drawn_and_touches_nothing_else(seed: int, arms: int) -> None:
    drawn = Drawn(seed, joint_noise=0.01, position_noise=0.002, angle_noise=0.05)
    channel, state = Channel(drawn, arms), np.zeros(52 + 33 * (arms - 1))
    state[20] = 1.0
    errors = np.array([channel.sense(state) - state for _ in range(1500)])
    joints = [k for start in (0, 52)[:arms] for k in (start, start + 1, *range(start + 3, start + 7))]
    assert errors[:, joints].std(axis=0) == pytest.approx(0.01, rel=0.15)
    assert errors[:, 14:17].std(axis=0) == pytest.approx(0.002, rel=0.15)
    assert 2.0 * errors[:, 17:20].std(axis=0) == pytest.approx(0.05, rel=0.15)
    assert (errors[:, 30:33] == errors[:, 14:17]).all()
    others = sorted({*range(errors.shape[1])} - {*joints, *range(14, 21), *range(30, 33)})
    assert not errors[:, others].any()


LOOKS = {
    "light": [0.3, 0.5], "colour": [0.4, 1.6], "camera_shift": [0.004, 0.006], "camera_turn": [0.02, 0.03],
    "field_of_view": [0.8, 0.9], "exposure": [0.5, 0.8], "picture_noise": [0.02, 0.04], "light_shift": [0.03, 0.05],
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(LOOKS))
def test_pictures_show_what_was_drawn(name: str) -> None:
    """Each range alone changes the picture, the same way for one seed, and an episode later the range of it is anew."""
    plain = SuturingEnv("reach", observation="image", size=(64, 48))
    expected = plain.reset(seed=4)[0].astype(float)
    plain.close()
    envs = [SuturingEnv("reach", observation="image", size=(64, 48), randomise={name: LOOKS[name]}) for _ in range(2)]
    pictures = [env.reset(seed=4)[0] for env in envs]
    again = envs[0].reset()[0]
    for env in envs:
        env.close()
    assert (pictures[0] == pictures[1]).all()
    assert np.abs(pictures[0] - expected).mean() > 0.5, name
    assert (pictures[0] != again).any()


def test_darker_lights_make_darker_pictures() -> None:
    means = []
    for factor in (0.3, 1.0, 2.0):
        env = SuturingEnv("reach", observation="image", randomise={"light": [factor] * 2})
        means.append(env.reset(seed=4)[0].mean())
        env.close()
    assert means[0] < 0.9 * means[1] and means[1] < means[2]


def test_experts_do_their_task_in_other_worlds() -> None:
    """Moderate ranges of what a hospital differs in: masses, friction, the needle."""
    env = SuturingEnv(
        "insert", max_steps=300, randomise={"mass": [0.8, 1.25], "friction": [0.85, 1.2], "needle_size": [0.97, 1.03]}
    )
    done = []
    for seed in range(4):
        observation, info = env.reset(seed=seed)
        for action in EXPERTS["insert"](Hand(env), observation):
            *_, ended, _, info = env.step(action.astype(np.float32))
            if ended:
                break
        done.append(info["is_success"])
    env.close()
    assert sum(done) >= 3, done


WITH_NEEDLES = sorted(task for task, goal in GOALS.items() if goal.scene != "ligating" and task != "peg_transfer")


@settings(max_examples=12, deadline=None)
@given(task=st.sampled_from(WITH_NEEDLES), size=st.floats(0.8, 1.2), seed=st.integers(0, 2**31))
@example(task="insert", size=0.85, seed=0)
@example(task="suture", size=0.9, seed=1)
@example(task="hand_over", size=0.8, seed=2)
@example(task="insert", size=0.8, seed=0)
def test_a_needle_of_any_size_is_in_the_hand_that_the_task_says_or_the_reset_is_refused(
    task: str, size: float, seed: int
) -> None:
    """Before, hands held small needles beyond their end, or by the thread, and episodes were lost as they began."""
    env = SuturingEnv(task, randomise={"needle_size": [size, size]})
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("ligature.environments.suturing.TRIES", 2)
            _, info = env.reset(seed=seed)
    except ValueError as error:
        assert size < 0.92 and "no episode can begin in 2 draws: PSM2 has no grasp of the needle" in str(error)
    else:
        grasping = [number for number in range(len(env.arms)) if env.goal.holds(number)]
        assert grasping == ([] if env.goal.grasping is None else [env.goal.grasping]) and not info["lost"]
        for _ in range(6):
            *_, info = env.step(np.zeros(env.action_space.shape))
            assert not info["lost"]
    finally:
        env.close()


def test_what_cannot_begin_is_drawn_again() -> None:
    """Needles that are too short for the throw are in the range; a grasp that is lost as an episode begins counts too."""
    env = SuturingEnv("insert", randomise={"needle_size": [0.8, 0.9]})
    sizes = [env.reset(seed=seed)[1]["randomisation"]["needle_size"] for seed in range(4)]
    env.close()
    assert all(0.83 < size <= 0.9 for size in sizes)
    plain = SuturingEnv("insert")
    plain.goal.grasping = None
    with pytest.raises(ValueError, match="no episode can begin in 20 draws: the jaws of PSM2 hold Needle"):
        plain.reset(seed=1)
    with pytest.raises(RuntimeError, match="no episode has begun"):
        plain.step(np.zeros(7))
    plain.goal.grasping = 0
    assert plain.reset(seed=1)[0][49] == 1.0
    plain.close()


def test_gymnasium_makes_them_and_vectors_take_them() -> None:
    env = gymnasium.make("ligature/Reach-v0", randomise={"action_delay": [1, 2]})
    _, info = env.reset(seed=1)
    env.close()
    assert info["randomisation"]["action_delay"] in (1, 2)
    with pytest.raises(ValueError, match="the state has randomise"):
        plain, other = SuturingEnv("reach"), SuturingEnv("reach", randomise={"mass": [1.0, 1.1]})
        plain.reset(seed=1)
        other.restore(plain.save())
