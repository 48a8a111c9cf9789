"""The grid of soft tissue as Ligature fills a body with it: cells, layers, faces that are held, slits. Metres, in B."""

from __future__ import annotations

import hashlib

import bpy
import numpy as np

from .ligature.mesh.voxels import lattice, usual_cell
from .mesh_reading import points_of
from .poses import relative_pose, shape_of, shapes_of
from .properties import KIND_OF_ROLE
from .quality import collision_print
from .schema_properties import fetch, identifier
from .solids import own_solid

FACES = ("-x", "+x", "-y", "+y", "-z", "+z")
MOST_CELLS = 60000
"""Cells beyond which nothing is drawn; a tenth of them is too much to be simulated."""

_kept: dict[str, dict[str, np.ndarray] | str] = {}
"""Lines of grids, or why there are none, by the print of what they were made of."""


def tissue_keys(body: bpy.types.Object) -> dict:
    """What a body states of its tissue, by the path below `ligature tissue`; empty for a rigid one."""
    if body.adf.role not in ("BODY", "SOFT_BODY"):
        return {}
    kind = KIND_OF_ROLE[body.adf.role]
    block = "ligature tissue."
    return {
        p[len(block) :]: v for p, v in fetch(getattr(body.adf, identifier(kind)), kind).items() if p.startswith(block)
    }


def held_faces(body: bpy.types.Object) -> tuple[str, ...]:
    """The faces that the rigid body holds; of a body that states none the lower one."""
    return tissue_keys(body).get("fixed", ("-z",) if body.adf.role == "BODY" else ())


def surface_of(body: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """What is filled: the mesh, else the one primitive; vertices (n, 3) and triangles (m, 3). Raises ValueError."""
    if body.type == "MESH":
        vertices, faces = points_of(own_solid(body))
        if len(faces):
            return vertices, faces
    shapes = shapes_of(body, "VISUAL") or shapes_of(body, "COLLISION")
    if len(shapes) != 1 or shape_of(shapes[0]).kind == "PLANE":
        raise ValueError("tissue needs a closed mesh, or one primitive with a volume")
    from .ligature.authoring.shapes import shape_mesh

    vertices, polygons = shape_mesh(shape_of(shapes[0]))
    T = relative_pose(body, shapes[0])
    faces = np.array([(p[0], b, c) for p in polygons for b, c in zip(p[1:], p[2:])])  # noqa: B905
    return vertices @ T[:3, :3].T + T[:3, 3], faces


def grid_of(body: bpy.types.Object) -> tuple[list[np.ndarray], np.ndarray, list, list[float]]:
    """Planes, filled cells, cuts and heights between the layers of a body's tissue; raises ValueError."""
    keys = tissue_keys(body)
    vertices, faces = surface_of(body)
    cell = keys.get("cell size") or usual_cell(vertices, bool(held_faces(body)))
    cells = float(np.prod(np.ceil(np.ptp(vertices, axis=0) / cell) + 1.0))
    if cells > MOST_CELLS:
        raise ValueError(f"it would have {cells:.0f} cells of {1e3 * cell:g} mm; use larger cells")
    slits = [np.array([item["from"], item["to"]]) for item in keys.get("slits", ()) if {"from", "to"} <= set(item)]
    top = float(vertices[:, 2].max())
    thick = [layer.get("thickness", 0.0) for layer in keys.get("layers", ())][:-1]
    heights = [float(top - down) for down in np.cumsum(thick)]
    axes, filled, cuts = lattice(vertices, faces, cell, slits, ((), (), heights))
    return axes, filled, cuts, heights


def grid_lines(body: bpy.types.Object) -> dict[str, np.ndarray]:
    """Pairs of points (n, 2, 3) in B: edges of the grid's surface, of held faces, of slits, between layers."""
    key = _print(body)
    if key not in _kept:
        while len(_kept) > 16:
            del _kept[next(iter(_kept))]
        try:
            _kept[key] = _lines(*grid_of(body), held_faces(body))
        except ValueError as error:
            _kept[key] = str(error)
    found = _kept[key]
    return {} if isinstance(found, str) else found


def fault_of(body: bpy.types.Object) -> str:
    """Why a body's tissue has no grid; empty when it has."""
    grid_lines(body)
    found = _kept[_print(body)]
    return found if isinstance(found, str) else ""


def _print(body: bpy.types.Object) -> str:
    visual = [(shape_of(s), relative_pose(body, s).tobytes()) for s in shapes_of(body, "VISUAL")]
    words = f"{collision_print(body)} {sorted(tissue_keys(body).items())} {visual} {body.adf.role}"
    return hashlib.blake2b(words.encode(), digest_size=16).hexdigest()


def _lines(
    axes: list[np.ndarray], filled: np.ndarray, cuts: list, heights: list[float], held: tuple[str, ...]
) -> dict[str, np.ndarray]:
    padded = np.pad(filled, 1)
    quads: dict[str, list[np.ndarray]] = {"tissue": [], "held": [], "slit": [], "layer": []}
    for axis in range(3):
        below, above = (
            np.take(padded, range(*ends), axis=axis) for ends in ((0, -1 + padded.shape[axis]), (1, padded.shape[axis]))
        )
        inner = [slice(1, -1)] * 3
        inner[axis] = slice(None)
        edge = (below != above)[tuple(inner)]
        sites = np.argwhere(edge)
        low, high = (int(end) for end in (np.argwhere(filled)[:, axis].min(), np.argwhere(filled)[:, axis].max() + 1))
        name = "xyz"[axis]
        is_held = np.zeros(len(sites), dtype=bool)
        for face, plane in ((f"-{name}", low), (f"+{name}", high)):
            if face in held:
                is_held |= sites[:, axis] == plane
        quads["tissue"].append(_quads(axes, axis, sites[~is_held]))
        quads["held"].append(_quads(axes, axis, sites[is_held]))
        for cut in [cut for cut in cuts if cut.axis == axis]:
            across = np.argwhere(cut.mask)
            cells = np.insert(across, axis, cut.index, axis=1)
            both = filled[tuple((cells - np.eye(3, dtype=int)[axis]).T)] & filled[tuple(cells.T)]
            quads["slit"].append(_quads(axes, axis, cells[both]))
    for height in heights:
        level = int(np.argmin(np.abs(axes[2] - height)))
        if 0 < level < len(axes[2]) - 1:
            sites = np.argwhere(filled[:, :, level - 1] & filled[:, :, level])
            quads["layer"].append(_quads(axes, 2, np.insert(sites, 2, level, axis=1)))
    return {name: _edges(np.concatenate(found)) for name, found in quads.items() if sum(map(len, found))}


def _quads(axes: list[np.ndarray], axis: int, sites: np.ndarray) -> np.ndarray:
    """Corners (n, 4, 3) of the lattice faces across an axis at lattice indices (n, 3)."""
    b, c = ((axis + 1) % 3, (axis + 2) % 3)
    corners = np.repeat(sites[:, None, :], 4, axis=1)
    corners[:, (1, 2), b] += 1
    corners[:, (2, 3), c] += 1
    return np.stack([axes[a][corners[:, :, a]] for a in range(3)], axis=2)


def _edges(quads: np.ndarray) -> np.ndarray:
    """The edges (n, 2, 3) of quads (m, 4, 3), each once."""
    pairs = np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    swap = (pairs[:, 0] > pairs[:, 1]).any(axis=1)
    pairs[swap] = pairs[swap][:, ::-1]
    return np.unique(pairs.reshape(-1, 6), axis=0).reshape(-1, 2, 3)
