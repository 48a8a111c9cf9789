"""Efforts of motors that are known before Bullet solves, and motors at stops."""

from __future__ import annotations

from typing import Any

import ligature
import numpy as np
import pybullet
import pytest
from ligature import Simulation

DT = 1e-3


def psm(sim: Simulation) -> tuple[Any, Any, Any, int]:
    """The engine, its arrays, and the tree of the first arm."""
    engine = sim._world.engine
    joint = sim.scene.arms[0].joints[0]
    index = next(k for k, tree in enumerate(engine.trees) if any(own == joint for _, own, _, _ in tree.axes))
    return engine, engine.motions.trees, engine.trees[index], index


@pytest.mark.parametrize("seed", range(4))
def test_known_efforts_are_those_of_inverse_dynamics(seed: int) -> None:
    """PyBullet's own inverse dynamics is the judge, at random set-points of a whole PSM with its jaws."""
    sim, rng = Simulation(ligature.load("suturing_small")), np.random.default_rng(seed)
    engine, trees, tree, k = psm(sim)
    rows, links = engine.motions.slices[k], [link for link, *_ in tree.axes]
    arm = sim.arms[sim.scene.arms[0].name]
    arm.enable()
    sim.step(20)
    arm.home()
    sim.step(2000)
    aim = arm.measured_js().position
    way = rng.uniform(-1, 1, len(aim))
    compared = 0
    for tick in range(40):
        arm.servo_jp(aim + 1e-7 * tick**2 * way)  # gently: half of a motor's strength is known ahead at most
        before = pybullet.getJointStates(tree.uid, links, physicsClientId=engine.client)
        q, u = (np.array([state[what] for state in before]) for what in (0, 1))
        sim.step()
        foreseen, change = trees.foreseen[rows], trees.change[rows]
        if not foreseen.any():
            continue
        wanted = pybullet.calculateInverseDynamics(
            tree.uid, q.tolist(), u.tolist(), (change / DT).tolist(), physicsClientId=engine.client
        )
        assert foreseen == pytest.approx(np.array(wanted), rel=1e-6, abs=1e-9)
        compared += 1
    assert compared > 5
    sim.close()
