"""The challenge's own scene: a needle of half a kilogram in the jaws of its PSM."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.model.frames import matrix_pose7, pose7_matrix

DEPTH = 0.003
"""Distance in metres of the wire from the fingers' axis: further out these jaws do not close on it."""

PIECE = 4
"""Convex piece of the needle that is taken."""


LIGHTER = 0.01
"""Of the thread, whose 1.2 kg would turn and draw the needle out: 12 N at 13 mm from the pads."""


def test_the_jaws_of_the_corpus_hold_its_needle_when_lifted_and_shaken(corpus: Path) -> None:
    """Closed with 0.19 N m a finger: 60 N, friction for 30 N, while weight and shaking pull with 7 N: it may not slip."""
    scene = ligature.load(corpus / "suturing_scene" / "launch.yaml", models=[10, 11, 6, 7, 8, 9])
    bodies = [
        replace(body, mass=LIGHTER * body.mass, inertia=LIGHTER * body.inertia)
        if body.index in scene.rod_bodies
        else body
        for body in scene.bodies
    ]
    scene = replace(scene, bodies=tuple(bodies))
    sim = Simulation(scene)
    world, jaw, arm = sim._world, scene.jaws[0], sim.arms["PSM1"]
    arm.enable()
    arm.home()
    while arm.is_busy or not arm.is_homed:
        sim.step(20)
    arm.servo_jaw([0.4])
    sim.step(300)
    needle = sim.bodies["Needle"]
    pieces = [part.shape.vertices for part in needle.body.colliders]
    middles = [0.5 * (points.min(axis=0) + points.max(axis=0)) for points in pieces]
    along = middles[PIECE + 1] - middles[PIECE - 1]
    along /= np.linalg.norm(along)
    H = pose7_matrix(world.motion(jaw.palm)[0])
    fingers = [pose7_matrix(world.motion(finger)[0])[:3, 1] for finger in jaw.fingers]
    axis, pivot = H[:3, :3] @ jaw.axis, H[:3, :3] @ jaw.pivot + H[:3, 3]
    way = fingers[0] + fingers[1] - (fingers[0] + fingers[1]) @ axis * axis
    way /= np.linalg.norm(way)
    local = np.column_stack([along, np.cross([0, 0, 1], along), [0, 0, 1]])
    T = np.eye(4)
    T[:3, :3] = np.column_stack([axis, np.cross(way, axis), way]) @ local.T
    T[:3, 3] = pivot + DEPTH * way - T[:3, :3] @ middles[PIECE]
    at = matrix_pose7(T)
    needle.set_pose(at)
    needle.command_pose(at)
    sim.step(800)
    arm.push_jaw([-0.19])
    for _ in range(200):
        sim.step()
        if sim.grasps["PSM1"] is not None:
            break
    assert sim.grasps["PSM1"] is not None
    assert sim.grasps["PSM1"].normal_force > 40.0
    needle.release()
    sim.step(300)
    height, start = needle.pose[2], arm.joints.setpoint[0].copy()
    for k in range(100):
        arm.servo_jp(start + [0, 0, -0.05 * (k + 1) / 100, 0, 0, 0])
        sim.step(10)
    assert needle.pose[2] > height + 0.03
    sim.step(300)
    hanging, begin = sim.grasps["PSM1"].slip, sim.time
    lifted = arm.joints.setpoint[0].copy()
    while sim.time - begin < 5.0:
        arm.servo_jp(lifted + [0, 0, 0.02 * np.sin(4 * np.pi * (sim.time - begin)), 0, 0, 0])
        sim.step(5)
        assert sim.grasps["PSM1"] is not None, f"lost after {sim.time - begin:.2f} s"
    assert sim.grasps["PSM1"].slip == pytest.approx(hanging, abs=1e-9)
    assert sim.grasps["PSM1"].share < 0.8
