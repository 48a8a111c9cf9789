"""Blocks of keys that several kinds of object share: identity, looks, collision, shaders, gains (as in AMBF)."""

from __future__ import annotations

from ligature.adf.schema.keys import (
    LARGEST_SCALE,
    POSE_ZERO,
    Fault,
    Key,
    Status,
    Type,
    each,
    ignored,
    spellings,
    unused,
)

N, U, F, T, P, C = Type.NUMBER, Type.UNSIGNED, Type.FLAG, Type.TEXT, Type.PATH, Type.CHOICE
V, POSE, MAP, MAPS = Type.VECTOR, Type.POSE, Type.MAP, Type.MAPS

SHAPES = spellings("box", "sphere", "cylinder", "capsule", "cone", "plane")
SHAPE_KEYS = {
    "BOX": ("x", "y", "z"),
    "SPHERE": ("radius",),
    "CYLINDER": ("radius", "height"),
    "CAPSULE": ("radius", "height"),
    "CONE": ("radius", "height"),
    "PLANE": ("normal", "offset"),
}
"""Keys that the geometry of a shape must have (as in AMBF)."""

AXES = {a: a.upper() for a in "xyzXYZ"}
OUTPUT_TYPES = {
    **{s: "FORCE" for s in ("FORCE", "EFFORT", "force", "effort")},
    **{s: "VELOCITY" for s in ("VELOCITY", "velocity", "POSITION", "position")},
}
MESH_TYPES = {
    **{s: "CONVEX_HULL" for s in ("CONVEX_HULL", "convex_hull", "hull")},
    **{s: "CONVEX_MESH" for s in ("CONVEX_MESH", "convex_mesh")},
    **{s: "CONCAVE_MESH" for s in ("TRIMESH", "CONCAVE_MESH", "trimesh")},
    **{s: "POINT_CLOUD" for s in ("POINT_CLOUD", "point_cloud")},
}

PLUGINS = Key(
    "plugins",
    Type.ANY,
    doc="list of {name, filename, path}; of files and bodies those in Python are run",
    status=Status.KEPT,
)
IDENTITY = (
    Key("name", T, "", doc="name of the topics and in messages; blanks are removed"),
    Key("namespace", T, "", doc="absolute with a leading '/', else appended to the file's"),
    Key("passive", F, False, doc="no topics; on a joint: excluded from command and state vectors"),
    Key("publish frequency", MAP, doc="publishing rates without and with commands"),
    Key("publish frequency.low", U, 50, "Hz", "rate until a command arrives", required=True),
    Key("publish frequency.high", U, 1000, "Hz", "rate while commands arrive", required=True),
    PLUGINS,
)
PARENT = (Key("parent", T, "", doc="reference to the parent object"),)


def _rgb(part: str, default: float) -> tuple[Key, ...]:
    return (
        Key(f"color components.{part}", MAP, doc=f"{part} colour"),
        *each("rgb", N, f"color components.{part}.{{}}", default, doc="{} of 0 to 1", required=True),
    )


COLOUR = (
    Key("color rgba", MAP, doc="diffuse colour and alpha; takes precedence over `color components`"),
    *each("rgba", N, "color rgba.{}", doc="{} of 0 to 1", required=True),
    Key("color components", MAP, doc="material colours"),
    *_rgb("diffuse", 0.7),
    *_rgb("specular", 1.0),
    *_rgb("emission", 0.0),
    Key("color components.ambient", MAP, doc="ambient colour; 0.3 each when absent"),
    Key("color components.ambient.level", N, doc="ambient = level × diffuse"),
    Key("color components.shininess", U, 64, doc="Blinn–Phong exponent"),
    Key("color components.transparency", N, 1.0, doc="alpha; 1 is opaque", required=True),
    Key("use material", F, True, doc="false: the mesh file's own materials are used"),
    *ignored(("color",), "colour name of old files"),
    Key("visible", F, True, doc="false hides the visual only"),
)


