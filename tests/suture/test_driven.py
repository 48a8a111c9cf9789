"""A light body that a client drives, with a thread on it, on our small scene."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from ligature import Simulation, load

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SMALL = SCENES / "suturing_small" / "launch.yaml"
TIP_IN_ENTRY = np.array([0.0335893825, 0.27, 0.7155273, -0.302078873, 0.639334306, 0.639334306, 0.302078873])
"""Pose of the needle of `suturing` with its tip in the first entry, pointing down."""


@pytest.fixture
def sim() -> Simulation:
    return Simulation(load(SMALL))


def first_gap(sim: Simulation) -> float:
    """Distance from the needle to the first element of its thread, metres."""
    chain = sim.scene.rods[0]
    return float(np.linalg.norm(sim.state["body_pose"][0, chain.bodies[0], :3] - sim.bodies["Needle"].pose[:3]))


def test_a_driven_needle_takes_the_commanded_pose_whatever_its_thread_pulls(sim: Simulation) -> None:
    sim.step(100)
    gap = first_gap(sim)
    target = [0.005, 0.2, 0.765, 0.0, 0.0, math.sin(0.5), math.cos(0.5)]
    sim.bodies["Needle"].command_pose(target)
    sim.step(2500)
    assert sim.bodies["Needle"].pose == pytest.approx(target, abs=1e-4)
    assert first_gap(sim) == pytest.approx(gap, abs=2e-4)  # the thread came along


def test_a_driven_needle_keeps_the_commanded_velocity(sim: Simulation) -> None:
    sim.step(100)
    sim.bodies["Needle"].command_twist([0.0, 0.0, 0.02, 0.0, 0.0, 0.3])
    before = sim.bodies["Needle"].pose
    sim.step(1000)
    after = sim.bodies["Needle"].pose
    assert after[2] - before[2] == pytest.approx(0.02, abs=2e-4)
    assert 2 * math.atan2(after[5], after[6]) == pytest.approx(0.3, abs=5e-3)


def test_a_needle_that_is_let_go_hangs_on_its_thread_again(sim: Simulation) -> None:
    needle = sim.bodies["Needle"]
    needle.command_pose([0.005, 0.2, 0.765, 0.0, 0.0, 0.0, 1.0])
    sim.step(1000)
    needle.command_wrench([0.0] * 6)
    sim.step(300)
    assert needle.pose[2] < 0.75


def test_a_needle_controlled_through_a_hole_and_out_again_falls_with_its_own_mass() -> None:
    """While it is commanded in a hole nothing moves it; that must not last, or its thread throws it at 20 m/s."""
    sim = Simulation(load(SCENES / "suturing" / "launch.yaml", models=[0, 1]))
    needle = sim.bodies["Needle"]
    inserted = 0
    for height, ticks in ((0.04, 1000), (0.0, 600), (-0.003, 300), (0.0, 300), (0.04, 600)):
        needle.command_pose([*TIP_IN_ENTRY[:2], TIP_IN_ENTRY[2] + height, *TIP_IN_ENTRY[3:]])
        sim.step(ticks)
        inserted += len(sim.insertions)
    assert inserted and not sim.insertions
    needle.release()
    rod = sim._suture.rods.rods[0]
    sim.step()
    assert rod.nodes.mass[rod.node_of[needle.body.index]] == needle.body.mass
    top_speed = 0.0
    for _ in range(150):
        sim.step(10)
        top_speed = max(top_speed, float(np.linalg.norm(needle.twist[:3])))
    assert top_speed < 1.5
    assert needle.pose[2] == pytest.approx(0.715, abs=0.015)
    assert not [problem for problem in sim.problems if problem.code == "diverged"]
