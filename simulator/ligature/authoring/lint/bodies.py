"""Checks of bodies: mass, inertia, collision shapes and meshes, margins, groups, overlaps."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from ligature.adf import Element, Severity
from ligature.adf.diagnostics import length
from ligature.adf.frames import Array, inverse
from ligature.authoring.lint.subject import Finding, Subject, rule
from ligature.authoring.placement import AXIS_TURNS, matrix_of
from ligature.authoring.shapes import ROUND, Shape, shape_mesh, shapes_properties
from ligature.mesh.inertia import mass_properties
from ligature.mesh.surface import extent_rank

INERTIA_RATIO = 10.0
MARGIN_RATIO = 4.0
HULL_VERTICES = 100
OVERLAP = 1e-4
"""Metres by which two shapes may reach into each other at rest."""


@rule("mass-missing")
def mass_missing(subject: Subject) -> Iterator[Finding]:
    """Without ``mass`` the loader reads no inertial key and takes 1 kg."""
    for body in subject.bodies.values():
        if not body.has("mass"):
            yield Finding(
                "mass-missing",
                Severity.ERROR,
                body.key,
                "it has no mass",
                "give its mass; 0 makes it static",
                {"mass": 1.0},
            )


@rule("inertia-impossible")
def inertia_impossible(subject: Subject) -> Iterator[Finding]:
    """Principal moments are positive, and none exceeds the sum of the others."""
    for body in subject.bodies.values():
        if not body.has("inertia") or not subject.moves(body):
            continue
        a, b, c = sorted(body.number(f"inertia.{i}") for i in ("ix", "iy", "iz"))
        if a <= 0.0:
            message = "a moment of inertia is not positive"
        elif c > (a + b) * 1.0001:
            message = f"no solid has the moments {a:g}, {b:g}, {c:g}: the largest exceeds the sum of the others"
        else:
            continue
        yield Finding("inertia-impossible", Severity.ERROR, body.key, message, "set the inertia from its geometry")


@rule("inertia-unlike-geometry")
def inertia_unlike_geometry(subject: Subject) -> Iterator[Finding]:
    """Moments far from those of the shapes or the mesh are a slip, unless inflated on purpose."""
    for body in subject.bodies.values():
        if not body.has("inertia") or body.key in subject.inflated or not subject.moves(body):
            continue
        expected = _geometric_moments(subject, body)
        if expected is None:
            continue
        given = np.sort([body.number(f"inertia.{i}") for i in ("ix", "iy", "iz")])
        ratio = float(np.max(np.maximum(given / expected, expected / np.maximum(given, 1e-300))))
        if ratio > INERTIA_RATIO:
            message = f"its inertia is {ratio:.3g} times larger or smaller than that of its geometry"
            hint = "compute it from the geometry, or inflate it by a factor that the file keeps"
            yield Finding("inertia-unlike-geometry", Severity.WARNING, body.key, message, hint)


def _geometric_moments(subject: Subject, body: Element) -> Array | None:
    shapes = [(shape, T) for shape, T in subject.shapes(body) if shape.kind != "PLANE"]
    try:
        if shapes:
            solid = shapes_properties(shapes)
        else:
            surface = subject.surface(body)
            if surface is None:
                return None
            solid = mass_properties(*surface)
        return np.asarray(solid.with_mass(body.number("mass")).principal()[0])
    except ValueError:
        return None


@rule("capsule-too-short")
def capsule_too_short(subject: Subject) -> Iterator[Finding]:
    """A capsule's height holds both caps."""
    for element in _shaped(subject):
        for shape, _ in subject.shapes(element):
            if shape.kind == "CAPSULE" and shape.height < 2.0 * shape.radius * (1.0 - 1e-6):
                message = f"a capsule is {shape.height:g} m high, less than its two caps of {shape.radius:g} m"
                hint = "its height is the whole length; use a sphere or enlarge it"
                yield Finding("capsule-too-short", Severity.ERROR, element.key, message, hint)


@rule("plane-in-compound")
def plane_in_compound(subject: Subject) -> Iterator[Finding]:
    """A plane is infinite and stands alone."""
    for element in _shaped(subject):
        shapes = subject.shapes(element)
        if len(shapes) > 1 and any(shape.kind == "PLANE" for shape, _ in shapes):
            hint = "give the plane a body of its own"
            yield Finding("plane-in-compound", Severity.ERROR, element.key, "a plane is part of a compound", hint)


