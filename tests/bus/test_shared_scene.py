"""The scene that physics has loaded reaches the other processes as it is, when all of it is there."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from ligature import Simulation, load
from ligature.bus import BusError
from ligature.bus.shared_scene import share_scene, shared_scene
from ligature.model.state import state_dtype

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@pytest.fixture
def shared() -> Iterator[int]:
    """Memory of a run."""
    descriptor = os.memfd_create("scene")
    yield descriptor
    os.close(descriptor)


def _never() -> bool:
    return False


@pytest.mark.parametrize("name", ["suturing_small", "soft_suturing", "peg_transfer"])
def test_the_scene_of_the_others_is_that_of_physics(name: str, shared: int) -> None:
    scene = load(SCENES / name / "launch.yaml")
    share_scene(shared, scene)
    for _ in range(2):  # one that starts again gets it, too
        found = shared_scene(shared, _never)
        assert repr(found) == repr(scene)
        assert state_dtype(found) == state_dtype(scene)


def test_the_scene_moves_with_the_same_bits(shared: int) -> None:
    scene = load(SCENES / "needle_pick" / "launch.yaml")
    share_scene(shared, scene)
    hashes = []
    for each in (scene, shared_scene(shared, _never)):
        with Simulation(each) as simulation:
            simulation.step(100)
            hashes.append(simulation.state_hash())
    assert hashes[0] == hashes[1]


def test_it_is_taken_when_all_of_it_is_there(shared: int) -> None:
    scene = load(SCENES / "suturing_small" / "launch.yaml")
    found = []
    waiting = threading.Thread(target=lambda: found.append(shared_scene(shared, _never)))
    waiting.start()
    os.pwrite(shared, b"a part", 8)
    waiting.join(0.05)
    assert waiting.is_alive()
    share_scene(shared, scene)
    waiting.join(10.0)
    assert [len(each.bodies) for each in found] == [len(scene.bodies)]


def test_a_wait_ends_when_it_is_asked_to(shared: int) -> None:
    with pytest.raises(BusError, match="no physics process has loaded the scene"):
        shared_scene(shared, lambda: True)
