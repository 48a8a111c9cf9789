"""Operators that make objects part of a file: roles, joints, inertia."""

from math import pi

import bpy
import numpy as np

from . import making
from .file_operators import chosen_collection
from .ligature.adf.frames import axis_rotation, frame, pose_matrix
from .ligature.authoring.generate import mass_keys
from .ligature.authoring.shapes import Shape, shapes_properties
from .ligature.mesh.inertia import combined, mass_properties
from .mesh_reading import points_of
from .poses import SHAPED, children_with, relative_pose, rest_pose, shape_of, shapes_of
from .properties import ROLES
from .solids import own_solid
from .steps import InSteps, all_or_nothing
from .write_file import NO_MESH

JOINT_KINDS = [
    (kind, kind.title(), f"A {kind} joint")
    for kind in (
        "revolute", "prismatic", "fixed", "six dof", "six dof spring", "linear spring", "torsion spring", "p2p",
        "cone twist",
    )
]  # fmt: skip
OBJECT_ROLES = [item for item in ROLES if item[0] not in ("NONE", "SHAPE", "HULL", "INERTIAL")]
AXES = [(a, a, f"World {a}") for a in ("X", "Y", "Z")] + [("CURSOR", "Cursor", "Z of the 3D cursor")]


def active_body(context, roles=("BODY", "GHOST_OBJECT", "SOFT_BODY")):
    """The active object or the body that it is a shape of."""
    obj = context.object
    while obj is not None and obj.adf.role not in roles:
        obj = obj.parent
    return obj


class NeedsBody:
    """Asks for an active body before an operator runs."""

    @classmethod
    def poll(cls, context):
        if active_body(context) is None:
            cls.poll_message_set("Make a body, a ghost or one of their shapes active")
            return False
        return True


class ADF_OT_new_file(bpy.types.Operator):
    """Add a collection that stands for a new file"""

    bl_idname = "adf.new_file"
    bl_label = "New ADF File"
    bl_options = {"REGISTER", "UNDO"}

    kind: bpy.props.EnumProperty(
        name="File", items=[("MODEL", "Model", "Bodies and joints"), ("WORLD", "World", "Lights and cameras")]
    )
    name: bpy.props.StringProperty(name="Name", default="model")
    namespace: bpy.props.StringProperty(name="Namespace", default="/ambf/env/")

    def execute(self, context):
        collection = making.new_file(context.scene, self.name, self.kind, making.closed(self.namespace))
        if self.kind == "WORLD":
            context.scene.adf.world = collection
        else:
            entry = context.scene.adf.models.add()
            entry.collection, entry.path = collection, f"{collection.name}.yaml"
        layer = context.view_layer.layer_collection.children.get(collection.name)
        if layer is not None:
            context.view_layer.active_layer_collection = layer
        return {"FINISHED"}


class ADF_OT_make(bpy.types.Operator):
    """Make the selected objects part of the active file"""

    bl_idname = "adf.make"
    bl_label = "Make Part of File"
    bl_options = {"REGISTER", "UNDO"}

    role: bpy.props.EnumProperty(name="Role", items=OBJECT_ROLES)

    @classmethod
    def poll(cls, context):
        if not context.selected_objects:
            cls.poll_message_set("Select objects first")
            return False
        return True

    def execute(self, context):
        for obj in context.selected_objects:
            if obj.adf.role in ("SHAPE", "HULL", "INERTIAL"):
                self.report({"WARNING"}, f"'{obj.name}' is part of a body and keeps its role")
                continue
            making.give_role(obj, self.role, making.file_of(obj) or target_file(context, self.role))
            if self.role in SHAPED and obj.type not in ("MESH", "EMPTY"):
                self.report({"WARNING"}, f"'{obj.name}': {NO_MESH.format(obj.type.lower())}")
        return {"FINISHED"}


class ADF_OT_clear(bpy.types.Operator):
    """Take the selected objects out of their files; the objects stay"""

    bl_idname = "adf.clear_role"
    bl_label = "Take Out of File"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not any(obj.adf.role != "NONE" for obj in context.selected_objects):
            cls.poll_message_set("Select objects that are part of a file")
            return False
        return True

    def execute(self, context):
        for obj in context.selected_objects:
            obj.adf.role = "NONE"
        return {"FINISHED"}