@rule("group-out-of-range")
def group_out_of_range(subject: Subject) -> Iterator[Finding]:
    """Groups are 0 to 999."""
    for element in _shaped(subject):
        groups = [int(g) for g in element.numbers("collision groups")]
        wrong = [g for g in groups if not 0 <= g <= 999]
        if wrong:
            kept = tuple(g for g in groups if 0 <= g <= 999)
            message = f"collision group {wrong[0]} is dropped"
            yield Finding(
                "group-out-of-range",
                Severity.ERROR,
                element.key,
                message,
                "groups are 0 to 999",
                {"collision groups": kept},
            )


@rule("groups-without-effect")
def groups_without_effect(subject: Subject) -> Iterator[Finding]:
    """The file's switch overrides groups among its own bodies."""
    grouped = [e for e in subject.bodies.values() if e.numbers("collision groups")]
    if subject.document.top.flag("ignore inter-collision") and len(grouped) > 1:
        message = "bodies have collision groups, but 'ignore inter-collision' keeps all bodies of the file apart"
        yield Finding("groups-without-effect", Severity.WARNING, "", message, "turn it off for groups to decide")


@rule("hull-flat")
def hull_flat(subject: Subject) -> Iterator[Finding]:
    """A convex piece needs four points that are not in one plane."""
    for body in subject.bodies.values():
        if not _collides_by_mesh(subject, body) or "CONVEX" not in body.text("collision mesh type"):
            continue
        mesh = _collision_mesh(subject, body)
        for part in mesh.parts if mesh else ():
            if len(part.faces) and extent_rank(part.vertices) < 3:
                message = f"the convex piece '{part.name}' is flat"
                yield Finding("hull-flat", Severity.ERROR, body.key, message, "give it thickness, or remove it")


@rule("hull-too-fine")
def hull_too_fine(subject: Subject) -> Iterator[Finding]:
    """Every vertex of a hull costs time in each contact."""
    for body in subject.bodies.values():
        if not _collides_by_mesh(subject, body) or body.text("collision mesh type") != "CONVEX_HULL":
            continue
        mesh = _collision_mesh(subject, body)
        for part in mesh.parts if mesh else ():
            count = len(np.unique(part.vertices, axis=0))
            if count > HULL_VERTICES:
                message = f"the convex piece '{part.name}' has {count} vertices"
                yield Finding("hull-too-fine", Severity.WARNING, body.key, message, "fit a primitive, or decimate it")


@rule("concave-moving")
def concave_moving(subject: Subject) -> Iterator[Finding]:
    """A moving triangle mesh is slow and lets things through."""
    for body in subject.bodies.values():
        if (
            subject.moves(body)
            and _collides_by_mesh(subject, body)
            and body.text("collision mesh type") == "CONCAVE_MESH"
        ):
            message = "it moves and collides as a triangle mesh"
            hint = "decompose it into convex pieces, or fit primitives"
            fix = {"collision mesh type": "CONVEX_HULL"}
            yield Finding("concave-moving", Severity.WARNING, body.key, message, hint, fix)


@rule("thin-for-margin")
def thin_for_margin(subject: Subject) -> Iterator[Finding]:
    """The margin is to be small beside the thinnest part."""
    for body in subject.bodies.values():
        sizes = [_thickness(shape) for shape, _ in subject.shapes(body) if shape.kind != "PLANE"]
        margin = body.number("collision margin")
        if sizes and min(sizes) < MARGIN_RATIO * margin:
            message = f"its margin of {margin:g} m is large for its thinnest part of {min(sizes):g} m"
            fix = {"collision margin": float(f"{min(sizes) / 10.0:.3g}")}
            hint = f"take {fix['collision margin']:g} m"
            yield Finding("thin-for-margin", Severity.WARNING, body.key, message, hint, fix)


def _thickness(shape: Shape) -> float:
    return min(shape.size) if shape.kind == "BOX" else 2.0 * shape.radius


@rule("name-clash")
def name_clash(subject: Subject) -> Iterator[Finding]:
    """Blanks are removed from names, and equal names share topics."""
    users: dict[tuple[str, str], Element] = {}
    for element in subject.objects:
        if element.kind in ("joint", "suture", "input device") or element.flag("passive"):
            continue
        name = (element.text("namespace"), element.text("name").replace(" ", ""))
        if name in users and name[1]:
            message = f"its name '{element.text('name')}' gives the same topics as the name of '{users[name].key}'"
            yield Finding("name-clash", Severity.ERROR, element.key, message, "spaces are ignored; rename one of them")
        users.setdefault(name, element)


