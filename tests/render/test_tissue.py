"""Tissue is drawn where its nodes are: places, normals, depth, ids, motion, shadows, slits and marks."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.model.scene import Scene
from ligature.model.state import new_state
from ligature.render import Renderer, view_of
from ligature.render.tissue import TissueSurface, tissue_surfaces
from ligature.render.visuals import VisualLoader

from tests.opengl import opengl

FEW = (120, 90)
"""Pixels of pictures that are compared with rays."""

LENS = (
    "field view angle: 0.5, clipping plane: {near: 0.01, far: 10}, publish image resolution: {width: 320, height: 240}"
)
HEAD = (
    "bodies: [Pad, Floor]\ncameras: [C]\nlights: [L]\nnamespace: /ambf/env/\n"
    "Floor: {name: Floor, mass: 0, shape: BOX, geometry: {x: 0.4, y: 0.4, z: 0.02}, "
    "location: {position: {x: 0, y: 0, z: -0.06}}}\n"
    f"C: {{name: C, location: {{x: 0, y: -0.1, z: 0.12}}, look at: {{x: 0, y: 0, z: 0}}, up: {{x: 0, y: 0, z: 1}}, {LENS}}}\n"
    "L: {name: L, location: {x: 0.1, y: -0.02, z: 0.3}, direction: {x: -0.1, y: 0.02, z: -0.3}, cutoff angle: 0.6, "
    "shadow quality: 5}\n"
)
PAD = "Pad: {{name: Pad, mass: 0, {shape}, location: {{position: {{x: 0.004, y: 0.002, z: 0.001}}, orientation: {{r: 0, p: 0, y: 0.3}}}}, ligature tissue: {{material: silicone pad, cell size: {cell}, fixed: [-z]{slits}}}}}\n"  # fmt: skip
BOX = "shape: BOX, geometry: {x: 0.06, y: 0.04, z: 0.012}"
BALL = "shape: SPHERE, geometry: {radius: 0.02}"
SLIT = ", slits: [{from: {x: -0.02, y: 0, z: 0}, to: {x: 0.02, y: 0, z: 0.006}}]"
GAP = ", slits: [{from: {x: -0.02, y: -0.003, z: -0.002}, to: {x: 0.02, y: 0.003, z: 0.006}}]"


def scene_of(folder: Path, shape: str = BOX, cell: float = 0.004, slits: str = "") -> Scene:
    (folder / "m.yaml").write_text(HEAD + PAD.format(shape=shape, cell=cell, slits=slits))
    scene = ligature.load(folder / "m.yaml")
    assert not [d for d in scene.diagnostics if d.severity.name == "ERROR"], scene.diagnostics
    return scene


def surface_of(scene: Scene) -> TissueSurface:
    (surface,) = tissue_surfaces(scene, VisualLoader().of_scene(scene))
    return surface


def rest_of(scene: Scene) -> np.ndarray:
    return new_state(scene)["tissue_node"][0]


@pytest.fixture(scope="module")
def forms(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Scene]:
    given = {"box": {}, "ball": {"shape": BALL}, "slit": {"slits": SLIT}, "gap": {"slits": GAP}}
    return {name: scene_of(tmp_path_factory.mktemp(name), **keys) for name, keys in given.items()}


@settings(max_examples=24)
@given(name=st.sampled_from(["box", "ball", "slit", "gap"]), seed=st.integers(0, 2**31))
def test_any_affine_motion_of_the_nodes_is_that_of_the_surface(forms, name, seed):
    rng = np.random.default_rng(seed)
    A, b = np.eye(3) + 0.4 * rng.standard_normal((3, 3)), rng.standard_normal(3)
    scene = forms[name]
    surface, rest = surface_of_cached(scene), rest_of(scene)
    T = scene.bodies[scene.tissues[0].body].T_world_body
    moved = surface.triangles(rest @ A.T + b)
    still = surface.piece.triangles
    expected = (still.positions @ T[:3, :3].T + T[:3, 3]) @ A.T + b
    np.testing.assert_allclose(moved.positions, expected, atol=1e-12)
    if name != "ball" and np.linalg.det(A) > 0.05:  # flat faces: n becomes A^-T n
        normals = still.normals @ T[:3, :3].T @ np.linalg.inv(A)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        np.testing.assert_allclose(moved.normals, normals, atol=1e-6)


_surfaces: dict[int, TissueSurface] = {}


def surface_of_cached(scene: Scene) -> TissueSurface:
    return _surfaces.setdefault(id(scene), surface_of(scene))


def test_normals_of_a_bent_surface_are_those_of_another_library(forms):
    scene = forms["ball"]
    surface, rest = surface_of(scene), rest_of(scene)
    x = bent(rest)
    ours = surface.triangles(x)
    places = surface.places(x)
    solid = [len(set(face)) == 3 for face in surface.smooth_faces.tolist()]  # poles have flat triangles
    theirs = trimesh.Trimesh(places, surface.smooth_faces[solid], process=False)
    assert theirs.is_watertight
    first = np.unique(surface._group, return_index=True)[1]
    np.testing.assert_allclose(ours.normals[first], theirs.vertex_normals, atol=1e-6)
    rigid = theirs.vertices - rest.mean(axis=0)
    assert np.abs(ours.normals[first] - rigid / np.linalg.norm(rigid, axis=1, keepdims=True)).max() > 0.05


def bent(x: np.ndarray, depth: float = 0.004, width: float = 0.01) -> np.ndarray:
    """Nodes pressed down in the middle and twisted a little."""
    r2 = ((x[:, :2] - [0.004, 0.002]) ** 2).sum(axis=1)
    out = x.copy()
    out[:, 2] -= depth * np.exp(-r2 / width**2) * (1.0 + x[:, 2] / 0.01)
    out[:, 0] += 0.1 * x[:, 2]
    return out


def test_what_lies_at_one_place_stays_at_one_place(forms):
    """No cracks: vertices that share a place at rest, but for those on lips, share it in any motion."""
    for name in ("box", "ball", "gap"):
        scene = forms[name]
        surface, rest = surface_of(scene), rest_of(scene)
        x = rest + 1e-3 * np.random.default_rng(1).standard_normal(rest.shape)
        _, index = np.unique(np.round(surface.piece.triangles.positions, 9), axis=0, return_inverse=True)
        order = np.argsort(index.reshape(-1), kind="stable")
        same = np.diff(index.reshape(-1)[order]) == 0
        moved = surface.triangles(x).positions[order]
        assert np.abs(np.diff(moved, axis=0)[same]).max() < 1e-9, name


def test_an_open_wound_is_a_closed_surface_with_walls_and_a_floor(forms):
    form = forms["gap"].tissues[0].form
    surface = surface_of(forms["gap"])
    t = surface.piece.triangles
    mesh = trimesh.Trimesh(np.round(t.positions, 9), t.faces, process=True)
    assert mesh.volume == pytest.approx(0.06 * 0.04 * 0.012 - 0.04 * 0.006 * 0.008)
    assert mesh.volume == pytest.approx(form.grid.sizes.prod(axis=1).sum())
    mouth = np.abs(t.positions[t.faces].mean(axis=1)) < [0.0199, 0.0029, 1.0]
    assert t.positions[t.faces][mouth.all(axis=1)][:, :, 2].max() == pytest.approx(-0.002)


@pytest.fixture
def drawn(forms):
    def make(name: str = "box", size: tuple[int, int] | None = None):
        scene = forms[name]
        with opengl():
            renderer = Renderer(scene)
        state = Simulation(scene).state.copy()
        view = view_of(scene.cameras[0], state["camera_world"][0, 0], size)
        return renderer, state, view, surface_of(scene)

    return make


def rays(view) -> tuple[np.ndarray, np.ndarray]:
    """Origin (3,) and directions (h w, 3) through the middles of all pixels, of depth 1."""
    v, u = np.mgrid[: view.height, : view.width].reshape(2, -1)
    K = view.intrinsics
    eye = np.stack([(u - K[0, 2]) / K[0, 0], -(v - K[1, 2]) / K[1, 1], -np.ones(u.size)], axis=1)
    T = np.linalg.inv(view.view)
    return T[:3, 3], eye @ T[:3, :3].T


def met(mesh: trimesh.Trimesh, view) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth (h, w) of a mesh by trimesh's rays, inf beside it; triangle (h, w), and places (h, w, 3)."""
    pytest.importorskip("rtree")
    origin, directions = rays(view)
    caster = trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
    places, ray, triangle = caster.intersects_location(
        np.tile(origin, (len(directions), 1)), directions, multiple_hits=False
    )
    shape = (view.height, view.width)
    depth, face, at = np.full(len(directions), np.inf), np.full(len(directions), -1), np.zeros((len(directions), 3))
    depth[ray] = (places - origin) @ -view.view[2, :3].T
    face[ray], at[ray] = triangle, places
    return depth.reshape(shape), face.reshape(shape), at.reshape(*shape, 3)


