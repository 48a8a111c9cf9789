"""Compiled code that calls Bullet itself and PyBullet's functions drive, push and read the same, to the bit."""

from __future__ import annotations

import errno
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import IO, Any

import ligature
import numpy as np
import pybullet
import pytest
from ligature import Simulation
from ligature.model.scene import Scene
from ligature.physics import bullet, engine

from tests.conftest import ROOT
from tests.driving import Driver


@pytest.fixture(scope="module", params=["suturing_small", "needle_pick"])
def scene(request: pytest.FixtureRequest) -> Scene:
    return ligature.load(ROOT / "scenes" / request.param / "launch.yaml")


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """No client of PyBullet is found in memory."""
    with monkeypatch.context() as patch:
        patch.setattr(bullet._Clients, "begin", 0)
        yield patch


def test_without_a_handle_pybullet_gets_and_gives_the_same_numbers(scene: Scene, plain: pytest.MonkeyPatch) -> None:
    runs = []
    for found in (False, True):
        if found:
            plain.undo()
        simulation = Simulation(scene)
        assert bool(simulation._world.engine.motions.handle) == found
        Driver(scene, 11).run(simulation, 0, 150)
        taken = simulation.snapshot()
        Driver(scene, 12).run(simulation, 150, 200)
        before = simulation.state_hash()
        simulation.restore(taken)
        Driver(scene, 12).run(simulation, 150, 200)
        runs.append((before, simulation.state_hash()))
        simulation.close()
    assert runs[0] == runs[1]


def test_each_client_has_a_handle_of_its_own_and_none_once_it_is_gone() -> None:
    clients = [bullet.connect() for _ in range(4)]
    handles = [handle for _, handle in clients]
    assert len(set(handles)) == 4 and 0 not in handles
    gone, kept = clients[1], clients[2]
    pybullet.disconnect(gone[0])
    assert bullet._handle(gone[0]) == 0
    assert bullet._handle(kept[0]) == kept[1]
    again = bullet.connect()
    assert again[0] == gone[0], "PyBullet gives the number away again"
    assert again[1] and again[1] not in handles[2:]
    for client, _ in (clients[0], *clients[2:], again):
        pybullet.disconnect(client)


