"""Workers of Ray that are killed change nothing of what is collected, nor does a training that is killed and resumed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ligature.environments import MAX_STEPS, SuturingEnv

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SCRIPT = EXAMPLES / "scale_out.py"


@pytest.fixture(scope="module")
def scale_out() -> Iterator[Any]:
    """The example as a module, with a local cluster of two whose workers find it."""
    ray = pytest.importorskip("ray")
    sys.path.insert(0, str(EXAMPLES))
    import scale_out

    where = {"PYTHONPATH": str(EXAMPLES)}
    ray.init(num_cpus=2, include_dashboard=False, object_store_memory=100_000_000, runtime_env={"env_vars": where})
    yield scale_out
    ray.shutdown()
    sys.path.remove(str(EXAMPLES))


@pytest.mark.slow
def test_a_killed_worker_is_replaced_and_its_episodes_are_rolled_again(scale_out: Any) -> None:
    """What two workers collect, one of them killed in the middle, is to the bit what this process rolls alone."""
    import ray

    seeds = range(3, 15)
    workers = [scale_out.Worker.remote("reach", 0.3) for _ in range(2)]
    begun = ray.get([worker.process.remote() for worker in workers])
    rolled = threading.Event()

    def kill() -> None:
        ray.get(workers[0].roll.remote(0, np.empty(0, "u1"), 0))  # it has begun to work
        os.kill(begun[0], signal.SIGKILL)
        rolled.set()

    thread = threading.Thread(target=kill)
    thread.start()
    found = scale_out.collect(workers, 0, np.empty(0, "u1"), seeds)
    thread.join()
    assert rolled.is_set()
    assert len({e.process for e in found} - set(begun)) == 1, "the worker was not replaced"
    env = SuturingEnv("reach", max_steps=MAX_STEPS)
    alone = [scale_out.roll(env, None, seed, 0.3) for seed in seeds]
    env.close()
    for one, other in zip(found, alone, strict=True):
        assert one.success == other.success
        np.testing.assert_array_equal(one.observations, other.observations)
        np.testing.assert_array_equal(one.actions, other.actions)


def learn(policy: Path, *more: str) -> str:
    """Run the example's command."""
    command = [sys.executable, SCRIPT, "reach", policy, "--workers", "1", "--episodes", "2", "--epochs", "1", *more]
    done = subprocess.run(command, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.mark.slow
def test_a_training_that_is_resumed_learns_what_one_without_a_break_does(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    pytest.importorskip("torch")
    whole, broken = tmp_path / "whole.onnx", tmp_path / "broken.onnx"
    learn(whole, "--rounds", "2")
    learn(broken, "--rounds", "1")
    broken.write_bytes(b"what a killed training left")
    assert "round 2: a policy of 2 episodes succeeded" in learn(broken, "--rounds", "2", "--resume")
    with np.load(whole.with_suffix(".npz")) as one, np.load(broken.with_suffix(".npz")) as other:
        for name in one.files:
            np.testing.assert_array_equal(one[name], other[name], name)
    assert whole.read_bytes() == broken.read_bytes()
    assert whole.with_suffix(".csv").read_text() == broken.with_suffix(".csv").read_text()


def test_without_a_checkpoint_there_is_nothing_to_resume(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    command = [sys.executable, SCRIPT, "reach", tmp_path / "none.onnx", "--resume"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and "nothing to resume: no file" in done.stdout and "none.npz" in done.stdout
