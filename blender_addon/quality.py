"""How well collision shapes stand for a body's mesh: figures kept with the body, and deviations to colour the mesh by.

Metres, in the body's frame. Volume error and Hausdorff distance are what `ligature.mesh.quality` reports, worked out
with Blender's own trees instead of compiled code.
"""

from __future__ import annotations

import hashlib
from typing import NamedTuple

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree
from mathutils.kdtree import KDTree

from . import making
from .ligature.authoring.shapes import shape_mesh, shape_properties
from .ligature.mesh.inertia import mass_properties
from .mesh_reading import points_of
from .object_operators import NeedsBody, active_body
from .poses import children_with, relative_pose, rest_matrix, shape_of, shapes_of
from .properties import KIND_OF_ROLE
from .schema_properties import identifier
from .solids import own_solid

SAMPLES = 4000
"""Points on each surface from which distances are measured."""

NUDGE = 1e-6
"""Step outwards, over the extent, that decides whether one solid covers a face of another."""

FINENESS = 1.0 / 32.0
"""Longest edge of the triangles that are coloured, over the extent of the mesh."""

MOST_TRIANGLES = 20000
"""Triangles beyond which edges are left as long as they are."""

REMEMBERED = 32
"""Measurements whose deviations can be drawn; older ones keep their figures."""

_deviations: dict[str, tuple[np.ndarray, np.ndarray]] = {}
"""Corners (n, 3, 3) of the coloured triangles and the deviation (n, 3) at each, by the print of what was measured."""


class Solid(NamedTuple):
    """A collision shape in the body's frame: triangles, outward planes (k, 4) if it is convex, volume if closed."""

    vertices: np.ndarray
    faces: np.ndarray
    planes: np.ndarray | None
    volume: float | None


class Figures(NamedTuple):
    """Number of pieces, (collision − mesh) / mesh by volume (None for an open mesh), Hausdorff distance."""

    pieces: int
    volume: float | None
    distance: float

    def __str__(self) -> str:
        pieces = f"{self.pieces} piece{'' if self.pieces == 1 else 's'}"
        volume = "volume unknown (the mesh is open)" if self.volume is None else f"volume {100.0 * self.volume:+.1f} %"
        return f"{pieces}, {volume}, Hausdorff distance {1e3 * self.distance:.2f} mm"


def measure(body: bpy.types.Object) -> Figures:
    """Compare a body's collision shapes with its mesh, and keep figures and deviations; raises ValueError."""
    if body.type != "MESH":
        raise ValueError("it has no mesh to compare its collision shapes with")
    vertices, faces = points_of(own_solid(body))
    if not len(faces):
        raise ValueError("it has no face to compare its collision shapes with")
    solids = solids_of(body)
    skin = Skin(solids, np.random.default_rng(0))
    on_mesh = sampled(vertices, faces, SAMPLES, skin.rng)[0]
    mesh_tree = BVHTree.FromPolygons(vertices.tolist(), faces.tolist())
    sticking_out = max((mesh_tree.find_nearest(point)[3] for point in skin.outside), default=0.0)
    distance = max(float(np.abs(skin.deviations(on_mesh)).max()), sticking_out)
    figures = Figures(len(solids), _volume_error(vertices, faces, solids), distance)
    corners = subdivided(vertices[faces], FINENESS * float(np.ptp(vertices, axis=0).max()))
    points, back = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    kept = body.adf.quality
    kept.pieces, kept.distance, kept.closed = figures.pieces, figures.distance, figures.volume is not None
    kept.volume = figures.volume or 0.0
    kept.measured = collision_print(body)
    _deviations[kept.measured] = corners, skin.deviations(points)[back.reshape(-1)].reshape(-1, 3)
    while len(_deviations) > REMEMBERED:
        del _deviations[next(iter(_deviations))]
    return figures


def kept_figures(body: bpy.types.Object) -> Figures:
    """The figures of the last measurement."""
    kept = body.adf.quality
    return Figures(kept.pieces, kept.volume if kept.closed else None, kept.distance)


