"""No environment pays for less than its deed: policies that cheat fail, and experts who do the deed succeed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.environments import SuturingEnv
from ligature.environments.experts import CORRECTING, EXPERTS, Policy, demonstrate
from ligature.environments.goals import GOALS
from ligature.environments.hand import JAW, SHUT, Hand
from ligature.environments.layout import HELD

from tests.environments.cheats import CHEATS, MOST, QUICK, described, most, roll

OPENING = 48
"""The number of an observation that has the set-point of the jaw."""

TABLE = Path(__file__).resolve().parents[2] / "docs" / "cheats.md"


LONG = ("first_throw", "knot_tie", "suture")
"""Environments whose episodes take long to compute: the slow tests have them."""


@pytest.fixture(
    scope="module",
    params=[pytest.param(task, marks=pytest.mark.slow) if task in LONG else task for task in sorted(CHEATS)],
)
def env(request: pytest.FixtureRequest) -> Iterator[SuturingEnv]:
    made = SuturingEnv(request.param, max_steps=most(request.param))
    yield made
    made.close()


def task_of(env: SuturingEnv) -> str:
    return next(name for name, goal in GOALS.items() if type(env.goal) is goal)


def test_every_environment_has_three_cheats_and_an_expert() -> None:
    assert set(CHEATS) == set(EXPERTS) == set(GOALS)
    assert min(len(cheats) for cheats in CHEATS.values()) >= 3


def test_the_expert_does_the_deed_and_what_comes_after_pays_nothing_more(env: SuturingEnv) -> None:
    found = roll(env, EXPERTS[task_of(env)], 11)
    assert found.success, found
    assert found.total == pytest.approx(found.deed, abs=1e-9)
    for k in range(30):  # let go, and move away
        action = np.where(np.arange(env.action_space.shape[0]) % 7 == JAW, 1.0, 0.3 * (k % 2))
        _, reward, ended, _, info = env.step(action)
        assert reward == 0.0 and ended and info["is_success"]


def test_no_cheat_succeeds(env: SuturingEnv) -> None:
    for policy in CHEATS[task_of(env)][-QUICK:]:
        found = roll(env, policy, 3)
        assert not found.success, (policy.__name__, found)
        assert found.total < found.deed - 1.0, (policy.__name__, found)


@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_dense_reward_is_what_is_gained_of_the_way_so_that_no_circle_pays(env: SuturingEnv, seed: int) -> None:
    """The sum of rewards is the way that is shorter now, whatever was done between, also over saves and restores."""
    rng = np.random.default_rng(seed)
    _, info = env.reset(seed=seed)
    begin, total, kept = info["distance"], 0.0, None
    for k in range(60):
        _, reward, ended, _, info = env.step(rng.uniform(-1.0, 1.0, env.action_space.shape))
        total += reward
        assert total == pytest.approx(100.0 * (begin - info["distance"]) + info["is_success"], abs=1e-9)
        if k == 20:
            kept = env.save(), total, info["distance"]
        if k == 40 and kept is not None:
            state, total, left = kept
            env.restore(state)
            assert env._progress is not None and env._progress.left == left
        if ended:
            break


@pytest.mark.slow
def test_blind_search_by_reward_finds_no_success(env: SuturingEnv) -> None:
    """From each moment the best of four random pushes, by dense reward: tasks with a needle want more than that."""
    if env.task == "reach":
        return
    rng = np.random.default_rng(3)
    _, info = env.reset(seed=3)
    for _ in range(40):
        start, best = env.save(), None
        for _ in range(4):
            env.restore(start)
            push, total = rng.uniform(-1.0, 1.0, env.action_space.shape), 0.0
            for _ in range(5):
                _, reward, ended, _, info = env.step(push)
                total += reward
                assert not info["is_success"]
            if not ended and (best is None or total > best[0]):
                best = total, env.save()
        env.restore(start if best is None else best[1])


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_experts_succeed_and_cheats_fail_wherever_the_needle_lies(env: SuturingEnv) -> None:
    task = task_of(env)
    seeds = range(20, 25 if task == "knot_tie" else 40)
    done = [roll(env, EXPERTS[task], seed).success for seed in seeds]
    assert sum(done) >= 0.95 * len(done), dict(zip(seeds, done, strict=True))
    for policy in CHEATS[task]:
        for seed in seeds[: 1 if task == "knot_tie" else 3]:
            assert not roll(env, policy, seed).success, (policy.__name__, seed)


def test_the_documents_list_every_cheat() -> None:
    text = TABLE.read_text("utf-8")
    missing = [described(p) for cheats in CHEATS.values() for p in cheats if f"| {described(p)} |" not in text]
    assert not missing


def lifted(env: SuturingEnv, policy: Policy, seed: int) -> tuple[float, bool]:
    """How high the needle's lowest point came, and whether the thread was ever held."""
    observation, _ = env.reset(seed=seed)
    hand, highest, held = Hand(env), 0.0, False
    start = env.goal.scenery.needle_points(env._simulation.state["body_pose"][0])[:, 2].min()
    thread = env._simulation.scene.rod_bodies
    for action in policy(hand, observation):
        env.step(np.asarray(action, dtype=np.float32))
        now = env.goal.scenery.needle_points(env._simulation.state["body_pose"][0])[:, 2].min()
        highest = max(highest, float(now - start))
        held = held or int(env._simulation.state["jaw_body"][0, 0]) in thread
    return highest, held


