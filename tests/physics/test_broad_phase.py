"""What spares Bullet the comparison of all boxes changes no bit, and stands back where memory looks otherwise."""

from __future__ import annotations

from collections.abc import Iterator

import ligature
import numpy as np
import pybullet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.model.scene import Scene
from ligature.physics import bullet, objects
from ligature.physics.broad_phase import MOST, SIMPLE, BroadPhase

from tests.conftest import ROOT
from tests.driving import Driver

BALLS = 8


@pytest.fixture(scope="module", params=["suturing_small", "needle_pick"])
def scene(request: pytest.FixtureRequest) -> Scene:
    return ligature.load(ROOT / "scenes" / request.param / "launch.yaml")


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """No broad phase is found in memory."""
    with monkeypatch.context() as patch:
        patch.setattr(objects, "part", lambda handle, kind: 0)
        yield patch


def test_bullet_alone_moves_a_scene_with_the_same_bits(scene: Scene, alone: pytest.MonkeyPatch) -> None:
    runs = []
    for found in (False, True):
        if found:
            alone.undo()
        simulation = Simulation(scene)
        assert simulation._world.engine.broad_phase.active == found
        Driver(scene, 5).run(simulation, 0, 150)
        taken = simulation.snapshot()
        Driver(scene, 6).run(simulation, 150, 250)
        before = simulation.state_hash()
        simulation.restore(taken)
        Driver(scene, 6).run(simulation, 150, 250)
        runs.append((before, simulation.state_hash()))
        simulation.close()
    assert runs[0] == runs[1]


def world(balls: int = BALLS) -> tuple[int, int]:
    """A client that compares all pairs, with balls far from each other, and its handle."""
    client, handle = bullet.connect()
    pybullet.resetSimulation(pybullet.RESET_USE_SIMPLE_BROADPHASE, physicsClientId=client)
    shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.5, physicsClientId=client)
    for k in range(balls):
        pybullet.createMultiBody(1.0, shape, basePosition=[3.0 * k, 0.0, 0.0], physicsClientId=client)
    return client, handle


def touching(client: int) -> set[tuple[int, int]]:
    return {(p[1], p[2]) for p in pybullet.getContactPoints(physicsClientId=client) or ()}


moves = st.tuples(st.just("move"), st.integers(0, BALLS - 1), st.integers(0, 2 * BALLS))
filters = st.tuples(st.just("filter"), st.integers(0, BALLS - 1), st.integers(0, BALLS - 1), st.integers(0, 1))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.lists(st.one_of(moves, filters), max_size=4), max_size=8))
def test_balls_touch_as_in_a_client_that_is_left_alone(ticks: list[list[tuple[str, int, int]]]) -> None:
    (one, handle), (other, _) = world(), world()
    broad_phase = BroadPhase(handle)
    assert broad_phase.active
    for acts in ticks:
        for act, ball, *rest in acts:
            for client in (one, other):
                if act == "move":
                    at = [0.9 * rest[0], 0.0, 0.0]
                    pybullet.resetBasePositionAndOrientation(ball, at, [0, 0, 0, 1], physicsClientId=client)
                else:
                    pybullet.setCollisionFilterPair(ball, rest[0], -1, -1, rest[1], physicsClientId=client)
            if act == "filter":
                broad_phase.forget()
        for client in (one, other):
            pybullet.stepSimulation(physicsClientId=client)
        assert touching(one) == touching(other)
        for ball in range(BALLS):
            poses = [pybullet.getBasePositionAndOrientation(ball, physicsClientId=client) for client in (one, other)]
            assert poses[0] == poses[1]
    for client in (one, other):
        pybullet.disconnect(client)


def test_it_looks_only_where_boxes_begin_or_cease_to_overlap() -> None:
    client, handle = world()
    broad_phase = BroadPhase(handle)
    seen, together = broad_phase._boxes.seen, broad_phase._boxes.meet
    pybullet.stepSimulation(physicsClientId=client)
    assert seen.tolist() == [BALLS - 1, 0, 0] and not together.any()
    pybullet.resetBasePositionAndOrientation(1, [0.9, 0.0, 0.0], [0, 0, 0, 1], physicsClientId=client)
    pybullet.stepSimulation(physicsClientId=client)
    assert seen.tolist() == [BALLS - 1, 1, 0] and together.sum() == 1
    broad_phase._boxes.own[0] = 0  # a call of it would end this process
    for _ in range(10):
        pybullet.stepSimulation(physicsClientId=client)
    assert touching(client) == {(0, 1)}
    pybullet.disconnect(client)


def test_a_world_beyond_its_arrays_is_bullets_own() -> None:
    client, handle = world(MOST + 1)
    assert not BroadPhase(handle).active
    pybullet.disconnect(client)
    client, handle = world(MOST)
    broad_phase = BroadPhase(handle)
    assert broad_phase.active
    shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.5, physicsClientId=client)
    pybullet.createMultiBody(1.0, shape, basePosition=[0.5, 0.0, 0.0], physicsClientId=client)
    pybullet.stepSimulation(physicsClientId=client)
    assert touching(client) == {(0, MOST)}
    pybullet.disconnect(client)


def test_trees_of_boxes_are_left_alone() -> None:
    client, handle = bullet.connect()
    assert objects.part(handle, SIMPLE) == 0
    assert not BroadPhase(handle).active and not BroadPhase(0).active
    pybullet.disconnect(client)


def test_a_layout_that_differs_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    client, handle = world()
    for name, other in (("STRIDE", 112), ("NUMBER", 24), ("LOW", 56), ("PAIRS", 40), ("HANDLES", 40)):
        with monkeypatch.context() as patch:
            patch.setattr(f"ligature.physics.broad_phase.{name}", other)
            if name == "LOW":
                patch.setattr("ligature.physics.broad_phase.HIGH", 24)
            assert not BroadPhase(handle).active, name
    assert BroadPhase(handle).active
    pybullet.disconnect(client)


@given(st.integers(-(1 << 70), 1 << 70))
def test_no_address_names_a_class_by_chance(address: int) -> None:
    assert objects.class_of(address) == ""


def test_an_object_without_a_name_has_no_class() -> None:
    words = np.zeros(8, dtype=np.int64)
    words[0], words[1], words[3] = words.ctypes.data + 16, words.ctypes.data + 24, words.ctypes.data
    assert objects.class_of(words.ctypes.data) == ""
    assert len(objects.words(0, 4)) == 0 and objects.word(-8) is None
