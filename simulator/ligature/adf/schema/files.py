"""Rows of the schema for the four kinds of file and for input devices."""

from __future__ import annotations

from ligature.adf.schema.blocks import PLUGINS, F, N, P, T, U, V, gains, shaders
from ligature.adf.schema.bodies import ROD
from ligature.adf.schema.keys import STRONGEST, ZERO, Fault, Key, Status, Type, each, ignored, unused

MAP = Type.MAP

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

PLURALS = {kind: name for name, kind in LISTS.items()}
"""The other way round: how several objects of a kind are called."""

_OWN_LISTS = ("sutures", "input devices")
VERSION = Key("adf version", T, "1.0", doc="must read exactly 1.0")
MODEL = (
    *(Key(k, Type.TEXTS, (), doc=f"{k} that exist, in order") for k in LISTS if k not in _OWN_LISTS),
    Key("sutures", Type.TEXTS, (), doc="threads by physical data", status=Status.OURS),
    Key("high resolution path", P, "", doc="folder of visual meshes"),
    Key("low resolution path", P, "", doc="folder of collision meshes"),
    Key("namespace", T, "", doc="prefix of every object of the file"),
    Key("ignore inter-collision", F, False, doc="bodies of this file do not collide with each other"),
    Key("gravity", V, unit="m/s²", doc="gravity of the bodies of this file", most=STRONGEST),
    *shaders("shaders"),
    PLUGINS,
    VERSION,
    *ignored(("joint erp", "joint cfm"), "of AMBF 1.0"),
    *ignored(("ADF Version",), "not the version's key, which is `adf version`"),
    ROD,
)
WORLD = (
    Key("environment", P, "", doc="model file used as environment"),
    *ignored(("enclosure",), "walls where no environment is"),
    Key("namespace", T, "", doc="namespace of the world's topics, lights and cameras"),
    Key("gravity", V, (0.0, 0.0, -9.8), "m/s²", "gravity", most=STRONGEST),
    *unused((Key("max iterations", U, 10, doc="most sub-steps of an update; an update is a whole number of ticks"),)),
    Key("lights", Type.TEXTS, (), doc="lights that exist, in order"),
    Key("cameras", Type.TEXTS, (), doc="cameras that exist, in order"),
    Key("skybox", MAP, doc="images around the scene; all six or none"),
    Key("skybox.path", P, doc="folder of the images", required=True),
    *each(("right", "left", "top", "bottom", "front", "back"), P, "skybox.{}", "", doc="image of the {} side"),
    *unused(shaders("skybox.shaders", "shader program of the sky")),
    *shaders("shaders", "shader program of the models' visual objects"),
    PLUGINS,
    *ignored(("name",), "the world is always called World"),
    VERSION,
    *ignored(("enclosure size", "conversion factor", "cam common configs"), "of old files"),
)
_DEVICE_NAMES = ("Default", "MTMR", "MTML", "Geomagic Touch", "PHANTOM Omni", "Novint Falcon", "Razer Hydra")
LAUNCH = (
    Key("world config", P, doc="world file", required=True),
    Key("input devices config", P, doc="input-devices file", required=True),
    Key("color config", P, doc="colours file; never opened", required=True),
    Key("multibody configs", Type.TEXTS, (), doc="model files, addressed by index from 0", required=True),
    PLUGINS,
    VERSION,
    *ignored(("gripper configs", *_DEVICE_NAMES), "of old files"),
    Key("ligature arms", Type.ANY, doc="bodies that form an arm", status=Status.OURS),
)
DEVICES = (Key("input devices", Type.TEXTS, (), doc="devices that exist, in order"), VERSION)
INPUT_DEVICE = (
    Key("hardware name", T, doc="name that the driver reports", required=True, fault=Fault.OBJECT),
    Key("simulated multibody", P, "", doc="model file of a proxy"),
    Key("root link", T, "", doc="body to drive"),
    Key("location", Type.POSE, unit="m, rad", doc="initial pose of the root link"),
    Key("controller gain", MAP, doc="Cartesian controller of the root link"),
    *gains("controller gain.linear", "gains of the linear half", required=True),
    *gains("controller gain.angular", "gains of the angular half", required=True),
    Key("enable joint control", F, True, doc="the gripper angle drives the joints below"),
    Key("haptic gain", MAP, doc="force feedback"),
    Key("haptic gain.linear", N, 10.0, "N/m", "force for a displacement", required=True),
    Key("haptic gain.angular", N, 10.0, "N·m/rad", "torque for a rotation", required=True),
    Key("workspace scaling", N, 1.0, doc="world metres for one metre of the device"),
    Key("deadband", N, 0.0, "N", "smaller forces are zeroed"),
    Key("max force", N, unit="N", doc="the hardware's own limit counts", status=Status.IGNORED),
    Key("max jerk", N, doc="no effect", status=Status.IGNORED),
    Key("orientation offset", Type.RPY, ZERO, "rad", "rotation between device and proxy"),
    Key("button mapping", MAP, doc="indices of the buttons"),
    *each(("a1", "a2", "g1", "next mode", "prev mode"), Type.INTEGER, "button mapping.{}", -1, doc="{}; -1 is none"),
    Key("pair cameras", Type.TEXTS, (), doc="cameras; the first defines the frame of motion"),
    Key("visible", F, False, doc="show a marker"),
    Key("visible size", N, 1.0, "m", "radius of the marker"),
    *ignored(("cameras",), "old name of `pair cameras`"),
    *ignored(("visible color",), "no effect"),
)