@pytest.mark.parametrize("unread", ["/proc/self/maps", "/proc/self/mem"])
def test_what_could_not_be_read_once_is_read_for_the_next_client(unread: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a process that had no file left when it made its first simulation."""

    def read(path: str, *rest: Any, **more: Any) -> IO[Any]:
        if path == unread:
            raise OSError(errno.EMFILE, "too many open files", path)
        return open(path, *rest, **more)

    for name in ("begin", "kind"):
        monkeypatch.setattr(bullet._Clients, name, None)
    with monkeypatch.context() as patch:
        patch.setattr(bullet, "open", read, raising=False)
        first = bullet.connect()
        assert first[1] == 0 and not bullet._is_client(8)
    second = bullet.connect()
    assert second[1] and bullet._handle(first[0])
    for client, _ in (first, second):
        pybullet.disconnect(client)


@pytest.mark.parametrize("address", [0, 4, 8, -8, 1 << 70, 0xFFFFFFFFFFFFFFF8])
def test_no_address_without_a_client_passes_for_one(address: int) -> None:
    assert not bullet._is_client(address)
    words = np.arange(4)
    assert not bullet._is_client(words.ctypes.data)


@pytest.mark.parametrize("name", ["suturing_small", "needle_pick", "peg_transfer"])
def test_boxes_that_touch_nothing_are_left_out_and_change_no_bit(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = ligature.load(ROOT / "scenes" / name / "launch.yaml")
    runs = []
    for left_out in (False, True):
        with monkeypatch.context() as patch:
            if not left_out:
                patch.setattr(engine, "exclude_void", lambda boxes: 0)
            simulation = Simulation(scene)
            places, hashes = simulation._world.engine, []
            for moment in range(3):
                assert places._boxes, "the broad phase is where this version of PyBullet keeps it"
                boxes = bullet._boxes(places._boxes)
                void = (boxes["group"] == 0) & (boxes["mask"] == 0)
                assert void.any() and not void.all()
                assert (boxes["owner"] == 0).tolist() == (void.tolist() if left_out else [False] * len(boxes))
                Driver(scene, 20 + moment).run(simulation, 0, 100)
                hashes.append(simulation.state_hash())
                if moment == 0:
                    simulation.restore(simulation.snapshot())
                else:
                    simulation.reset()
            runs.append(hashes)
            simulation.close()
    assert runs[0] == runs[1]


@pytest.fixture
def two_balls() -> Iterator[tuple[int, int, list[int]]]:
    """Client, handle and the two balls in it, one in the other, where all boxes are compared."""
    client, handle = bullet.connect()
    pybullet.resetSimulation(pybullet.RESET_USE_SIMPLE_BROADPHASE, physicsClientId=client)
    balls = []
    for x in (0.0, 0.1):
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.1, physicsClientId=client)
        balls.append(pybullet.createMultiBody(1.0, shape, basePosition=[x, 0, 0], physicsClientId=client))
    yield client, handle, balls
    pybullet.disconnect(client)


def test_a_body_touches_again_once_its_mask_is_set(two_balls: tuple[int, int, list[int]]) -> None:
    client, handle, (one, other) = two_balls
    found = bullet.find_boxes(handle)
    assert found and bullet.exclude_void(found) == 0

    def touching() -> int:
        pybullet.stepSimulation(physicsClientId=client)
        return len(pybullet.getContactPoints(one, other, physicsClientId=client))

    assert touching()
    pybullet.setCollisionFilterGroupMask(other, -1, 0, 0, physicsClientId=client)
    assert bullet.exclude_void(found) == 1 and not touching() and not touching()
    pybullet.setCollisionFilterGroupMask(other, -1, 1, -1, physicsClientId=client)
    assert bullet.exclude_void(found) == 0 and touching()
    pybullet.setCollisionFilterGroupMask(other, -1, 0, 0, physicsClientId=client)
    bullet.exclude_void(found)
    pybullet.stepSimulation(physicsClientId=client)
    pybullet.removeBody(other, physicsClientId=client)
    shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.1, physicsClientId=client)
    other = pybullet.createMultiBody(1.0, shape, basePosition=[0, 0.1, 0], physicsClientId=client)
    assert touching(), "a new body in the place of one that was left out"


def found_elsewhere() -> list[tuple[int, ...]]:
    """Offsets of other versions of PyBullet with which a broad phase is found all the same.

    Run it in a process with no other client: before one in memory may be another one, whose broad phase is true.
    """
    client, handle = bullet.connect()
    pybullet.resetSimulation(pybullet.RESET_USE_SIMPLE_BROADPHASE, physicsClientId=client)
    shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.1, physicsClientId=client)
    pybullet.createMultiBody(1.0, shape, physicsClientId=client)
    known, found = tuple(bullet._TO_BROAD_PHASE), []
    for place in range(len(known)):
        for shift in (0, -0x1000, -64, -8, 8, 16, 64, 0x100, 0x10000):
            bullet._TO_BROAD_PHASE = tuple(offset + shift * (k == place) for k, offset in enumerate(known))
            if bullet.find_boxes(handle):
                found.append(bullet._TO_BROAD_PHASE)
    return found


def test_nothing_is_left_out_where_the_broad_phase_is_not_found() -> None:
    trees, other = bullet.connect()
    shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.1, physicsClientId=trees)
    pybullet.createMultiBody(1.0, shape, physicsClientId=trees)
    assert bullet.find_boxes(other) == 0, "trees of boxes"
    pybullet.disconnect(trees)
    assert bullet.find_boxes(0) == 0
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as alone:
        found = alone.submit(found_elsewhere).result(timeout=120)
    assert set(found) == {tuple(bullet._TO_BROAD_PHASE)}, "another version of PyBullet"
    assert bullet.exclude_void(0) == 0