class ADF_OT_add(bpy.types.Operator):
    """Add an object of the file at the 3D cursor; parented to the active body if its role allows it"""

    bl_idname = "adf.add"
    bl_label = "Add ADF Object"
    bl_options = {"REGISTER", "UNDO"}

    role: bpy.props.EnumProperty(name="Role", items=OBJECT_ROLES)
    name: bpy.props.StringProperty(name="Name", description="Name of the object; that of its role when empty")
    hang: bpy.props.BoolProperty(name="On Active Body", description="Parent it to the active body", default=True)

    def execute(self, context):
        collection = target_file(context, self.role)
        name = self.name or self.role.replace("_", " ").title()
        body = active_body(context) if self.hang and self.role in making.PARENTED else None
        obj = making.new_object(collection, self.role, name, making.cursor_pose(context.scene), body)
        group = getattr(obj.adf, self.role.lower())
        if self.role == "SENSOR":
            group.type = "PROXIMITY"
            ray = group.array.add()
            ray.offset, ray.direction = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
        if self.role == "ACTUATOR":
            group.type = "CONSTRAINT"
        if self.role == "SUTURE":
            group.length, group.diameter, group.elements = 0.1, 0.0004, 40
        if self.role == "LIGHT":
            group.shadow_quality = 0
        if self.role == "GHOST_OBJECT":
            making.add_shape(obj, Shape("BOX", size=(0.01, 0.01, 0.01)))
        return {"FINISHED"}


class ADF_OT_duplicate(InSteps, bpy.types.Operator):
    """Copy the selected objects of files with their shapes; each copy gets an identifier and a name of its own"""

    bl_idname = "adf.duplicate"
    bl_label = "Duplicate with Shapes"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not any(making.is_file_object(obj) for obj in context.selected_objects):
            cls.poll_message_set("Select objects that are part of a file")
            return False
        return True

    def steps(self, context):
        originals = [obj for obj in context.selected_objects if making.is_file_object(obj)]
        active = context.view_layer.objects.active
        copies = {}
        with all_or_nothing():
            for obj in originals:
                yield f"Copying '{obj.name}'", len(copies) / len(originals)
                copies[obj] = making.copied(obj)
        for obj, copy in copies.items():
            for end in ("parent_object", "child_object"):
                body = getattr(obj.adf, end)
                if body in copies:
                    setattr(copy.adf, end, copies[body])
            if obj.parent in copies:
                copy.parent = copies[obj.parent]
            obj.select_set(False)
            copy.select_set(True)
        if active in copies:
            context.view_layer.objects.active = copies[active]
        if self.started():
            bpy.ops.transform.translate("INVOKE_DEFAULT")
        return {"FINISHED"}


class ADF_OT_connect(bpy.types.Operator):
    """Join the selected bodies to the active one, which becomes the parent"""

    bl_idname = "adf.connect"
    bl_label = "Connect by Joint"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    type: bpy.props.EnumProperty(name="Type", items=JOINT_KINDS)
    pivot: bpy.props.EnumProperty(
        name="Pivot",
        items=[
            ("CHILD", "Child Origin", "Where the child's origin is"),
            ("CURSOR", "3D Cursor", "Where the 3D cursor is"),
        ],
    )
    axis: bpy.props.EnumProperty(name="Axis", items=AXES, default="Z")
    flip: bpy.props.BoolProperty(name="Flip Axis", description="Turn the axis round")

    @classmethod
    def poll(cls, context):
        bodies = [obj for obj in context.selected_objects if obj.adf.role == "BODY"]
        if len(bodies) < 2 or context.object not in bodies:
            cls.poll_message_set("Select the child bodies, then the parent body last")
            return False
        return True

    def execute(self, context):
        parent = context.object
        collection = making.file_of(parent)
        for child in [obj for obj in context.selected_objects if obj.adf.role == "BODY" and obj is not parent]:
            making.connect(collection, parent, child, self.type, self._pose(context, child))
        return {"FINISHED"}

    def _pose(self, context, child):
        cursor = making.cursor_pose(context.scene)
        origin = cursor[:3, 3] if self.pivot == "CURSOR" else rest_pose(child)[:3, 3]
        turn = {"X": axis_rotation((0, 1, 0), pi / 2), "Y": axis_rotation((1, 0, 0), -pi / 2), "Z": np.eye(3)}
        R = cursor[:3, :3] if self.axis == "CURSOR" else turn[self.axis]
        if self.flip:
            R = R @ axis_rotation((1, 0, 0), pi)
        if self.type == "prismatic":
            R = R @ axis_rotation((0, 1, 0), -pi / 2)  # a prismatic joint moves along its X
        return frame(R, origin)


