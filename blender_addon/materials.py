"""Blender's materials from the materials of mesh files, and back."""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

import bpy
import numpy as np

from . import compat
from .ligature.authoring.objfile import Paint
from .ligature.mesh.mesh import Material

PICTURES = ("Base Color", "Normal")
"""Inputs of a Principled shader whose pictures are written."""


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
    """Texture files that go with meshes: bytes by name, copied as they are and never encoded again.

    ``names`` are those of `texture_names`.
    """

    def __init__(self, names: dict[str, str]) -> None:
        self.files: dict[str, bytes] = {}
        self.problems: list[str] = []
        self._names = names

    def name_of(self, image: bpy.types.Image | None, user: str) -> str:
        """The file name under which an image is saved; empty, with a problem noted, when it cannot be read.

        ``user`` is the object that shows it.
        """
        if image is None:
            return ""
        data = _image_bytes(image)
        if data is None:
            self.problems.append(f"'{user}': the texture '{image.name}' {_why_unreadable(image)}")
            return ""
        if image.is_dirty:
            self.problems.append(
                f"'{user}': the texture '{image.name}' has changes that are not saved, and is written without them; "
                "save it, or pack it again"
            )
        name = self._names[image.name_full]
        self.files[name] = data
        return name


def texture_names() -> dict[str, str]:
    """The names of the files of all images, by their full names: one each, also where disks fold case.

    They follow from the images alone, so that all files of a scene, and later exports of it, have the same ones.
    """
    wanted = {image.name_full: _file_name(image) for image in bpy.data.images}
    named: dict[str, str] = {}
    taken: set[str] = set()
    for full in sorted(wanted, key=lambda full: wanted[full] != full):  # those that keep their own name come first
        stem, end = os.path.splitext(wanted[full])
        name, number = wanted[full], 2
        while name.lower() in taken:
            name, number = f"{stem}_{number}{end}", number + 1
        taken.add(name.lower())
        named[full] = name
    return named


def _file_name(image: bpy.types.Image) -> str:
    """The name for an image's file; Blender numbers images of one name behind their ending."""
    base, number = os.path.splitext(image.name)
    stem = f"{Path(base).stem}_{number[1:]}" if number[1:].isdigit() else base
    return bpy.path.clean_name(stem) + (Path(image.filepath_raw or image.name).suffix or ".png")


def changed_textures(obj: bpy.types.Object, names: dict[str, str], own: Collection[str]) -> dict[str, bytes]:
    """The pictures of an object of which there are copies among the files ``own``, by the names of these."""
    copies = {os.path.basename(path) for path in own}
    shaders = [principled(slot.material) for slot in obj.material_slots if slot.material is not None]
    images = {_linked_image(shader.inputs[name]) for shader in shaders if shader for name in PICTURES}
    found = {}
    for image in images - {None}:
        name = names[image.name_full]
        if name in copies and (image.packed_file is not None or os.path.realpath(_image_path(image)) not in own):
            data = _image_bytes(image)
            if data is not None:
                found[name] = data
    return found


def _image_bytes(image: bpy.types.Image) -> bytes | None:
    if image.packed_file is not None:
        return bytes(image.packed_file.data)
    path = _image_path(image)
    try:
        return Path(path).read_bytes() if path and os.path.isfile(path) else None
    except OSError:
        return None


def _image_path(image: bpy.types.Image) -> str:
    return bpy.path.abspath(image.filepath, library=image.library)


def _why_unreadable(image: bpy.types.Image) -> str:
    if image.source == "TILED":
        return "is one of many tiles, which the format does not have; bake it to a single picture"
    if image.source == "GENERATED" or not image.filepath:
        return "is in Blender's memory alone; save or pack it"
    return f"cannot be read from '{image.filepath}'"


def paint_of(material: bpy.types.Material | None, name: str, textures: Textures | None, user: str = "") -> Paint:
    """A material of the object ``user`` in the dialect of MTL files; without ``textures`` its colours only."""
    if material is None:
        return Paint(name)
    shader = principled(material)
    if shader is None:
        r, g, b, a = material.diffuse_color
        return Paint(material.name, (r, g, b), alpha=a, shininess=shininess_of(material.roughness))
    images = (_linked_image(shader.inputs[name]) for name in PICTURES)
    colour, normal = (textures.name_of(image, user) if textures else "" for image in images)
    shininess = shininess_of(shader.inputs["Roughness"].default_value)
    level = compat.specular_input(shader).default_value
    return Paint(
        material.name,
        tuple(shader.inputs["Base Color"].default_value)[:3],
        (level, level, level),
        shininess,
        shader.inputs["Alpha"].default_value,
        colour,
        normal,
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


def look_of(material: bpy.types.Material | None) -> tuple:
    """Colours, exponent, opacity and texture paths of a material, which differ when its looks differ."""
    if material is None:
        return ()
    paint = paint_of(material, "", None)
    shader = principled(material)
    images = [_linked_image(shader.inputs[name]) for name in PICTURES] if shader else []
    return (paint.diffuse, paint.specular, paint.shininess, paint.alpha, [i.filepath if i else "" for i in images])
