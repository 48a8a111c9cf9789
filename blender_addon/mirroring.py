"""Mirrors bodies with their shapes, joints and sensors.

A reflection F of the world moves a point v of a body at pose T to F T v = (F T M) (M v), for any reflection M of the
body's own axes, with M M = 1. F T M is a rigid pose, and M v the mirrored geometry. Here M reflects x. The frame of a
joint is F T M with an M that does not change the joint's own motion, so that limits and commands stay the same.

M is applied to the mesh, not to the scale: an object with a negative scale has no rigid body frame.
"""

from __future__ import annotations

import re
from collections.abc import Container
from functools import lru_cache
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from . import making
from .ligature.adf.document import object_element
from .ligature.adf.nodes import Mapping as MappingNode
from .ligature.adf.nodes import parse
from .ligature.authoring.placement import JointKeys, child_pose
from .mesh_reading import baked
from .placing import parent_to, place
from .poses import SHAPED, inertial_frame, relative_pose, rest_pose
from .preview_operators import behind, is_previewing, joints_of
from .references import file_of, owner_of, topic_name
from .steps import InSteps, Steps, all_or_nothing

FLIP_X, FLIP_Z = np.diag([-1.0, 1.0, 1.0, 1.0]), np.diag([1.0, 1.0, -1.0, 1.0])
SIDES = (("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"))
MIRRORED = ("GHOST_OBJECT", "SENSOR", "ACTUATOR", "CAMERA", "LIGHT", "SUTURE", "VOLUME")
"""Roles of objects that are mirrored with the body that they are parented to."""


def mirrored_name(name: str) -> str:
    """The name of the other side: left becomes right, and L behind a dot, dash or underscore becomes R, and back."""
    for one, other in SIDES:
        if one in name or other in name:
            return re.sub(f"{one}|{other}", lambda found, a=one, b=other: b if found[0] == a else a, name)
    swapped = re.sub(r"(?<=[._-])([LRlr])(?=$|[._-])", lambda found: found[0].translate(_LETTERS), name)
    return swapped if swapped != name else f"{name}_mirrored"


_LETTERS = str.maketrans("LRlr", "RLrl")


def free_name(name: str, taken: Container[str]) -> str:
    """A name that is free. If a name is taken, Blender may rename the other object instead."""
    found, number = name.encode()[:LONGEST].decode(errors="ignore"), 1
    while found in taken:
        found, number = f"{name.encode()[: LONGEST - 5].decode(errors='ignore')}.{number:03d}", number + 1
    return found


LONGEST = 63
"""Bytes of a name in Blender."""


def mirroring(objects: list[bpy.types.Object], plane: np.ndarray) -> Steps[tuple[list[bpy.types.Object], list[str]]]:
    """The steps that mirror bodies and joints at the plane across the X of a frame (4, 4), to what is made, and notes.

    Joints whose child is mirrored, and objects parented to the bodies, are mirrored with them. If the parent of a joint
    is not mirrored, it is also the parent of the mirror image.
    """
    reflection = plane @ FLIP_X @ np.linalg.inv(plane)
    bodies = [obj for obj in objects if obj.adf.role == "BODY"]
    files = list(dict.fromkeys(file_of(body) for body in bodies))
    near = [obj for file in files for obj in file.all_objects]
    joints = [j for j in joints_of(near) if j.adf.child_object in bodies]
    parented = [obj for obj in near if obj.adf.role in MIRRORED and owner_of(obj) in bodies]
    made: dict[bpy.types.Object, bpy.types.Object] = {}
    notes: list[str] = []
    for obj in (*bodies, *parented, *joints):
        yield f"Mirroring '{obj.name}'", len(made) / (len(bodies) + len(parented) + len(joints))
        if obj.adf.role == "BODY":
            made[obj] = _shaped(obj, reflection, None)
        elif obj.adf.role == "JOINT":
            made[obj] = _joint(obj, reflection, made, notes)
        else:
            made[obj] = _parented(obj, made[owner_of(obj)])
    return list(made.values()), notes


def chain_of(objects: list[bpy.types.Object]) -> list[bpy.types.Object]:
    """Bodies and the children of joints among objects, with all that moves with them."""
    ends = [obj.adf.child_object if obj.adf.role == "JOINT" else obj for obj in objects]
    bodies = [obj for obj in ends if obj is not None and obj.adf.role == "BODY"]
    found = list(bodies)
    for body in bodies:
        file = file_of(body)
        for joint in joints_of(file.all_objects):
            if joint.adf.parent_object is body:
                found += [one for one in behind(joint) if one not in found]
    return found


