"""Makes the objects of a file in Blender: new files, bodies, joints, shapes, and objects parented to bodies.

Nothing here selects, hides, renames or moves the user's objects.
"""

from __future__ import annotations

from math import pi

import bmesh
import bpy
import numpy as np

from .ligature.authoring.placement import rigid
from .ligature.authoring.shapes import Shape, shape_mesh
from .mesh_making import shape_data
from .placing import parent_to, place
from .poses import rest_pose
from .properties import KIND_OF_ROLE
from .read_file import SHAPE_COLOUR, set_shape, shape_collection
from .references import file_of, topic_name

PREFIXES = {
    "BODY": "BODY ", "JOINT": "JOINT ", "GHOST_OBJECT": "GHOST ", "SENSOR": "SENSOR ", "ACTUATOR": "ACTUATOR ",
    "SOFT_BODY": "SOFT ", "VOLUME": "VOLUME ", "SUTURE": "SUTURE ",
}  # fmt: skip
PARENTED = ("GHOST_OBJECT", "SENSOR", "ACTUATOR", "CAMERA", "LIGHT", "SUTURE", "VOLUME")
"""Roles whose objects may be parented to a body."""


PARTS = ("SHAPE", "HULL", "INERTIAL")
"""Roles of the parts of one body."""


def new_file(scene: bpy.types.Scene, name: str, kind: str, namespace: str = "/ambf/env/") -> bpy.types.Collection:
    """An empty model or world as a collection of the scene."""
    collection = unplaced_file(name, kind, namespace)
    scene.collection.children.link(collection)
    return collection


def unplaced_file(name: str, kind: str, namespace: str = "/ambf/env/") -> bpy.types.Collection:
    """An empty model or world as a collection that is part of no scene yet."""
    collection = bpy.data.collections.new(name)
    collection.adf.kind = kind
    if kind in ("MODEL", "WORLD"):
        getattr(collection.adf, kind.lower()).namespace = namespace
    return collection


def closed(namespace: str) -> str:
    """A namespace between slashes."""
    return "/" + "".join(f"{part}/" for part in namespace.split("/") if part)


def free_key(collection: bpy.types.Collection, role: str, name: str) -> str:
    """An identifier that no object of the file has."""
    taken = {obj.adf.key for obj in collection.all_objects}
    key = base = PREFIXES.get(role, "") + name
    number = 1
    while key in taken:
        key, number = f"{base} {number}", number + 1
    return key


def give_role(obj: bpy.types.Object, role: str, collection: bpy.types.Collection) -> None:
    """Make an object part of a file; it stays where it is and keeps its other collections."""
    if obj.name not in collection.all_objects:
        collection.objects.link(obj)
    if obj.adf.role != role or not obj.adf.key:
        obj.adf.key = free_key(collection, role, obj.name)
    obj.adf.role = role
    group = getattr(obj.adf, role.lower())
    if not group.is_property_set("name"):
        group.name = obj.name if role == "JOINT" else topic_name(obj.name)
    if role == "BODY":
        for name, value in (("mass", 1.0), ("collision_margin", 0.0001)):
            if not group.is_property_set(name):
                setattr(group, name, value)


def make_own(obj: bpy.types.Object) -> None:
    """Give a copy of an object of a file its own identifier and name, and copies of the original's shapes.

    It refers to the mesh files of the original until its mesh changes.
    """
    original = original_of(obj)
    obj.adf.key = free_key(file_of(obj), obj.adf.role, obj.name)
    obj.adf.like, obj.adf.was = obj.adf.was or obj.adf.like, ""
    group = getattr(obj.adf, obj.adf.role.lower())
    group.name = obj.name if obj.adf.role == "JOINT" else topic_name(obj.name)
    obj.adf.called = obj.name
    if original is not None:
        take_shapes(original, obj)


def copied(obj: bpy.types.Object) -> bpy.types.Object:
    """A copy of an object of a file in the same collections, with its own identifier and the same mesh."""
    copy = obj.copy()
    for collection in obj.users_collection:
        collection.objects.link(copy)
    make_own(copy)
    return copy


def original_of(copy: bpy.types.Object) -> bpy.types.Object | None:
    """The object of the same file that has the identifier of a copy."""
    file = file_of(copy)
    same = [o for o in file.all_objects if o.adf.key == copy.adf.key and o.adf.role == copy.adf.role] if file else []
    return next((other for other in same if other is not copy), None)