def geometry(block: str, doc: str) -> tuple[Key, ...]:
    """Dimensions of a primitive shape; which of them it must have states `SHAPE_KEYS`."""
    return (
        Key(block, MAP, doc=doc),
        *each("xyz", N, f"{block}.{{}}", unit="m", doc="full edge of a box along {}"),
        Key(f"{block}.radius", N, unit="m", doc="radius of a round shape"),
        Key(f"{block}.height", N, unit="m", doc="height of a round shape; of a capsule with both caps"),
        Key(f"{block}.axis", C, "Z", doc="axis of a round shape", choices=AXES, fault=Fault.VALUE),
        Key(f"{block}.normal", V, doc="normal of a plane"),
        Key(f"{block}.offset", N, unit="m", doc="distance of a plane from the origin along its normal"),
    )


def _compound(block: str, doc: str) -> tuple[Key, ...]:
    return (
        Key(block, MAPS, doc=doc),
        Key(f"{block}[].shape", C, doc="primitive", required=True, choices=SHAPES),
        *geometry(f"{block}[].geometry", "dimensions of the primitive"),
        Key(f"{block}[].offset", POSE, POSE_ZERO, "m, rad", "pose in the body frame B"),
        *ignored((f"{block}[].name",), "name of the primitive"),
    )


LOOKS = (
    Key("mesh", P, "", doc="visual mesh, and collision mesh unless another is named; '' is none"),
    *unused((Key("mesh remove duplicates", F, False, doc="merge identical visual vertices; no visible effect"),)),
    Key("shape", C, doc="visual primitive; takes precedence over `mesh`", choices=SHAPES),
    *geometry("geometry", "dimensions of `shape`"),
    *_compound("compound shape", "several visual primitives"),
    Key("high resolution path", P, "", doc="folder of visual meshes, appended to the file's own"),
    Key("low resolution path", P, "", doc="folder of collision meshes, appended to the file's own"),
    *COLOUR,
)
COLLISION = (
    Key("collision shape", C, doc="single collision primitive; takes precedence", choices=SHAPES),
    *geometry("collision geometry", "dimensions of `collision shape`"),
    Key(
        "collision offset",
        POSE,
        None,
        "m, rad",
        "pose of the primitive in B; inertial offset when absent",
    ),
    *_compound("compound collision shape", "several collision primitives"),
    Key("collision mesh", P, doc="collision mesh in the low-resolution folder; '' is none"),
    Key(
        "collision mesh type",
        C,
        "CONCAVE_MESH",
        doc="how the mesh collides",
        choices=MESH_TYPES,
        fault=Fault.VALUE,
    ),
    Key("collision margin", N, 0.001, "m", "collision margin", least=0.0),
    Key("collision groups", Type.INTEGERS, (), doc="two bodies in groups collide only if they share one"),
    Key("scale", N, 1.0, doc="factor on meshes and joint pivots", most=LARGEST_SCALE),
)


def shaders(block: str, doc: str = "shader program of the visual objects") -> tuple[Key, ...]:
    """A shader program: a folder and two files in it."""
    return (
        Key(block, MAP, doc=doc),
        Key(f"{block}.path", P, doc="folder of the shader files", required=True),
        Key(f"{block}.vertex", P, doc="vertex shader file", required=True),
        Key(f"{block}.fragment", P, doc="fragment shader file", required=True),
    )


def gains(block: str, doc: str, required: bool) -> tuple[Key, ...]:
    """Gains of one PID loop; their units follow from the error and the output type."""
    return (
        Key(block, MAP, doc=doc),
        Key(f"{block}.P", N, 10.0, doc="proportional gain", required=required),
        Key(f"{block}.I", N, 0.0, doc="integral gain"),
        Key(f"{block}.D", N, 1.0, doc="derivative gain", required=required),
    )


OUTPUT_TYPE = Key(
    "controller output type", C, doc="quantity that the output commands", choices=OUTPUT_TYPES, fault=Fault.VALUE
)
