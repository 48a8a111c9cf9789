"""Depth, ids and projection against closed forms, on the software rasteriser."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.render import Renderer, view_of

from tests.opengl import opengl

SCENE = (
    "bodies: [Wall, Ball]\ncameras: [C]\nlights: [L]\nnamespace: /ambf/env/\n"
    "Wall: {name: Wall, mass: 0, shape: BOX, geometry: {x: 0.2, y: 8, z: 8}, location: {position: {x: -2.1, y: 0, z: 0}}}\n"
    "Ball: {name: Ball, mass: 0, shape: SPHERE, geometry: {radius: 0.3}, location: {position: {x: -1, y: 0, z: 0}}}\n"
    "C: {name: C, location: {x: 0, y: 0, z: 0}, look at: {x: -1, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}, "
    "field view angle: 0.9, clipping plane: {near: 0.05, far: 10}, publish image resolution: {width: 320, height: 240}}\n"
    "L: {name: L, location: {x: 0, y: 0, z: 0}, direction: {x: -1, y: 0, z: 0}, cutoff angle: 1.5}\n"
)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory):
    path = tmp_path_factory.mktemp("scene") / "m.yaml"
    path.write_text(SCENE)
    simulation = Simulation(ligature.load(path))
    with opengl():
        renderer = Renderer(simulation.scene)
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    return renderer.render(simulation.state, view), view


def test_depth_of_a_plane_is_its_distance(drawn) -> None:
    frame, _ = drawn
    wall = frame.ids == 1
    assert wall.sum() > 20_000
    assert np.abs(frame.depth[wall] - 2.0).max() < 2.0 * 1e-5


def test_depth_of_a_sphere_follows_its_equation(drawn) -> None:
    frame, view = drawn
    K = view.intrinsics
    rows, columns = np.nonzero(frame.ids == 2)
    depth = frame.depth[rows, columns]
    x = (columns - K[0, 2]) / K[0, 0] * depth
    y = (rows - K[1, 2]) / K[1, 1] * depth
    radius = np.sqrt(x**2 + y**2 + (depth - 1.0) ** 2)
    steep = frame.normals[rows, columns, 2] > 0.05
    assert np.abs(radius - 0.3)[steep].max() < 1e-5


def test_ids_split_the_picture_where_the_silhouette_is(drawn) -> None:
    frame, view = drawn
    pixels = (frame.ids == 2).sum()
    outline = view.intrinsics[0, 0] * 0.3 / np.sqrt(1 - 0.3**2)
    assert pixels == pytest.approx(np.pi * outline**2, rel=0.002)


def test_a_known_point_is_seen_where_the_intrinsics_state(drawn) -> None:
    frame, view = drawn
    rows, columns = np.nonzero(frame.ids == 2)
    assert columns.mean() == pytest.approx(view.intrinsics[0, 2], abs=0.1)
    assert rows.mean() == pytest.approx(view.intrinsics[1, 2], abs=0.1)


def test_normals_of_the_wall_face_the_camera(drawn) -> None:
    frame, _ = drawn
    assert np.allclose(frame.normals[frame.ids == 1], [0, 0, 1], atol=1e-5)


def test_two_pictures_of_one_state_are_equal(drawn, tmp_path: Path) -> None:
    frame, view = drawn
    path = tmp_path / "m.yaml"
    path.write_text(SCENE)
    simulation = Simulation(ligature.load(path))
    again = Renderer(simulation.scene).render(simulation.state, view)
    assert (again.rgb == frame.rgb).all() and (again.depth == frame.depth).all() and (again.ids == frame.ids).all()


@pytest.mark.parametrize("size", [(0, 240), (-1, 240), (320, 1_000_000)])
def test_a_picture_that_cannot_be_drawn_is_refused(tmp_path: Path, size: tuple[int, int]) -> None:
    (tmp_path / "m.yaml").write_text(SCENE)
    simulation = Simulation(ligature.load(tmp_path / "m.yaml"))
    with opengl(), pytest.raises(ValueError, match=f"a picture cannot be {size[0]} x {size[1]}: each is "):
        simulation.cameras["C"].capture(size)