def test_depth_and_ids_of_a_pressed_pad_are_those_of_rays(drawn):
    renderer, state, view, surface = drawn(size=FEW)
    still = renderer.render(state, view, ("depth", "ids"))
    state["tissue_node"][0] = bent(state["tissue_node"][0])
    frame = renderer.render(state, view, ("depth", "ids", "normals"))
    t = surface.triangles(state["tissue_node"][0])
    depth, face, _ = met(trimesh.Trimesh(t.positions, t.faces, process=False), view)
    seen = frame.ids == 1
    assert seen.sum() > 700
    assert (seen != np.isfinite(depth)).sum() < 10  # of some 200 pixels of outline
    both = seen & np.isfinite(depth)
    error = np.abs(frame.depth - depth)[both]
    assert np.percentile(error, 99.9) < 2e-6 and error.max() < 2e-3
    assert np.abs(frame.depth - still.depth)[both & (still.ids == 1)].max() > 2e-3
    flat = trimesh.Trimesh(t.positions, t.faces, process=False).face_normals[face[both]] @ view.view[:3, :3].T
    assert np.percentile((frame.normals[both] * flat).sum(axis=1), 1) > 0.97  # smoothed over neighbours


def test_flow_is_where_the_material_went(drawn):
    renderer, state, view, surface = drawn(size=FEW)
    passes = ("depth", "ids", "flow")
    before = surface.triangles(state["tissue_node"][0]).positions
    assert np.abs(renderer.render(state, view, passes).flow).max() < 1e-3
    state["tissue_node"][0] = bent(state["tissue_node"][0])
    frame = renderer.render(state, view, passes)
    t = surface.triangles(state["tissue_node"][0])
    _, face, at = met(trimesh.Trimesh(t.positions, t.faces, process=False), view)
    both = (frame.ids == 1) & (face >= 0)
    corners = t.faces[face[both]]
    shares = trimesh.triangles.points_to_barycentric(t.positions[corners], at[both])
    was = np.einsum("nk,nka->na", shares, before[corners])
    v, u = np.nonzero(both)
    eye = was @ view.view[:3, :3].T + view.view[:3, 3]
    K = view.intrinsics
    then = np.stack([K[0, 2] - K[0, 0] * eye[:, 0] / eye[:, 2], K[1, 2] + K[1, 1] * eye[:, 1] / eye[:, 2]], axis=1)
    error = np.abs(frame.flow[both] - (np.stack([u, v], axis=1) - then))
    assert np.percentile(error, 99.9) < 0.02
    assert np.abs(frame.flow[both]).max() > 1.0
    again = renderer.render(state, view, passes)
    assert np.abs(again.flow).max() < 1e-3


