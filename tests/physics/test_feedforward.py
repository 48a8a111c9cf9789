"""Efforts of motors that are known before Bullet solves, and motors at stops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ligature
import numpy as np
import pybullet
import pytest
from ligature import Simulation
from ligature.model.commands import CommandType

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


@pytest.mark.parametrize("seed", range(4))
def test_jaws_asked_to_close_farther_rest_on_their_stops(seed: int) -> None:
    """While the wrist moves, in free air."""
    sim, rng = Simulation(ligature.load("suturing_small")), np.random.default_rng(seed)
    engine, _, tree, _ = psm(sim)
    arm = sim.arms[sim.scene.arms[0].name]
    fingers = [j for _, j, _, _ in tree.axes if sim.scene.joints[j].low == 0.0 and sim.scene.joints[j].high > 1.0]
    assert len(fingers) == 2
    arm.place_jp([0.0, 0.0, 0.08, 0.0, 0.0, 0.0])
    arm.adopt()
    aim, way, pace = arm.measured_js().position, rng.uniform(-0.05, 0.05, 6), rng.uniform(0.5, 4.0, 6)
    way[2] = 0.0
    arm.jaw.servo_jp([-rng.uniform(0.05, 0.6)])
    q, u = [], []
    for tick in range(600):
        arm.servo_jp(aim + way * (1.0 - np.cos(pace * tick * DT)))
        sim.step()
        q.append(sim.state["joint_position"][0, fingers].copy())
        u.append(sim.state["joint_velocity"][0, fingers].copy())
        assert (sim.state["joint_effort"][0, fingers] < -0.1).all(), "they press on"
    assert np.abs(q).max() < 1e-5 and np.abs(u).max() < 1e-2, "neither thrown through a stop nor back"
    sim.close()


def chain(rng: np.random.Generator) -> str:
    """A model file of one to four light links on hinges and sliders that have stops."""
    count = int(rng.integers(1, 5))
    text = f"bodies: [{', '.join(f'B{k}' for k in range(count + 1))}]\n"
    text += f"joints: [{', '.join(f'J{k}' for k in range(1, count + 1))}]\nB0: {{name: B0, mass: 0}}\n"
    for k in range(1, count + 1):
        x, y, z = rng.normal(size=3)
        axis = f"{{x: {x:.6f}, y: {y:.6f}, z: {z:.6f}}}"
        kind, reach = ("revolute", 1.5) if rng.random() < 0.6 else ("prismatic", 0.2)
        low, high = -rng.uniform(0.05, reach), rng.uniform(0.05, reach)
        text += (
            f"B{k}: {{name: B{k}, mass: {10 ** rng.uniform(-3, -1)}, collision shape: SPHERE, "
            f"collision geometry: {{radius: {10 ** rng.uniform(-2, -1)}}}, collision groups: [{k}]}}\n"
            f"J{k}: {{name: J{k}, type: {kind}, parent: B{k - 1}, child: B{k}, parent axis: {axis}, child axis: {axis}, "
            f"parent pivot: {{x: {rng.uniform(-0.1, 0.1)}, y: {rng.uniform(-0.1, 0.1)}, z: 0}}, "
            f"child pivot: {{x: 0, y: 0, z: {rng.uniform(0.02, 0.2)}}}, joint limits: {{low: {low}, high: {high}}}}}\n"
        )
    return text


@pytest.mark.parametrize("seed", range(24))
def test_joints_driven_into_their_stops_stay_there(seed: int, simulate: Callable[[str], Simulation]) -> None:
    """Whatever chain they belong to."""
    rng = np.random.default_rng(seed)
    sim = simulate(chain(rng))
    joints, state = sim.scene.joints, sim.state
    low, high = np.array([(j.low, j.high) for j in joints]).T
    for _ in range(3):
        speed = rng.uniform(1.0, 3.0, len(joints)) * rng.choice((-1, 1), len(joints))
        stop = np.where(speed > 0, high, low)
        sim.bodies["B0"].command_joints(speed, CommandType.VELOCITY)
        arrived = np.zeros(len(joints), np.bool_)
        for _ in range(3500):
            sim.step()
            q = state["joint_position"][0]
            assert (np.maximum(low - q, q - high) < 3.1e-3).all(), "beyond a stop by less than a tick's way"
            arrived |= np.abs(q - stop) < 1e-4
        assert arrived.all()
        assert np.abs(q - stop).max() < 1e-4 and np.abs(state["joint_velocity"][0]).max() < 1e-2
    sim.close()
