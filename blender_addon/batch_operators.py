"""Edits a selection at once: keys of the active object, one number, collision shapes, controller gains."""

from functools import cache

import bpy
import numpy as np

from . import making
from .held_keys import keys_of
from .key_panels import CATEGORIES, OTHER, SHOWN, group_of
from .ligature.adf.schema import Type
from .mesh_reading import points_of
from .object_operators import active_body
from .placing import parent_to
from .poses import SHAPED, inertial_frame, relative_pose, rest_pose
from .preview_operators import behind
from .properties import KIND_OF_ROLE
from .schema_properties import fetch, identifier, store, unset
from .solids import own_solid
from .steps import InSteps

NUMBERS = (Type.NUMBER, Type.NUMBER_OR_MAP, Type.INTEGER, Type.UNSIGNED)
OWN = ("name", "namespace")
"""Keys that identify one object, which batch operators leave out."""


def alike(context):
    """The selected objects of the active one's role, without the active one."""
    active = context.object
    if not making.is_file_object(active):
        return []
    return [o for o in context.selected_objects if o is not active and o.adf.role == active.adf.role]


class ToSelected:
    """Asks for an active object of a file and others of its role."""

    @classmethod
    def poll(cls, context):
        if not alike(context):
            cls.poll_message_set("Select objects of one role, that to copy from last")
            return False
        return True


class ADF_OT_copy_keys(ToSelected, bpy.types.Operator):
    """Give the selected objects the keys of the active one: all of a panel that its file gives"""

    bl_idname = "adf.copy_keys"
    bl_label = "Copy Keys to Selected"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    panel: bpy.props.EnumProperty(
        name="Keys",
        items=[("ALL", "All", "All keys but names")]
        + [(identifier(name).upper(), name, f"The keys under {name}") for name in (*CATEGORIES, OTHER)],
    )
    exact: bpy.props.BoolProperty(
        name="Take Out Others", description="Also take keys of this panel out that the active object does not give"
    )

    def execute(self, context):
        kind = KIND_OF_ROLE[context.object.adf.role]
        names = [name for name in (*CATEGORIES, OTHER) if self.panel in ("ALL", identifier(name).upper())]
        keys = [key for name in names for key in SHOWN[kind][name] if key.path not in OWN]
        paths = {key.path for key in keys}
        values = {path: v for path, v in fetch(group_of(context.object), kind).items() if path in paths}
        others = alike(context)
        for obj in others:
            group = group_of(obj)
            if self.exact:
                for key in [key for key in keys if key.path not in values and not key.required]:
                    _take_out(group, key)
            store(group, kind, values)
        self.report({"INFO"}, f"{len(values)} keys copied to {len(others)} objects")
        return {"FINISHED"}


def _take_out(group, key):
    name = identifier(key.path)
    if key.type is Type.MAPS:
        getattr(group, name).clear()
    else:
        for one in (f"{name}_position", f"{name}_orientation") if key.type is Type.POSE else (name,):
            unset(group, one)


@cache
def _numbers_of(kind):
    """The numeric keys of a kind as items of an enum; referenced here, since Blender keeps no reference to them."""
    found = [key for key in keys_of(kind) if key.type in NUMBERS]
    return [(identifier(key.path), key.path, key.doc or key.path) for key in found]


def _choices(self, context):
    role = context.object.adf.role if context is not None and context.object is not None else ""
    return _numbers_of(KIND_OF_ROLE[role]) if role in KIND_OF_ROLE else _numbers_of("body")


class ADF_OT_edit_selected(bpy.types.Operator):
    """Set, multiply or shift one number of all selected objects of the active one's role"""

    bl_idname = "adf.edit_selected"
    bl_label = "Edit Number of Selected"
    bl_options = {"REGISTER", "UNDO"}

    key: bpy.props.EnumProperty(name="Key", items=_choices)
    how: bpy.props.EnumProperty(
        name="How",
        items=[
            ("SET", "Set To", "All get the value"),
            ("MULTIPLY", "Multiply By", "What each has, its default too, times the value"),
            ("ADD", "Add", "What each has, its default too, and the value"),
        ],
    )
    value: bpy.props.FloatProperty(name="Value", default=1.0, precision=5)

    @classmethod
    def poll(cls, context):
        if not making.is_file_object(context.object):
            cls.poll_message_set("Make an object of a file active, and select others of its role")
            return False
        return True

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        chosen = [context.object, *alike(context)]
        for obj in chosen:
            group = group_of(obj)
            was = getattr(group, self.key)
            now = {"SET": self.value, "MULTIPLY": was * self.value, "ADD": was + self.value}[self.how]
            setattr(group, self.key, round(now) if isinstance(was, int) else now)
        self.report({"INFO"}, f"{len(chosen)} objects changed")
        return {"FINISHED"}