def test_a_slit_is_closed_at_rest_and_opens_with_its_lips(drawn):
    renderer, state, view, _ = drawn("slit")
    form = renderer._scene.tissues[0].form
    closed = renderer.render(state, view, ("depth", "ids"))
    R = renderer._scene.bodies[renderer._scene.tissues[0].body].T_world_body[:3, :3]
    aside = np.zeros(len(form.grid.nodes))
    aside[form.grid.lips[:, 0]], aside[form.grid.lips[:, 1]] = -0.001, 0.001
    state["tissue_node"][0] += aside[:, None] * R[:, 1]
    opened = renderer.render(state, view, ("depth", "ids"))
    deeper = (opened.depth - closed.depth > 1e-3) & (closed.ids == 1)
    width = 0.002 * 0.03 * (view.intrinsics[0, 0] / np.median(closed.depth[closed.ids == 1])) ** 2
    assert 0.3 * width < deeper.sum() < 1.5 * width
    assert (opened.ids == 1)[deeper].mean() > 0.9  # the walls and the floor of the slit


def test_shadows_follow_the_surface(drawn):
    renderer, state, view, _ = drawn()
    before = renderer.render(state, view, ("rgb", "ids"))
    nodes = state["tissue_node"][0]
    nodes[:, 0] -= 0.03
    after = renderer.render(state, view, ("rgb", "ids"))
    floor = (before.ids == 2) & (after.ids == 2)
    changed = np.abs(before.rgb.astype(int) - after.rgb).max(axis=2) > 25
    assert (changed & floor).sum() > 100


