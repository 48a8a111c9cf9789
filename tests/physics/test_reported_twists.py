"""The twists that a state reports are those with which its poses move, in loops of any kind."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.model.frames import pose7_matrix
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.corpus.test_corpus_scenes import LOOPS
from tests.physics.linkages import KINDS, doubled, linkage

Array = NDArray[np.float64]

TURNING, MOVING = 0.05, 0.01
"""Mean twist (rad/s, m/s) by which a report may differ: a loop that is open by less than 1 µm is not projected."""

SHARE = 0.05
"""The same as a share of the largest speed of the time: a body's path is an arc, whose chords are compared."""

LOCKED = (92, 132, 217, 227)
"""Double parallelograms that roundings lock: a loop of theirs asks for centimetres where it is open by micrometres."""

TICKS, DT = 50, 1e-3


def difference(sim: Simulation, ticks: int = TICKS) -> Array:
    """By how much mean reported twists miss the poses in the coming ``ticks``: (turning, moving), 1 being allowed."""
    moving = [body for body in sim.scene.bodies if not body.static]
    offsets = [body.T_body_inertial for body in moving]
    rows = [body.index for body in moving]
    poses, twists = np.empty((ticks + 1, len(rows), 7)), np.empty((ticks, len(rows), 6))
    poses[0] = sim.state["body_pose"][0, rows]
    for k in range(ticks):
        sim.step()
        poses[k + 1], twists[k] = sim.state["body_pose"][0, rows], sim.state["body_twist"][0, rows]
    worst = np.zeros(2)
    for i, T_body_inertial in enumerate(offsets):
        at = np.array([(pose7_matrix(pose) @ T_body_inertial)[:3, 3] for pose in poses[:, i]])
        turns = Rotation.from_quat(poses[:, i, 3:])
        turned = (turns[1:] * turns[:-1].inv()).as_rotvec().sum(axis=0) / (ticks * DT)
        moved = (at[-1] - at[0]) / (ticks * DT)
        mean, top = twists[:, i].mean(axis=0), np.linalg.norm(twists[:, i].reshape(ticks, 2, 3), axis=2).max(axis=0)
        miss = np.linalg.norm(mean[3:] - turned), np.linalg.norm(mean[:3] - moved)
        worst = np.maximum(worst, (miss[0] / (TURNING + SHARE * top[1]), miss[1] / (MOVING + SHARE * top[0])))
    return worst


def mechanism(number: int, folder: Path) -> Simulation:
    """The linkage of this number: well posed where it is a multiple of 3, else with a joint twice."""
    rng = np.random.default_rng([21, number])
    kind = KINDS[number % len(KINDS)]
    text = linkage(rng, kind, "p2p" if kind == "spatial" else str(rng.choice(("revolute", "p2p"))))
    if number % 3:
        text = doubled(rng, text)
    file = folder / "model.yaml"
    file.write_text("namespace: /ambf/env/\n" + text, encoding="utf-8")
    return Simulation(ligature.load(file))


def misses(numbers: Iterable[int], folder: Path) -> dict[int, Array]:
    """The linkages whose twists are not those of their poses, and by how much."""
    found = {}
    for number in numbers:
        sim = mechanism(number, folder)
        for pause in (0, 100, 300, 500):
            sim.step(pause)
            miss = difference(sim)
            if miss.max() > 1.0:
                found[number] = np.maximum(found.get(number, 0.0), miss)
        sim.close()
    return found


def test_linkages_move_with_the_twists_that_are_reported(tmp_path: Path) -> None:
    assert not misses((*range(13), *LOCKED[:2]), tmp_path)


@pytest.mark.slow
def test_every_linkage_moves_with_the_twists_that_are_reported(tmp_path: Path) -> None:
    assert not misses(range(13, 300), tmp_path)


@pytest.mark.usefixtures("hulls")
@pytest.mark.parametrize("name", LOOPS)
def test_loops_of_others_move_with_the_twists_that_are_reported(name: str, corpus: Path) -> None:
    scene = ligature.load(corpus / "multibodies/descriptions/multi-bodies" / name, roots=[corpus])
    sim = Simulation(scene)
    for pause in (0, 100, 300):
        sim.step(pause)
        assert difference(sim).max() <= 1.0
    sim.close()