@rule("overlap-at-rest")
def overlap_at_rest(subject: Subject) -> Iterator[Finding]:
    """Bodies that start inside each other are thrown apart."""
    if subject.document.top.flag("ignore inter-collision"):
        return
    joined = {frozenset((a.key, b.key)) for a, b in _joined_pairs(subject)}
    placed = [(body, _world_shapes(subject, body)) for body in subject.bodies.values() if subject.shapes(body)]
    for (a, shapes_a), (b, shapes_b) in combinations(placed, 2):
        if frozenset((a.key, b.key)) in joined or not (subject.moves(a) or subject.moves(b)) or _apart_by_groups(a, b):
            continue
        depth = max((_depth(s, t) for s in shapes_a for t in shapes_b), default=0.0)
        if depth > OVERLAP:
            message = f"it starts {length(depth, 2)} inside '{b.key}'"
            yield Finding(
                "overlap-at-rest", Severity.WARNING, a.key, message, "move one of them, or set collision groups"
            )


def _joined_pairs(subject: Subject) -> Iterator[tuple[Element, Element]]:
    for joint in subject.joints:
        parent, child = subject.body(joint.text("parent")), subject.body(joint.text("child"))
        if parent is not None and child is not None and joint.flag("ignore inter-collision"):
            yield parent, child


def _apart_by_groups(a: Element, b: Element) -> bool:
    groups = [set(e.numbers("collision groups")) for e in (a, b)]
    return bool(groups[0] and groups[1] and not groups[0] & groups[1])


def _world_shapes(subject: Subject, body: Element) -> list[tuple[Shape, Array]]:
    T = matrix_of(body.pose("location"))
    return [(shape, T @ T_shape) for shape, T_shape in subject.shapes(body) if shape.kind != "PLANE"]


def _depth(a: tuple[Shape, Array], b: tuple[Shape, Array]) -> float:
    """How deep points of one shape lie inside the other, either way round; a lower bound."""
    if np.linalg.norm(a[1][:3, 3] - b[1][:3, 3]) > _reach(a[0]) + _reach(b[0]):
        return 0.0
    return max(_points_inside(a, b), _points_inside(b, a))


def _reach(shape: Shape) -> float:
    """Radius of a ball around the origin of a shape's frame that holds it, a cone as a cylinder."""
    if shape.kind == "BOX":
        return float(np.linalg.norm(shape.size)) / 2.0
    return shape.radius if shape.kind == "SPHERE" else float(np.hypot(shape.radius, shape.height / 2.0))


def _points_inside(a: tuple[Shape, Array], b: tuple[Shape, Array]) -> float:
    vertices, _ = shape_mesh(a[0])
    points = np.vstack([vertices, vertices.mean(axis=0)])
    T = inverse(b[1]) @ a[1]
    return float(max(inside_depth(b[0], points @ T[:3, :3].T + T[:3, 3]).max(), 0.0))


def inside_depth(shape: Shape, points: Array) -> Array:
    """Distance (n,) of points (n, 3) to the surface of a shape from inside, negative outside; cones as cylinders."""
    local = points @ AXIS_TURNS[shape.axis] if shape.kind in ROUND else points
    if shape.kind == "BOX":
        return np.asarray((np.asarray(shape.size) / 2.0 - np.abs(local)).min(axis=1))
    if shape.kind == "SPHERE":
        return np.asarray(shape.radius - np.linalg.norm(local, axis=1))
    across, along = np.hypot(local[:, 0], local[:, 1]), np.abs(local[:, 2])
    if shape.kind == "CAPSULE":
        over = np.maximum(along - (shape.height / 2.0 - shape.radius), 0.0)
        return np.asarray(shape.radius - np.hypot(across, over))
    return np.minimum(shape.radius - across, shape.height / 2.0 - along)


def _shaped(subject: Subject) -> list[Element]:
    return [e for e in subject.objects if e.kind in ("body", "ghost object", "soft body")]


def _collides_by_mesh(subject: Subject, body: Element) -> bool:
    if body.has("collision shape") or body.has("compound collision shape"):
        return False
    return bool(body.value("collision mesh")) or (not body.has("collision mesh") and bool(body.text("mesh")))


def _collision_mesh(subject: Subject, body: Element):  # type: ignore[no-untyped-def]
    return subject.mesh(body, "collision mesh" if body.has("collision mesh") else "mesh")
