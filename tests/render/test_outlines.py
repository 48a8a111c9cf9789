"""Smoothing of the steps of edges in a finished picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ligature.render.context import draws_on_processor
from ligature.render.outlines import CONTRAST, smoothed

from tests.render.stage import Stage, ball

WHITE, DARK = np.array([250, 240, 230], np.uint8), np.array([120, 30, 20], np.uint8)


def half_plane(slope: float, size: int = 64, fine: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """A picture cut by a line of ``slope``: by the colour of each pixel's centre, and by how much of it each side fills."""
    at = (np.arange(size * fine) + 0.5) / fine
    above = at[:, None] < 20.0 + slope * at[None, :]
    share = above.reshape(size, fine, size, fine).mean(axis=(1, 3))[..., None]
    middle = np.arange(size) + 0.5
    hard = np.where((middle[:, None] < 20.0 + slope * middle[None, :])[..., None], WHITE, DARK)
    return hard, share * WHITE + (1.0 - share) * DARK


def soft_of(rgb: np.ndarray, keys: np.ndarray | None = None) -> np.ndarray:
    alpha = np.zeros(rgb.shape[:2], np.uint8) if keys is None else keys
    return smoothed(np.dstack([rgb, alpha]), keys is not None)


@pytest.mark.parametrize(("slope", "left"), [(0.05, 0.1), (0.21, 0.1), (0.5, 0.05), (0.9, 0.5), (1.7, 0.3)])
def test_a_slanted_edge_comes_near_to_what_each_side_fills_of_a_pixel(slope: float, left: float) -> None:
    hard, exact = half_plane(slope)
    soft = soft_of(hard)
    assert ((soft - exact) ** 2).mean() < left * ((hard - exact) ** 2).mean()
    assert (soft_of(hard.transpose(1, 0, 2)) == soft.transpose(1, 0, 2)).mean() > 0.99


def test_what_is_painted_on_a_surface_stays_and_its_outline_becomes_smooth() -> None:
    hard, _ = half_plane(0.21)
    assert (soft_of(hard, np.full(hard.shape[:2], 200, np.uint8)) == hard).all()
    assert (soft_of(hard, np.where(hard[..., 0] > 200, np.uint8(1), np.uint8(254))) == hard).all(), "keys go around"
    assert (soft_of(hard, np.where(hard[..., 0] > 200, np.uint8(1), np.uint8(9))) == soft_of(hard)).all()


def test_straight_edges_and_flat_colours_stay_as_they_are() -> None:
    board = np.where((np.indices((40, 60)) // 10).sum(axis=0)[..., None] % 2, WHITE, DARK)
    for picture in (board[:, :10].copy(), board[:10].copy(), np.full((5, 7, 3), 90, np.uint8)):
        assert (soft_of(picture) == picture).all()


def test_gradients_and_faint_grain_stay_as_they_are() -> None:
    grain = np.random.default_rng(3).integers(100, 100 + CONTRAST, (80, 90, 3)).astype(np.uint8)
    slope = (
        np.clip(4 * np.arange(60)[:, None, None] + np.arange(50)[None, :, None], 0, 255).repeat(3, 2).astype(np.uint8)
    )
    for picture in (grain, slope):
        assert (soft_of(picture) == picture).all()


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 9, 3), (9, 1, 3), (2, 2, 3)])
def test_the_smallest_pictures_can_be_smoothed(shape: tuple[int, int, int]) -> None:
    picture = np.random.default_rng(1).integers(0, 256, shape).astype(np.uint8)
    assert soft_of(picture).shape == shape


def test_colours_stay_between_those_of_the_neighbours() -> None:
    picture = np.random.default_rng(2).choice(np.array([40, 90, 200], np.uint8), (50, 60, 1)).repeat(3, 2)
    soft = soft_of(picture)
    assert soft.min() >= 40 and soft.max() <= 200 and (soft != picture).any()


def test_on_a_software_rasteriser_a_picture_is_smoothed_and_its_truths_are_not(tmp_path: Path) -> None:
    scene = Stage(tmp_path, [ball("Ka 1 1 1\nKd 0.7 0.2 0.15\n")], table=None)
    renderer, _ = scene.renderer(None)
    if not draws_on_processor(renderer._context):
        pytest.skip("a GPU draws with four samples")
    hard, four, soft = scene.draw(0), scene.draw(4), scene.draw(None)
    assert (soft.ids == hard.ids).all() and (soft.depth == hard.depth).all() and (soft.normals == hard.normals).all()
    gap = [((frame.rgb.astype(float) - four.rgb) ** 2).mean() for frame in (hard, soft)]
    assert gap[1] < 0.6 * gap[0]
    assert (soft.rgb == scene.draw(None).rgb).all()
