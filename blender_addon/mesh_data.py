"""Blender meshes and materials from mesh files, and back: arrays in, arrays out, no operators.

Reading a mesh never changes the scene: modifiers are evaluated on a copy, scale and mirroring are
taken into the vertices, the winding of mirrored faces is turned round.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from . import compat
from .ligature.authoring.objfile import Paint, Surface
from .ligature.mesh.mesh import Material, Mesh, MeshPart
from .solids import Solid


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
        welded = [_welded(part) for part in parts]
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


def _welded(part: MeshPart) -> tuple[np.ndarray, np.ndarray]:
    """Vertices that differ only in normal or texture coordinate joined, so that edges are whole."""
    vertices, inverse = np.unique(part.vertices.astype(np.float32), axis=0, return_inverse=True)
    return vertices, inverse.reshape(-1)[part.faces].reshape(-1, 3)


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


def make_material(look: Material) -> bpy.types.Material:
    """A Principled material of a mesh file's material, with its textures."""
    material = bpy.data.materials.new(look.name)
    material.diffuse_color = (*look.diffuse, look.alpha)
    material.roughness = roughness_of(look.shininess)
    compat.enable_nodes(material)
    shader = principled(material)
    if shader is None:
        return material
    shader.inputs["Base Color"].default_value = (*look.diffuse, 1.0)
    shader.inputs["Alpha"].default_value = look.alpha
    shader.inputs["Roughness"].default_value = roughness_of(look.shininess)
    compat.specular_input(shader).default_value = min(sum(look.specular) / 3.0, 1.0)
    if look.alpha < 1.0:
        compat.make_transparent(material)
    links = material.node_tree.links
    if look.texture is not None and look.texture.is_file():
        links.new(_image_node(material, look.texture).outputs["Color"], shader.inputs["Base Color"])
    if look.normal_map is not None and look.normal_map.is_file():
        image = _image_node(material, look.normal_map)
        image.image.colorspace_settings.is_data = True
        bump = material.node_tree.nodes.new("ShaderNodeNormalMap")
        links.new(image.outputs["Color"], bump.inputs["Color"])
        links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    return material


def _image_node(material: bpy.types.Material, path: Path) -> bpy.types.Node:
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.load(str(path), check_existing=True)
    return node


def principled(material: bpy.types.Material) -> bpy.types.Node | None:
    """The Principled shader of a material, if it has one."""
    nodes = material.node_tree.nodes if material.node_tree else ()
    return next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)


def roughness_of(shininess: float) -> float:
    """Roughness of a Blinn–Phong exponent: the exponent is 2/r⁴ − 2 (Walter et al. 2007, as r² = α)."""
    return float(np.clip((2.0 / (max(shininess, 0.0) + 2.0)) ** 0.25, 0.0, 1.0))


def shininess_of(roughness: float) -> float:
    """Blinn–Phong exponent of a roughness; the inverse of `roughness_of`, at most 1000."""
    return float(min(2.0 / max(roughness, 0.05) ** 4 - 2.0, 1000.0))


class Textures:
    """Texture files that go with meshes: bytes by name, copied as they are and never encoded again."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.problems: list[str] = []

    def name_of(self, image: bpy.types.Image | None, user: str) -> str:
        """The file name under which an image is saved; empty, with a problem noted, when it cannot be read.

        ``user`` is the object that shows it.
        """
        if image is None:
            return ""
        data = _image_bytes(image)
        if data is None:
            self.problems.append(f"'{user}': the texture '{image.name}' cannot be read from '{image.filepath}'")
            return ""
        name = bpy.path.clean_name(Path(image.name).stem) + (Path(image.filepath_raw or image.name).suffix or ".png")
        while name in self.files and self.files[name] != data:
            name = f"{Path(name).stem}_{Path(name).suffix}"
        self.files[name] = data
        return name


def _image_bytes(image: bpy.types.Image) -> bytes | None:
    if image.packed_file is not None:
        return bytes(image.packed_file.data)
    path = bpy.path.abspath(image.filepath, library=image.library)
    try:
        return Path(path).read_bytes() if path and os.path.isfile(path) else None
    except OSError:
        return None


def paint_of(material: bpy.types.Material | None, name: str, textures: Textures | None, user: str = "") -> Paint:
    """A material of the object ``user`` in the dialect of MTL files; without ``textures`` its colours only."""
    if material is None:
        return Paint(name)
    shader = principled(material)
    if shader is None:
        r, g, b, a = material.diffuse_color
        return Paint(material.name, (r, g, b), alpha=a, shininess=shininess_of(material.roughness))
    colour = tuple(shader.inputs["Base Color"].default_value)[:3]
    level = compat.specular_input(shader).default_value
    return Paint(
        material.name,
        colour,
        (level, level, level),
        shininess_of(shader.inputs["Roughness"].default_value),
        shader.inputs["Alpha"].default_value,
        textures.name_of(_linked_image(shader.inputs["Base Color"]), user) if textures else "",
        textures.name_of(_linked_image(shader.inputs["Normal"]), user) if textures else "",
    )


def _linked_image(socket: bpy.types.NodeSocket) -> bpy.types.Image | None:
    """The image behind a socket, through a normal-map node."""
    for _ in range(4):
        if not socket.is_linked:
            return None
        node = socket.links[0].from_node
        if node.type == "TEX_IMAGE":
            return node.image
        if "Color" not in node.inputs:
            return None
        socket = node.inputs["Color"]
    return None


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
        self.copy.parent = None
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
        digest.update(repr(_look(slot.material)).encode())
    return digest.hexdigest()


def mesh_print(solids: Sequence[Solid]) -> str:
    """A text that changes when the files of an object and its convex parts have to be written again."""
    own, *hulls = (fingerprint(solid) for solid in solids)
    return json.dumps([own, *sorted(hulls)])


def _look(material: bpy.types.Material | None) -> tuple:
    if material is None:
        return ()
    paint = paint_of(material, "", None)
    shader = principled(material)
    images = [_linked_image(shader.inputs[name]) for name in ("Base Color", "Normal")] if shader else []
    return (paint.diffuse, paint.specular, paint.shininess, paint.alpha, [i.filepath if i else "" for i in images])


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