class ADF_OT_copy_shapes(InSteps, bpy.types.Operator):
    """Give the selected bodies copies of the active one's collision shapes, stretched to their own size if wanted"""

    bl_idname = "adf.copy_shapes"
    bl_label = "Copy Shapes to Selected"
    bl_options = {"REGISTER", "UNDO"}

    fit: bpy.props.BoolProperty(
        name="Fit to Size",
        description="Move and stretch the shapes as the box around the body's mesh differs from the active one's",
        default=True,
    )

    @classmethod
    def poll(cls, context):
        if not _receivers(context):
            cls.poll_message_set("Select bodies, that with the shapes last")
            return False
        return True

    def steps(self, context):
        source, receivers = active_body(context), _receivers(context)
        parts = [child for child in source.children if _is_collision_part(child)]
        if not parts:
            self.report({"ERROR"}, f"'{source.name}' has no collision shape to copy")
            return {"CANCELLED"}
        box, boxes = _box(source) if self.fit else None, []
        for body in receivers if box is not None else ():
            yield f"Measuring '{body.name}'", len(boxes) / len(receivers)
            boxes.append(_box(body))
        for body, own in zip(receivers, boxes or [None] * len(receivers), strict=True):
            for old in [child for child in body.children if _is_collision_part(child)]:
                bpy.data.objects.remove(old)
            T, stretch = np.eye(4), np.ones(3)
            if own is not None:
                (low, size), (own_low, own_size) = box, own
                stretch = own_size / size
                T[:3, 3] = own_low - stretch * low
            for part in parts:
                copy = making.copied_part(part, body)
                _stretch(copy, body, relative_pose(source, part), T, stretch)
            for name in ("collision_mesh_type", "collision_margin"):
                own = group_of(source)
                if own.is_property_set(name):
                    setattr(group_of(body), name, getattr(own, name))
        self.report({"INFO"}, f"{len(parts)} shapes copied to {len(receivers)} bodies")
        return {"FINISHED"}


def _receivers(context):
    source = active_body(context)
    return [o for o in context.selected_objects if source is not None and o is not source and o.adf.role in SHAPED]


def _is_collision_part(child):
    """Whether a part is collision geometry of its body."""
    return child.adf.role == "HULL" or (child.adf.role == "SHAPE" and child.adf.shape.use == "COLLISION")


def _box(body):
    """Lowest corner and size of the box around a body's mesh in its frame; None without extent along all axes."""
    if body.type != "MESH":
        return None
    points = points_of(own_solid(body))[0]
    if not len(points) or not (np.ptp(points, axis=0) > 0.0).all():
        return None
    return points.min(axis=0), np.ptp(points, axis=0)


def _stretch(part, body, T_source, T, stretch):
    """Place a copied part in a stretched box; each of its axes is scaled as the box is along that axis."""
    place = T_source.copy()
    place[:3, 3] = stretch * T_source[:3, 3] + T[:3, 3]
    along = np.linalg.norm(stretch[:, None] * T_source[:3, :3], axis=0)
    scale = np.array(part.scale)
    parent_to(part, body, place)
    part.scale = scale * along


MOTORS = {
    "OWN": ("Own", "The frequency and damping below; the motor's strength stays", 0.0, 0.0),
    "SOFT": ("Soft", "1 Hz, twice as strong as what it moves is heavy: gives way to a hand", 1.0, 2.0),
    "MEDIUM": ("Medium", "5 Hz, five times as strong as what it moves is heavy", 5.0, 5.0),
    "STIFF": ("Stiff", "20 Hz, twenty times as strong as what it moves is heavy: an industrial drive", 20.0, 20.0),
}
"""Name, meaning, frequency in Hz, and strength over what holds the load against gravity; no data of products."""

GRAVITY, TICK = 9.81, 1e-3
"""m/s²; seconds for which a motor impulse acts."""


