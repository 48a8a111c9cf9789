"""Depth, outline and normals of primitives against distance fields that are marched in double precision."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.model.frames import pose_matrix
from ligature.render import CameraView, Renderer, view_of

from tests.opengl import opengl

RADIUS, HEIGHT = 0.21, 0.8
SHAPES = {
    "SPHERE": "geometry: {radius: 0.21}",
    "CYLINDER": "geometry: {radius: 0.21, height: 0.8, axis: z}",
    "CAPSULE": "geometry: {radius: 0.21, height: 0.8, axis: z}",
    "CONE": "geometry: {radius: 0.21, height: 0.8, axis: z}",
    "BOX": "geometry: {x: 0.3, y: 0.5, z: 0.4}",
}
POSES = {
    "askew": ((-1.3, 0.1, -0.05), (0.5, 0.9, -0.4)),
    "upright": ((-1.1, -0.1, 0.1), (0.0, 0.0, 0.0)),
    "end on": ((-1.6, 0.05, 0.0), (0.0, np.pi / 2, 0.0)),
    "far": ((-7.0, 0.3, 0.2), (2.2, -0.4, 1.0)),
}

SNAP = 1 / 256
"""Share of a pixel to which OpenGL moves corners: GL_SUBPIXEL_BITS is 8 with Mesa and on NVIDIA's GPUs."""

GRAZING = 2e-6
"""Rays that pass the outline closer than this share of their length may count either way in single precision."""


def distance(kind: str, p: np.ndarray) -> np.ndarray:
    """Signed distance of ``p`` (n, 3) to a shape along z (Quilez's closed forms)."""
    rho, z = np.linalg.norm(p[:, :2], axis=1), p[:, 2]
    if kind == "SPHERE":
        return np.linalg.norm(p, axis=1) - RADIUS
    if kind == "CAPSULE":
        half = HEIGHT / 2 - RADIUS
        return np.hypot(rho, z - np.clip(z, -half, half)) - RADIUS
    if kind == "BOX":
        q = np.abs(p) - np.array([0.3, 0.5, 0.4]) / 2
        return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)
    if kind == "CYLINDER":
        d = np.stack([rho - RADIUS, np.abs(z) - HEIGHT / 2], axis=1)
        return np.minimum(d.max(axis=1), 0) + np.linalg.norm(np.maximum(d, 0), axis=1)
    # the cone as an intersection of its side and its base: a lower bound outside, exact at the surface
    slope = np.array([HEIGHT, RADIUS]) / np.hypot(HEIGHT, RADIUS)
    return np.maximum(slope[0] * rho + slope[1] * (z - HEIGHT / 2), -HEIGHT / 2 - z)


def met(kind: str, T_eye_shape: np.ndarray, view: CameraView) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Depth (h, w), inf beside the shape; how far each pixel's ray passes outside (inside: below 0); the normals met.

    The last is the cosine (h, w) between ray and normal.

    Along a line the distance to a convex shape is convex: its least value is found by thirds, the entry by halves.
    """
    K = view.intrinsics
    v, u = np.mgrid[: view.height, : view.width]
    ways = np.stack([(u - K[0, 2]) / K[0, 0], -(v - K[1, 2]) / K[1, 1], -np.ones(u.shape)], axis=-1).reshape(-1, 3)
    length = np.linalg.norm(ways, axis=1)
    R, o = T_eye_shape[:3, :3], T_eye_shape[:3, 3]
    d, origin = ways / length[:, None] @ R, -o @ R

    def gap(t: np.ndarray) -> np.ndarray:
        return distance(kind, origin + t[:, None] * d)

    low, high = np.zeros(len(d)), np.full(len(d), 12.0)
    for _ in range(80):
        first, second = low + (high - low) / 3, high - (high - low) / 3
        nearer = gap(first) < gap(second)
        low, high = np.where(nearer, low, first), np.where(nearer, second, high)
    least, outside, inside = gap(low), np.zeros(len(d)), low
    for _ in range(50):
        middle = (outside + inside) / 2
        beyond = gap(middle) > 0
        outside, inside = np.where(beyond, middle, outside), np.where(beyond, inside, middle)
    hit = origin + inside[:, None] * d
    e = 1e-7
    normal = np.stack([distance(kind, hit + e * a) - distance(kind, hit - e * a) for a in np.eye(3)], axis=1) / (2 * e)
    depth = np.where(least < 0, inside / length, np.inf)
    shape = (view.height, view.width)
    facing = np.abs(np.einsum("ij,ij->i", normal, d))
    return depth.reshape(shape), least.reshape(shape), (normal @ R.T).reshape(*shape, 3), facing.reshape(shape)


@pytest.mark.parametrize(("pose", "samples"), [*((pose, 0) for pose in POSES), ("askew", 4)])
@pytest.mark.parametrize("kind", SHAPES)
def test_depth_ids_and_normals_are_those_of_the_shape(tmp_path: Path, kind: str, pose: str, samples: int) -> None:
    at, rpy = POSES[pose]
    path = tmp_path / "m.yaml"
    path.write_text(
        "bodies: [A]\ncameras: [C]\nnamespace: /ambf/env/\n"
        f"A: {{name: A, mass: 0, shape: {kind}, {SHAPES[kind]}, location: {{position: {{x: {at[0]}, y: {at[1]}, z: {at[2]}}}, "
        f"orientation: {{r: {rpy[0]}, p: {rpy[1]}, y: {rpy[2]}}}}}}}\n"
        "C: {name: C, location: {x: 0, y: 0, z: 0}, look at: {x: -1, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}, "
        "field view angle: 0.8, clipping plane: {near: 0.05, far: 10}, publish image resolution: {width: 96, height: 72}}\n"
    )
    simulation = Simulation(ligature.load(path))
    with opengl():
        renderer = Renderer(simulation.scene, samples)
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    frame = renderer.render(simulation.state, view)
    depth, least, normal, facing = met(kind, view.view @ pose_matrix(at, rpy), view)
    seen = frame.ids == 1
    assert seen.sum() > 20
    wrong = seen != np.isfinite(depth)
    snap = SNAP * 0.8 / view.height  # rad, of a pixel's ray
    assert not (wrong & (np.abs(least) > (GRAZING + snap) * abs(at[0]))).any(), (
        "a pixel's ray clearly meets, or misses, the shape"
    )
    steep = facing > 0.05
    surely = seen & np.isfinite(depth)
    slope = np.sqrt(1 - np.minimum(facing, 1) ** 2) / np.maximum(facing, 0.05)
    reach = (np.where(steep, 1e-5, 1e-3) + 1.5 * snap * slope)[surely] * depth[surely]
    assert (np.abs(frame.depth[surely] - depth[surely]) <= reach).all()
    inner = surely & steep
    agreement = np.einsum("hwi,hwi->hw", frame.normals, normal)[inner]
    assert np.median(agreement) > 1 - 1e-6
    assert (agreement > 1 - 1e-4).mean() > 0.98  # edges, where the marched normal is a mean of two
