"""What Blender stores of a scene file: on collections the file, on objects their role, on the scene the launch file."""

import bpy

from .ligature.adf.schema import SCHEMA
from .schema_properties import group_class, identifier

FILE_KINDS = ("launch", "world", "model", "input devices")
OBJECT_KINDS = tuple(kind for kind in SCHEMA if kind not in FILE_KINDS)
ROLES = [
    ("NONE", "None", "Not part of the file", "BLANK1", 0),
    ("BODY", "Body", "Rigid body; a mesh, or an empty with shapes below it", "RIGID_BODY", 1),
    ("JOINT", "Joint", "Joint between two bodies; an empty whose Z (prismatic: X) is the axis", "CONSTRAINT", 2),
    ("SHAPE", "Shape", "Primitive of the body or ghost that it is parented to", "MESH_UVSPHERE", 3),
    ("HULL", "Collision Mesh", "Part of the collision mesh of the body that it is parented to", "MESH_ICOSPHERE", 4),
    ("INERTIAL", "Inertial Frame", "Centre of mass and principal axes of the body it is parented to", "EMPTY_AXIS", 5),
    ("GHOST_OBJECT", "Ghost", "Region that senses overlaps and does not collide", "GHOST_ENABLED", 6),
    ("SENSOR", "Sensor", "Rays or contacts", "OUTLINER_OB_FORCE_FIELD", 7),
    ("ACTUATOR", "Actuator", "Constraint that holds bodies on command", "SNAP_ON", 8),
    ("CAMERA", "Camera", "Camera that the simulator draws and publishes", "CAMERA_DATA", 9),
    ("LIGHT", "Light", "Spot light", "LIGHT_SPOT", 10),
    ("SOFT_BODY", "Soft Body", "Deformable body, simulated as tissue; docs/tissue.md", "MOD_SOFT", 11),
    ("VEHICLE", "Vehicle", "Wheels on a chassis; checked, not simulated", "AUTO", 12),
    ("VOLUME", "Volume", "Image stack; checked, not simulated", "VOLUME_DATA", 13),
    ("SUTURE", "Suture", "Thread by physical data, leaving along +Z", "CURVE_DATA", 14),
    ("INPUT_DEVICE", "Input Device", "Haptic device that drives a body", "MOUSE_LMB_DRAG", 15),
]  # fmt: skip
KIND_OF_ROLE = {identifier(kind).upper(): kind for kind in OBJECT_KINDS}
ROLE_OF_KIND = {kind: role for role, kind in KIND_OF_ROLE.items()}
SHAPE_KINDS = [
    (k, k.title(), f"{k.title()} of the format") for k in ("BOX", "SPHERE", "CYLINDER", "CAPSULE", "CONE", "PLANE")
]
USES = [("COLLISION", "Collision", "What bodies touch"), ("VISUAL", "Visual", "What is seen")]


class ADF_PG_shape(bpy.types.PropertyGroup):
    """A primitive; its dimensions are these numbers times the object's own scale."""

    kind: bpy.props.EnumProperty(name="Shape", items=SHAPE_KINDS)
    use: bpy.props.EnumProperty(name="Use", items=USES)
    size: bpy.props.FloatVectorProperty(
        name="Size", size=3, default=(1, 1, 1), subtype="XYZ_LENGTH", min=0.0, precision=5
    )
    radius: bpy.props.FloatProperty(name="Radius", default=0.5, min=0.0, subtype="DISTANCE", precision=5)
    height: bpy.props.FloatProperty(
        name="Height",
        description="Whole height; of a capsule with both caps",
        default=1.0,
        min=0.0,
        subtype="DISTANCE",
        precision=5,
    )
    axis: bpy.props.EnumProperty(name="Axis", items=[(a, a, f"Along {a}") for a in "XYZ"], default="Z")
    normal: bpy.props.FloatVectorProperty(name="Normal", size=3, default=(0, 0, 1), subtype="XYZ")
    offset: bpy.props.FloatProperty(name="Offset", subtype="DISTANCE")
    order: bpy.props.IntProperty(options={"HIDDEN"})


