"""Makes Blender's mesh data-blocks of mesh files."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np

from . import compat
from .ligature.mesh.mesh import Material, Mesh, MeshPart
from .materials import make_material


class MeshMaker:
    """Makes mesh data-blocks of mesh files; one per file, one material per look."""

    def __init__(self) -> None:
        self._meshes: dict[tuple, bpy.types.Mesh] = {}
        self._materials: dict[tuple, bpy.types.Material] = {}

    def whole(self, mesh: Mesh, name: str, scale: float = 1.0) -> bpy.types.Mesh:
        """All parts of a file as one data-block with one material slot per part."""
        key = (mesh.path, scale)
        if key not in self._meshes:
            self._meshes[key] = self._make(mesh.parts, name, scale)
        return self._meshes[key]

    def part(self, mesh: Mesh, index: int, name: str, scale: float = 1.0) -> bpy.types.Mesh:
        """One part of a file as a data-block without material."""
        key = (mesh.path, scale, index)
        if key not in self._meshes:
            part = mesh.parts[index]
            bare = MeshPart(part.name, part.vertices, part.faces)
            self._meshes[key] = self._make((bare,), name, scale)
        return self._meshes[key]

    def _make(self, parts: tuple[MeshPart, ...], name: str, scale: float) -> bpy.types.Mesh:
        made = bpy.data.meshes.new(name)
        parts, welded = _welded(parts)
        vertices = np.vstack([v for v, _ in welded]) if welded else np.zeros((0, 3))
        first = np.cumsum([0] + [len(v) for v, _ in welded[:-1]]) if welded else []
        triangles = (
            np.vstack([f + start for (_, f), start in zip(welded, first, strict=True)]) if welded else np.zeros((0, 3))
        )
        _fill(made, vertices * scale, triangles.astype(np.int32))
        counts = [len(part.faces) for part in parts]
        made.polygons.foreach_set("material_index", np.repeat(np.arange(len(parts), dtype=np.int32), counts))
        if any(part.material is not None for part in parts):
            for part in parts:
                made.materials.append(self._material(part.material, part.name))
        _add_corners(made, parts)
        made.update()
        return made

    def _material(self, material: Material | None, name: str) -> bpy.types.Material:
        look = material or Material(name)
        key = (look.name, look.diffuse, look.specular, look.shininess, look.alpha, look.texture, look.normal_map)
        if key not in self._materials:
            self._materials[key] = make_material(look)
        return self._materials[key]


def _welded(parts: tuple[MeshPart, ...]) -> tuple[tuple[MeshPart, ...], list[tuple[np.ndarray, np.ndarray]]]:
    """Merge vertices that differ only in normal or texture coordinate, so that faces share edges.

    Triangles of which two corners are one place have no area and are left out of the parts: Blender crashes on them.
    """
    kept, welded = [], []
    for part in parts:
        vertices, inverse = np.unique(part.vertices.astype(np.float32), axis=0, return_inverse=True)
        triangles = inverse.reshape(-1)[part.faces].reshape(-1, 3)
        proper = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
        kept.append(replace(part, faces=part.faces[proper]))
        welded.append((vertices, triangles[proper]))
    return tuple(kept), welded


def _fill(mesh: bpy.types.Mesh, vertices: np.ndarray, triangles: np.ndarray) -> None:
    count = len(triangles)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(vertices, dtype=np.float32).ravel())
    mesh.loops.add(3 * count)
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(triangles, dtype=np.int32).ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    if compat.VERSION < (3, 6, 0):
        mesh.polygons.foreach_set("loop_total", np.full(count, 3, dtype=np.int32))
    mesh.update(calc_edges=True)


def _add_corners(mesh: bpy.types.Mesh, parts: tuple[MeshPart, ...]) -> None:
    """Texture coordinates and normals of all parts that have them."""
    corners = sum(3 * len(part.faces) for part in parts)
    if corners != len(mesh.loops) or not corners:
        return
    if any(part.uvs is not None for part in parts):
        uvs = [
            part.uvs[part.faces].reshape(-1, 2) if part.uvs is not None else np.zeros((3 * len(part.faces), 2))
            for part in parts
        ]
        layer = mesh.uv_layers.new(name="UVMap")
        layer.data.foreach_set("uv", np.vstack(uvs).astype(np.float32).ravel())
    mesh.polygons.foreach_set("use_smooth", np.full(len(mesh.polygons), all(p.normals is not None for p in parts)))
    if all(part.normals is not None for part in parts):
        compat.set_corner_normals(mesh, np.vstack([part.normals[part.faces].reshape(-1, 3) for part in parts]))


def shape_data(vertices: np.ndarray, faces: list[tuple[int, ...]], name: str) -> bpy.types.Mesh:
    """A data-block of vertices and polygons."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(vertices, dtype=float).tolist(), [], [list(face) for face in faces])
    mesh.update()
    return mesh
