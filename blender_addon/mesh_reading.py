"""Reads the meshes of Blender's objects: arrays and digests, no operators.

Reading never changes the scene: modifiers are evaluated on a copy, scale and mirroring are
taken into the vertices, the winding of mirrored faces is turned round.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence

import bpy
import numpy as np

from . import compat
from .ligature.authoring.objfile import Surface
from .materials import Textures, look_of, paint_of
from .solids import Solid


class _Evaluated:
    """The mesh of an object with its modifiers, while it is used."""

    def __init__(self, obj: bpy.types.Object) -> None:
        self.obj = obj
        self.scene: bpy.types.Scene | None = None
        self.copy: bpy.types.Object | None = None
        self.user: bpy.types.Object | None = None
        self.edited: bpy.types.Mesh | None = None

    def __enter__(self) -> bpy.types.Mesh:
        if self.obj.mode == "EDIT":  # what is being edited is read from a copy, which has all layers
            self.obj.update_from_editmode()
            self.edited = self.obj.data.copy()
        if not self.obj.modifiers and not (self.obj.data.shape_keys and self.obj.type == "MESH"):
            return self.edited or self.obj.data
        # a scene of its own: the object may be hidden or excluded, and then nothing evaluates it
        self.scene = bpy.data.scenes.new("ADF evaluation")
        self.copy = self.obj.copy()
        self.copy.hide_viewport = False
        if self.edited is not None:
            self.copy.data = self.edited
        self.scene.collection.objects.link(self.copy)
        layer = self.scene.view_layers[0]
        layer.update()
        self.user = self.copy.evaluated_get(layer.depsgraph)
        return self.user.to_mesh()

    def __exit__(self, *error: object) -> None:
        if self.user is not None:
            self.user.to_mesh_clear()
        if self.copy is not None:
            bpy.data.objects.remove(self.copy)
        if self.scene is not None:
            bpy.data.scenes.remove(self.scene)
        if self.edited is not None:
            bpy.data.meshes.remove(self.edited)


def baked(obj: bpy.types.Object) -> bpy.types.Mesh:
    """A new data-block of an object's mesh with its modifiers applied."""
    evaluated = _Evaluated(obj)
    with evaluated as mesh:
        return mesh.copy() if evaluated.user is None else bpy.data.meshes.new_from_object(evaluated.user)


def surfaces_of(solid: Solid, textures: Textures | None = None, corners: bool = True) -> list[Surface]:
    """The triangles of a solid by material, in its owner's frame; ``corners`` adds normals and texture coordinates."""
    obj, place = solid.obj, solid.scale if solid.T_owner is None else solid.T_owner @ solid.scale
    with _Evaluated(obj) as mesh:
        mesh.calc_loop_triangles()
        vertices = _floats(mesh.vertices, "co", 3)
        triangles = _ints(mesh.loop_triangles, "vertices").reshape(-1, 3)
        loops = _ints(mesh.loop_triangles, "loops").reshape(-1, 3)
        material = np.empty(len(mesh.loop_triangles), dtype=np.int32)
        mesh.loop_triangles.foreach_get("material_index", material)
        uvs = _floats(mesh.uv_layers.active.data, "uv", 2)[loops] if corners and mesh.uv_layers.active else None
        normals = compat.corner_normals(mesh)[loops] if corners and len(loops) else None
        slots = [slot.material for slot in obj.material_slots] or [None]
    if np.linalg.det(place[:3, :3]) < 0.0:
        triangles = triangles[:, ::-1]
        uvs, normals = (None if v is None else v[:, ::-1] for v in (uvs, normals))
    vertices = vertices @ place[:3, :3].T + place[:3, 3]
    if normals is not None:
        normals = _unit(normals @ np.linalg.inv(place[:3, :3]))
    found = []
    for index in range(len(slots)):
        chosen = material == index if index < len(slots) - 1 else material >= index
        paint = paint_of(slots[index], f"material_{index:03d}", textures, obj.name)
        part = (None if v is None else v[chosen] for v in (normals, uvs))
        found.append(Surface(paint, vertices, triangles[chosen], *part))
    return [surface for surface in found if len(surface.triangles)]


def points_of(solid: Solid) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) in the owner's frame and triangles (m, 3), modifiers applied."""
    surfaces = surfaces_of(solid, corners=False)
    if not surfaces:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32)
    return surfaces[0].vertices, np.vstack([s.triangles for s in surfaces])


def fingerprint(solid: Solid) -> str:
    """A text that changes when the mesh that would be written changes."""
    obj = solid.obj
    if obj.type != "MESH":
        return obj.type
    digest = hashlib.blake2b(digest_size=16)
    with _Evaluated(obj) as mesh:
        digest.update(_floats(mesh.vertices, "co", 3).tobytes())
        digest.update(_ints(mesh.loops, "vertex_index", 1).tobytes())
        digest.update(_ints(mesh.polygons, "material_index", 1).tobytes())
        smooth = np.empty(len(mesh.polygons), dtype=bool)
        mesh.polygons.foreach_get("use_smooth", smooth)
        digest.update(smooth.tobytes())
        if mesh.uv_layers.active:
            digest.update(_floats(mesh.uv_layers.active.data, "uv", 2).tobytes())
    digest.update((np.round(solid.scale[:3, :3], 6) + 0.0).tobytes())  # a negative zero is none
    for slot in obj.material_slots:
        digest.update(repr(look_of(slot.material)).encode())
    return digest.hexdigest()


def mesh_print(solids: Sequence[Solid]) -> str:
    """A text that changes when the files of an object and its convex parts have to be written again."""
    own, *hulls = (fingerprint(solid) for solid in solids)
    return json.dumps([own, *sorted(hulls)])


def _floats(items: object, name: str, width: int) -> np.ndarray:
    values = np.empty(len(items) * width, dtype=np.float32)
    items.foreach_get(name, values)
    return values.reshape(-1, width)


def _ints(items: object, name: str, width: int = 3) -> np.ndarray:
    values = np.empty(len(items) * width, dtype=np.int32)
    items.foreach_get(name, values)
    return values


def _unit(vectors: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)
