"""The drawn surface of a body of tissue: its visual mesh, opened by its slits and moved by its nodes.

Rest positions are in the body frame B, moved ones in world axes. Metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from ligature.mesh.voxels import Embedding
from ligature.model.scene import Scene
from ligature.model.shapes import Capsule, Cylinder
from ligature.model.soft import TissueBody, TissueForm
from ligature.render.geometry import Triangles
from ligature.render.refine import ON_PLANE, faces_of, split_at, split_edges
from ligature.render.visuals import Piece

Array = NDArray[np.float64]

FINENESS = 0.5
"""Longest edge of a drawn triangle, in cells."""

MOST_FACES = 60_000
"""Faces beyond which no triangle is divided further."""

ASIDE = 1e-3
"""Fraction of the distance to its faces by which a vertex is moved to find the cell that contains it."""

NEAR, ALIKE = 1e-9, 1e-4
"""Metres, and differences of unit vectors, below which vertices count as the same."""

SLIVER = 1e-13
"""Square metres of twice a triangle below which its direction does not count."""

TOLERANCE = 1e-6
"""Metres by which a slit may miss the surface that it opens."""

MARK, LEAST_MARK = 1.6, 0.3e-3
"""Radius of the mark that a puncture leaves, in radii of the thickest needle, and at least, m."""


class TissueSurface:
    """One piece of the surface of a body of tissue.

    Parameters
    ----------
    tissue
        The body.
    piece
        Its triangles at rest.
    walls
        Whether this piece has the walls of the slits too.
    fineness
        Longest edge of a triangle, in cells.
    """

    def __init__(self, tissue: TissueBody, piece: Piece, walls: bool = False, fineness: float = FINENESS) -> None:
        form, self.rows, self.index = tissue.form, tissue.rows, tissue.index
        length = fineness * float(np.median(form.grid.sizes))
        rest = _opened(_at_rest(piece), form.slits, length)
        embedding = _embedded(rest, form)
        if walls and form.slits:
            rest, embedding = _with_walls(rest, embedding, form)
        self._faces, self._uvs = rest.faces, rest.uvs
        self._carried = _matrix(embedding, len(form.grid.nodes))
        self._group = _smooth_groups(rest, embedding)
        corners = self._group[rest.faces].reshape(-1)
        shape = (int(self._group.max(initial=-1)) + 1, len(corners))
        self._summed = csr_matrix((np.ones(len(corners)), (corners, np.arange(len(corners)))), shape)
        self.piece = replace(
            piece, geometry=("tissue", id(self)), triangles=rest, T_owner_piece=np.eye(4),
            closed=piece.closed and not form.slits, coarse=None, primitive=None, deforms=True,
        )  # fmt: skip
        self._nodes = np.zeros((0, 3))
        self._moved = rest
        self._carried_once = self._carried[np.unique(self._group, return_index=True)[1]]
        self.smooth_faces = self._group[rest.faces]
        """Faces (m, 3) of `places`."""

    def triangles(self, nodes: Array) -> Triangles:
        """The surface when the nodes of all bodies of tissue are at ``nodes`` (n, 3); the same object for the same."""
        own = nodes[self.rows]
        if not np.array_equal(own, self._nodes):
            self._nodes = own.copy()
            x = np.asarray(self._carried @ own)
            self._moved = Triangles(x, self._normals(x), self._uvs, self._faces)
        return self._moved

    def places(self, nodes: Array) -> Array:
        """Positions of the surface with one vertex for all that share a place and a normal."""
        return np.asarray(self._carried_once @ nodes[self.rows])

    def _normals(self, x: Array) -> Array:
        """Normals (v, 3): those of the faces around, by their angles (Thürmer and Wüthrich 1998)."""
        a, b, c = x.T[:, self._faces.T].transpose(1, 0, 2)  # (3, m) each: long rows are quick
        u, v, w = b - a, c - b, a - c
        uu, vv, ww = (np.einsum("am,am->m", e, e) for e in (u, v, w))
        across = np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
        double = np.sqrt(np.einsum("am,am->m", across, across))
        # each corner by its edges: tan = |across| / (inner product of the edges that leave it)
        angles = np.stack([np.arctan2(2.0 * double, ww + uu - vv), np.arctan2(2.0 * double, uu + vv - ww)])
        angles = np.concatenate([angles, np.pi - angles.sum(axis=0, keepdims=True)])
        weights = angles / np.maximum(double, SLIVER)
        sums = self._summed @ (weights[:, None] * across).transpose(2, 0, 1).reshape(-1, 3)
        normals: Array = _unit(sums)[self._group]
        return normals


def tissue_surfaces(scene: Scene, pieces: Sequence[Piece], fineness: float = FINENESS) -> list[TissueSurface]:
    """The surfaces of all bodies of tissue, of those ``pieces`` of the scene that are theirs."""
    found = []
    for tissue in scene.tissues:
        own = [piece for piece in pieces if piece.owner == tissue.body and piece.coarse is not True]
        found += [TissueSurface(tissue, piece, number == 0, fineness) for number, piece in enumerate(own)]
    return found


class Marks:
    """Marks of punctures on the surface of one body of tissue."""

    def __init__(self, scene: Scene, tissue: TissueBody) -> None:
        self._index = tissue.index
        self._reach = 0.5 * float(tissue.form.grid.sizes.max())
        self.radius = mark_radius(scene)

    def of(self, state: NDArray[np.void]) -> Array:
        """Place, radius, outward normal, and how far along it the mark is seen (n, 8), in world axes."""
        count = int(state["puncture_count"][0, self._index])
        points, normals = (state[f"puncture_{name}"][0, self._index, :count] for name in ("point", "normal"))
        ones = np.ones((count, 1))
        return np.hstack([points, self.radius * ones, normals, self._reach * ones])


def mark_radius(scene: Scene) -> float:
    """Radius of the mark of a puncture, m."""
    shapes = [collider.shape for needle in scene.needles for collider in scene.bodies[needle.body].colliders]
    return max([LEAST_MARK, *(MARK * shape.radius for shape in shapes if isinstance(shape, Capsule | Cylinder))])


def _at_rest(piece: Piece) -> Triangles:
    """Its triangles in the body frame."""
    t, T = piece.triangles, piece.T_owner_piece
    turn = np.linalg.inv(T[:3, :3]).T
    return Triangles(t.positions @ T[:3, :3].T + T[:3, 3], _unit(t.normals @ turn.T), t.uvs, t.faces)


def _opened(surface: Triangles, slits: Sequence[Array], length: float) -> Triangles:
    """``surface`` with gaps removed and slits opened, refined to edges up to ``length``."""
    for box in slits:
        for axis in range(3):
            for place in sorted(set(box[:, axis].tolist())):
                surface = split_at(surface, axis, place)
    surface = split_edges(surface, length, MOST_FACES)
    for box in slits:
        low, high = box.min(axis=0), box.max(axis=0)
        centres = surface.positions[surface.faces].mean(axis=1)
        inside = (centres > low - TOLERANCE) & (centres < high + TOLERANCE)
        flat = np.flatnonzero(low == high)
        if not len(flat):
            surface = faces_of(surface, ~inside.all(axis=1))
            continue
        axis = int(flat[0])
        within = np.delete(inside, axis, axis=1).all(axis=1)
        on = np.abs(surface.positions[surface.faces][:, :, axis] - low[axis]) < ON_PLANE
        side = np.where(centres[:, axis] > low[axis], 2, 1)
        surface = _parted(surface, np.where(on & within[:, None], side[:, None], 0))
    return surface


def _parted(surface: Triangles, side: NDArray[np.int64]) -> Triangles:
    """``surface`` with vertices split where the ``side`` (m, 3), 0, 1 or 2, of the corners at it differs."""
    keys, faces = np.unique(3 * surface.faces.astype(np.int64) + side, return_inverse=True)
    vertex = keys // 3
    faces = faces.reshape(-1, 3).astype(np.int32)
    return Triangles(surface.positions[vertex], surface.normals[vertex], surface.uvs[vertex], faces)


def _embedded(surface: Triangles, form: TissueForm) -> Embedding:
    """The cells that carry the vertices: those on a slit are carried by cells on the side that their faces are on."""
    x = surface.positions
    beside = x.copy()
    for box in form.slits:
        low, high = box.min(axis=0) - TOLERANCE, box.max(axis=0) + TOLERANCE
        on = ((x >= low) & (x <= high)).all(axis=1)
        beside[on] += ASIDE * (_middles(surface)[on] - x[on])
    _, first, each = np.unique(np.round(beside / NEAR), axis=0, return_index=True, return_inverse=True)
    found = form.embed(x[first], beside[first])
    each = each.reshape(-1)
    return Embedding(found.nodes[each], found.weights[each])


def _matrix(embedding: Embedding, nodes: int) -> csr_matrix:
    """The embedding in ``nodes`` nodes as a sparse matrix (v, nodes), which is faster."""
    vertices, corners = embedding.nodes.shape
    rows = np.repeat(np.arange(vertices), corners)
    return csr_matrix((embedding.weights.reshape(-1), (rows, embedding.nodes.reshape(-1))), (vertices, nodes))


def _middles(surface: Triangles) -> Array:
    """Mean of the middles of the faces around each vertex, (v, 3)."""
    corners = surface.faces.reshape(-1)
    centres = np.repeat(surface.positions[surface.faces].mean(axis=1), 3, axis=0)
    count = np.maximum(np.bincount(corners, minlength=len(surface.positions)), 1)
    return np.stack([np.bincount(corners, weights=centres[:, a], minlength=len(count)) / count for a in range(3)], 1)


def _smooth_groups(surface: Triangles, embedding: Embedding) -> NDArray[np.int64]:
    """Groups (v,) of vertices that share a normal: they have the same position and normal at rest, and move together.

    Vertices move together if they have the same position after a random displacement of all nodes.
    """
    nodes = int(embedding.nodes.max(initial=0)) + 1
    moved = embedding.positions(np.random.default_rng(0).standard_normal((nodes, 3)))
    keys = np.hstack([surface.positions / NEAR, surface.normals / ALIKE, moved / ALIKE])
    group: NDArray[np.int64] = np.unique(np.round(keys), axis=0, return_inverse=True)[1].reshape(-1)
    return group


def _with_walls(surface: Triangles, embedding: Embedding, form: TissueForm) -> tuple[Triangles, Embedding]:
    """``surface`` and the faces of the grid that bound slits and gaps, coloured as the surface beside them is."""
    grid = form.grid
    corners = grid.nodes[grid.faces]
    centres, near = corners.mean(axis=1), 0.01 * float(grid.sizes.min())
    bounds = np.zeros(len(centres), dtype=bool)
    for box in form.slits:
        bounds |= ((centres > box.min(axis=0) - near) & (centres < box.max(axis=0) + near)).all(axis=1)
    nodes, corners = grid.faces[bounds].reshape(-1), corners[bounds]
    normals = np.repeat(_unit(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])), 4, axis=0)
    places = corners.reshape(-1, 3)
    uvs = surface.uvs[cKDTree(surface.positions).query(places)[1]] if len(surface.uvs) else np.zeros((len(places), 2))
    quads = len(surface.positions) + np.arange(len(places)).reshape(-1, 4)
    faces = np.vstack([surface.faces, quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    weights = np.zeros((len(nodes), 8))
    weights[:, 0] = 1.0
    bound = Embedding(
        np.vstack([embedding.nodes, np.repeat(nodes[:, None], 8, axis=1)]), np.vstack([embedding.weights, weights])
    )
    joined = [np.vstack(pair) for pair in ((surface.positions, places), (surface.normals, normals), (surface.uvs, uvs))]
    return Triangles(joined[0], joined[1], joined[2], faces), bound


def _unit(vectors: Array) -> Array:
    unit: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)
    return unit