class ADF_PG_quality(bpy.types.PropertyGroup):
    """How well collision shapes stand for a mesh, as it was measured."""

    pieces: bpy.props.IntProperty()
    volume: bpy.props.FloatProperty()
    closed: bpy.props.BoolProperty()
    distance: bpy.props.FloatProperty()
    measured: bpy.props.StringProperty()


class ADF_PG_object(bpy.types.PropertyGroup):
    """What an object is in the file."""

    role: bpy.props.EnumProperty(name="Role", items=ROLES)
    key: bpy.props.StringProperty(name="Identifier", description="Key that lists and defines the object in the file")
    export: bpy.props.BoolProperty(
        name="Export", description="Whether the object goes to the file; hiding does not matter", default=True
    )
    parent_text: bpy.props.StringProperty(
        name="Parent Text", description="Reference to an object of another file, such as psm1/BODY tool yaw link"
    )
    child_text: bpy.props.StringProperty(name="Child Text", description="Reference to a child body of another file")
    parent_object: bpy.props.PointerProperty(
        type=bpy.types.Object, name="Parent", description="Parent body of the joint"
    )
    child_object: bpy.props.PointerProperty(type=bpy.types.Object, name="Child", description="Child body of the joint")
    was: bpy.props.StringProperty(options={"HIDDEN"})
    like: bpy.props.StringProperty(options={"HIDDEN"})
    called: bpy.props.StringProperty(options={"HIDDEN"})
    hung: bpy.props.BoolProperty(options={"HIDDEN"})
    imported: bpy.props.StringProperty(options={"HIDDEN"})
    mesh_print: bpy.props.StringProperty(options={"HIDDEN"})
    inertia_factor: bpy.props.FloatProperty(
        name="Inertia Factor",
        description="Factor by which the inertia was inflated for stability, on purpose",
        default=1.0,
        min=0.0,
    )
    shape: bpy.props.PointerProperty(type=ADF_PG_shape)
    quality: bpy.props.PointerProperty(type=ADF_PG_quality)


class ADF_PG_file(bpy.types.PropertyGroup):
    """A scene file: a collection holds what it lists."""

    kind: bpy.props.EnumProperty(
        name="File",
        items=[
            ("NONE", "None", "An ordinary collection"),
            ("MODEL", "Model", "Bodies, joints and what belongs to them"),
            ("WORLD", "World", "Lights, cameras, gravity, environment"),
            ("INPUT_DEVICES", "Input Devices", "Haptic devices"),
            ("OTHER", "Other", "A file that is kept as it is"),
        ],
    )
    filepath: bpy.props.StringProperty(name="File", subtype="FILE_PATH")
    source: bpy.props.StringProperty(options={"HIDDEN"})
    byte_order_mark: bpy.props.BoolProperty(options={"HIDDEN"})
    imported_keys: bpy.props.StringProperty(options={"HIDDEN"})
    written: bpy.props.StringProperty(options={"HIDDEN"})


class ADF_PG_variant(bpy.types.PropertyGroup):
    """The same model in another file: another namespace, another place."""

    filepath: bpy.props.StringProperty(name="File", subtype="FILE_PATH")
    namespace: bpy.props.StringProperty(name="Namespace", default="/ambf/env/")
    location: bpy.props.FloatVectorProperty(name="Moved By", size=3, subtype="TRANSLATION")
    rotation: bpy.props.FloatVectorProperty(name="Turned By", size=3, subtype="EULER")


class ADF_PG_pose(bpy.types.PropertyGroup):
    """Where the joints of a model stand, under a name; kept in the blend file, the format has no place for it."""

    positions: bpy.props.StringProperty(options={"HIDDEN"})


class ADF_PG_launch_entry(bpy.types.PropertyGroup):
    """One model of the launch file, by its index."""

    path: bpy.props.StringProperty(name="Path", description="Path as written in the launch file")
    collection: bpy.props.PointerProperty(type=bpy.types.Collection, name="Model")