def _copy(obj: bpy.types.Object) -> bpy.types.Object:
    """A copy with the name of the other side, which the file does not have yet."""
    copy = obj.copy()
    copy.name = free_name(mirrored_name(obj.name), bpy.data.objects)
    for collection in obj.users_collection:
        collection.objects.link(copy)
    copy.parent = None
    own = copy.adf
    own.key = ""
    own.key = making.free_key(file_of(obj), own.role, copy.name)
    own.was = own.like = own.imported = own.mesh_print = ""
    own.hung = False
    group = getattr(own, own.role.lower())
    group.name = copy.name if own.role == "JOINT" else topic_name(copy.name)
    own.called = copy.name
    return copy


def _shaped(obj: bpy.types.Object, reflection: np.ndarray, owner: bpy.types.Object | None) -> bpy.types.Object:
    """The mirror image of a body or ghost with its parts, parented to ``owner`` if there is one."""
    copy = _copy(obj)
    if owner is None:
        place(copy, reflection @ rest_pose(obj) @ FLIP_X)
    else:
        parent_to(copy, owner, FLIP_X @ relative_pose(owner_of(obj), obj) @ FLIP_X)
    copy.scale = obj.scale
    if obj.type == "MESH":
        copy.data = flipped(obj)
        copy.modifiers.clear()
    for part in [child for child in obj.children if child.adf.role in making.PARTS]:
        _part(part, obj, copy)
    return copy


def flipped(obj: bpy.types.Object) -> bpy.types.Mesh:
    """The mesh of an object, modifiers applied, mirrored along its X."""
    mesh = baked(obj)
    mesh.name = free_name(mirrored_name(obj.data.name), bpy.data.meshes)
    mesh.transform(Matrix(FLIP_X.tolist()))
    mesh.flip_normals()
    mesh.update()
    return mesh


def _part(part: bpy.types.Object, body: bpy.types.Object, image: bpy.types.Object) -> None:
    own = making.copied_part(part, image)
    scale = np.array(part.scale)
    flip = _symmetry(part)
    parent_to(own, image, FLIP_X @ relative_pose(body, part) @ flip)
    own.scale = scale
    if part.adf.role == "HULL":
        own.data = flipped(part)
        own.modifiers.clear()


def _symmetry(part: bpy.types.Object) -> np.ndarray:
    """A reflection (4, 4) of a part's axes under which it looks the same; that of x for any mesh, which is mirrored."""
    shape = part.adf.shape
    if part.adf.role != "SHAPE" or (shape.kind in ("CYLINDER", "CAPSULE", "CONE") and shape.axis != "X"):
        return FLIP_X
    if shape.kind == "PLANE":
        n = np.array(shape.normal) / np.linalg.norm(shape.normal)
        across = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        across /= np.linalg.norm(across)
        flip = np.eye(4)
        flip[:3, :3] -= 2.0 * np.outer(across, across)
        return flip
    return FLIP_Z if shape.kind in ("CYLINDER", "CAPSULE", "CONE") else FLIP_X


def _parented(obj: bpy.types.Object, owner: bpy.types.Object) -> bpy.types.Object:
    if obj.adf.role in SHAPED:
        return _shaped(obj, np.eye(4), owner)
    copy = _copy(obj)
    parent_to(copy, owner, FLIP_X @ relative_pose(owner_of(obj), obj) @ FLIP_X)
    copy.scale = obj.scale
    if obj.adf.role == "SENSOR":
        for ray in copy.adf.sensor.array:
            ray.offset[0], ray.direction[0] = -ray.offset[0], -ray.direction[0]
    return copy


def _joint(
    joint: bpy.types.Object, reflection: np.ndarray, made: dict[bpy.types.Object, bpy.types.Object], notes: list[str]
) -> bpy.types.Object:
    copy = _copy(joint)
    parent, child = joint.adf.parent_object, joint.adf.child_object
    copy.adf.parent_object, copy.adf.child_object = made.get(parent, parent), made[child]
    copy.adf.parent_text = copy.adf.child_text = ""
    kind = joint.adf.joint.type
    flip = FLIP_X if kind == "linear spring" else FLIP_Z
    making.parent_in_place(copy, copy.adf.parent_object, reflection @ rest_pose(joint) @ flip)
    if kind.startswith("six dof"):
        _mirror_axes(copy.adf.joint)
    elif kind in ("revolute", "prismatic", "linear spring", "torsion spring"):
        away = zero_of(joint)
        if abs(away) > 1e-5:
            for end in ("low", "high"):
                name = f"joint_limits_{end}"
                if copy.adf.joint.is_property_set(name):
                    setattr(copy.adf.joint, name, getattr(copy.adf.joint, name) - away)
            notes.append(
                f"'{copy.name}' is at zero where '{joint.name}' is at {away:.4g}; its limits are moved by that"
            )
    return copy