def is_measured_now(body: bpy.types.Object) -> bool:
    """Whether the kept figures are those of what the body is now."""
    return body.adf.quality.measured == collision_print(body)


def deviations_of(body: bpy.types.Object) -> tuple[np.ndarray, np.ndarray] | None:
    """Corners (n, 3, 3) of triangles over the body's mesh and the deviation (n, 3) at each; None in another session.

    Positive outside all collision shapes, negative inside one: by how far the shape stands over the mesh there.
    """
    return _deviations.get(body.adf.quality.measured)


def collision_print(body: bpy.types.Object) -> str:
    """A text that changes when the mesh or a collision shape of a body does; nothing is evaluated for it."""
    digest = hashlib.blake2b(_stretch(body).tobytes(), digest_size=16)
    shapes = [*children_with(body, "HULL"), *shapes_of(body, "COLLISION")]
    for shape in shapes:
        digest.update(np.array([shape.matrix_basis, shape.matrix_parent_inverse]).tobytes())
    for obj in (body, *shapes):
        digest.update(repr([(m.type, _settings(m)) for m in obj.modifiers]).encode())
        if obj.type == "MESH":
            points = np.empty(3 * len(obj.data.vertices), dtype=np.float32)
            obj.data.vertices.foreach_get("co", points)
            digest.update(points.tobytes())
            digest.update(np.int64(len(obj.data.polygons)).tobytes())
    digest.update(_mesh_type(body).encode())
    return digest.hexdigest()


def _stretch(obj: bpy.types.Object) -> np.ndarray:
    """Scale and shear of an object, free of its pose and of the noise of single precision."""
    matrix = rest_matrix(obj)[:3, :3]
    return np.round(matrix.T @ matrix, 5) + 0.0


def _settings(modifier: bpy.types.Modifier) -> list[tuple[str, str]]:
    plain = [p.identifier for p in modifier.bl_rna.properties if p.type in ("BOOLEAN", "INT", "FLOAT", "ENUM")]
    return [(name, repr(getattr(modifier, name))) for name in plain if not name.startswith("is_")]


def _mesh_type(body: bpy.types.Object) -> str:
    group = getattr(body.adf, identifier(KIND_OF_ROLE[body.adf.role]))
    return getattr(group, "collision_mesh_type", "")


def solids_of(body: bpy.types.Object) -> list[Solid]:
    """What collides of a body: its primitives, and without any its collision mesh; raises ValueError for none."""
    shapes = shapes_of(body, "COLLISION")
    if shapes:
        return [_primitive(shape_of(child), relative_pose(body, child)) for child in shapes]
    convex = _mesh_type(body).startswith("CONVEX")
    found = []
    for child in children_with(body, "HULL"):
        vertices, faces = points_of(own_solid(child))
        if convex:
            vertices, polygons = making.hull_of(vertices)
            faces = np.array(polygons)
        T = relative_pose(body, child)
        found.append(_solid(vertices @ T[:3, :3].T + T[:3, 3], faces, convex))
    if not found:
        raise ValueError("it has no collision shape; add or fit a primitive, add a hull, or decompose its mesh")
    return found


def _primitive(shape, T: np.ndarray) -> Solid:
    if shape.kind == "PLANE":
        raise ValueError("a plane is infinite, so its fit cannot be measured")
    vertices, polygons = shape_mesh(shape)
    faces = np.array([(face[0], b, c) for face in polygons for b, c in zip(face[1:], face[2:])])  # noqa: B905
    solid = _solid(vertices @ T[:3, :3].T + T[:3, 3], faces, True)
    return solid._replace(volume=shape_properties(shape).volume)


def _solid(vertices: np.ndarray, faces: np.ndarray, convex: bool) -> Solid:
    try:
        volume = abs(mass_properties(vertices, faces).volume)
    except ValueError:
        volume = None
    if not convex:
        return Solid(vertices, faces, None, volume)
    normals = _normals(vertices[faces])
    flat = ~normals.any(axis=1)
    planes = np.column_stack([normals, np.einsum("ij,ij->i", normals, vertices[faces[:, 0]])])[~flat]
    return Solid(vertices, faces, planes, volume)


