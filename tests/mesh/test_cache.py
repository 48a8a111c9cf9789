"""Sanitised collision files: by content, whole, and as many hulls in Bullet as were given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ligature.mesh import CollisionCache
from ligature.physics import World  # noqa: F401  (imports Bullet without its banner)

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


@pytest.fixture
def cache(tmp_path: Path) -> CollisionCache:
    return CollisionCache(tmp_path)


def test_equal_content_is_one_file(cache: CollisionCache) -> None:
    first = cache.hulls([CUBE, CUBE + 2])
    assert cache.hulls([CUBE, CUBE + 2]) == first
    assert cache.hulls([CUBE]) != first
    assert [path.suffix for path in cache.folder.iterdir()] == [".obj", ".obj"]


def test_bullet_makes_one_hull_of_each(cache: CollisionCache) -> None:
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    hulls = [CUBE * 0.1 + [i, 0, 0] for i in range(9)]
    shape = pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=str(cache.hulls(hulls)), physicsClientId=client)
    body = pybullet.createMultiBody(1.0, shape, physicsClientId=client)
    gaps = np.array([[i + 0.5, 0.05, 0.05] for i in range(8)])
    inside = np.array([[i + 0.05, 0.05, 0.05] for i in range(9)])

    def hit(points: np.ndarray) -> list[bool]:
        results = pybullet.rayTestBatch(
            (points + [0, 0, 1]).tolist(), (points - [0, 0, 1]).tolist(), physicsClientId=client
        )
        return [r[0] == body for r in results]

    assert not any(hit(gaps)) and all(hit(inside))
    pybullet.disconnect(client)


def test_a_folder_that_cannot_be_written_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    cache = CollisionCache(tmp_path / "file" / "below")
    assert cache.hulls([CUBE]).is_file()
