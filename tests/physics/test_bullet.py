"""Compiled code that calls Bullet itself and PyBullet's functions drive, push and read the same, to the bit."""

from __future__ import annotations

from collections.abc import Iterator

import ligature
import numpy as np
import pybullet
import pytest
from ligature import Simulation
from ligature.model.scene import Scene
from ligature.physics import bullet

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


@pytest.mark.parametrize("address", [0, 4, 8, -8, 1 << 70, 0xFFFFFFFFFFFFFFF8])
def test_no_address_without_a_client_passes_for_one(address: int) -> None:
    assert not bullet._is_client(address)
    words = np.arange(4)
    assert not bullet._is_client(words.ctypes.data)