class ADF_OT_inertia(InSteps, bpy.types.Operator):
    """Set mass, principal moments and centre of mass of the selected bodies from their geometry"""

    bl_idname = "adf.set_inertia"
    bl_label = "Set Inertia"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    source: bpy.props.EnumProperty(
        name="From",
        items=[
            ("MESH", "Visual Mesh", "The closed mesh of the body"),
            ("SHAPES", "Primitives", "The collision primitives; overlaps count twice"),
            ("HULLS", "Convex Pieces", "The convex pieces of the collision mesh; overlaps count twice"),
        ],
    )
    given: bpy.props.EnumProperty(
        name="Given",
        items=[("MASS", "Mass", "The mass stays; the density follows"), ("DENSITY", "Density", "The density is given")],
    )
    density: bpy.props.FloatProperty(name="Density", description="In kg/m³", default=1000.0, min=1e-6)
    factor: bpy.props.FloatProperty(
        name="Inflate By",
        description="Factor on the moments, for stability; it is remembered, so that checks know it is on purpose",
        default=1.0,
        min=1e-6,
    )

    @classmethod
    def poll(cls, context):
        if not any(obj.adf.role == "BODY" for obj in context.selected_objects):
            cls.poll_message_set("Select bodies")
            return False
        return True

    def steps(self, context):
        bodies = [obj for obj in context.selected_objects if obj.adf.role == "BODY"]
        found, failed = {}, []
        for number, body in enumerate(bodies):
            yield f"Weighing '{body.name}'", number / len(bodies)
            try:
                found[body] = solid_of(body, self.source, self.density)
            except ValueError as error:
                failed.append(f"'{body.name}': {error}")
        for words in failed:
            self.report({"WARNING"} if found else {"ERROR"}, words)
        for body, solid in found.items():
            if self.given == "MASS":
                solid = solid.with_mass(body.adf.body.mass or 1.0)
            keys = mass_keys(solid, self.factor)
            body.adf.body.mass = keys["mass"]
            for axis in "xyz":
                setattr(body.adf.body, f"inertia_i{axis}", keys[f"inertia.i{axis}"])
            body.adf.inertia_factor = self.factor
            making.inertial_of(body, pose_matrix(*keys["inertial offset"]))
        return {"FINISHED"} if found else {"CANCELLED"}


def solid_of(body, source, density=1.0):
    """Mass properties of a body in its own frame; raises ValueError with the reason."""
    if source == "MESH":
        if body.type != "MESH":
            raise ValueError("it has no visual mesh; use its primitives instead")
        return mass_properties(*points_of(own_solid(body)), density)
    if source == "SHAPES":
        shapes = [(shape_of(child), relative_pose(body, child)) for child in shapes_of(body, "COLLISION")]
        if not shapes:
            raise ValueError("it has no collision primitive; add or fit one")
        return shapes_properties(shapes, density)
    hulls = children_with(body, "HULL")
    if not hulls:
        raise ValueError("it has no convex piece; add a hull or decompose its mesh")
    return combined(
        [mass_properties(*points_of(own_solid(hull)), density).placed(relative_pose(body, hull)) for hull in hulls]
    )


def target_file(context, role):
    """The file that a new object goes to: the active one of the right kind, the world's, or a new one."""
    scene = context.scene
    world_role = role in ("CAMERA", "LIGHT")
    chosen = chosen_collection(context)
    if chosen is not None and (chosen.adf.kind == "MODEL" or (world_role and chosen.adf.kind == "WORLD")):
        return chosen
    models = [entry.collection for entry in scene.adf.models if entry.collection is not None]
    if world_role and scene.adf.world is not None:
        return scene.adf.world
    if models:
        return models[-1]
    collection = making.new_file(scene, "model", "MODEL")
    entry = scene.adf.models.add()
    entry.collection, entry.path = collection, f"{collection.name}.yaml"
    return collection


CLASSES = (ADF_OT_new_file, ADF_OT_make, ADF_OT_clear, ADF_OT_add, ADF_OT_duplicate, ADF_OT_connect, ADF_OT_inertia)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
