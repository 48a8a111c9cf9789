"""The one table of the format: every key of every kind of object, its type, unit, default and meaning.

Reader, checker, writer and the support table in ``docs/adf.md`` are generated from it. Section
numbers are those of the ADF specification. Paths are dotted: ``friction.static`` is the key
``static`` inside the block ``friction``; ``compound shape[].offset`` lies in each item of a list.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


class Type(enum.Enum):
    """What a value is; block types name their sub-keys in the text of the value."""

    NUMBER = "number"
    INTEGER = "integer"
    UNSIGNED = "whole number >= 0"
    FLAG = "true/false"
    TEXT = "text"
    PATH = "path"
    CHOICE = "one of"
    VECTOR = "{x, y, z}"
    RPY = "{r, p, y}"
    POSE = "{position, orientation}"
    MAP = "block"
    MAPS = "list of blocks"
    TEXTS = "list of text"
    INTEGERS = "list of whole numbers"
    MATRIX = "4x4 list of lists"
    ANY = "anything"


class Status(enum.Enum):
    """What becomes of a key."""

    USED = "used"
    IGNORED = "read and ignored, as in AMBF"
    NOT_SIMULATED = "validated, not simulated"
    OURS = "Ligature's own; AMBF ignores it"


@dataclass(frozen=True)
class Key:
    """One key. ``required`` holds when the enclosing block is present."""

    path: str
    type: Type
    default: Any = None
    unit: str = ""
    doc: str = ""
    required: bool = False
    choices: Mapping[str, str] = field(default_factory=dict)
    status: Status = Status.USED
    lenient: bool = False
    """A text that is not among the choices is a warning, and the default is taken."""


def spellings(*names: str) -> dict[str, str]:
    """Each name in lower case, Capitalised and UPPER case, mapped to UPPER case."""
    return {form: n.upper() for n in names for form in (n.lower(), n.capitalize(), n.upper())}


SHAPES = spellings("box", "sphere", "cylinder", "capsule", "cone", "plane")
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
JOINT_TYPES = {
    **{s: "revolute" for s in ("revolute", "hinge", "continuous")},
    **{s: "prismatic" for s in ("prismatic", "slider")},
    "fixed": "fixed",
    **{s: "linear spring" for s in ("linear spring", "spring")},
    **{s: "torsion spring" for s in ("torsion spring", "torsional spring", "angular spring")},
    "p2p": "p2p",
    "cone twist": "cone twist",
    "six dof": "six dof",
    "six dof spring": "six dof spring",
}
SENSOR_TYPES = spellings("proximity", "resistance", "contact")
ACTUATOR_TYPES = spellings("constraint")
ZERO = (0.0, 0.0, 0.0)
POSE_ZERO = (ZERO, ZERO)

N, I, U, F, T, P, C = (
    Type.NUMBER, Type.INTEGER, Type.UNSIGNED, Type.FLAG, Type.TEXT, Type.PATH, Type.CHOICE,
)  # fmt: skip
V, RPY, POSE, MAP, MAPS, ANY = Type.VECTOR, Type.RPY, Type.POSE, Type.MAP, Type.MAPS, Type.ANY

IDENTITY = (
    Key("name", T, "", "", "name of the topics; blanks are removed"),
    Key("namespace", T, "", "", "absolute with a leading '/', else appended to the file's"),
    Key("passive", F, False, "", "no topics; on a joint: left out of command and state vectors"),
    Key("publish frequency", MAP, None, "Hz", "publishing rates without and with commands"),
    Key("publish frequency.low", U, 50, "Hz", "rate until a command arrives", required=True),
    Key("publish frequency.high", U, 1000, "Hz", "rate while commands arrive", required=True),
    Key("plugins", ANY, None, "", "kept as written for plug-ins", status=Status.IGNORED),
)
PARENT = (Key("parent", T, "", "", "reference to the parent object, §4.5"),)
COLOUR = (
    Key("color rgba", MAP, None, "0–1", "diffuse colour and alpha"),
    *(Key(f"color rgba.{c}", N, None, "", required=True) for c in "rgba"),
    Key("color components", MAP, None, "0–1", "material colours"),
    *(
        Key(f"color components.{part}", MAP, None, "", doc)
        for part, doc in (
            ("diffuse", "0.7 each"),
            ("specular", "1 each"),
            ("emission", "0 each"),
            ("ambient", ""),
        )
    ),
    *(
        Key(f"color components.{part}.{c}", N, default, "", required=True)
        for part, default in (("diffuse", 0.7), ("specular", 1.0), ("emission", 0.0))
        for c in "rgb"
    ),
    Key("color components.ambient.level", N, None, "", "ambient = level × diffuse"),
    Key("color components.shininess", U, 64, "", "Blinn–Phong exponent"),
    Key("color components.transparency", N, 1.0, "", "alpha; 1 is opaque", required=True),
    Key("use material", F, True, "", "false: the mesh file's own materials are used"),
    Key("color", T, None, "", "colour name of old files", status=Status.IGNORED),
    Key("visible", F, True, "", "hides the visual only"),
)


def _geometry(block: str, doc: str) -> tuple[Key, ...]:
    return (
        Key(block, MAP, None, "m", doc),
        *(Key(f"{block}.{k}", N, None, "m") for k in ("x", "y", "z", "radius", "height", "offset")),
        Key(f"{block}.axis", C, "Z", "", "axis of a round shape", choices=AXES, lenient=True),
        Key(f"{block}.normal", V, None, "", "normal of a plane"),
    )


def _compound(block: str, doc: str) -> tuple[Key, ...]:
    return (
        Key(block, MAPS, None, "", doc),
        Key(f"{block}[].shape", C, None, "", required=True, choices=SHAPES),
        *_geometry(f"{block}[].geometry", "dimensions"),
        Key(f"{block}[].offset", POSE, POSE_ZERO, "m, rad", "pose in the body frame"),
        Key(f"{block}[].name", T, "", "", status=Status.IGNORED),
    )


LOOKS = (
    Key("mesh", P, "", "", "visual mesh, and collision mesh unless another is named"),
    Key("mesh remove duplicates", F, False, "", "weld identical visual vertices"),
    Key("shape", C, None, "", "visual primitive", choices=SHAPES),
    *_geometry("geometry", "dimensions of `shape`"),
    *_compound("compound shape", "several visual primitives"),
    Key("high resolution path", P, "", "", "appended to the file's own"),
    Key("low resolution path", P, "", "", "appended to the file's own"),
    *COLOUR,
)
COLLISION = (
    Key("collision shape", C, None, "", "single collision primitive", choices=SHAPES),
    *_geometry("collision geometry", "dimensions of `collision shape`"),
    Key("collision offset", POSE, None, "m, rad", "pose of the primitive in B; default: inertial offset"),
    *_compound("compound collision shape", "several collision primitives"),
    Key("collision mesh", P, None, "", "collision mesh in the low-resolution folder"),
    Key(
        "collision mesh type",
        C,
        "CONCAVE_MESH",
        "",
        "how the mesh collides, §12.5",
        choices=MESH_TYPES,
        lenient=True,
    ),
    Key("collision margin", N, 0.001, "m", "collision margin"),
    Key("collision groups", Type.INTEGERS, (), "", "two bodies in groups collide only if they share one"),
    Key("scale", N, 1.0, "", "factor on meshes and joint pivots"),
)


def _shaders(block: str) -> tuple[Key, ...]:
    return (
        Key(block, MAP, None, "", "shader program"),
        *(Key(f"{block}.{k}", P, None, "", required=True) for k in ("path", "vertex", "fragment")),
    )


def _pid(block: str, doc: str, required: bool) -> tuple[Key, ...]:
    return (
        Key(block, MAP, None, "", doc),
        Key(f"{block}.P", N, 10.0, "", required=required),
        Key(f"{block}.I", N, 0.0, ""),
        Key(f"{block}.D", N, 1.0, "", required=required),
    )


BODY = (
    *IDENTITY,
    *PARENT,
    *LOOKS,
    *COLLISION,
    *_shaders("shaders"),
    Key("mass", N, 1.0, "kg", "0: static"),
    Key("inertia", MAP, None, "kg·m²", "principal moments; default: estimated"),
    *(Key(f"inertia.{k}", N, None, "kg·m²", required=True) for k in ("ix", "iy", "iz")),
    Key("inertial offset", POSE, None, "m, rad", "inertial frame I in B"),
    Key("gravity", V, None, "m/s²", "gravity of this body"),
    Key("location", POSE, POSE_ZERO, "m, rad", "initial pose of B in the world"),
    Key("friction", MAP),
    Key("friction.static", N, 0.5, "", "friction coefficient"),
    Key("friction.rolling", N, 0.01, "", "rolling friction"),
    Key("friction.linear", N, None, "", "old name", status=Status.IGNORED),
    Key("damping", MAP),
    Key("damping.linear", N, 0.04, "", "velocity × (1 − d)^dt"),
    Key("damping.angular", N, 0.1, "", "velocity × (1 − d)^dt"),
    Key("restitution", N, 0.1, "", "restitution"),
    Key("controller", MAP, None, "", "Cartesian controller, §13"),
    *_pid("controller.linear", "gains of the linear half", required=True),
    *_pid("controller.angular", "gains of the angular half", required=True),
    Key(
        "controller output type",
        C,
        None,
        "",
        "what the output is applied as",
        choices=OUTPUT_TYPES,
        lenient=True,
    ),
    Key("publish children names", F, False),
    Key("publish joint names", F, True),
    Key("publish joint positions", F, True),
    *(
        Key(k, ANY, None, "", "of old files", status=Status.IGNORED)
        for k in ("linear gain", "angular gain", "resistive surface", "resistive surface1", "enable feedback")
    ),
    Key("ligature rod", F, True, "", "false: never part of a rod", status=Status.OURS),
)


def _six(block: str, default: float, unit: str, doc: str) -> tuple[Key, ...]:
    return (
        Key(f"{block}.linear", MAP),
        Key(f"{block}.angular", MAP),
        *(Key(f"{block}.linear.{a}", N, default, unit, doc) for a in "xyz"),
        *(Key(f"{block}.angular.{a}", N, default, unit, doc) for a in "xyz"),
    )


JOINT = (
    *IDENTITY,
    Key("parent", T, "", "", "parent body, §4.5", required=True),
    Key("child", T, "", "", "child body, §4.5", required=True),
    Key("type", C, None, "", "joint type, §14", required=True, choices=JOINT_TYPES),
    Key("parent pivot", V, None, "m", "joint origin in the parent's body frame", required=True),
    Key("child pivot", V, None, "m", "joint origin in the child's body frame", required=True),
    Key("parent axis", V, None, "", "joint axis in the parent's body frame", required=True),
    Key("child axis", V, None, "", "joint axis in the child's body frame", required=True),
    Key("offset", N, None, "rad", "rotation of the child about the axis at joint position 0"),
    Key("child offset", N, 0.0, "rad", "old name of `offset`"),
    Key("joint offset", N, 0.0, "rad", "rotation of the constraint frame about the axis"),
    Key("joint limits", MAP, None, "rad, m", "both of low and high, or unlimited"),
    Key("joint limits.low", N),
    Key("joint limits.high", N),
    *(Key(f"joint limits.{a}", N, 0.7, "rad", "cone twist half angle") for a in "xyz"),
    *(Key(f"joint limits.{half}", MAP) for half in ("linear", "angular")),
    *(Key(f"joint limits.{half}.{end}", MAP) for half in ("linear", "angular") for end in ("low", "high")),
    *(
        Key(f"joint limits.{half}.{end}.{a}", N, sign * 1.2, "m, rad", "six-DOF limit")
        for half in ("linear", "angular")
        for end, sign in (("low", -1), ("high", 1))
        for a in "xyz"
    ),
    *_pid("controller", "joint PID, §15.6", required=False),
    Key(
        "controller output type",
        C,
        None,
        "",
        "what the output is applied as",
        choices=OUTPUT_TYPES,
        lenient=True,
    ),
    Key("max motor impulse", N, 0.1, "N·m·s or N·s per ms", "motor strength"),
    Key("joint erp", N, 0.1),
    Key("joint cfm", N, 0.1),
    Key("damping", ANY, None, "N·s/m, N·m·s/rad", "number, or a six-DOF block"),
    *_six("damping", 0.7, "N·s/m, N·m·s/rad", "damper of an axis"),
    Key("stiffness", ANY, None, "N/m, N·m/rad", "number, or a six-DOF block"),
    *_six("stiffness", 1.0, "N/m, N·m/rad", "spring of an axis"),
    Key("equilibrium point", ANY, None, "m, rad", "number, or a six-DOF block"),
    *_six("equilibrium point", 0.0, "m, rad", "rest position of an axis"),
    Key("enable feedback", F, False, "", "compute effort and wrench"),
    Key("enable motor", ANY, None, "", "0 or false: no position commands"),
    Key("ignore inter-collision", F, True, "", "the two bodies do not collide"),
    *(
        Key(k, ANY, None, "", "of old files and importers", status=Status.IGNORED)
        for k in ("detached", "redundant", "controller gains", "origin", "axis")
    ),
    Key("ligature rod", F, True, "", "false: never part of a rod", status=Status.OURS),
)
GHOST = (
    *IDENTITY,
    *PARENT,
    *LOOKS,
    *COLLISION,
    Key("location", POSE, POSE_ZERO, "m, rad", "pose in the parent's frame"),
    Key("inertial offset", POSE, None, "m, rad", "fallback of `collision offset`"),
)
SENSOR = (
    *IDENTITY,
    *PARENT,
    Key("type", C, None, "", "sensor type", required=True, choices=SENSOR_TYPES),
    Key("location", POSE, POSE_ZERO, "m, rad", "sensor frame in the parent's body frame"),
    Key("range", N, 0.5, "m", "length of a ray"),
    Key("array", MAPS, None, "", "one ray an item"),
    Key("array[].offset", V, None, "m", required=True),
    Key("array[].direction", V, None, "", "not normalised: its length scales the range", required=True),
    Key("mesh", P, None, "", "one ray a triangle"),
    Key("parametric", MAP),
    Key("parametric.resolution", U, None, "", required=True),
    Key("parametric.horizontal angle", N, None, "rad", required=True),
    Key("parametric.vertical angle", N, None, "rad", required=True),
    Key("parametric.start offset", N, None, "m", required=True),
    Key("visible", F, False),
    Key("visible size", N, 0.02, "m"),
    Key("friction", MAP, None, "", "of a resistance sensor, §17.3"),
    Key("friction.static", N, 0.0),
    Key("friction.damping", N, 0.1),
    Key("friction.dynamic", N, 0.0),
    Key("friction.variable", F, False),
    Key("contact area", N, 0.1, "m"),
    Key("contact stiffness", N, 0.0, "N"),
    Key("contact damping", N, 0.0, "", status=Status.IGNORED),
    Key("distance threshold", N, 0.0, "m", "of a contact sensor, §17.4"),
    Key("process contact details", F, True),
    *(
        Key(k, ANY, None, "", "of old files", status=Status.IGNORED)
        for k in ("direction", "count", "resolution", "variable")
    ),
)
ACTUATOR = (
    *IDENTITY,
    *PARENT,
    Key("type", C, None, "", "actuator type", required=True, choices=ACTUATOR_TYPES),
    Key("location", POSE, POSE_ZERO, "m, rad", "actuator frame on the parent"),
    Key("visible", F, False),
    Key("visible size", N, 0.02, "m"),
    Key("max impulse", N, 10.0, "", status=Status.IGNORED),
    Key("tau", N, 1.0, "", status=Status.IGNORED),
)
CAMERA = (
    *IDENTITY,
    *PARENT,
    Key("location", V, ZERO, "m", "position in the parent's frame"),
    Key("look at", V, ZERO, "m", "target point"),
    Key("up", V, (0.0, 0.0, 1.0), "", "up direction"),
    Key("clipping plane", MAP),
    Key("clipping plane.near", N, 0.1, "m", required=True),
    Key("clipping plane.far", N, 10.0, "m", required=True),
    Key("field view angle", N, 0.7, "rad", "vertical field of view"),
    Key("orthographic view width", N, None, "m", "orthographic when present"),
    Key("stereo", MAP),
    Key("stereo.mode", T, None, "", required=True),
    Key("stereo.eye separation", N, 0.2, "m", required=True),
    Key("stereo.focal length", N, 0.5, "m", required=True),
    Key("monitor", U, 0),
    Key("visible", F, True),
    Key("multipass", F, False),
    Key("controlling devices", Type.TEXTS, ()),
    Key("publish image", F, False),
    Key("publish image interval", U, 1, "frames"),
    Key("publish image resolution", MAP),
    Key("publish image resolution.width", U, 640, "px", required=True),
    Key("publish image resolution.height", U, 480, "px", required=True),
    Key("publish depth", F, False),
    Key("publish depth interval", U, 10, "frames"),
    Key("publish depth resolution", ANY, None, "", "the image resolution is used", status=Status.IGNORED),
    Key("publish depth noise", MAP),
    Key("publish depth noise.mean", N, 0.1, "m", required=True),
    Key("publish depth noise.std_dev", N, None, "m"),
    Key("publish depth noise.std dev", N, None, "m"),
    Key("publish depth noise.bias", N, 0.0, "m"),
    *_shaders("preprocessing shaders"),
    *_shaders("depth compute shaders"),
    Key("mouse control multipliers", MAP),
    *(Key(f"mouse control multipliers.{k}", N, 1.0) for k in ("pan", "rotate", "scroll", "arcball")),
    Key("window resolution", MAP),
    Key("window resolution.width", U, None, "px", required=True),
    Key("window resolution.height", U, None, "px", required=True),
    Key("camera intrinsics", MAP),
    *(Key(f"camera intrinsics.{k}", N, None, "px") for k in ("fx", "fy", "f", "cx", "cy", "s")),
    Key("projection matrix", Type.MATRIX, None, "", "rows of the OpenGL projection"),
)
LIGHT = (
    *IDENTITY,
    *PARENT,
    Key("location", V, ZERO, "m", "position in the parent's frame"),
    Key("location.orientation", RPY, ZERO, "rad"),
    Key("direction", V, None, "", "direction of the light"),
    Key("spot exponent", N, 0.7),
    Key("cutoff angle", N, 0.7, "rad", "half angle"),
    Key("shadow quality", U, 0, "", "0 none … 5 very high"),
    Key("attenuation", MAP),
    Key("attenuation.constant", N, 1.0),
    Key("attenuation.linear", N, 0.0, "1/m"),
    Key("attenuation.quadratic", N, 0.0, "1/m²"),
)
_SOFT_NUMBERS = [
    "kLST",
    "kAST",
    "kVST",
    "kVCF",
    "kDP",
    "kDG",
    "kLF",
    "kPR",
    "kVC",
    "kDF",
    "kMT",
    "kCHR",
    "kKHR",
    "kSHR",
    "kAHR",
    "kSRHR_CL",
    "kSKHR_CL",
    "kSSHR_CL",
    "kSR_SPLT_CL",
    "kSK_SPLT_CL",
    "kSS_SPLT_CL",
    "maxvolume",
    "timescale",
]
_SOFT_INTEGERS = (
    "viterations",
    "piterations",
    "diterations",
    "citerations",
    "flags",
    "bending constraint",
    "clusters",
)
SOFT_BODY = (
    *IDENTITY,
    *PARENT,
    *LOOKS,
    *COLLISION,
    Key("location", POSE, POSE_ZERO, "m, rad", "initial pose"),
    Key("mass", N, 1.0, "kg", "total mass"),
    Key("inertial offset", POSE, None, "m, rad", status=Status.IGNORED),
    Key("randomize constraints", ANY),
    Key("config", MAP, None, "", "Bullet soft-body parameters, §20"),
    *(Key(f"config.{k}", N) for k in _SOFT_NUMBERS),
    *(Key(f"config.{k}", I) for k in _SOFT_INTEGERS),
    Key("config.fixed nodes", Type.INTEGERS, ()),
    *(Key(f"config.{k}", ANY, None, "", status=Status.IGNORED) for k in ("cutting", "margin")),
    *(
        Key(k, ANY, None, "", "no effect on a soft body", status=Status.IGNORED)
        for k in (
            "inertia",
            "controller",
            "controller output type",
            "gravity",
            "friction",
            "damping",
            "restitution",
        )
    ),
)
VEHICLE = (
    *IDENTITY,
    *PARENT,
    Key("chassis", T, "", "", "chassis body", required=True),
    Key("wheels", MAPS),
    Key("wheels[].body", T, ""),
    Key("wheels[].mesh", P, ""),
    *(Key(f"wheels[].{k}", N) for k in ("radius", "width", "friction", "roll influence")),
    Key("wheels[].suspension", MAP),
    *(
        Key(f"wheels[].suspension.{k}", N, None, required=True)
        for k in ("stiffness", "damping", "compression", "rest length")
    ),
    *(Key(f"wheels[].{k}", V, ZERO) for k in ("down direction", "axel direction", "offset")),
    Key("wheels[].front", F, False),
    Key("wheels[].steering limits", MAP),
    *(Key(f"wheels[].steering limits.{k}", N, 0.0, "rad", required=True) for k in ("low", "high")),
    *(Key(f"wheels[].max {k} power", N, 0.0, "N") for k in ("engine", "brake")),
    Key("high resolution path", P, "", status=Status.IGNORED),
)
VOLUME = (
    *IDENTITY,
    *PARENT,
    *COLOUR,
    *_shaders("shaders"),
    Key("location", POSE, POSE_ZERO, "m, rad"),
    Key("scale", N, 1.0),
    Key("images", MAP),
    *(Key(f"images.{k}", T, None, required=True) for k in ("path", "prefix", "format")),
    Key("images.count", U, None, required=True),
    Key("dimensions", V, (1.0, 1.0, 1.0), "m"),
    Key("iso-surface value", N, 0.5),
    Key("optical density", N, 1.0),
    Key("quality", N, 0.5),
)
SUTURE = (
    *IDENTITY,
    Key("length", N, None, "m", "length of the thread", required=True),
    Key("diameter", N, None, "m", "diameter; or give `USP size`"),
    Key("USP size", T, "", "", "such as 2-0"),
    Key("density", N, 1200.0, "kg/m³", "density"),
    Key("youngs modulus", N, 2.0e9, "Pa", "Young's modulus"),
    Key("poisson ratio", N, 0.4, "", "ratio that gives the shear modulus"),
    Key("damping time", N, 0.002, "s", "bending damping over bending stiffness"),
    Key("elements", U, 40, "", "number of elements"),
    Key("friction", N, 0.3, "", "friction coefficient"),
    Key("location", POSE, POSE_ZERO, "m, rad", "pose of the start; the thread leaves along +z"),
    Key("parent", T, "", "", "body that the start is fixed to; `location` is then in its frame"),
    Key("color rgba", MAP),
    *(Key(f"color rgba.{c}", N, None, "", required=True) for c in "rgba"),
)
INPUT_DEVICE = (
    Key("hardware name", T, None, "", "name that the driver reports", required=True),
    Key("simulated multibody", P, "", "", "proxy model"),
    Key("root link", T, "", "", "body to drive"),
    Key("location", POSE, None, "m, rad"),
    Key("controller gain", MAP),
    *_pid("controller gain.linear", "", required=True),
    *_pid("controller gain.angular", "", required=True),
    Key("enable joint control", F, True),
    Key("haptic gain", MAP),
    Key("haptic gain.linear", N, 10.0, "N/m", required=True),
    Key("haptic gain.angular", N, 10.0, "N·m/rad", required=True),
    Key("workspace scaling", N, 1.0),
    Key("deadband", N, 0.0, "N"),
    Key("max force", N, None, "N", status=Status.IGNORED),
    Key("max jerk", N, None, "", status=Status.IGNORED),
    Key("orientation offset", RPY, ZERO, "rad"),
    Key("button mapping", MAP),
    *(Key(f"button mapping.{k}", I, -1) for k in ("a1", "a2", "g1", "next mode", "prev mode")),
    Key("pair cameras", Type.TEXTS, ()),
    Key("visible", F, False),
    Key("visible size", N, 1.0, "m"),
    Key("cameras", ANY, None, "", "old name of `pair cameras`", status=Status.IGNORED),
    Key("visible color", ANY, None, "", status=Status.IGNORED),
)
LISTS = {
    "bodies": "body",
    "soft bodies": "soft body",
    "ghost objects": "ghost object",
    "sensors": "sensor",
    "actuators": "actuator",
    "joints": "joint",
    "vehicles": "vehicle",
    "cameras": "camera",
    "lights": "light",
    "volumes": "volume",
    "sutures": "suture",
    "input devices": "input device",
}
"""Key of each list of objects, and the kind of object that it lists."""

VERSION = Key("adf version", T, "1.0", "", "must read exactly 1.0")
MODEL = (
    *(Key(k, Type.TEXTS, ()) for k in LISTS if k not in ("input devices", "sutures")),
    Key("sutures", Type.TEXTS, (), "", "threads by physical data", status=Status.OURS),
    Key("high resolution path", P, "", "", "folder of visual meshes"),
    Key("low resolution path", P, "", "", "folder of collision meshes"),
    Key("namespace", T, "", "", "prefix of every object of the file"),
    Key("ignore inter-collision", F, False, "", "bodies of this file do not collide with each other"),
    Key("gravity", V, None, "m/s²", "gravity of the bodies of this file"),
    *_shaders("shaders"),
    Key("plugins", ANY, None, "", status=Status.IGNORED),
    VERSION,
    *(Key(k, ANY, None, "", status=Status.IGNORED) for k in ("joint erp", "joint cfm", "ADF Version")),
    Key("ligature rod", F, True, "", "false: chains of this file stay bodies", status=Status.OURS),
)
WORLD = (
    Key("environment", P, "", "", "model file used as environment"),
    Key("enclosure", ANY, None, "m", "walls; without effect", status=Status.IGNORED),
    Key("namespace", T, "", "", "namespace of the world's topics, lights and cameras"),
    Key("gravity", V, (0.0, 0.0, -9.8), "m/s²", "gravity"),
    Key("max iterations", U, 10, "", "most 1 ms sub-steps of an update"),
    Key("lights", Type.TEXTS, ()),
    Key("cameras", Type.TEXTS, ()),
    Key("skybox", MAP),
    Key("skybox.path", P, None, required=True),
    *(Key(f"skybox.{k}", P, "") for k in ("right", "left", "top", "bottom", "front", "back")),
    *_shaders("skybox.shaders"),
    *_shaders("shaders"),
    Key("plugins", ANY, None, "", status=Status.IGNORED),
    Key("name", T, "World", status=Status.IGNORED),
    VERSION,
    *(
        Key(k, ANY, None, "", status=Status.IGNORED)
        for k in ("enclosure size", "conversion factor", "cam common configs")
    ),
)
LAUNCH = (
    Key("world config", P, None, "", "world file", required=True),
    Key("input devices config", P, None, "", "input-devices file", required=True),
    Key("color config", P, None, "", "colours file; never opened", required=True),
    Key("multibody configs", Type.TEXTS, (), "", "model files, addressed by index", required=True),
    Key("plugins", ANY, None, "", status=Status.IGNORED),
    VERSION,
    Key("ligature arms", ANY, None, "", "which bodies are an arm", status=Status.OURS),
)
DEVICES = (Key("input devices", Type.TEXTS, ()), VERSION)

SCHEMA: dict[str, tuple[Key, ...]] = {
    "launch": LAUNCH,
    "world": WORLD,
    "model": MODEL,
    "input devices": DEVICES,
    "body": BODY,
    "joint": JOINT,
    "ghost object": GHOST,
    "sensor": SENSOR,
    "actuator": ACTUATOR,
    "camera": CAMERA,
    "light": LIGHT,
    "soft body": SOFT_BODY,
    "vehicle": VEHICLE,
    "volume": VOLUME,
    "suture": SUTURE,
    "input device": INPUT_DEVICE,
}
NOT_SIMULATED = {"soft body", "vehicle", "volume"}
"""Kinds that are read and validated, and reported as not simulated."""

BY_PATH: dict[str, dict[str, Key]] = {kind: {key.path: key for key in keys} for kind, keys in SCHEMA.items()}
