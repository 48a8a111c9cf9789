"""Random trees of objects as users of Blender make them: names, transforms, parents, modifiers; and how they are seen."""

from pathlib import Path

import bmesh
import bpy
import numpy as np
from mathutils import Quaternion, Vector

from .scene import select

NAMES = (
    "Würfel", "球.001", "a.b.c", "name with spaces", "1st", "a/b", "quote'\"", "colon: x", "#hash", "x" * 60, "- dash",
    "{brace}", "tab\tname", "null", "0x10", "é", "true", "[list]", "&anchor", "*star", "%percent", "BODY x",
    "back\\slash", "日本語 部品", "Part.L", "Part.R", "part.l", "trailing ", "  leading", "~", "line\nbreak", "=", "!tag", "`",
    "@at", "|pipe", ">more", "?question",
)  # fmt: skip
MODES = ("QUATERNION", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "AXIS_ANGLE")
SOLIDS = ("cube", "ball", "polygon", "grid", "prism")
ALONE = ("ARRAY", "MIRROR", "SUBSURF", "SOLIDIFY", "BEVEL", "TRIANGULATE", "DISPLACE", "WIREFRAME")
WITH_ANOTHER = {
    "ARRAY": "offset_object", "MIRROR": "mirror_object", "BOOLEAN": "object", "HOOK": "object",
    "SIMPLE_DEFORM": "origin", "CAST": "object", "SHRINKWRAP": "target",
}  # fmt: skip
"""Modifiers that look at another object, and how they call it."""


def turned(obj, rng):
    """Turn an object at random, in any of the ways that Blender has."""
    obj.rotation_mode = str(rng.choice(MODES))
    if obj.rotation_mode == "QUATERNION":
        obj.rotation_quaternion = rng.normal(size=4)  # not of unit length either
    elif obj.rotation_mode == "AXIS_ANGLE":
        obj.rotation_axis_angle = [float(rng.uniform(-6.0, 6.0)), *rng.normal(size=3).tolist()]
    else:
        obj.rotation_euler = rng.uniform(-7.0, 7.0, 3)


def random_mesh(rng, kind=""):
    """A mesh of one of `SOLIDS`, each vertex a little beside its place; some have loose edges too."""
    kind, work = kind or str(rng.choice(SOLIDS)), bmesh.new()
    if kind == "cube":
        bmesh.ops.create_cube(work, size=0.2)
    elif kind == "ball":
        bmesh.ops.create_icosphere(work, subdivisions=1, radius=0.1)
    elif kind == "polygon":
        bmesh.ops.create_circle(work, cap_ends=True, segments=int(rng.integers(5, 12)), radius=0.1)
    elif kind == "grid":
        bmesh.ops.create_grid(work, x_segments=3, y_segments=2, size=0.1)
    else:
        turns = np.linspace(0.0, 2.0 * np.pi, 7, endpoint=False)
        corners = [(0.1 * np.cos(t), 0.1 * np.sin(t) * (0.3 if n % 2 else 1.0), 0.0) for n, t in enumerate(turns)]
        base = work.faces.new([work.verts.new(corner) for corner in corners])
        top = bmesh.ops.extrude_face_region(work, geom=[base])["geom"]
        bmesh.ops.translate(work, verts=[v for v in top if isinstance(v, bmesh.types.BMVert)], vec=(0.0, 0.0, 0.1))
    for vertex in work.verts:
        vertex.co += Vector(rng.normal(size=3) * 0.005)
    if rng.random() < 0.3:
        work.verts.ensure_lookup_table()
        work.edges.new((work.verts[0], work.verts.new(rng.uniform(-0.3, 0.3, 3))))
    data = bpy.data.meshes.new(kind)
    work.to_mesh(data)
    work.free()
    return data


