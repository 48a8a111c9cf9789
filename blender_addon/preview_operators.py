"""Pose preview: moves a joint with everything behind it, and brings the rest pose back.

While a pose is previewed nothing can be written: the rest pose is what belongs to the file.
"""

import json

import bpy
import numpy as np

from . import making
from .ligature.adf.frames import axis_rotation, frame
from .placing import place
from .poses import rest_pose

WITHOUT_LIMITS = {"T": (-0.05, 0.05), "R": (-np.pi, np.pi)}
"""Metres along and radians about an axis without limits that a preview shows."""

_TRANSFORM = ("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale")


def joints_of(scene_objects):
    """The joints among objects whose two ends are here."""
    return [o for o in scene_objects if o.adf.role == "JOINT" and o.adf.parent_object and o.adf.child_object]


def behind(joint):
    """The bodies that move with a joint's child: all that other joints connect to it, but not its parent."""
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


def show(scene, positions):
    """Show joints away from rest: by name of each, the metres along and radians about its axes, TX to RZ."""
    bring_back(scene)
    joints = [bpy.data.objects.get(name) for name in positions]
    moved = {}
    for joint in _root_first([joint for joint in joints if joint is not None and joint in joints_of([joint])]):
        motion = np.eye(4)
        for axis in sorted(positions[joint.name], reverse=True):  # along its axes, then about them
            motion = motion @ motion_along(axis, positions[joint.name][axis])
        T = moved.get(joint.adf.parent_object, np.eye(4)) @ rest_pose(joint)
        step = T @ motion @ np.linalg.inv(T)
        for body in behind(joint):
            moved[body] = step @ moved.get(body, np.eye(4))
    rest, targets = {}, []
    for body, T in moved.items():
        rest[body.name] = {name: list(getattr(body, name)) for name in _TRANSFORM} | {
            "rotation_mode": body.rotation_mode
        }
        parent = np.eye(4)
        if body.parent is not None:
            parent = moved.get(body.parent, parent) @ rest_pose(body.parent) @ np.array(body.matrix_parent_inverse)
        targets.append((body, np.linalg.inv(parent) @ T @ rest_pose(body), np.array(body.scale)))
    for body, target, scale in targets:
        place(body, target)
        body.scale = scale
    if rest:
        scene["adf_rest"], scene["adf_shown"] = json.dumps(rest), json.dumps(positions)


def _root_first(joints):
    """Joints ordered from the root outwards."""
    below = {joint: behind(joint) for joint in joints}
    return sorted(joints, key=lambda joint: sum(joint.adf.parent_object in bodies for bodies in below.values()))


def shown(scene):
    """What `show` shows now."""
    return json.loads(scene.get("adf_shown", "{}")) if is_previewing(scene) else {}


def bring_back(scene):
    """Put everything that is previewed back to rest."""
    for name, values in json.loads(scene.get("adf_rest", "{}")).items():
        body = bpy.data.objects.get(name)
        if body is not None:
            for attribute, value in values.items():
                setattr(body, attribute, value)
    for name in ("adf_rest", "adf_shown"):
        if name in scene:
            del scene[name]


def is_previewing(scene):
    """Whether something stands elsewhere than at rest."""
    return bool(scene.get("adf_rest"))


class ADF_OT_move_joint(bpy.types.Operator):
    """Show the active joint at another position, with all bodies behind it"""

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
    others: bpy.props.BoolProperty(
        name="Keep Others", description="Other joints stay where they are previewed, else they go to rest", default=True
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
        positions = shown(context.scene) if self.others else {}
        own = {**positions.get(joint.name, {}), name: low + self.part * (high - low)}
        show(context.scene, {**positions, joint.name: own})
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