def test_the_thread_really_lifts_the_needle() -> None:
    """The cheat does what it claims: otherwise that it fails would show nothing."""
    env = SuturingEnv("pick", max_steps=MOST)
    policy = next(p for p in CHEATS["pick"] if p.__name__ == "lift_by_thread")
    highest, held = lifted(env, policy, 3)
    env.close()
    assert held and highest > 0.02


def test_a_needle_must_be_held_for_half_a_second() -> None:
    """It is done half a second after the needle is up, not before: 25 actions."""
    env = SuturingEnv("pick", max_steps=MOST)
    observation, _ = env.reset(seed=3)
    hand, shares = Hand(env), []
    for action in EXPERTS["pick"](hand, observation):
        observation, _, ended, _, info = env.step(np.asarray(action, dtype=np.float32))
        shares.append(observation[50])
        if ended:
            break
    env.close()
    assert info["is_success"]
    up = np.flatnonzero(np.array(shares) > 0.0)
    assert len(up) == 25 and up[-1] == len(shares) - 1
    assert np.diff(shares[-25:]) == pytest.approx(0.04)


def test_a_dropped_needle_ends_the_episode() -> None:
    for task in ("pick", "insert"):
        env = SuturingEnv(task, max_steps=MOST, reward="sparse")
        policy = next(p for p in CHEATS[task] if p.__name__ in ("toss", "let_go"))
        found = roll(env, policy, 3)
        env.close()
        assert found.lost == "the needle was dropped"
        assert found.steps < MOST / 2 and found.total == 0.0


def test_an_open_hand_ends_no_episode_in_which_nothing_was_lifted() -> None:
    env = SuturingEnv("pick")
    env.reset(seed=3)
    hand = Hand(env)
    for action in hand.stay(30, 0.8):
        *_, ended, _, info = env.step(np.asarray(action, dtype=np.float32))
        assert not ended and not info["lost"]
    env.close()
    assert SHUT < 0.0


@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 10**6), noise=st.floats(0.0, 0.3))
def test_what_an_expert_does_follows_from_where_things_are(env: SuturingEnv, seed: int, noise: float) -> None:
    """One that is asked for the first time at any moment answers as one does that has acted since the beginning."""
    if env.task not in CORRECTING:
        return
    answers, count = [], iter(range(MOST))

    def look(observation: np.ndarray, action: np.ndarray) -> None:
        if next(count) % 10 == 0:
            answers.append((action, next(EXPERTS[env.task](Hand(env), observation))))

    demonstrate(env, seed, noise, look)
    assert len(answers) > 1
    for whole, anew in answers:
        np.testing.assert_allclose(whole, anew, rtol=0.0, atol=1e-9)


def test_an_expert_corrects_a_policy_that_acts_in_its_stead(env: SuturingEnv) -> None:
    """A policy that does nothing leaves the arm where it is: the expert has the same answer again and again."""

    def stay(_: np.ndarray) -> np.ndarray:
        return np.zeros(env.action_space.shape)

    if env.task not in CORRECTING:
        with pytest.raises(ValueError, match=f"the expert of '{env.task}' cannot correct a policy"):
            demonstrate(env, 5, 0.3, lambda *_: None, stay)
        return
    answers: list[np.ndarray] = []
    steps, info = demonstrate(env, 5, 0.3, lambda _, action: answers.append(action[:6]), stay)
    assert steps == len(answers) == MOST and not info["is_success"]
    np.testing.assert_allclose(answers[1:50], np.tile(answers[0], (49, 1)), atol=0.02)


def test_an_expert_whose_jaws_slip_shows_what_to_do_with_jaws_that_shut_on_nothing() -> None:
    """It opens them again, and picks the needle up."""
    env = SuturingEnv("pick", max_steps=MOST)
    for slips in (False, True):
        shown: list[tuple[bool, float, float]] = []

        def look(seen: np.ndarray, action: np.ndarray, shown: list[tuple[bool, float, float]] = shown) -> None:
            shown.append((bool(seen[HELD]), float(seen[OPENING]), float(action[JAW])))

        _, info = demonstrate(env, 5, 0.1, look, slips=slips)
        held, opening, jaw = map(np.array, zip(*shown, strict=True))
        opened = np.maximum.accumulate(opening) > 0.5
        assert bool((opened & ~held & (opening < 0.2) & (jaw > 0.0)).any()) == slips
        assert info["is_success"]
    env.close()