def _mirror_axes(group: bpy.types.PropertyGroup) -> None:
    """Negate the axes that the reflection of z reverses: translation along z, rotation about x and y."""
    for half, axis in (("linear", "z"), ("angular", "x"), ("angular", "y")):
        low, high = (f"joint_limits_{half}_{end}_{axis}" for end in ("low", "high"))
        values = [getattr(group, name) if group.is_property_set(name) else None for name in (low, high)]
        if None not in values:
            setattr(group, low, -values[1])
            setattr(group, high, -values[0])
        rest = f"equilibrium_point_{half}_{axis}"
        if hasattr(group, rest) and group.is_property_set(rest):
            setattr(group, rest, -getattr(group, rest))


def zero_of(joint: bpy.types.Object) -> float:
    """The position of a joint of the file at rest, in radians, or metres if it slides.

    It is zero for new joints, and for those whose bodies are not where the joint holds them.
    """
    file, parent, child = file_of(joint), joint.adf.parent_object, joint.adf.child_object
    if not joint.adf.was or not file.adf.source or None in (parent, child):
        return 0.0
    element = object_element("joint", joint.adf.was, _parsed(file.adf.source))
    if element is None:
        return 0.0
    values = element.given()
    names = ("parent pivot", "child pivot", "parent axis", "child axis")
    if any(name not in values for name in names):
        return 0.0
    scales = [body.adf.body.scale or 1.0 for body in (parent, child)]
    pivots = [tuple(scale * v for v in values[name]) for scale, name in zip(scales, names[:2], strict=True)]
    offset = values.get("offset", values.get("child offset", 0.0))
    keys = JointKeys(*pivots, values["parent axis"], values["child axis"], offset, values.get("joint offset", 0.0))
    slides = joint.adf.joint.type == "prismatic"
    T_zero = child_pose(keys, inertial_frame(parent), inertial_frame(child), slides)
    T_joint = relative_pose(parent, joint)
    motion = np.linalg.inv(T_joint) @ relative_pose(parent, child) @ np.linalg.inv(T_zero) @ T_joint
    if joint.adf.joint.type in ("prismatic", "linear spring"):
        return float(motion[0 if slides else 2, 3])
    return float(np.arctan2(motion[1, 0], motion[0, 0]))


@lru_cache(maxsize=1)
def _parsed(source: str) -> MappingNode:
    """The text of a file as nodes, in which its joints are looked up."""
    return parse(source, Path("model.yaml"))


class ADF_OT_mirror(InSteps, bpy.types.Operator):
    """Mirror the selected bodies, with all that moves with them, to the other side; left and right change in names"""

    bl_idname = "adf.mirror"
    bl_label = "Mirror Chain"
    bl_options = {"REGISTER", "UNDO"}

    across: bpy.props.EnumProperty(
        name="Across", items=[(a, a, f"The plane across {a}") for a in "XYZ"], description="Which axis the plane cuts"
    )
    plane: bpy.props.EnumProperty(
        name="Plane",
        items=[
            ("WORLD", "World", "Through the origin of the world"),
            ("CURSOR", "3D Cursor", "Through the 3D cursor, along its axes"),
        ],
    )
    chain: bpy.props.BoolProperty(
        name="Whole Chain",
        description="Also all bodies that move with the selected ones, by their joints",
        default=True,
    )

    @classmethod
    def poll(cls, context):
        if is_previewing(context.scene):
            cls.poll_message_set("A joint is previewed; bring everything back to rest first")
            return False
        if not chain_of(context.selected_objects):
            cls.poll_message_set("Select bodies, or joints between two bodies")
            return False
        return True

    def steps(self, context):
        chosen = chain_of(context.selected_objects)
        if not self.chain:
            ends = [obj.adf.child_object if obj.adf.role == "JOINT" else obj for obj in context.selected_objects]
            chosen = [obj for obj in chosen if obj in ends]
        T = making.cursor_pose(context.scene) if self.plane == "CURSOR" else np.eye(4)
        turn = np.eye(4)
        turn[:3, :3] = np.roll(np.eye(3), "XYZ".index(self.across), axis=0)
        with all_or_nothing():
            made, notes = yield from mirroring(chosen, T @ turn)
        for note in notes:
            self.report({"WARNING"}, note)
        for obj in context.selected_objects:
            obj.select_set(False)
        for obj in made:
            obj.select_set(True)
        context.view_layer.objects.active = made[0]
        kinds = [obj.adf.role for obj in made]
        self.report({"INFO"}, f"{kinds.count('BODY')} bodies and {kinds.count('JOINT')} joints mirrored")
        return {"FINISHED"}


CLASSES = (ADF_OT_mirror,)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