class ADF_OT_set_gains(InSteps, bpy.types.Operator):
    """Set the controller gains of the selected revolute and prismatic joints from what they move"""

    bl_idname = "adf.set_gains"
    bl_label = "Set Controller Gains"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    output: bpy.props.EnumProperty(
        name="Output",
        items=[
            ("FORCE", "Force", "The controller pushes: P = J ω², D = 2 ζ J ω, with J the inertia that the joint moves"),
            ("VELOCITY", "Velocity", "The controller sets the speed: P = ω"),
        ],
    )
    motor: bpy.props.EnumProperty(
        name="Motor", items=[(key, name, words) for key, (name, words, _, _) in MOTORS.items()]
    )
    frequency: bpy.props.FloatProperty(
        name="Frequency", description="Of the closed loop, in Hz: ω / 2π", default=5.0, min=0.01, max=200.0
    )
    damping: bpy.props.FloatProperty(
        name="Damping", description="ζ; 1 does not overshoot", default=1.0, min=0.0, max=10.0
    )

    @classmethod
    def poll(cls, context):
        if not _driven(context):
            cls.poll_message_set("Select revolute or prismatic joints between two bodies")
            return False
        return True

    def steps(self, context):
        _, _, frequency, strength = MOTORS[self.motor]
        omega = 2.0 * np.pi * (frequency or self.frequency)
        joints, moved = _driven(context), []
        for joint in joints:
            yield f"Weighing what '{joint.name}' moves", len(moved) / len(joints)
            moved.append((moved_inertia(joint), held_effort(joint)))
        for joint, (inertia, held) in zip(joints, moved, strict=True):
            group = joint.adf.joint
            if self.output == "VELOCITY":
                gains = (omega, 0.0, 0.0)
            else:
                if not inertia > 0.0:
                    self.report({"WARNING"}, f"'{joint.name}' moves no mass; give its bodies mass and inertia")
                    continue
                gains = (inertia * omega**2, 0.0, 2.0 * self.damping * inertia * omega)
            for letter, value in zip("pid", gains, strict=True):
                setattr(group, f"controller_{letter}", value)
            group.controller_output_type = self.output
            effort = strength * held
            if effort > 0.0:
                group.max_motor_impulse = effort * TICK
            self.report({"INFO"}, f"'{joint.name}': P {gains[0]:.4g}, D {gains[2]:.4g}")
        return {"FINISHED"}


def _driven(context):
    joints = [obj for obj in context.selected_objects if obj.adf.role == "JOINT"]
    return [
        j for j in joints
        if j.adf.joint.type in ("revolute", "prismatic") and j.adf.parent_object and j.adf.child_object
    ]  # fmt: skip


def moved_inertia(joint):
    """Inertia about a revolute joint's axis of all that it moves, in kg m²; the mass in kg of a prismatic one.

    Bodies that state no moments count as points at their centre of mass.
    """
    T = rest_pose(joint)
    total = 0.0
    for body in behind(joint):
        group = body.adf.body
        if joint.adf.joint.type == "prismatic":
            total += group.mass
            continue
        frame = rest_pose(body) @ inertial_frame(body)
        axis, arm = T[:3, 2], frame[:3, 3] - T[:3, 3]
        moments = np.zeros(3)
        if group.is_property_set("inertia_ix"):
            moments = np.array([getattr(group, f"inertia_i{a}") for a in "xyz"])
        total += float(moments @ (frame[:3, :3].T @ axis) ** 2 + group.mass * np.sum(np.cross(axis, arm) ** 2))
    return total


def held_effort(joint):
    """What holds all that a joint moves where gravity pulls most: N m about a revolute axis, N along a slide."""
    bodies = behind(joint)
    mass = sum(body.adf.body.mass for body in bodies)
    if joint.adf.joint.type == "prismatic" or not mass > 0.0:
        return GRAVITY * mass
    T = rest_pose(joint)
    centres = [(rest_pose(body) @ inertial_frame(body))[:3, 3] * body.adf.body.mass for body in bodies]
    return GRAVITY * mass * float(np.linalg.norm(np.cross(T[:3, 2], sum(centres) / mass - T[:3, 3])))


CLASSES = (ADF_OT_copy_keys, ADF_OT_edit_selected, ADF_OT_copy_shapes, ADF_OT_set_gains)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
