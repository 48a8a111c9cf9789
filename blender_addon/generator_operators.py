"""Operators that add generated parts: needle, thread, suture hole, grasp set of jaws, stereo endoscope."""

from math import pi

import bpy
import numpy as np

from . import making
from .decimals import decimal
from .ligature.authoring.generate import (
    Anchor,
    Needle,
    Thread,
    jaw_grasp_set,
    needle,
    needle_end,
    stereo_endoscope,
    suture,
    suture_chain,
    suture_hole,
)
from .object_operators import active_body, target_file
from .placing import parent_to, place
from .poses import inertial_frame, rest_pose
from .read_file import add_parts, find_open

THREADS = [
    ("NONE", "None", "No thread"),
    (
        "PHYSICAL",
        "Physical Data",
        "One block with length, diameter and material, which Ligature simulates as an elastic rod",
    ),
    ("CHAIN", "Capsules and Springs", "A chain of bodies, which every simulator of the format loads"),
]


class ThreadSettings:
    """The thread's numbers, for operators that make one."""

    length: bpy.props.FloatProperty(name="Length", default=0.1, min=0.001, subtype="DISTANCE", precision=4)
    diameter: bpy.props.FloatProperty(name="Diameter", default=0.0004, min=1e-5, subtype="DISTANCE", precision=5)
    elements: bpy.props.IntProperty(name="Elements", default=40, min=2, max=400)
    youngs_modulus: bpy.props.FloatProperty(name="Young's Modulus", description="In Pa", default=2.0e9, min=1.0)
    density: bpy.props.FloatProperty(name="Density", description="In kg/m³", default=1200.0, min=1.0)

    def thread(self):
        return Thread(
            decimal(self.length), decimal(self.diameter), self.elements, decimal(self.youngs_modulus),
            density=decimal(self.density),
        )  # fmt: skip


class ADF_OT_add_needle(ThreadSettings, bpy.types.Operator):
    """Add a curved needle with convex collision pieces at the 3D cursor, and a thread at its blunt end"""

    bl_idname = "adf.add_needle"
    bl_label = "Add Needle"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    radius: bpy.props.FloatProperty(name="Radius", default=0.0085, min=1e-4, subtype="DISTANCE", precision=5)
    arc: bpy.props.FloatProperty(name="Arc", default=pi, min=0.1, max=2 * pi - 0.1, subtype="ANGLE")
    thickness: bpy.props.FloatProperty(name="Thickness", default=0.001, min=1e-5, subtype="DISTANCE", precision=5)
    taper: bpy.props.FloatProperty(
        name="Taper", description="Part of the arc that narrows to the point", default=0.25, min=0.01, max=1.0
    )
    hulls: bpy.props.IntProperty(name="Convex Pieces", default=9, min=1, max=64)
    with_thread: bpy.props.EnumProperty(name="Thread", items=THREADS, default="PHYSICAL")

    def execute(self, context):
        collection = target_file(context, "BODY")
        spec = Needle(decimal(self.radius), self.arc, decimal(self.thickness), decimal(self.taper), self.hulls)
        T = making.cursor_pose(context.scene)
        made = add_parts(collection, needle(spec, T_world=T))
        body = made[0]
        if self.with_thread == "PHYSICAL":
            add_parts(collection, suture(self.thread(), needle_end(spec), parent=body.adf.key))
            hang_by_text(collection)
        elif self.with_thread == "CHAIN":
            add_parts(collection, suture_chain(self.thread(), T @ needle_end(spec), "Thread", anchor_of(body)))
        return {"FINISHED"}


class ADF_OT_add_suture(ThreadSettings, bpy.types.Operator):
    """Add a thread that leaves the 3D cursor along its Z, fixed to the active body if there is one"""

    bl_idname = "adf.add_suture"
    bl_label = "Add Suture"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    form: bpy.props.EnumProperty(name="Form", items=THREADS[1:])

    def execute(self, context):
        collection = target_file(context, "SUTURE")
        T = making.cursor_pose(context.scene)
        body = active_body(context, ("BODY",))
        key = body.adf.key if body is not None and making.file_of(body) == collection else ""
        T_parent = rest_pose(body) if key else np.eye(4)
        if self.form == "PHYSICAL":
            add_parts(collection, suture(self.thread(), np.linalg.inv(T_parent) @ T, parent=key))
            hang_by_text(collection)
        else:
            add_parts(collection, suture_chain(self.thread(), T, "Thread", anchor_of(body) if key else None))
        return {"FINISHED"}


