"""Boxes far from all that moves are not compared, which changes no bit: a run that compares all is the judge."""

from __future__ import annotations

import ctypes
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.physics import bullet, engine
from ligature.physics.parking import HIGH, LOW, ROUNDING
from ligature.robots.commands import Adopt, ServoJr

from tests.conftest import ROOT

BALLS, BLOCKS, RESTING = 3, 12, "damping: {linear: 0, angular: 0}, gravity: {x: 0, y: 0, z: 0}"


def _scene(rng: np.random.Generator) -> str:
    """Blocks that rest here and there, some touching, a wall, and balls."""
    wall = "collision shape: BOX, collision geometry: {x: 0.01, y: 0.4, z: 0.2}"
    parts = {"Wall": f"mass: 0, {wall}, location: {{position: {{x: 0.3, y: 0, z: 0}}}}"}
    for k in range(BLOCKS + BALLS):
        at = rng.uniform([-0.2, -0.2, -0.05], [0.2, 0.2, 0.05])
        shape = "collision shape: SPHERE, collision geometry: {radius: 0.01}"
        if k < BLOCKS:
            size = rng.uniform(0.005, 0.05, 3)
            shape = f"collision shape: BOX, collision geometry: {{x: {size[0]}, y: {size[1]}, z: {size[2]}}}"
        name = f"Block{k}" if k < BLOCKS else f"Ball{k - BLOCKS}"
        place = f"location: {{position: {{x: {at[0]}, y: {at[1]}, z: {at[2]}}}}}"
        parts[name] = f"mass: {rng.uniform(0.01, 0.2)}, {shape}, {RESTING}, {place}"
    bodies = "".join(f"{name}: {{name: {name}, {text}}}\n" for name, text in parts.items())
    return f"namespace: /ambf/env/\nbodies: [{', '.join(parts)}]\n{bodies}"


@pytest.mark.parametrize("seed", range(8))
def test_balls_that_fly_among_resting_blocks_hit_the_same(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    (tmp_path / "model.yaml").write_text(_scene(rng), encoding="utf-8")
    scene = ligature.load(tmp_path / "model.yaml")
    first, none = Simulation(scene), np.zeros(0, dtype=np.int64)
    with monkeypatch.context() as patch:
        patch.setattr(engine, "find_owners", lambda boxes: (none, none))
        runs = first, Simulation(scene)
    (boxes, empty), parted = [simulation._world.engine.motions.trees.boxes for simulation in runs], 0
    assert len(boxes.at) == BLOCKS + BALLS + 1 and not len(empty.at)
    for _ in range(30):
        ball, speed = f"Ball{rng.integers(BALLS)}", float(10.0 ** rng.uniform(-2, 1.5))
        way = rng.standard_normal(6)
        twist = speed * way / np.linalg.norm(way[:3])
        at = [*rng.uniform([-0.2, -0.2, -0.05], [0.35, 0.2, 0.05]), 0, 0, 0, 1]
        event, ticks = int(rng.integers(4)), int(rng.integers(1, 40))
        for simulation in runs:
            body = simulation.bodies[ball]
            if event == 0:
                body.set_pose(at)
            elif event == 1:
                simulation.bodies["Wall"].set_pose([*at[:2], 0.3, 0, 0, 0, 1])
            else:
                body.command_twist(twist.tolist())
            simulation.step(ticks)
            body.release()
        parted += int(boxes.parked.sum()) * (not boxes.parked.all())
        assert runs[0].state_hash() == runs[1].state_hash()
    assert parted > 30, "nothing rests while something moves"


@pytest.mark.parametrize("name", ["PAIRS", "FIRST_PAIR"])
def test_all_boxes_are_compared_where_bullet_keeps_its_pairs_elsewhere(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation = Simulation(ligature.load(ROOT / "scenes" / "needle_pick" / "launch.yaml"))
    simulation.step(5)
    boxes = simulation._world.engine._boxes
    at, owners = bullet.find_owners(boxes)
    assert len(at) == len(owners) > 0
    assert len(bullet.find_owners(0)[0]) == 0
    monkeypatch.setattr(bullet, name, getattr(bullet, name) - 8)  # what is there is never an address
    assert len(bullet.find_owners(boxes)[0]) == 0


def test_groups_of_bodies_feel_contacts_whenever_bullet_has_some(tmp_path: Path) -> None:
    """Contacts are not asked for where no pair of boxes may have one: PyBullet, asked in every tick, is the judge."""
    rng, seen = np.random.default_rng(0), set()
    for _ in range(4):
        (tmp_path / "model.yaml").write_text(_scene(rng), encoding="utf-8")
        simulation = Simulation(ligature.load(tmp_path / "model.yaml"))
        wrenches, bodies = simulation._world.wrenches, len(simulation.scene.bodies)
        groups = [(body,) for body in range(bodies)]
        groups += [tuple(rng.choice(bodies, n, replace=False).tolist()) for n in (2, 4, 8)]
        bits = [wrenches.group(group) for group in groups]
        for _ in range(100):
            if rng.random() < 0.1:
                way = rng.standard_normal(6) * 10.0 ** rng.uniform(-2, 1)
                simulation.bodies[f"Ball{rng.integers(BALLS)}"].command_twist(way.tolist())
            simulation.step()
            felt = [bool(wrenches.felt() & bit) for bit in bits]
            assert felt == [wrenches._contacts.touch(wrenches._own(group)) for group in groups]
            seen.add(any(felt))
    assert seen == {True, False}


@pytest.mark.parametrize("seed", range(3))
def test_no_box_moves_farther_in_a_tick_than_its_tree_is_said_to(seed: int) -> None:
    """The boxes that Bullet compares are the judge. Jaws look so much farther for what they may grasp: not too far."""
    simulation = Simulation(ligature.load(ROOT / "scenes" / "suturing_small" / "launch.yaml"))
    rng, shares = np.random.default_rng(seed), list[float]()
    simulation.arms["PSM1"].home()
    simulation.step(200)
    boxes = simulation._world.engine.motions.trees.boxes
    corners = [np.ctypeslib.as_array((ctypes.c_double * (HIGH + 3)).from_address(at)) for at in boxes.at.tolist()]
    for k in range(400):
        if k % 20 == 0:
            step = rng.uniform(-1.0, 1.0, 6) * (0.01, 0.01, 0.005, 0.05, 0.05, 0.05)
            simulation.apply(Adopt(0))
            simulation.apply(ServoJr(0, tuple(step.tolist())))
        before, bound = np.array(corners), boxes.moved.copy()
        simulation.step()
        changed = np.abs(np.array(corners) - before)
        moved = np.maximum(changed[:, LOW : LOW + 3], changed[:, HIGH : HIGH + 3]).max(axis=1)
        assert (moved <= bound[boxes.tree] + ROUNDING).all(), k
        for tree in np.unique(boxes.tree[moved > 1e-5]):
            shares.append(bound[tree] / moved[boxes.tree == tree].max())
    assert len(shares) > 100
    assert np.median(shares) < 10.0
