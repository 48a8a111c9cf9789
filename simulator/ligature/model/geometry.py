"""Shapes and visuals of elements, with their files found and their axes folded into poses.

Shapes are placed in the body frame B; metres.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ligature.adf import Diagnostic, Element, Resolver, Severity
from ligature.adf.diagnostics import AdfError, length
from ligature.adf.lacking import lack_of
from ligature.mesh import ConvexPart, collision_parts, load_mesh
from ligature.mesh.load import EXTENSIONS
from ligature.mesh.mesh import LOOK
from ligature.model.frames import Array, frame, pose_matrix, rpy_matrix
from ligature.model.shapes import (
    Box,
    Capsule,
    Collider,
    Colour,
    Cone,
    Cylinder,
    Hull,
    Plane,
    ShaderFiles,
    Shape,
    Sphere,
    TriMesh,
    Visual,
)

Report = Callable[[Diagnostic], None]

_AXIS = {"X": rpy_matrix(0, np.pi / 2, 0), "Y": rpy_matrix(-np.pi / 2, 0, 0), "Z": np.eye(3)}
"""Rotation that takes local Z to the axis."""

_MESH_KINDS = {
    "CONVEX_HULL": "hull",
    "CONVEX_MESH": "convex",
    "CONCAVE_MESH": "trimesh",
    "POINT_CLOUD": "points",
}


class GeometryError(Exception):
    """An object that cannot be built; ``diagnostic`` is the reason."""

    def __init__(self, diagnostic: Diagnostic) -> None:
        super().__init__(str(diagnostic))
        self.diagnostic = diagnostic


@dataclass(frozen=True)
class FileContext:
    """Where a model file looks for meshes: its folder and its file-level paths."""

    folder: Path
    high: str
    low: str
    resolver: Resolver
    report: Report


def colliders(element: Element, context: FileContext, default_offset: Array) -> tuple[Collider, ...]:
    """Collision shapes by priority: one primitive, a compound, a mesh, none; raises `GeometryError`."""
    if element.has("collision shape"):
        offset = _offset(element, "collision offset", default_offset)
        return (primitive(element, "collision shape", "collision geometry", offset),)
    if element.has("compound collision shape"):
        parts = _compound(element, "compound collision shape")
        if not parts:
            raise _error(element, "compound collision shape", "the list of collision shapes is empty", "add a shape")
        return parts
    name = element.text("collision mesh") if element.has("collision mesh") else element.text("mesh")
    if not name:
        return ()
    return _mesh_colliders(element, name, context)


def collision_margin(element: Element, shapes: tuple[Collider, ...], report: Report) -> float:
    """The collision margin, in metres, of an element with ``shapes``.

    It lies within boxes and cylinders, so that one of at least half their thickness turns them inside out for Bullet:
    spheres fall through them. Half of that is taken then.
    """
    margin = element.number("collision margin")
    inner = [part.shape for part in shapes if isinstance(part.shape, Box | Cylinder)]
    halves = [min(shape.size) / 2 if isinstance(shape, Box) else min(shape.radius, shape.height / 2) for shape in inner]
    if not halves or margin < min(halves):
        return margin
    least = float(min(halves))
    what = f"has a collision margin of {length(margin)} in a shape {length(2 * least)} thick"
    severity = Severity.WARNING if element.has("collision margin") else Severity.INFO
    hint = f"{length(least / 2)} is taken; give less than half the thickness"
    message = f"{element.kind} '{element.key}' {what}"
    report(Diagnostic(severity, message, element.mark_of("collision margin"), hint, "geometry"))
    return least / 2


def visual(element: Element, context: FileContext, shaders: ShaderFiles | None) -> Visual:
    """What is drawn: a shape, a compound or a mesh; raises `GeometryError` when the mesh is missing."""
    own = shader_files(element, "shaders", context.folder) or shaders
    colour = colour_of(element)
    shapes: tuple[Collider, ...] = ()
    mesh = low = None
    if element.has("shape"):
        shapes = (primitive(element, "shape", "geometry", np.eye(4)),)
    elif element.has("compound shape"):
        shapes = _compound(element, "compound shape")
    elif element.text("mesh"):
        mesh = _mesh_path(
            element, element.text("mesh"), "mesh", context, context.high, element.text("high resolution path")
        )
        low_text = os.path.join(context.low, _body_low(element), element.text("mesh"))
        low = _allowed(context, low_text)
    return Visual(mesh, low, element.number("scale"), shapes, colour, element.flag("visible"), own)


def colour_of(element: Element) -> Colour | None:
    """The colours that ``use material`` sets, or None to keep those of the mesh file."""
    if not element.flag("use material"):
        return None
    if element.has("color rgba"):
        r, g, b, a = (element.number(f"color rgba.{c}") for c in "rgba")
        return Colour(diffuse=(r, g, b), ambient=(r / 2, g / 2, b / 2), alpha=a)
    if not element.has("color components"):
        return None
    triples = {
        part: tuple(element.number(f"color components.{part}.{c}") for c in "rgb")
        for part in ("diffuse", "specular", "emission")
    }
    diffuse = triples["diffuse"]
    level = element.value("color components.ambient.level")
    ambient = (0.3, 0.3, 0.3) if level is None else tuple(level * c for c in diffuse)
    return Colour(
        diffuse=(diffuse[0], diffuse[1], diffuse[2]),
        ambient=(ambient[0], ambient[1], ambient[2]),
        specular=(triples["specular"][0], triples["specular"][1], triples["specular"][2]),
        emission=(triples["emission"][0], triples["emission"][1], triples["emission"][2]),
        shininess=element.integer("color components.shininess"),
        alpha=element.number("color components.transparency"),
    )


def shader_files(element: Element, block: str, folder: Path) -> ShaderFiles | None:
    """The shader program of a block, paths joined to ``folder``; None without the block."""
    if f"{block}.path" not in _known(element) or not element.has(block):
        return None
    base = folder / element.text(f"{block}.path")
    vertex, fragment = (base / element.text(f"{block}.{stage}") for stage in ("vertex", "fragment"))
    return ShaderFiles(vertex, fragment, element.mark_of(block))


def primitive(element: Element, shape_key: str, geometry: str, T: Array) -> Collider:
    """The primitive of ``shape_key`` at ``T`` (4, 4) in B, its axis folded in; raises `GeometryError`."""

    def size(name: str) -> float:
        value = element.value(f"{geometry}.{name}")
        if value is None:
            kind_ = element.text(shape_key)
            raise _error(element, geometry, f"a {kind_} needs '{name}' in '{geometry}'", f"add {name}: metres")
        if not value > 0.0:
            raise _error(element, f"{geometry}.{name}", f"'{name}' is {value:g}", "it must be larger than 0")
        return float(value)

    kind = element.text(shape_key)
    if kind == "BOX":
        return Collider(Box(np.array([size("x"), size("y"), size("z")])), T)
    if kind == "SPHERE":
        return Collider(Sphere(size("radius")), T)
    if kind == "PLANE":
        if not element.has(f"{geometry}.normal"):
            raise _error(element, geometry, "a PLANE needs 'normal'", "add normal: {x, y, z}")
        normal = np.array(element.vector(f"{geometry}.normal"))
        norm = float(np.linalg.norm(normal))
        if norm == 0.0:
            raise _error(element, geometry, "the normal of the plane is zero", "set a direction of non-zero length")
        return Collider(Plane(normal / norm, (element.value(f"{geometry}.offset") or 0.0) / norm), T)
    round_shapes: dict[str, type[Cylinder] | type[Capsule] | type[Cone]]
    round_shapes = {"CYLINDER": Cylinder, "CAPSULE": Capsule, "CONE": Cone}
    turned = T @ frame(_AXIS[element.text(f"{geometry}.axis")], (0, 0, 0))
    return Collider(round_shapes[kind](size("radius"), size("height")), turned)


def _compound(element: Element, key: str) -> tuple[Collider, ...]:
    parts = []
    for item in element.children(key):
        xyz, rpy = item.pose("offset")
        parts.append(primitive(item, "shape", "geometry", pose_matrix(xyz, rpy)))
    return tuple(parts)


def collision_mesh(element: Element, name: str, context: FileContext) -> Path:
    """The file of a collision mesh; raises `GeometryError` when it is missing."""
    return _mesh_path(element, name, "collision mesh", context, context.low, _body_low(element))


def _mesh_colliders(element: Element, name: str, context: FileContext) -> tuple[Collider, ...]:
    path = collision_mesh(element, name, context)
    kind = _MESH_KINDS[element.text("collision mesh type")]
    try:
        mesh = load_mesh(path, context.resolver)
        pieces = collision_parts(mesh, kind, element.number("scale"), context.report)
    except AdfError as error:
        raise GeometryError(error.diagnostics[0]) from error
    for diagnostic in mesh.diagnostics:
        if diagnostic.code != LOOK:  # this mesh is never drawn
            context.report(diagnostic)
    identity = np.eye(4)
    shapes: list[Shape] = []
    for piece in pieces:
        if not isinstance(piece, ConvexPart):
            shapes.append(TriMesh(piece.vertices, piece.faces, str(path)))
        elif len(piece.vertices) == 1:
            shapes.append(Sphere(_point_radius(element)))
        else:
            shapes.append(Hull(piece.vertices))
    places = [
        frame(np.eye(3), piece.vertices[0]) if isinstance(shape, Sphere) else identity
        for piece, shape in zip(pieces, shapes, strict=True)
    ]
    return tuple(Collider(shape, T) for shape, T in zip(shapes, places, strict=True))


def _point_radius(element: Element) -> float:
    """Radius of the spheres that stand for the points of a mesh: the collision margin."""
    radius = element.number("collision margin")
    if not radius > 0.0:
        raise _error(
            element, "collision margin", f"its points are spheres of radius {radius:g}",
            "give a 'collision margin' above 0, or another 'collision mesh type'",
        )  # fmt: skip
    return radius


def _body_low(element: Element) -> str:
    """Body-level folder of collision meshes: low, else high."""
    return element.text("low resolution path") or element.text("high resolution path")


def _mesh_path(element: Element, name: str, key: str, context: FileContext, level: str, own: str) -> Path:
    """The mesh file of a body; a missing low-resolution file falls back to the high-resolution one."""
    key = key if element.has(key) else "mesh"
    text = os.path.join(level, own, name)
    try:
        path = context.resolver.resolve(text, context.folder, element.mark_of(key))
    except AdfError as error:
        raise GeometryError(error.diagnostics[0]) from error
    if path.suffix.lower() not in EXTENSIONS:
        raise _error(element, key, f"'{name}' is not a mesh format that is read", f"use {', '.join(EXTENSIONS)}")
    lack = lack_of(path)
    if lack is None:
        return path
    high = _allowed(context, os.path.join(context.high, element.text("high resolution path"), name))
    if high is not None and lack_of(high) is None:
        context.report(
            Diagnostic(
                Severity.WARNING, f"'{text}' {lack.fault}; using the high-resolution mesh",
                element.mark_of(key), f"looked for {path}", "mesh",
            )
        )  # fmt: skip
        return high
    raise _error(element, key, f"mesh '{name}' {lack.fault}", lack.hint or f"looked for {path}")


def _allowed(context: FileContext, text: str) -> Path | None:
    try:
        return context.resolver.resolve(text, context.folder)
    except AdfError:
        return None


def _offset(element: Element, key: str, default: Array) -> Array:
    return pose_matrix(*element.pose(key)) if element.has(key) else default


def _known(element: Element) -> set[str]:
    from ligature.adf.schema import BY_PATH

    return set(BY_PATH[element.kind])


def _error(element: Element, key: str, message: str, hint: str) -> GeometryError:
    text = f"{element.kind} '{element.key}': {message}"
    return GeometryError(Diagnostic(Severity.ERROR, text, element.mark_of(key), hint, "geometry"))
