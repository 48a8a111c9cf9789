"""Crossings of holes are found where the frame of every hole has them, and only there."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import pose7_matrix
from ligature.tasks.passages import NEAR, PassageWatch
from ligature.tasks.scenery import Scenery

NEEDLE, ENTRIES, EXITS = 0, (1, 2), (3, 4)


def _crossings(before: np.ndarray, after: np.ndarray) -> set[tuple[int, bool]]:
    """Holes (pair, is an exit) that the tip, the needle's origin, crosses between two moments, hole by hole."""
    found = set()
    for is_exit, holes in ((False, ENTRIES), (True, EXITS)):
        for pair, hole in enumerate(holes, 1):
            at = []
            for poses in (before, after):
                T = pose7_matrix(poses[hole])
                at.append(T[:3, :3].T @ (poses[NEEDLE, :3] - T[:3, 3]))
            near = min(np.abs(point).max() for point in at) <= NEAR
            turns = at[0][2] <= 0.0 < at[1][2] if is_exit else at[0][2] >= 0.0 > at[1][2]
            if near and turns:
                found.add((pair, is_exit))
    return found


@pytest.mark.parametrize("seed", range(8))
def test_the_tip_crosses_the_holes_whose_planes_it_passes_nearby(seed: int) -> None:
    rng = np.random.default_rng(seed)
    watch = PassageWatch(Scenery(NEEDLE, np.zeros((3, 3)), ENTRIES, EXITS, (), ()))
    poses, count = np.zeros((5, 7)), 0
    poses[:, :3], poses[:, 3:] = 0.003 * rng.standard_normal((5, 3)), rng.standard_normal((5, 4))
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1)[:, None]
    for moment in range(300):
        before = poses.copy()
        poses[NEEDLE, :3] = rng.choice([0.003, 0.008]) * rng.uniform(-1.0, 1.0, 3)
        poses[1:, :3] += 1e-4 * rng.standard_normal((4, 3))
        watch.observe(float(moment), poses)
        found = {(p.pair, p.exit) for p in watch.passages[count:]}
        assert len(found) == len(watch.passages) - count
        assert found == (_crossings(before, poses) if moment else set())
        count = len(watch.passages)
    assert count > 30
