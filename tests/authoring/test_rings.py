"""Capsules along the edges of holes, against circles and squares."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.authoring.rings import capsules_along, edge_loops


def test_runs_of_edges_are_put_in_order() -> None:
    found = edge_loops([(3, 1), (1, 2), (2, 3), (7, 8), (9, 8), (9, 10)])
    assert found[0] == ([7, 8, 9, 10], False)
    run, closed = found[1]
    assert closed and sorted(run) == [1, 2, 3]


def test_edges_that_branch_are_refused() -> None:
    with pytest.raises(ValueError, match="the edges branch"):
        edge_loops([(0, 1), (0, 2), (0, 3)])


def test_a_square_gets_a_capsule_on_each_side_that_ends_in_its_corners() -> None:
    square = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], dtype=float)
    found = capsules_along(square, True, 12, 0.1)
    assert len(found) == 4
    for (shape, T), a, b in zip(found, square, np.roll(square, -1, axis=0), strict=True):
        half = shape.height / 2.0 - shape.radius
        np.testing.assert_allclose(T[:3, 3] - half * T[:3, 2], a, atol=1e-12)
        np.testing.assert_allclose(T[:3, 3] + half * T[:3, 2], b, atol=1e-12)


def test_a_circle_of_many_edges_is_cut_into_few_equal_capsules() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 240, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(240)])
    found = capsules_along(circle, True, 8, 0.05)
    lengths = [shape.height - 0.1 for shape, _ in found]
    np.testing.assert_allclose(lengths, 2.0 * np.sin(np.pi / 8), rtol=1e-4)
    np.testing.assert_allclose([np.linalg.norm(T[:3, 3]) for _, T in found], np.cos(np.pi / 8), rtol=1e-4)


def test_an_open_run_has_no_last_side() -> None:
    assert len(capsules_along(np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0)], dtype=float), False, 9, 0.1)) == 2
    with pytest.raises(ValueError, match="no length"):
        capsules_along(np.zeros((3, 3)), True, 4, 0.1)