def _volume_error(vertices: np.ndarray, faces: np.ndarray, solids: list[Solid]) -> float | None:
    try:
        volume = abs(mass_properties(vertices, faces).volume)
    except ValueError:
        return None
    if any(solid.volume is None for solid in solids):
        return None
    return sum(solid.volume for solid in solids) / volume - 1.0


class Skin:
    """The outside of several solids taken together: where they meet inside, there is no outside."""

    def __init__(self, solids: list[Solid], rng: np.random.Generator) -> None:
        self.rng, self._planes = rng, [solid.planes for solid in solids if solid.planes is not None]
        first = np.cumsum([0] + [len(solid.vertices) for solid in solids[:-1]])
        vertices = np.vstack([solid.vertices for solid in solids])
        faces = np.vstack([solid.faces + start for solid, start in zip(solids, first)])  # noqa: B905
        self._tree = BVHTree.FromPolygons(vertices.tolist(), faces.tolist())
        self._outwards = NUDGE * float(np.ptp(vertices, axis=0).max()) * _normals(vertices[faces])
        points, face = sampled(vertices, faces, SAMPLES, rng)
        self.outside = points[~self._inside(points + self._outwards[face])]
        """Points on the outside, spread evenly."""
        self._near = KDTree(len(self.outside))
        for index, point in enumerate(self.outside):
            self._near.insert(point, index)
        self._near.balance()

    def deviations(self, points: np.ndarray) -> np.ndarray:
        """Distance (n,) of points to the outside, negative for those inside a convex solid.

        Exact, but for points so deep inside that the nearest face is an inner one: these are measured to the
        sampled outside, which may be too large by the samples' spacing.
        """
        feet = [self._tree.find_nearest(point) for point in points]
        found = np.array([foot[3] for foot in feet])
        nudged = np.array([foot[0] for foot in feet]) + self._outwards[[foot[2] for foot in feet]]
        for index in np.nonzero(self._inside(nudged))[0]:
            found[index] = self._near.find(points[index])[2]
        return np.where(self._inside(points), -found, found)

    def _inside(self, points: np.ndarray) -> np.ndarray:
        inside = np.zeros(len(points), dtype=bool)
        for planes in self._planes:
            inside |= (points @ planes[:, :3].T < planes[:, 3]).all(axis=1)
        return inside


def sampled(vertices: np.ndarray, faces: np.ndarray, count: int, rng) -> tuple[np.ndarray, np.ndarray]:
    """Points (count, 3) spread evenly over triangles by area, and the triangle (count,) of each."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = rng.choice(len(faces), count, p=area / area.sum())
    u, v = rng.random((2, count, 1))
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    return a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen], chosen


def subdivided(corners: np.ndarray, longest: float) -> np.ndarray:
    """Triangles (n, 3, 3) with each that has an edge above ``longest`` cut into four, again and again."""
    while len(corners) < MOST_TRIANGLES:
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
        long = edges > longest
        if not long.any():
            break
        a, b, c = corners[long].transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0
        quarters = [np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        corners = np.concatenate([corners[~long], *quarters])
    return corners


def _normals(corners: np.ndarray) -> np.ndarray:
    """Unit normal (n, 3) of triangles (n, 3, 3), zero for one without area."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)


class ADF_OT_measure(NeedsBody, bpy.types.Operator):
    """Compare the active body's collision shapes with its mesh: volume, Hausdorff distance, deviation over the mesh"""

    bl_idname = "adf.measure_collision"
    bl_label = "Measure Collision"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        body = active_body(context)
        try:
            figures = measure(body)
        except ValueError as error:
            self.report({"ERROR"}, f"'{body.name}': {error}")
            return {"CANCELLED"}
        self.report({"INFO"}, f"'{body.name}': {figures}")
        return {"FINISHED"}


CLASSES = (ADF_OT_measure,)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Forget what was measured."""
    _deviations.clear()
