"""A viewpoint turns about what it looks at, and starts where a camera stood."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import matrix_pose7, pose7_matrix
from ligature.model.mounted import camera_frame
from ligature.render.viewpoint import Viewpoint


def look_at(pose: np.ndarray, distance: float) -> np.ndarray:
    T = pose7_matrix(pose)
    return T[:3, 3] - distance * T[:3, 0]


@pytest.mark.parametrize("elevation", [-1.4, -0.3, 0.0, 0.9, 1.5])
def test_a_viewpoint_looks_at_its_focus_with_the_horizon_level(elevation: float) -> None:
    viewpoint = Viewpoint((0.1, -0.2, 0.3), 2.0, azimuth=2.5, elevation=elevation)
    assert look_at(viewpoint.pose, 2.0) == pytest.approx(viewpoint.focus)
    T = pose7_matrix(viewpoint.pose)
    assert T[2, 1] == pytest.approx(0, abs=1e-12) and T[2, 2] > 0


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 1, 0)])
def test_a_viewpoint_starts_where_a_camera_stands(up: tuple[float, ...]) -> None:
    eye, at = np.array([0.3, 0.1, 0.6]), np.array([0.25, 0.05, 0.0])
    viewpoint = Viewpoint.at(
        matrix_pose7(camera_frame(eye, at, np.array(up, dtype=float))), float(np.linalg.norm(eye - at))
    )
    assert viewpoint.focus == pytest.approx(at)
    assert viewpoint.pose[:3] == pytest.approx(eye, abs=1e-9)


def test_a_camera_that_looks_straight_down_keeps_its_up() -> None:
    T = camera_frame(np.array([0.0, 0, 1]), np.zeros(3), np.array([0.0, 1, 0]))
    viewpoint = Viewpoint.at(matrix_pose7(T), 1.0)
    assert pose7_matrix(viewpoint.pose)[:3, 2] @ [0, 1, 0] > 0.99


def test_turning_keeps_focus_and_distance_and_panning_keeps_directions() -> None:
    start = Viewpoint((1.0, 2.0, 3.0), 0.5, 0.3, 0.4)
    turned = start.orbit(1.0, -5.0)
    assert turned.focus == start.focus and look_at(turned.pose, 0.5) == pytest.approx(start.focus)
    moved = start.pan(0.1, 0.0)
    assert np.allclose(moved.pose[3:], start.pose[3:])
    assert moved.pose[:3] - start.pose[:3] == pytest.approx(-0.05 * pose7_matrix(start.pose)[:3, 1])
    assert start.zoom(1).distance == pytest.approx(0.45)