def take_shapes(original: bpy.types.Object, copy: bpy.types.Object) -> None:
    """Give a copy of a body copies of the original's primitives, hulls and inertial frame, if it has none."""
    if any(child.adf.role in PARTS for child in copy.children):
        return
    for part in [child for child in original.children if child.adf.role in PARTS]:
        copied_part(part, copy)


def copied_part(part: bpy.types.Object, body: bpy.types.Object) -> bpy.types.Object:
    """A copy of a primitive, hull or frame, parented to another body at the same relative pose."""
    own = part.copy()
    for collection in part.users_collection:
        collection.objects.link(own)
    own.parent = body
    own.matrix_parent_inverse = part.matrix_parent_inverse.copy()
    return own


def new_object(
    collection: bpy.types.Collection, role: str, name: str, T_world: np.ndarray, parent: bpy.types.Object | None = None
) -> bpy.types.Object:
    """A new object of a role at a rigid pose in the world, parented to ``parent`` if there is one."""
    obj = bpy.data.objects.new(name, _data(role, name))
    collection.objects.link(obj)
    give_role(obj, role, collection)
    if obj.type == "EMPTY":
        obj.empty_display_size = 0.02
        obj.empty_display_type = {"JOINT": "SINGLE_ARROW", "SENSOR": "CONE", "ACTUATOR": "SPHERE"}.get(
            role, "PLAIN_AXES"
        )
    if parent is None:
        place(obj, T_world)
    else:
        parent_to(obj, parent, np.linalg.inv(rest_pose(parent)) @ T_world)
    return obj


def _data(role: str, name: str) -> bpy.types.ID | None:
    if role == "CAMERA":
        camera = bpy.data.cameras.new(name)
        camera.sensor_fit, camera.angle_y, camera.clip_start, camera.clip_end = "VERTICAL", 0.7, 0.01, 10.0
        camera.display_size = 0.05
        return camera
    if role == "LIGHT":
        light = bpy.data.lights.new(name, "SPOT")
        light.spot_size = min(2.0 * 0.7, pi)
        return light
    return None


def add_shape(
    body: bpy.types.Object, shape: Shape, use: str = "COLLISION", T_body: np.ndarray | None = None
) -> bpy.types.Object:
    """A primitive below a body."""
    collection = _shapes_of_file(body)
    data = shape_data(*shape_mesh(shape), shape.kind.title())
    obj = bpy.data.objects.new(f"{body.name} {use.lower()}", data)
    collection.objects.link(obj)
    obj.adf.role = "SHAPE"
    set_shape(obj, shape, use, 1 + max((c.adf.shape.order for c in body.children if c.adf.role == "SHAPE"), default=-1))
    parent_to(obj, body, np.eye(4) if T_body is None else T_body)
    return obj


def parent_in_place(obj: bpy.types.Object, body: bpy.types.Object, T_world: np.ndarray | None = None) -> None:
    """Parent an object to a body; it stays where it is, or goes to a pose in the world."""
    T = rest_pose(obj) if T_world is None else T_world
    parent_to(obj, body, np.linalg.inv(rest_pose(body)) @ T)


def new_part(body: bpy.types.Object, name: str, data: bpy.types.ID | None, role: str) -> bpy.types.Object:
    """An object that belongs to a body, at the body's origin."""
    obj = bpy.data.objects.new(name, data)
    _shapes_of_file(body).objects.link(obj)
    obj.adf.role = role
    parent_to(obj, body, np.eye(4))
    return obj


def _shapes_of_file(body: bpy.types.Object) -> bpy.types.Collection:
    """The collection for primitives, hulls and frames of a body."""
    file = file_of(body)
    return bpy.context.scene.collection if file is None else shape_collection(file)


def redraw_shape(obj: bpy.types.Object) -> None:
    """Make the mesh of a primitive's object from its numbers; other users keep the old mesh."""
    data = obj.adf.shape
    shape = Shape(data.kind, tuple(data.size), data.radius, data.height, data.axis, tuple(data.normal), data.offset)
    obj.data = shape_data(*shape_mesh(shape), shape.kind.title())


