"""The cameras of a lab's scene, headless: left and right agree with each other by depth, ids and calibration."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.model.frames import inverse, pose7_matrix
from ligature.model.optics import T_CAMERA_OPTICAL
from ligature.render import Frame, unproject

from tests.opengl import opengl

pytestmark = pytest.mark.corpus
NEAR = 0.5
"""Metres within which things are small enough to compare pixel by pixel."""


@pytest.fixture(scope="module")
def simulation(corpus: Path) -> Simulation:
    found = Simulation(ligature.load(corpus / "suturing_scene" / "launch.yaml", (10, 11, 6, 7, 8, 9)))
    found.step(20)
    return found


@pytest.fixture(scope="module")
def pictures(simulation: Simulation) -> tuple[Frame, Frame]:
    with opengl():
        left, right = (simulation.cameras[name].capture() for name in ("cameraL", "cameraR"))
    return left, right


def test_both_eyes_see_needle_thread_and_phantom_in_colour(
    simulation: Simulation, pictures: tuple[Frame, Frame]
) -> None:
    names = simulation.scene.drawn_names
    thread = {simulation.scene.bodies[b].identity.identifier for rod in simulation.scene.rods for b in rod.bodies}
    for frame in pictures:
        seen = {names[number] for number in np.unique(frame.ids[frame.ids > 0]).tolist()}
        assert {"/ambf/env/phantom/BODY Needle", "/ambf/env/phantom/BODY Phantom"} <= seen and thread & seen
        assert frame.rgb.std(axis=(0, 1)).min() > 10
        assert np.isfinite(frame.depth[frame.ids > 0]).all() and np.isinf(frame.depth[frame.ids == 0]).all()


def test_points_of_the_left_picture_are_found_in_the_right_one(
    simulation: Simulation, pictures: tuple[Frame, Frame]
) -> None:
    left, right = (simulation.cameras[name] for name in ("cameraL", "cameraR"))
    points = unproject(pictures[0].depth, left.view())
    rows, columns = np.nonzero(pictures[0].depth < NEAR)
    to_right = inverse(pose7_matrix(right.pose) @ T_CAMERA_OPTICAL) @ pose7_matrix(left.pose) @ T_CAMERA_OPTICAL
    there = points[rows, columns] @ to_right[:3, :3].T + to_right[:3, 3]
    u, v, w = right.calibration().K @ there.T
    u, v = np.rint(u / w).astype(int), np.rint(v / w).astype(int)
    inside = (u >= 0) & (u < 640) & (v >= 0) & (v < 480)
    assert inside.sum() > 50_000
    seen = pictures[1].depth[v[inside], u[inside]]
    agree = np.abs(seen - there[inside, 2]) < 1e-3
    assert agree.mean() > 0.95, "what is not hidden from one eye has one depth for both"
    same = pictures[1].ids[v[inside], u[inside]] == pictures[0].ids[rows[inside], columns[inside]]
    assert same[agree].mean() > 0.98