class ADF_OT_add_hole(bpy.types.Operator):
    """Add a suture hole at the 3D cursor around its Z: a ring on a spring, and a ghost that feels the needle"""

    bl_idname = "adf.add_hole"
    bl_label = "Add Suture Hole"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    name: bpy.props.StringProperty(name="Name", default="Entry")
    radius: bpy.props.FloatProperty(name="Radius", default=0.0015, min=1e-5, subtype="DISTANCE", precision=5)
    wire: bpy.props.FloatProperty(name="Thickness", default=0.0003, min=1e-5, subtype="DISTANCE", precision=5)
    stiffness: bpy.props.FloatProperty(name="Stiffness", description="In N/m", default=100.0, min=0.0)
    travel: bpy.props.FloatProperty(name="Travel", default=0.001, min=0.0, subtype="DISTANCE", precision=5)

    @classmethod
    def poll(cls, context):
        if active_body(context, ("BODY",)) is None:
            cls.poll_message_set("Make the body active that is to hold the hole, such as the tissue")
            return False
        return True

    def execute(self, context):
        body = active_body(context, ("BODY",))
        collection = making.file_of(body)
        parts = suture_hole(
            self.name, making.cursor_pose(context.scene), anchor_of(body), decimal(self.radius), decimal(self.wire),
            decimal(self.stiffness), 1.0, decimal(self.travel),
        )  # fmt: skip
        add_parts(collection, parts)
        hang_by_text(collection)
        return {"FINISHED"}


class ADF_OT_add_grasp(bpy.types.Operator):
    """Add what lets two jaws grasp: a ghost on each, an actuator on the wrist; bodies are named by text"""

    bl_idname = "adf.add_grasp"
    bl_label = "Add Jaw Grasp Set"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    left: bpy.props.StringProperty(name="Left Jaw", default="psm1/BODY tool gripper left link")
    right: bpy.props.StringProperty(name="Right Jaw", default="psm1/BODY tool gripper right link")
    wrist: bpy.props.StringProperty(name="Wrist", default="psm1/BODY tool yaw link")
    reach: bpy.props.FloatProperty(name="Reach", default=0.0066, subtype="DISTANCE", precision=5)

    def execute(self, context):
        collection = target_file(context, "GHOST_OBJECT")
        add_parts(collection, jaw_grasp_set(self.left, self.right, self.wrist, self.reach))
        hang_by_text(collection)
        return {"FINISHED"}


class ADF_OT_add_endoscope(bpy.types.Operator):
    """Add two parallel cameras at the 3D cursor that look along its −Z"""

    bl_idname = "adf.add_endoscope"
    bl_label = "Add Stereo Endoscope"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    separation: bpy.props.FloatProperty(name="Eye Separation", default=0.004, min=0.0, subtype="DISTANCE", precision=5)
    field_of_view: bpy.props.FloatProperty(name="Field of View", default=1.2, min=0.05, max=3.0, subtype="ANGLE")
    parent: bpy.props.StringProperty(name="Parent", description="Body that carries the cameras; the world when empty")

    def execute(self, context):
        collection = target_file(context, "CAMERA")
        made = add_parts(collection, stereo_endoscope(self.parent, self.separation, self.field_of_view))
        if not self.parent:
            T = making.cursor_pose(context.scene)
            for camera in made:
                place(camera, T @ rest_pose(camera))
        hang_by_text(collection)
        return {"FINISHED"}


def anchor_of(body):
    """A body as what holds a generated part."""
    return Anchor(body.adf.key, rest_pose(body), inertial_frame(body))


def hang_by_text(collection):
    """Parent new objects to the bodies that their references mean."""
    for obj in collection.all_objects:
        if obj.adf.role in making.PARENTED and obj.adf.parent_text and obj.parent is None:
            parent = find_open(obj.adf.parent_text, ("body",))
            if parent is not None:
                parent_to(obj, parent, rest_pose(obj))


CLASSES = (ADF_OT_add_needle, ADF_OT_add_suture, ADF_OT_add_hole, ADF_OT_add_grasp, ADF_OT_add_endoscope)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
