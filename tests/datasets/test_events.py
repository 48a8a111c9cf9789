"""Events of a dataset are there when they happened, and at no other sample: against geometry and Bullet's own contacts."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import pybullet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.datasets import DatasetWriter
from ligature.datasets.events import ARM_EVENTS, NEEDLE_EVENTS
from ligature.datasets.lerobot import FORMATS, export
from ligature.environments import SuturingEnv
from ligature.environments.experts import EXPERTS
from ligature.environments.hand import OPEN, Hand

from tests.environments.cheats import CHEATS

Array = np.ndarray


class Moment(NamedTuple):
    """What a sample shows: what each arm grasps, what each tool touches, the needle's tip, its lowest height."""

    held: tuple[int, ...]
    met: tuple[set[int], ...]
    tip: Array
    low: float


class Rolled(NamedTuple):
    """An episode: what was there at each sample, and the events that the dataset has of it, by arm and of the needle."""

    moments: list[Moment]
    arms: list[Array]
    needle: Array

    def of_arm(self, arm: int, name: str) -> list[int]:
        """Samples at which something happened to an arm."""
        return np.flatnonzero(self.arms[arm][:, ARM_EVENTS.index(name)]).tolist()

    def of_needle(self, name: str) -> list[int]:
        """Samples at which something happened to the needle."""
        return np.flatnonzero(self.needle[:, NEEDLE_EVENTS.index(name)]).tolist()


def looked(env: SuturingEnv) -> Moment:
    """What is there now, from what the simulation reports elsewhere than the dataset reads it."""
    simulation = env.simulation
    engine = simulation._world.engine
    grasps = [simulation.grasps[arm.name] for arm in env.arms]
    pairs = [
        (engine.body_at[c[1], c[3]], engine.body_at[c[2], c[4]])
        for c in pybullet.getContactPoints(physicsClientId=engine.client)
        if c[8] <= 0.0 and (c[1], c[3]) in engine.body_at and (c[2], c[4]) in engine.body_at
    ]
    met = []
    for arm in env.arms:
        jaw = next(jaw for jaw in simulation.scene.jaws if jaw.name == arm.name)
        tool = {jaw.palm, *jaw.fingers}
        met.append({b for a, b in pairs + [(b, a) for a, b in pairs] if a in tool and b not in tool})
    held = tuple(-1 if grasp is None else grasp.body for grasp in grasps)
    points = env.goal.scenery.needle_points(simulation.state["body_pose"][0])
    return Moment(held, tuple(met), points[2], float(points[:, 2].min()))


def rolled(env: SuturingEnv, path: Path, policy: Callable[[Hand, Any], Iterator[Array]], seed: int) -> Rolled:
    """Record an episode, a sample for each action."""
    path.unlink(missing_ok=True)
    observation, _ = env.reset(seed=seed)
    moments = []
    with DatasetWriter(path, env.simulation, (), rate=50.0) as writer:
        assert writer.sample()
        moments.append(looked(env))
        for action in policy(Hand(env), observation):
            _, _, ended, _, _ = env.step(np.asarray(action, dtype=np.float32))
            assert writer.sample()
            moments.append(looked(env))
            if ended:
                break
    with h5py.File(path) as file:
        episode = file["episode_0000"]
        arms = [episode[f"arms/{arm.name}/events"][:] for arm in env.arms]
        assert episode["needle/events"].attrs["axes"] == ", ".join(NEEDLE_EVENTS)
        return Rolled(moments, arms, episode["needle/events"][:])


@pytest.fixture(scope="module", params=["pick", "insert", "puncture", "hand_over", "suture"])
def env(request: pytest.FixtureRequest) -> Iterator[SuturingEnv]:
    made = SuturingEnv(request.param, max_steps=None)
    yield made
    made.close()


def check_arms(found: Rolled) -> None:
    """Each event of an arm is one of the two samples that it lies between, and none is missing."""
    for arm, events in enumerate(found.arms):
        assert not events[0].any()
        for k in range(1, len(events)):
            before, now = found.moments[k - 1], found.moments[k]
            was, held = before.held[arm], now.held[arm]
            grasp, release, contact = events[k].astype(bool)
            assert grasp == (held >= 0 and held != was)
            assert release == (was >= 0 and held != was)
            assert contact == bool(now.met[arm] - before.met[arm] - {held})


