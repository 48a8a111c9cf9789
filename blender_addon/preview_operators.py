"""Pose preview: moves a joint with everything behind it, and brings the rest pose back.

While a pose is previewed nothing can be written: the rest pose is what belongs to the file.
"""

import json

import bpy
import numpy as np

from . import making
from .ligature.adf.frames import axis_rotation, frame
from .placing import place, rest_pose

WITHOUT_LIMITS = {"T": (-0.05, 0.05), "R": (-np.pi, np.pi)}
"""Metres along and radians about an axis that has no limits, which are shown of it."""

_TRANSFORM = ("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale")


def joints_of(scene_objects):
    """The joints among objects whose two ends are here."""
    return [o for o in scene_objects if o.adf.role == "JOINT" and o.adf.parent_object and o.adf.child_object]


def behind(joint):
    """The bodies that move with a joint's child: all that hang on it by other joints, but not its parent."""
    collection = making.file_of(joint)
    joints = [j for j in joints_of(collection.all_objects) if j is not joint]
    found, open_ends = [], [joint.adf.child_object]
    while open_ends:
        body = open_ends.pop()
        if body in found or body is joint.adf.parent_object:
            continue
        found.append(body)
        open_ends += [j.adf.child_object for j in joints if j.adf.parent_object is body]
    return found


def move_joint(scene, joint, motion):
    """Show a joint with its frame moved by ``motion`` (4, 4) in itself; from rest."""
    bring_back(scene)
    bodies = behind(joint)
    T = rest_pose(joint)
    moved = T @ motion @ np.linalg.inv(T)
    rest, targets = {}, []
    for body in bodies:
        rest[body.name] = {name: list(getattr(body, name)) for name in _TRANSFORM} | {
            "rotation_mode": body.rotation_mode
        }
        parent = np.eye(4) if body.parent is None else rest_pose(body.parent) @ np.array(body.matrix_parent_inverse)
        targets.append((body, np.linalg.inv(parent) @ moved @ rest_pose(body), np.array(body.scale)))
    for body, target, scale in targets:
        place(body, target)
        body.scale = scale
    scene["adf_rest"] = json.dumps(rest)


def bring_back(scene):
    """Put everything that is previewed back to rest."""
    for name, values in json.loads(scene.get("adf_rest", "{}")).items():
        body = bpy.data.objects.get(name)
        if body is not None:
            for attribute, value in values.items():
                setattr(body, attribute, value)
    if "adf_rest" in scene:
        del scene["adf_rest"]


def is_previewing(scene):
    """Whether something stands elsewhere than at rest."""
    return bool(scene.get("adf_rest"))


class ADF_OT_move_joint(bpy.types.Operator):
    """Show the active joint at another position, with everything that hangs on it"""

    bl_idname = "adf.move_joint"
    bl_label = "Preview Joint"
    bl_options = {"REGISTER", "UNDO"}

    axis: bpy.props.EnumProperty(
        name="Axis",
        description="Which way a joint of several axes moves",
        items=[("FREE", "First Free", "The first axis that is not locked")]
        + [(f"T{a}", f"Along {a}", f"Along {a} of the joint") for a in "XYZ"]
        + [(f"R{a}", f"About {a}", f"About {a} of the joint") for a in "XYZ"],
    )
    part: bpy.props.FloatProperty(
        name="Position",
        description="Part of the way from the lower to the upper limit",
        default=0.5,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    )

    @classmethod
    def poll(cls, context):
        obj = context.object
        if obj is None or obj.adf.role != "JOINT" or not obj.adf.parent_object or not obj.adf.child_object:
            cls.poll_message_set("Make a joint between two bodies of this file active")
            return False
        return True

    def execute(self, context):
        joint = context.object
        ranges = ranges_of(joint)
        name = next(iter(ranges), "") if self.axis == "FREE" else self.axis
        if name not in ranges:
            self.report({"ERROR"}, f"'{joint.name}' is locked there; it moves {', '.join(ranges) or 'nowhere'}")
            return {"CANCELLED"}
        low, high = ranges[name]
        move_joint(context.scene, joint, motion_along(name, low + self.part * (high - low)))
        return {"FINISHED"}


def motion_along(name, position):
    """Motion (4, 4) of a joint frame by metres along, or radians about, one of its axes: TX to RZ."""
    axis = np.eye(3)["XYZ".index(name[1])]
    if name[0] == "T":
        return frame(np.eye(3), position * axis)
    return frame(axis_rotation(axis, position), (0.0, 0.0, 0.0))


def ranges_of(joint):
    """The free axes of a joint, TX to RZ, and the range that each is shown in: its limits where it has any."""
    group, kind = joint.adf.joint, joint.adf.joint.type
    if kind.startswith("six dof"):
        found = {}
        for letter, half in (("T", "linear"), ("R", "angular")):
            for a in "xyz":
                low, high = (getattr(group, f"joint_limits_{half}_{end}_{a}") for end in ("low", "high"))
                if low != high:
                    found[letter + a.upper()] = (low, high) if low < high else WITHOUT_LIMITS[letter]
        return found
    if kind == "cone twist":
        widths = {f"R{a.upper()}": getattr(group, f"joint_limits_{a}") for a in "xyz"}
        return {name: (-width, width) for name, width in widths.items() if width > 0.0}
    if kind in ("fixed", "p2p"):
        return {} if kind == "fixed" else {f"R{a}": WITHOUT_LIMITS["R"] for a in "XYZ"}
    name = {"prismatic": "TX", "linear spring": "TZ"}.get(kind, "RZ")
    if group.is_property_set("joint_limits_low") and group.is_property_set("joint_limits_high"):
        return {name: (group.joint_limits_low, group.joint_limits_high)}
    return {name: WITHOUT_LIMITS[name[0]]}


class ADF_OT_rest(bpy.types.Operator):
    """Bring everything back to the rest pose"""

    bl_idname = "adf.rest_pose"
    bl_label = "Back to Rest"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not is_previewing(context.scene):
            cls.poll_message_set("Nothing is previewed")
            return False
        return True

    def execute(self, context):
        bring_back(context.scene)
        return {"FINISHED"}


CLASSES = (ADF_OT_move_joint, ADF_OT_rest)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