class ADF_PG_finding(bpy.types.PropertyGroup):
    """One finding of Check Scene."""

    severity: bpy.props.StringProperty()
    rule: bpy.props.StringProperty()
    message: bpy.props.StringProperty()
    hint: bpy.props.StringProperty()
    object: bpy.props.PointerProperty(type=bpy.types.Object)
    fixable: bpy.props.BoolProperty()


class ADF_PG_scene(bpy.types.PropertyGroup):
    """The launch file, and the state of the panels."""

    filepath: bpy.props.StringProperty(name="Launch File", subtype="FILE_PATH")
    source: bpy.props.StringProperty(options={"HIDDEN"})
    byte_order_mark: bpy.props.BoolProperty(options={"HIDDEN"})
    written: bpy.props.StringProperty(options={"HIDDEN"})
    folders: bpy.props.StringProperty(options={"HIDDEN"})
    world: bpy.props.PointerProperty(type=bpy.types.Collection, name="World")
    environment: bpy.props.PointerProperty(
        type=bpy.types.Collection, name="Environment", description="Model that the world names as its surroundings"
    )
    devices: bpy.props.PointerProperty(type=bpy.types.Collection, name="Input Devices")
    colours: bpy.props.PointerProperty(type=bpy.types.Collection, name="Colours")
    world_path: bpy.props.StringProperty(name="World File", default="world.yaml")
    devices_path: bpy.props.StringProperty(name="Input Devices File", default="input_devices.yaml")
    colours_path: bpy.props.StringProperty(name="Colours File", default="colors.yaml")
    models: bpy.props.CollectionProperty(type=ADF_PG_launch_entry)
    active_model: bpy.props.IntProperty()
    findings: bpy.props.CollectionProperty(type=ADF_PG_finding)
    active_finding: bpy.props.IntProperty()
    active_object: bpy.props.IntProperty()
    search: bpy.props.StringProperty(name="Search", options={"TEXTEDIT_UPDATE"})
    show_overlay: bpy.props.BoolProperty(
        name="Overlay", description="Draw joints, limits, inertia, rays over the scene", default=True
    )
    show_tissue: bpy.props.BoolProperty(
        name="Tissue Grid",
        description="Draw the cells of soft tissue, the faces that are held, and slits",
        default=True,
    )
    show_quality: bpy.props.BoolProperty(
        name="Collision Quality",
        description="Draw volume error, Hausdorff distance and deviation over the meshes that were measured",
        default=True,
    )


for _kind in OBJECT_KINDS:
    ADF_PG_object.__annotations__[identifier(_kind)] = bpy.props.PointerProperty(type=group_class(_kind))
for _kind in ("model", "world", "input devices"):
    ADF_PG_file.__annotations__[identifier(_kind)] = bpy.props.PointerProperty(type=group_class(_kind))
ADF_PG_file.__annotations__["poses"] = bpy.props.CollectionProperty(type=ADF_PG_pose)
ADF_PG_file.__annotations__["variants"] = bpy.props.CollectionProperty(type=ADF_PG_variant)
ADF_PG_scene.__annotations__["launch"] = bpy.props.PointerProperty(type=group_class("launch"))

CLASSES = (
    ADF_PG_shape, ADF_PG_quality, ADF_PG_object, ADF_PG_variant, ADF_PG_pose, ADF_PG_file, ADF_PG_launch_entry,
    ADF_PG_finding, ADF_PG_scene,
)  # fmt: skip


def attach() -> None:
    """Give objects, collections and scenes their groups."""
    bpy.types.Object.adf = bpy.props.PointerProperty(type=ADF_PG_object)
    bpy.types.Collection.adf = bpy.props.PointerProperty(type=ADF_PG_file)
    bpy.types.Scene.adf = bpy.props.PointerProperty(type=ADF_PG_scene)


def detach() -> None:
    """Take them away again."""
    for owner in (bpy.types.Object, bpy.types.Collection, bpy.types.Scene):
        del owner.adf
