"""Surfaces that are drawn: tangents, threads, closedness, what counts as metal."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.mesh import Material, Mesh, MeshPart
from ligature.model.poses import pose7_matrices
from ligature.model.shapes import Box, Colour, Sphere
from ligature.render.geometry import of_shape
from ligature.render.surface import surface_of
from ligature.render.thread import Tube
from ligature.render.visuals import faces_outward

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


def test_tangents_of_a_sphere_point_east_with_north_on_their_left() -> None:
    ball = of_shape(Sphere(0.3))
    tangents = ball.tangents()
    off_the_poles = np.abs(ball.normals[:, 2]) < 0.98
    angle = np.arctan2(ball.positions[:, 1], ball.positions[:, 0])
    east = np.stack([-np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=1)
    assert np.einsum("ij,ij->i", tangents[:, :3], east)[off_the_poles].min() > 0.99
    assert np.abs(np.einsum("ij,ij->i", tangents[:, :3], ball.normals)).max() < 1e-9
    assert (tangents[off_the_poles, 3] == 1.0).all()


def test_mirrored_texture_coordinates_turn_the_handedness() -> None:
    ball = of_shape(Sphere(0.3))
    mirrored = type(ball)(ball.positions, ball.normals, ball.uvs * [-1, 1], ball.faces)
    off_the_poles = np.abs(ball.normals[:, 2]) < 0.98
    assert (mirrored.tangents()[off_the_poles, 3] == -1.0).all()


def test_vertices_without_texture_coordinates_still_have_a_tangent() -> None:
    ball = of_shape(Sphere(0.3))
    flat = type(ball)(ball.positions, ball.normals, np.zeros_like(ball.uvs), ball.faces)
    assert np.allclose(np.abs(np.einsum("ij,ij->i", flat.tangents()[:, :3], ball.normals)), 0.0, atol=1e-12)
    assert (np.linalg.norm(flat.tangents()[:, :3], axis=1) > 0.5).all()


def test_a_thread_is_as_thick_and_long_as_its_rod_and_ends_at_the_needle() -> None:
    scene = ligature.load(SMALL)
    rod = scene.rods[0]
    T = np.array([body.T_world_body for body in scene.bodies])
    surface = Tube(scene, rod).triangles(T)
    rings = surface.positions.reshape(-1, 11, 3)
    centres = rings[:, :-1].mean(axis=1)
    thickness = np.linalg.norm(rings - centres[:, None], axis=2)
    assert np.allclose(thickness[1:-1], rod.radius, rtol=1e-6)
    assert np.allclose(thickness[[0, -1]], 0.0, atol=1e-12)
    assert np.linalg.norm(np.diff(centres, axis=0), axis=1).sum() == pytest.approx(rod.lengths.sum(), rel=1e-6)
    joint = scene.joints[rod.anchors[0]]
    needle = scene.bodies[joint.parent]
    hold = needle.T_world_body @ needle.T_body_inertial @ joint.T_parent_a[:, 3]
    assert np.linalg.norm(centres[[0, -1]] - hold[:3], axis=1).min() < 1e-9


def test_a_bent_thread_has_no_hard_edges() -> None:
    scene = ligature.load(SMALL)
    rod = scene.rods[0]
    poses = np.array([[*body.T_world_body[:3, 3], 0, 0, 0, 1] for body in scene.bodies])
    angles = np.linspace(0.0, np.pi, len(rod.bodies))
    poses[list(rod.bodies), :3] = 0.03 * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    half = (angles + np.pi / 2) / 2
    about_z = np.stack([np.zeros_like(half), np.zeros_like(half), np.sin(half), np.cos(half)], axis=1)
    to_x = np.array([0.0, np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)])  # an element's Z axis to X
    x, y, z, w = about_z.T
    a, b, c, d = to_x
    turned = [w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a, w * c + x * b - y * a + z * d,
              w * d - x * a - y * b - z * c]  # fmt: skip
    poses[list(rod.bodies), 3:] = np.stack(turned, axis=1)
    surface = Tube(scene, rod).triangles(pose7_matrices(poses))
    centres = surface.positions.reshape(-1, 11, 3)[2:-2, :-1].mean(axis=1)
    way = np.diff(centres, axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    turn = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", way[1:], way[:-1]), -1, 1)))
    assert turn.max() < 3.0, "between one point of the spline and the next"


def mesh_of(shape: Box, flip: bool = False, drop: int = 0) -> Mesh:
    surface = of_shape(shape)
    faces = surface.faces[drop:, ::-1] if flip else surface.faces[drop:]
    return Mesh(Path("box.obj"), (MeshPart("", surface.positions, faces),))


def test_only_closed_meshes_that_wind_outwards_may_lose_their_back_faces() -> None:
    box = Box(np.array([1.0, 2.0, 3.0]))
    assert faces_outward(mesh_of(box))
    assert not faces_outward(mesh_of(box, flip=True))
    assert not faces_outward(mesh_of(box, drop=1))


GREY = Material("m", diffuse=(0.8, 0.8, 0.8), specular=(0.5, 0.5, 0.5), shininess=360)


def test_a_bright_grey_with_a_sharp_highlight_is_metal() -> None:
    look = surface_of(None, GREY).physical
    assert look is not None and look.metallic == 1.0


@pytest.mark.parametrize(
    "change",
    [{"diffuse": (0.8, 0.4, 0.7)}, {"shininess": 30}, {"specular": (0.1, 0.1, 0.1)}, {"texture": Path("drape.png")}],
    ids=["coloured", "dull", "faint", "textured"],
)
def test_other_greys_are_lit_as_the_reference_lights_them(change) -> None:
    from dataclasses import replace

    look = surface_of(None, replace(GREY, **change)).physical
    assert look is None or look.metallic == 0.0


def test_colours_of_the_scene_replace_those_of_the_mesh_and_keep_its_textures() -> None:
    material = Material("m", texture=Path("a.png"), normal_map=Path("b.png"))
    surface = surface_of(Colour(diffuse=(0.1, 0.2, 0.3)), material)
    assert surface.colour.diffuse == (0.1, 0.2, 0.3)
    assert (surface.texture, surface.normal_map) == (Path("a.png"), Path("b.png"))
