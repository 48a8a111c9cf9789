"""Threads on the surface of tissue: they lie, are drawn over edges, and push what they lie on."""

from __future__ import annotations

import numpy as np
import pytest

TOP = 0.105


SIZE = (0.11, 0.03, 0.01)


def _thread(kit, pad):
    """A needle that a command holds 2 mm over the pad's left side, its thread along X over the pad."""
    simulation = kit.run(pad, kit.needle(), kit.THREAD)
    needle = simulation.bodies["BODY Needle"]
    rod = simulation.scene.rods[0].bodies
    first, last = simulation.state["body_pose"][0, [rod[0], rod[-1]], :3]
    along = (last - first) / np.linalg.norm(last - first)
    turn = np.arctan2(-along[2], along[0])
    needle.set_pose([0, 0, 0.2, *_about_y(-turn)])
    place = np.array([-0.05, 0.003, TOP + 0.002]) - simulation.state["body_pose"][0, rod[0], :3] + needle.pose[:3]
    needle.set_pose([*place, *_about_y(-turn)])
    needle.command_twist([0] * 6)
    return simulation, needle, list(rod)


def _about_y(angle):
    return [0.0, np.sin(0.5 * angle), 0.0, np.cos(0.5 * angle)]


@pytest.mark.parametrize("material", ["silicone pad", "stomach"])
def test_the_end_of_a_thread_lies_on_tissue_with_its_share_of_the_weight(kit, material):
    simulation, _, rod = _thread(kit, kit.pad(material=material, size=SIZE))
    simulation.step(1500)
    # A beam clamped at the needle: its far end lies.
    height = simulation.state["body_pose"][0, rod[-1], 2] - TOP
    radius = simulation.scene.bodies[rod[0]].colliders[0].shape.radius
    assert -0.1e-3 < height < radius + 0.02e-3
    assert np.abs(simulation.state["body_twist"][0, rod[-10:], :3]).max() < 1e-3
    weight = 9.8 * sum(simulation.scene.bodies[b].mass for b in rod)
    lying = -simulation.state["tissue_wrench"][0, 0, 2]
    assert 0.25 * weight < lying < 0.5 * weight


def test_a_thread_drawn_over_tissue_neither_sinks_nor_leaps(kit):
    simulation, needle, rod = _thread(kit, kit.pad(size=SIZE))
    simulation.step(500)
    needle.command_twist([-0.03, 0.02, -0.004, 0, 0, 0])
    before = simulation.state["body_pose"][0, rod, :3]
    for _ in range(900):
        simulation.step()
        now = simulation.state["body_pose"][0, rod, :3].copy()
        assert np.linalg.norm(now - before, axis=1).max() < 0.5e-3
        before = now
        over = (np.abs(now[:, 0]) < 0.05) & (np.abs(now[:, 1]) < 0.013)
        assert (now[over, 2] > TOP - 1e-3).all()
    assert not simulation.problems
