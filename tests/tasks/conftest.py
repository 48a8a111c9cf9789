"""A made-up task: a needle that is driven along its arc through pairs of holes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from ligature.model.frames import axis_rotation, frame, matrix_pose7
from ligature.tasks.scenery import Scenery

RADIUS = 0.01
PAIRS = 4
GAP = 0.008
NEEDLE, FIRST_ENTRY, FIRST_EXIT = 0, 1, 1 + PAIRS


def hole_poses() -> np.ndarray:
    """Poses of all bodies: needle, entries at x = 0, exits at x = GAP, 20 mm apart in y; z along the suture's way."""
    poses = np.zeros((1 + 2 * PAIRS, 7))
    poses[:, 6] = 1.0
    for k in range(PAIRS):
        poses[FIRST_ENTRY + k, :3] = 0.0, 0.02 * k, 0.0
        poses[FIRST_EXIT + k, :3] = GAP, 0.02 * k, 0.0
    return poses


def drive(pair: int, steps: int = 60, turn: float = np.pi) -> Iterator[np.ndarray]:
    """Poses while a half circle is turned through a pair: down the entry, up the exit."""
    centre = np.array([GAP / 2, 0.02 * (pair - 1), np.sqrt(RADIUS**2 - (GAP / 2) ** 2)])
    for angle in np.linspace(0.0, turn, steps):
        poses = hole_poses()
        R = axis_rotation((0, 1, 0), -angle)
        poses[NEEDLE] = matrix_pose7(frame(R, centre))
        yield poses


@pytest.fixture
def scenery() -> Scenery:
    """Needle points in a body frame at the arc's centre; the tip begins above the entry's side."""
    points = RADIUS * np.array([[0.0, 0, 1.0], [1.0, 0, 0.0], [-1.0, 0, 0.0]])
    points[1] = RADIUS * np.array([np.cos(np.pi / 4), 0, np.sin(np.pi / 4)])
    entries, exits = tuple(range(FIRST_ENTRY, FIRST_EXIT)), tuple(range(FIRST_EXIT, FIRST_EXIT + PAIRS))
    return Scenery(NEEDLE, points, entries, exits, (), ())
