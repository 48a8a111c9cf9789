"""Environments in processes are single ones to the bit, say which of them ended, and leave nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.environments import SuturingEnv, SuturingVectorEnv, make_vec

from tests.waiting import stays, until

N, STEPS = 2, 6


@pytest.fixture(scope="module")
def vector() -> Iterator[SuturingVectorEnv]:
    envs = make_vec("reach", N, max_steps=STEPS)
    yield envs
    envs.close()


def actions_of(seed: int, steps: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, N, 7)).astype(np.float32)


def rolled_alone(env: SuturingEnv, seed: int, actions: np.ndarray) -> list[np.ndarray]:
    """What one environment observes, with a reset in the step after the end of an episode."""
    seen, over = [env.reset(seed=seed)[0]], False
    for action in actions:
        if over:
            seen.append(env.reset()[0])
            over = False
        else:
            observation, _, done, cut, _ = env.step(action)
            seen.append(observation)
            over = done or cut
    return seen


@settings(max_examples=6)
@given(seed=st.integers(0, 2**31), steps=st.integers(1, 4 * STEPS))
def test_environments_of_a_vector_are_fresh_single_ones_to_the_bit(
    vector: SuturingVectorEnv, seed: int, steps: int
) -> None:
    """Whatever a vector did before, and over the ends of episodes."""
    actions = actions_of(seed, steps)
    seen = [vector.reset(seed=[seed, seed + 1])[0], *(vector.step(each)[0] for each in actions)]
    for k in range(N):
        env = SuturingEnv("reach", max_steps=STEPS)
        assert np.array_equal(np.array(seen)[:, k], rolled_alone(env, seed + k, actions[:, k]))
        env.close()


def test_an_episode_may_begin_anew_within_the_step_that_ends_one() -> None:
    envs, actions = make_vec("reach", N, autoreset="same step", max_steps=2), actions_of(3, 3)
    envs.reset(seed=5)
    first = envs.step(actions[0])
    then, *_, cut, infos = envs.step(actions[1])
    envs.close()
    assert not first[3].any() and cut.all()
    env = SuturingEnv("reach", max_steps=2)
    env.reset(seed=5)
    last = [env.step(action)[0] for action in actions[:2, 0]][1]
    assert np.array_equal(infos["final_obs"][0], last)
    assert np.array_equal(then[0], env.reset()[0])
    env.close()


def test_episodes_may_begin_only_when_asked() -> None:
    envs, actions = make_vec("reach", N, autoreset="off", max_steps=1), actions_of(3, 2)
    before, _ = envs.reset(seed=5)
    after, *_, cut, _ = envs.step(actions[0])
    again, _ = envs.reset(options={"reset_mask": np.array([True, False])})
    envs.close()
    assert cut.all()
    assert not np.array_equal(again[0], after[0]) and np.array_equal(again[1], after[1])


def gone(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


@pytest.mark.parametrize("when", ["before a step", "within a step", "before a reset"])
def test_a_worker_that_is_killed_is_named_and_the_others_end(when: str) -> None:
    envs = make_vec("reach", N)
    envs.reset(seed=1)
    victim, *others = (process.pid for process in reversed(envs.processes))
    if when == "within a step":
        os.kill(victim, signal.SIGSTOP)
        envs.step_async(actions_of(0, 1)[0])
    os.kill(victim, signal.SIGKILL)
    with pytest.raises(RuntimeError, match=rf"environment 1 of 2 \(process {victim}\) was ended by SIGKILL"):
        if when == "within a step":
            envs.step_wait()
        elif when == "before a step":
            envs.step(actions_of(0, 1)[0])
        else:
            envs.reset()
    assert all(gone(pid) for pid in (victim, *others))
    with pytest.raises(ClosedEnvironmentError):
        envs.reset()
    envs.close()


def test_what_an_environment_raises_names_it_and_ends_all() -> None:
    envs = make_vec("reach", N)
    pids = [process.pid for process in envs.processes]
    with pytest.raises(
        RuntimeError, match=r"environment 1 of 2 raised ValueError: reset takes no options, but got 'easy'"
    ):
        envs.reset(options={"easy": True})
    assert all(gone(pid) for pid in pids)


def test_closing_ends_all_processes_also_after_one_was_killed() -> None:
    for kill in (False, True):
        envs = make_vec("reach", N)
        envs.reset(seed=1)
        pids = [process.pid for process in envs.processes]
        if kill:
            os.kill(pids[0], signal.SIGKILL)
        envs.close()
        assert all(gone(pid) for pid in pids)


WRONG = st.sampled_from([(7,), (3, 7), (1, 7), (2, 6), (2, 8), (2,), (7, 2), (2, 1, 7), (), (0,), (0, 7)]).map(np.zeros)


@settings(max_examples=20)
@given(seed=st.integers(0, 2**31), wrong=WRONG | st.sampled_from([None, "left", {}, [[0.0] * 7, [0.0]], 1j]))
def test_wrong_actions_of_a_vector_are_refused_before_anybody_acts(
    vector: SuturingVectorEnv, seed: int, wrong: object
) -> None:
    """The next action is answered as if nothing had been."""
    actions = actions_of(seed, 2)
    seen = []
    for disturbed in (False, True):
        vector.reset(seed=seed)
        vector.step(actions[0])
        if disturbed:
            with pytest.raises(ValueError, match="actions of 2 environments are 2 by 7 numbers"):
                vector.step(wrong)
        seen.append(vector.step(actions[1])[0])
    assert np.array_equal(*seen)


DREW = """
from ligature.environments import SuturingEnv, make_vec
if __name__ == "__main__":
    env = SuturingEnv("pick", observation="image")
    first = env.reset(seed=1)[0]
    env.close()
    envs = make_vec("pick", 2, observation="image")
    seen = envs.reset(seed=[1, 2])[0]
    envs.close()
    assert (seen[0] == first).all() and (seen[1] != first).any()
    print("drawn")
