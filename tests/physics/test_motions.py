"""Poses and velocities of links, by our own forward kinematics, are those that Bullet has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pybullet
from ligature import Simulation

ARM = """
multibody:
bodies: [BODY base, BODY swing, BODY slide, BODY hand]
joints: [JOINT one, JOINT two, JOINT three]
BODY base: {name: base, mass: 0}
BODY swing:
  {name: swing, mass: 1, inertia: {ix: 0.1, iy: 0.1, iz: 0.1}, inertial offset: {position: {x: 0.1, y: 0.02, z: 0.3},
   orientation: {r: 0.3, p: 0.1, y: 0.7}}}
BODY slide:
  {name: slide, mass: 1, inertia: {ix: 0.1, iy: 0.1, iz: 0.1}, inertial offset: {position: {x: 0, y: 0.2, z: 0.1},
   orientation: {r: 0.3, p: 0.5, y: 0}}}
BODY hand:
  {name: hand, mass: 1, inertia: {ix: 0.1, iy: 0.1, iz: 0.1}, inertial offset: {position: {x: 0.1, y: 0, z: 0},
   orientation: {r: 0, p: 0, y: 0}}}
JOINT one:
  {name: one, parent: BODY base, child: BODY swing, type: revolute, parent axis: {x: 0, y: 0.6, z: 0.8},
   parent pivot: {x: 0.1, y: 0.2, z: 0.3}, child axis: {x: 0, y: 1, z: 0}, child pivot: {x: 0, y: 0.1, z: 0}}
JOINT two:
  {name: two, parent: BODY swing, child: BODY slide, type: prismatic, parent axis: {x: 1, y: 0, z: 0},
   parent pivot: {x: 0, y: 0, z: 0.3}, child axis: {x: 0, y: 0, z: 1}, child pivot: {x: 0, y: 0, z: 0.2},
   joint limits: {low: -1, high: 1}}
JOINT three:
  {name: three, parent: BODY slide, child: BODY hand, type: revolute, parent axis: {x: 1, y: 0, z: 0},
   parent pivot: {x: 0, y: 0.3, z: 0}, child axis: {x: 0, y: 0, z: 1}, child pivot: {x: 0, y: 0, z: 0}}
"""


def test_links_of_a_moving_arm_are_where_the_engine_has_them(simulate: Callable[[str], Simulation]) -> None:
    simulation = simulate(ARM)
    world = simulation._world
    rng = np.random.default_rng(3)
    for joint in simulation.joints.values():
        world.set_joint_position(joint.joint.index, rng.uniform(-0.8, 0.8), rng.uniform(-2.0, 2.0))
    simulation.step(7)
    checked = 0
    for body, place in world.engine.place_of.items():
        if place.link >= 0:
            found = pybullet.getLinkState(place.uid, place.link, 1, 1, physicsClientId=world.engine.client)
            pose, twist = world.motion(body)
            q = np.array(found[1]) * np.sign(np.dot(found[1], pose[3:]))
            np.testing.assert_allclose(pose, [*found[0], *q], atol=1e-12)
            np.testing.assert_allclose(twist, [*found[6], *found[7]], atol=1e-11)
            assert np.abs(twist[3:]).max() > 0.1
            checked += 1
    assert checked == 3
    simulation.close()


def test_forces_on_links_reach_the_joints_by_virtual_work(simulate: Callable[[str], Simulation]) -> None:
    simulation = simulate(ARM)
    world, motions = simulation._world, simulation._world.engine.motions
    rng = np.random.default_rng(5)
    joints = [joint.joint.index for joint in simulation.joints.values()]
    q = rng.uniform(-0.8, 0.8, size=3)
    motions.force[:] = rng.normal(size=motions.force.shape)
    motions.force[0] = 0.0

    def work(q: np.ndarray) -> float:
        for joint, value in zip(joints, q, strict=True):
            world.set_joint_position(joint, value)
        motions.links(0)
        return float((motions.force * motions.pose[:, :3]).sum())

    slope = [(work(q + 1e-6 * step) - work(q - 1e-6 * step)) / 2e-6 for step in np.eye(3)]
    work(q)
    motions.push[:] = 0.0
    motions.apply_gravity(0)
    np.testing.assert_allclose(motions.push, slope, atol=1e-7)
    assert np.abs(slope).min() > 0.01
    simulation.close()


def test_bodies_on_joints_fall_with_their_own_gravity(simulate: Callable[[str], Simulation]) -> None:
    """A slider under a gravity that most bodies of the scene do not have."""
    text = """
multibody:
bodies: [BODY base, BODY slide, BODY a, BODY b]
joints: [JOINT down]
BODY base: {name: base, mass: 0}
BODY slide:
  {name: slide, mass: 2, inertia: {ix: 0.1, iy: 0.1, iz: 0.1}, gravity: {x: 0, y: 0, z: -3.0},
   damping: {linear: 0, angular: 0}}
BODY a: {name: a, mass: 1, inertia: {ix: 0.1, iy: 0.1, iz: 0.1}, gravity: {x: 0, y: 0, z: 0}}
BODY b: {name: b, mass: 1, inertia: {ix: 0.1, iy: 0.1, iz: 0.1}, gravity: {x: 0, y: 0, z: 0}}
JOINT down:
  {name: down, parent: BODY base, child: BODY slide, type: prismatic, parent axis: {x: 0, y: 0.6, z: 0.8},
   parent pivot: {x: 0, y: 0, z: 0}, child axis: {x: 0, y: 0.6, z: 0.8}, child pivot: {x: 0, y: 0, z: 0},
   joint limits: {low: -10, high: 10}, enable motor: false}
"""
    simulation = simulate(text)
    simulation.step(500)
    joint = next(iter(simulation.joints.values()))
    # semi-implicit steps fall half a tick's speed further than g t²/2
    assert abs(joint.position + 0.5 * 3.0 * 0.8 * 0.5 * (0.5 + 1e-3)) < 1e-4
    assert abs(joint.velocity + 3.0 * 0.8 * 0.5) < 1e-4
    simulation.close()