def test_a_puncture_leaves_a_dark_mark_of_its_size_where_it_is(drawn):
    renderer, state, view, surface = drawn()
    clean = renderer.render(state, view, ("rgb", "depth"))
    nodes = state["tissue_node"][0]
    top = nodes[nodes[:, 2] > nodes[:, 2].max() - 1e-9]
    place = top[np.argmin(np.linalg.norm(top[:, :2], axis=1))]
    state["puncture_count"][0, 0] = 1
    state["puncture_point"][0, 0, 0], state["puncture_normal"][0, 0, 0] = place, (0, 0, 1)
    marked = renderer.render(state, view, ("rgb", "depth"))
    assert (marked.depth == clean.depth).all()
    dark = clean.rgb.astype(int).sum(axis=2) - marked.rgb.astype(int).sum(axis=2) > 60
    v, u = np.nonzero(dark)
    eye = view.view @ [*place, 1.0]
    K = view.intrinsics
    at = np.array([K[0, 2] - K[0, 0] * eye[0] / eye[2], K[1, 2] + K[1, 1] * eye[1] / eye[2]])
    radius = renderer._marks[0].radius * K[0, 0] / -eye[2]
    assert dark.any()
    assert np.hypot(u.mean() - at[0], v.mean() - at[1]) < 0.7
    assert np.hypot(u - at[0], v - at[1]).max() < 1.3 * radius + 1.0
    assert clean.rgb[v, u].mean() > 2.0 * marked.rgb[v, u].mean() or radius < 1.5


def test_two_bodies_of_one_shape_are_drawn_each_where_it_is(tmp_path: Path):
    text = HEAD.replace("[Pad,", "[Pad, Other,") + PAD.format(shape=BOX, cell=0.006, slits="")
    other = PAD.format(shape=BOX, cell=0.006, slits="").replace("Pad: {name: Pad", "Other: {name: Other")
    (tmp_path / "m.yaml").write_text(text + other.replace("x: 0.004, y: 0.002", "x: 0.004, y: 0.044"))
    simulation = Simulation(ligature.load(tmp_path / "m.yaml"))
    with opengl():
        renderer = Renderer(simulation.scene)
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    before = renderer.render(simulation.state, view, ("depth", "ids"))
    assert {1, 2, 3} <= set(np.unique(before.ids).tolist())
    state = simulation.state.copy()
    rows = simulation.scene.tissues[1].rows
    state["tissue_node"][0, rows] += [0.0, 0.0, 0.005]
    after = renderer.render(state, view, ("depth", "ids"))
    first = (before.ids == 1) & (after.ids == 1)
    second = (before.ids == 2) & (after.ids == 2)
    assert (before.depth == after.depth)[first].all()
    assert np.median((before.depth - after.depth)[second]) > 2e-3


def test_a_soft_body_that_fell_is_drawn_where_its_nodes_are(tmp_path):
    trimesh.creation.icosphere(3, 0.02).export(tmp_path / "lump.obj")
    head = HEAD.replace("bodies: [Pad, Floor]", "bodies: [Floor]\nsoft bodies: [Lump]")
    head = head.replace("shape: BOX, geometry: {x: 0.4, y: 0.4, z: 0.02}", "shape: BOX, geometry: {x: 0.4, y: 0.4, z: 0.02}, collision shape: BOX, collision geometry: {x: 0.4, y: 0.4, z: 0.02}")  # fmt: skip
    lump = "Lump: {name: lump, mesh: lump.obj, mass: 0.03, config: {kMT: 0.003}}\n"
    (tmp_path / "m.yaml").write_text(head + lump)
    scene = ligature.load(tmp_path / "m.yaml")
    with opengl():
        renderer = Renderer(scene)
    simulation = Simulation(scene)
    simulation.step(800)
    state = simulation.state.copy()
    (surface,) = tissue_surfaces(scene, VisualLoader().of_scene(scene))
    moved = surface.triangles(state["tissue_node"][0])
    lowest = moved.positions[:, 2].min()
    assert -0.0525 < lowest < -0.0475  # on the floor, within half a cell of the grid that carries it
    view = view_of(scene.cameras[0], state["camera_world"][0, 0], FEW)
    frame = renderer.render(state, view, ("depth", "ids"))
    number = next(n for n, name in scene.drawn_names.items() if name.endswith("Lump"))
    seen = frame.ids == number
    solid = trimesh.Trimesh(moved.positions, moved.faces, process=False)
    camera = np.array([0.0, -0.1, 0.12])
    assert seen.sum() > 200
    forward = -camera / np.linalg.norm(camera)
    assert frame.depth[seen].min() == pytest.approx(((solid.vertices - camera) @ forward).min(), abs=1e-3)