def random_tree(seed, count=8, modifiers=True):
    """Objects with meshes, empties and linked duplicates, scaled, mirrored, turned and parented; returns them."""
    rng = np.random.default_rng(seed)
    objects = []
    for name in rng.permutation(NAMES)[:count]:
        data = None if rng.random() < 0.1 else random_mesh(rng)
        if objects and rng.random() < 0.15:
            data = objects[rng.integers(len(objects))].data
        obj = bpy.data.objects.new(str(name), data)
        bpy.context.scene.collection.objects.link(obj)
        obj.location = rng.uniform(-1.0, 1.0, 3)
        if rng.random() < 0.7:
            obj.scale = rng.uniform(0.4, 2.0, 3) * np.where(rng.random(3) < 0.25, -1.0, 1.0)
        turned(obj, rng)
        for group, low, high in (("location", -0.3, 0.3), ("scale", 0.5, 1.5), ("rotation_euler", -1.0, 1.0)):
            if rng.random() < 0.2:
                setattr(obj, f"delta_{group}", rng.uniform(low, high, 3))
        if objects and rng.random() < 0.5:
            obj.parent = objects[rng.integers(len(objects))]
            if rng.random() < 0.5:
                bpy.context.view_layer.update()
                obj.matrix_parent_inverse = obj.parent.matrix_world.inverted()
        objects.append(obj)
    if modifiers:
        for number, obj in enumerate(objects):
            if obj.type == "MESH" and rng.random() < 0.6:
                _modify(obj, objects[:number], rng)
    bpy.context.view_layer.update()
    return objects


def _modify(obj, others, rng):
    """Give an object a modifier, which may look at one of ``others``."""
    others = [other for other in others if other.type == "MESH"]
    if not others or rng.random() < 0.4:
        modifier = obj.modifiers.new("modifier", str(rng.choice(ALONE)))
        modifier.show_viewport = bool(rng.random() < 0.8)
        return
    kind = str(rng.choice(list(WITH_ANOTHER)))
    modifier = obj.modifiers.new("modifier", kind)
    setattr(modifier, WITH_ANOTHER[kind], others[rng.integers(len(others))])
    if kind == "ARRAY":
        modifier.use_relative_offset, modifier.use_object_offset = False, True
    elif kind == "BOOLEAN":
        modifier.operation = "UNION"
    elif kind == "HOOK":
        modifier.vertex_indices_set([0, 1])
    elif kind == "SIMPLE_DEFORM":
        modifier.angle = 0.5


def hidden(objects, rng):
    """Hide some of the objects, in each of the ways that Blender has."""
    for obj in objects:
        way = rng.integers(6)
        if way == 0:
            obj.hide_set(True)
        elif way < 3:
            setattr(obj, ("hide_viewport", "hide_render")[way - 1], True)


def made_bodies(objects):
    """Make the objects bodies of a new model; returns its collection."""
    bpy.ops.adf.new_file(kind="MODEL", name="model")
    select(*objects)
    bpy.ops.adf.make(role="BODY")
    return bpy.context.scene.adf.models[0].collection


def as_seen(objects):
    """By name: the world matrix (4, 4) and the vertices of faces in the world (n, 3), as Blender itself has them."""
    bpy.context.view_layer.update()
    graph, found = bpy.context.evaluated_depsgraph_get(), {}
    for obj in objects:
        T, points = np.array(obj.matrix_world, dtype=float), None
        if obj.type == "MESH":
            user = obj.evaluated_get(graph)
            mesh = user.to_mesh()
            used = sorted({vertex for polygon in mesh.polygons for vertex in polygon.vertices})
            points = np.array([mesh.vertices[n].co for n in used], dtype=float) @ T[:3, :3].T + T[:3, 3]
            user.to_mesh_clear()
        found[obj.name] = (T, points)
    return found


def files_below(folder):
    """The content of all files below a folder, by their path from there."""
    return {path.relative_to(folder): path.read_bytes() for path in Path(folder).rglob("*") if path.is_file()}


def quaternion(rng):
    """A random rotation, as Blender takes it."""
    return Quaternion(rng.normal(size=4).tolist()).normalized()
