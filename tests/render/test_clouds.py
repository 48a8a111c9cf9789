"""Clouds of points in pictures: where they are, what they hide and what hides them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.model.clouds import Cloud
from ligature.render.camera import CameraView
from ligature.render.clouds import with_clouds
from ligature.render.target import Frame

WIDTH, HEIGHT, F = 41, 31, 30.0


def view() -> CameraView:
    """An eye at the origin that looks along -z, focal length 30 pixels."""
    near, far = 0.1, 10.0
    projection = np.array(
        [
            [2 * F / WIDTH, 0, 0, 0],
            [0, 2 * F / HEIGHT, 0, 0],
            [0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, -1, 0],
        ]
    )
    return CameraView(np.eye(4), projection, near, far, WIDTH, HEIGHT)


def empty(depth: float = np.inf) -> Frame:
    return Frame(
        rgb=np.zeros((HEIGHT, WIDTH, 3), np.uint8),
        depth=np.full((HEIGHT, WIDTH), depth, np.float32),
        ids=np.full((HEIGHT, WIDTH), 7, np.int32),
    )


def cloud(points: list[tuple[float, float, float]], size: int = 1, level: int = 255) -> Cloud:
    return Cloud(np.array(points, dtype=float), np.full((len(points), 3), level, np.uint8), size)


@settings(max_examples=200, deadline=None)
@given(
    points=st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-12, 1)), min_size=1, max_size=8),
    size=st.integers(1, 5),
    wall=st.floats(0.2, 9.0),
)
def test_every_pixel_shows_the_nearest_of_wall_and_points(
    points: list[tuple[float, float, float]], size: int, wall: float
) -> None:
    """Against a loop over pixels and points that computes the pinhole picture by hand."""
    colours = np.arange(1, len(points) + 1, dtype=np.uint8)[:, None].repeat(3, axis=1)
    drawn = with_clouds(empty(wall), [Cloud(np.array(points), colours, size)], view())
    expected_depth, expected = np.full((HEIGHT, WIDTH), np.float32(wall)), np.zeros((HEIGHT, WIDTH), np.uint8)
    for k, (x, y, z) in enumerate(points):
        if not 0.1 < -z < 10.0:
            continue
        u = F * x / -z + WIDTH / 2 - 0.5 * (size - 1)
        v = -F * y / -z + HEIGHT / 2 - 0.5 * (size - 1)
        if min(abs(u - round(u)), abs(v - round(v))) < 1e-6:
            return  # the rounding of a pixel's edge
        for row in range(int(np.floor(v)), int(np.floor(v)) + size):
            for column in range(int(np.floor(u)), int(np.floor(u)) + size):
                if 0 <= row < HEIGHT and 0 <= column < WIDTH and np.float32(-z) < expected_depth[row, column]:
                    expected_depth[row, column], expected[row, column] = np.float32(-z), k + 1
    assert np.allclose(drawn.depth, expected_depth, rtol=1e-6)
    distances = np.array([np.float32(-z) for *_, z in points])
    if len(np.unique(distances)) == len(points):
        assert (drawn.rgb[..., 0] == expected).all()
    assert ((drawn.ids == 0) == (drawn.depth < np.float32(wall))).all()


def test_the_picture_itself_stays_as_it_was() -> None:
    frame = empty(5.0)
    with_clouds(frame, [cloud([(0, 0, -1)], 3)], view())
    assert not frame.rgb.any()
    assert (frame.depth == 5.0).all()


@pytest.mark.parametrize(("size", "pixels"), [(0, 1), (1, 1), (3, 9), (64, HEIGHT * WIDTH), (10_000, HEIGHT * WIDTH)])
def test_sizes_are_bounded(size: int, pixels: int) -> None:
    drawn = with_clouds(empty(), [cloud([(0, 0, -1)], size)], view())
    assert int((drawn.rgb[..., 0] == 255).sum()) == pixels