"""


def test_a_process_that_has_drawn_makes_environments_that_draw(tmp_path: Path) -> None:
    """OpenGL does not work in a child that is forked then."""
    (tmp_path / "drew.py").write_text(DREW)
    done = subprocess.run([sys.executable, tmp_path / "drew.py"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stdout == "drawn\n", done.stderr[-2000:]


MAKER = """
import os, sys, time
from ligature.environments import make_vec
envs = make_vec("reach", 2)
print(*(process.pid for process in envs.processes), flush=True)
time.sleep(600)
"""


def test_no_worker_outlives_who_made_it_however_that_ends() -> None:
    maker = subprocess.Popen([sys.executable, "-c", MAKER], stdout=subprocess.PIPE, encoding="utf-8")
    assert maker.stdout is not None
    pids = [int(text) for text in maker.stdout.readline().split()]
    assert len(pids) == N and not any(gone(pid) for pid in pids)
    maker.kill()
    maker.wait()
    maker.stdout.close()
    until(lambda: all(gone(pid) for pid in pids), "the workers end")


def test_a_server_that_forks_starts_them_too() -> None:
    """Their parent is the server then, which lives on when their maker ends: the default from Python 3.14 on."""
    one = MAKER.replace('"reach", 2', '"reach", 1')
    code = f"import multiprocessing; multiprocessing.set_start_method('forkserver')\n{one}"
    maker = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, encoding="utf-8")
    assert maker.stdout is not None
    pids = [int(text) for text in maker.stdout.readline().split()]
    stays(lambda: len(pids) == 1 and not any(gone(pid) for pid in pids), "the workers work", 1.0)
    maker.kill()
    maker.wait()
    maker.stdout.close()
    until(lambda: all(gone(pid) for pid in pids), "the workers end")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"n": 0}, "n is a number of environments, at least 1, not 0"),
        ({"n": "2"}, "n is a number of environments, at least 1, not '2'"),
        ({"n": 2.0}, "n is a number of environments, at least 1, not 2.0"),
        ({"n": 1, "autoreset": "never"}, "autoreset must be one of 'next step', 'same step', 'off', not 'never'"),
        ({"n": 1, "action": "torque"}, "action must be one of cartesian, joint"),
    ],
)
def test_wrong_options_of_a_vector_are_reported(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_vec("reach", **wrong)  # type: ignore[arg-type]


def test_a_vector_steps_while_its_processes_work() -> None:
    """Sending actions does not wait for what they do."""
    envs = make_vec("reach", N)
    envs.reset(seed=1)
    envs.step(actions_of(0, 1)[0])
    for process in envs.processes:
        os.kill(process.pid, signal.SIGSTOP)
    begin = time.monotonic()
    envs.step_async(actions_of(0, 1)[0])
    assert time.monotonic() - begin < 1.0
    for process in envs.processes:
        os.kill(process.pid, signal.SIGCONT)
    observations, *_ = envs.step_wait()
    envs.close()
    assert np.isfinite(observations).all()