def test_an_experts_deed_has_its_events(env: SuturingEnv, tmp_path: Path) -> None:
    found = rolled(env, tmp_path / "data.h5", EXPERTS[env.task], 3)
    check_arms(found)
    assert found.of_needle("drop") == []
    if env.task == "pick":
        assert len(found.of_arm(0, "grasp")) == 1 and found.of_arm(0, "release") == []
        assert found.of_needle("puncture") == found.of_needle("exit") == []
        return
    if env.task == "hand_over":
        (taken,), (left,) = found.of_arm(1, "grasp"), found.of_arm(0, "release")
        assert taken < left and found.of_arm(1, "release") == []
        return
    entry, exit = env.goal._places
    (inward,), (outward,) = found.of_needle("puncture"), found.of_needle("exit")
    assert inward < outward
    for k, place in ((inward, entry), (outward, exit)):
        assert np.linalg.norm(found.moments[k].tip - place) < 0.004
    if env.task == "suture":
        (taken,), (left,) = found.of_arm(1, "grasp"), found.of_arm(0, "release")
        assert outward < taken < left


@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_whatever_arms_do_events_are_what_happened(
    env: SuturingEnv, tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    """A random walk that opens and shuts its jaws, and that starts from what an expert has done for a while."""
    rng = np.random.default_rng(seed)

    def wander(hand: Hand, observation: Any) -> Iterator[Array]:
        for _, action in zip(range(int(rng.integers(120))), EXPERTS[env.task](hand, observation), strict=False):
            yield action
        for _ in range(3):
            push = rng.uniform(-1.0, 1.0, env.action_space.shape)
            for _ in range(20):
                yield push

    found = rolled(env, tmp_path_factory.mktemp("events") / "data.h5", wander, seed)
    check_arms(found)
    for k in found.of_needle("drop"):
        needle = env.needle
        assert needle in found.moments[k - 1].held and needle not in found.moments[k].held


def test_a_needle_that_is_let_go_is_dropped_and_falls(tmp_path: Path) -> None:
    env = SuturingEnv("pick", max_steps=None)
    found = rolled(env, tmp_path / "data.h5", next(p for p in CHEATS["pick"] if p.__name__ == "toss"), 3)
    (grasped,), (released,), (dropped,) = found.of_arm(0, "grasp"), found.of_arm(0, "release"), found.of_needle("drop")
    assert grasped < released == dropped
    for _ in range(20):
        env.step(np.r_[np.zeros(6), OPEN].astype(np.float32))
    assert looked(env).low < found.moments[dropped].low - 0.01
    env.close()


def test_a_needle_that_tissue_has_is_released_and_not_dropped(tmp_path: Path) -> None:
    env = SuturingEnv("insert", max_steps=None)
    found = rolled(env, tmp_path / "data.h5", next(p for p in CHEATS["insert"] if p.__name__ == "leave_it_in"), 3)
    env.close()
    assert len(found.of_needle("puncture")) == 1 and len(found.of_arm(0, "release")) == 1
    assert found.of_needle("drop") == []


@pytest.mark.parametrize("format", FORMATS)
def test_an_export_lists_the_events(format: str, tmp_path: Path) -> None:
    env = SuturingEnv("hand_over", max_steps=None)
    found = rolled(env, tmp_path / "data.h5", EXPERTS["hand_over"], 3)
    env.close()
    export(tmp_path / "data.h5", tmp_path / "export", format, log=lambda _: None)
    lines = [json.loads(line) for line in (tmp_path / "export/meta/events.jsonl").read_text().splitlines()]
    (taken,), (left,) = found.of_arm(1, "grasp"), found.of_arm(0, "release")
    giver, taker = (arm.name for arm in env.arms)
    for k, event, who in ((taken, "grasp", taker), (left, "release", giver)):
        wanted = {"episode_index": 0, "frame_index": k, "timestamp": k / 50.0, "event": event, "of": who}
        assert lines.count(wanted) == 1
    assert len(lines) == sum(int(events.sum()) for events in (*found.arms, found.needle))
    assert [line["frame_index"] for line in lines] == sorted(line["frame_index"] for line in lines)
