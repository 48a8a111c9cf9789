"""Distances between surfaces against geometry done by hand."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.mesh.quality import hausdorff_distance, nearest_points, sample_surface, volume_error
from ligature.mesh.surface import convex_surface

from tests.mesh.shapes import CUBE, ell

L, FACES = ell(1.0)
BOXES = [CUBE * [2, 1, 1], CUBE + [0, 1, 0]]


@pytest.mark.parametrize(
    ("point", "foot"),
    [
        ((0.5, 0.5, 3.0), (0.5, 0.5, 1.0)),
        ((0.5, 0.5, 0.9), (0.5, 0.5, 1.0)),
        ((3.0, 0.5, 3.0), (1.0, 0.5, 1.0)),
        ((2.0, 2.0, 2.0), (1.0, 1.0, 1.0)),
        ((0.2, 0.5, 0.5), (0.0, 0.5, 0.5)),
    ],
    ids=["face", "from inside", "edge", "corner", "another face"],
)
def test_the_nearest_point_of_a_cube(point: tuple[float, ...], foot: tuple[float, ...]) -> None:
    assert nearest_points(np.array([point]), *convex_surface(CUBE))[0][0] == pytest.approx(foot)


def test_samples_lie_on_the_surface_evenly() -> None:
    points, chosen = sample_surface(L, FACES, 8000, np.random.default_rng(0))
    assert np.abs(points - nearest_points(points, L, FACES)[0]).max() < 1e-12
    a, b, c = (L[FACES[chosen, i]] for i in range(3))
    assert np.abs(np.einsum("ij,ij->i", points - a, np.cross(b - a, c - a))).max() < 1e-12
    assert (points[:, 2] == 0).mean() == pytest.approx(3 / 14, abs=0.02)


def test_exact_pieces_are_at_no_distance_and_fill_the_volume() -> None:
    assert volume_error(L, FACES, BOXES) == pytest.approx(0.0, abs=1e-12)
    assert hausdorff_distance(L, FACES, BOXES) < 1e-9


def test_a_hull_over_the_notch_is_as_far_as_half_the_thickness() -> None:
    """From the notch's corner the outside is nearest through the top; from the slope, the notch's walls."""
    assert volume_error(L, FACES, [L]) == pytest.approx(0.5 / 3.0)
    assert hausdorff_distance(L, FACES, [L]) == pytest.approx(0.5, abs=0.01)


def test_a_missing_piece_is_as_far_as_its_far_end() -> None:
    assert volume_error(L, FACES, BOXES[:1]) == pytest.approx(1.0 / 3.0)
    assert hausdorff_distance(L, FACES, BOXES[:1]) == pytest.approx(1.0, abs=0.01)


def test_a_piece_too_large_is_as_far_as_it_sticks_out() -> None:
    bigger = [BOXES[0] * [1.1, 1, 1], BOXES[1]]
    assert hausdorff_distance(L, FACES, bigger) == pytest.approx(0.2, abs=0.01)


def test_an_open_surface_has_no_volume() -> None:
    assert volume_error(L, FACES[1:], BOXES) is None