def add_hull(body: bpy.types.Object, points: np.ndarray, order: int | None = None) -> bpy.types.Object:
    """A convex piece of the body's collision mesh around ``points`` (n, 3) in the body's frame."""
    vertices, faces = hull_of(points)
    collection = _shapes_of_file(body)
    obj = bpy.data.objects.new(f"{body.name} hull", shape_data(vertices, faces, f"{body.name} hull"))
    collection.objects.link(obj)
    obj.adf.role = "HULL"
    others = [c.adf.shape.order for c in body.children if c.adf.role == "HULL"]
    obj.adf.shape.order = max(others, default=-1) + 1 if order is None else order
    look_like_collision(obj)
    parent_to(obj, body, np.eye(4))
    return obj


def look_like_collision(obj: bpy.types.Object) -> None:
    """Show an object as a collision shape: as wires of their colour, not rendered."""
    obj.display_type, obj.hide_render, obj.color = "WIRE", True, SHAPE_COLOUR["COLLISION"]


def hull_of(points: np.ndarray) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Vertices and triangles of the convex hull of points (n, 3), by Blender's own algorithm; raises ValueError."""
    work = bmesh.new()
    try:
        for point in points:
            work.verts.new(point)
        made = bmesh.ops.convex_hull(work, input=work.verts, use_existing_faces=False)
        loose = {
            item for item in (*made["geom_interior"], *made["geom_unused"]) if isinstance(item, bmesh.types.BMVert)
        }
        bmesh.ops.delete(work, geom=list(loose), context="VERTS")
        bmesh.ops.triangulate(work, faces=work.faces)
        bmesh.ops.recalc_face_normals(work, faces=work.faces)
        work.verts.index_update()
        if len(work.verts) < 4 or not work.faces:
            raise ValueError("the points enclose no volume; take more of the mesh")
        vertices = np.array([v.co for v in work.verts], dtype=float)
        return vertices, [tuple(v.index for v in face.verts) for face in work.faces]
    finally:
        work.free()


def inertial_of(body: bpy.types.Object, T_body: np.ndarray) -> bpy.types.Object:
    """The body's inertial frame, made or moved to a pose in the body."""
    frame = next((c for c in body.children if c.adf.role == "INERTIAL"), None)
    if frame is None:
        frame = bpy.data.objects.new(f"{body.name} inertial", None)
        _shapes_of_file(body).objects.link(frame)
        frame.adf.role = "INERTIAL"
        frame.empty_display_type, frame.empty_display_size = "ARROWS", 0.01
    parent_to(frame, body, T_body)
    return frame


def connect(
    collection: bpy.types.Collection, parent: bpy.types.Object, child: bpy.types.Object, kind: str, T_world: np.ndarray
) -> bpy.types.Object:
    """A joint of a kind between two bodies, at a pose in the world."""
    joint = new_object(collection, "JOINT", f"{parent.name}-{child.name}", rigid(T_world), parent)
    joint.adf.joint.type = kind
    joint.adf.parent_object, joint.adf.child_object = parent, child
    if kind in ("revolute", "prismatic"):
        low, high = (-pi / 2, pi / 2) if kind == "revolute" else (-0.05, 0.05)
        joint.adf.joint.joint_limits_low, joint.adf.joint.joint_limits_high = low, high
    if kind.startswith("six dof"):
        for half in ("linear", "angular"):
            for end in ("low", "high"):
                for axis in "xyz":
                    setattr(joint.adf.joint, f"joint_limits_{half}_{end}_{axis}", 0.0)
    if kind == "six dof spring":
        for block in ("stiffness", "damping"):
            for half in ("linear", "angular"):
                for axis in "xyz":
                    setattr(joint.adf.joint, f"{block}_{half}_{axis}", 1.0)
    if kind in ("linear spring", "torsion spring"):
        joint.adf.joint.joint_limits_low, joint.adf.joint.joint_limits_high = (
            (-0.05, 0.05) if kind[0] == "l" else (-1.0, 1.0)
        )
        joint.adf.joint.stiffness, joint.adf.joint.damping = 1.0, 0.1
    if kind == "cone twist":
        for axis in "xyz":
            setattr(joint.adf.joint, f"joint_limits_{axis}", 0.7)
    return joint


def cursor_pose(scene: bpy.types.Scene) -> np.ndarray:
    """Pose of the 3D cursor."""
    return rigid(np.array(scene.cursor.matrix, dtype=float))


def is_file_object(obj: bpy.types.Object | None) -> bool:
    """Whether an object represents one of the file."""
    return obj is not None and obj.adf.role in KIND_OF_ROLE
