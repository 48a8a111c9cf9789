"""Everything that differs between Blender 3.4 and 5: no other file asks for the version."""

from __future__ import annotations

import sys
from pathlib import Path

import bpy
import numpy as np

VERSION = bpy.app.version
HAS_FILE_HANDLER = hasattr(bpy.types, "FileHandler")


def corner_normals(mesh: bpy.types.Mesh) -> np.ndarray:
    """Normals (n, 3) of the loops of a mesh."""
    if hasattr(mesh, "corner_normals"):  # from 4.1
        normals = np.empty(len(mesh.loops) * 3, dtype=np.float32)
        mesh.corner_normals.foreach_get("vector", normals)
        return normals.reshape(-1, 3)
    mesh.calc_normals_split()
    normals = np.empty(len(mesh.loops) * 3, dtype=np.float32)
    mesh.loops.foreach_get("normal", normals)
    mesh.free_normals_split()
    return normals.reshape(-1, 3)


def set_corner_normals(mesh: bpy.types.Mesh, normals: np.ndarray) -> None:
    """Give the loops of a mesh normals (n, 3) of their own."""
    if VERSION < (4, 1, 0):
        mesh.use_auto_smooth = True
    mesh.normals_split_custom_set(normals.tolist())


def specular_input(shader: bpy.types.Node) -> bpy.types.NodeSocket:
    """The input of a Principled shader that holds the strength of reflections."""
    return shader.inputs.get("Specular IOR Level") or shader.inputs["Specular"]  # renamed in 4.0


def enable_nodes(material: bpy.types.Material) -> None:
    """Give a material a node tree; from 5.0 every material has one."""
    if material.node_tree is None:
        material.use_nodes = True


def make_transparent(material: bpy.types.Material) -> None:
    """Let a material with alpha below one be seen through."""
    if hasattr(material, "surface_render_method"):  # from 4.2
        material.surface_render_method = "BLENDED"
    else:
        material.blend_method = "BLEND"


def cache_folder() -> str:
    """Folder for decompositions and simulated motions; it survives updates."""
    if hasattr(bpy.utils, "extension_path_user") and __package__.startswith("bl_ext."):  # from 4.2
        return bpy.utils.extension_path_user(__package__, path="cache", create=True)
    return bpy.utils.user_resource("DATAFILES", path="adf_studio", create=True)


def is_online() -> bool:
    """Whether the user lets extensions use the network; before 4.2 nobody was asked."""
    return getattr(bpy.app, "online_access", True)


def python() -> str:
    """The Python that Blender comes with, or that it is a module of; Debian's Blender uses the system's."""
    name = f"python{sys.version_info.major}.{sys.version_info.minor}"
    own = Path(sys.prefix, "bin", name)
    return str(own) if bpy.app.binary_path and own.is_file() else sys.executable


def custom_properties(owner: bpy.types.ID) -> dict:
    """The properties that add-ons gave an object or scene, by name; also of add-ons that are not enabled."""
    groups = [owner]
    if hasattr(owner, "bl_system_properties_get"):  # from 5.0 those of add-ons lie apart from the user's own
        groups.append(owner.bl_system_properties_get() or {})
    found = {name: group[name] for group in groups for name in group.keys()}  # noqa: SIM118  (no dict)
    enabled = [name for name in owner.bl_rna.properties.keys() if name.startswith("ambf_")]  # noqa: SIM118
    return {**found, **{name: getattr(owner, name) for name in enabled}}


def line_shader():
    """Shader and name of the colour uniform for plain lines of one colour."""
    import gpu

    return gpu.shader.from_builtin("UNIFORM_COLOR")


def colour_shader():
    """Shader for triangles with a colour at each corner."""
    import gpu

    return gpu.shader.from_builtin("SMOOTH_COLOR")


def text_size(font: int, size: float) -> None:
    """Set the height in pixels of text drawn over the view."""
    import blf

    if VERSION < (4, 0, 0):
        blf.size(font, round(size), 72)  # whole points of 72 to the inch
    else:
        blf.size(font, size)
