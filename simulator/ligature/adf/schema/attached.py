"""Rows of the schema for what rides on bodies: sensors, actuators, cameras, lights, volumes."""

from __future__ import annotations

import math

from ligature.adf.schema.blocks import COLOUR, IDENTITY, PARENT, F, N, P, T, U, V, shaders
from ligature.adf.schema.keys import POSE_ZERO, ZERO, Fault, Key, Status, Type, each, ignored, spellings, unused

C, MAP, POSE = Type.CHOICE, Type.MAP, Type.POSE

SENSOR_TYPES = spellings("proximity", "resistance", "contact")
ACTUATOR_TYPES = spellings("constraint")
RENDERINGS = spellings("mesh", "rays", "transfer function")

WIDEST = 16384
"""Most pixels along an edge of a picture: the largest texture that OpenGL drivers commonly offer."""

MOST_RAYS = 65536
"""Most rays of a sensor; each is cast in every tick."""

CLIPPING = (0.1, 1000.0)
"""Nearest and farthest distance in metres of a camera whose own are not 0 < near < far: those that CHAI3D keeps then
(``cCamera::setClippingPlanes``)."""

SENSOR = (
    *IDENTITY,
    *PARENT,
    Key("type", C, doc="sensor type", required=True, choices=SENSOR_TYPES, fault=Fault.OBJECT),
    Key("location", POSE, POSE_ZERO, "m, rad", "sensor frame S in the parent's body frame"),
    Key("range", N, 0.5, "m", "length of a ray"),
    Key("array", Type.MAPS, doc="one ray for each item"),
    Key("array[].offset", V, unit="m", doc="start of the ray in S", required=True),
    Key("array[].direction", V, doc="not normalised: its length scales the range", required=True),
    Key("mesh", P, doc="without `array`: one ray for each triangle"),
    Key("parametric", MAP, doc="without `array` and `mesh`: a fan of resolution² rays"),
    Key("parametric.resolution", U, doc="rays along each side, at least 2", required=True, most=MOST_RAYS**0.5),
    Key("parametric.horizontal angle", N, unit="rad", doc="full angle about z", required=True),
    Key("parametric.vertical angle", N, unit="rad", doc="full angle about y", required=True),
    Key("parametric.start offset", N, unit="m", doc="distance of the starts from S", required=True),
    Key("visible", F, False, doc="draw the sensor in the window"),
    Key("visible size", N, 0.02, "m", "radius of the markers; pixels for a contact sensor"),
    Key("friction", MAP, doc="of a resistance sensor"),
    Key("friction.static", N, 0.0, doc="stick stiffness"),
    Key("friction.damping", N, 0.1, doc="stick damping"),
    Key("friction.dynamic", N, 0.0, doc="sliding gain"),
    Key("friction.variable", F, False, doc="the first two are multiplied by the normal force"),
    Key("contact area", N, 0.1, "m", "radius within which the stick point stays"),
    Key("contact stiffness", N, 0.0, "N", "normal force at full measurement"),
    *ignored(("contact damping",), "no effect"),
    Key("distance threshold", N, 0.0, "m", "contact points up to this distance count"),
    Key("process contact details", F, True, doc="draw the contact points"),
    *ignored(("direction", "count", "resolution"), "single ray of old files"),
    *ignored(("variable",), "belongs into `friction`"),
)
ACTUATOR = (
    *IDENTITY,
    *PARENT,
    Key("type", C, doc="actuator type", required=True, choices=ACTUATOR_TYPES, fault=Fault.OBJECT),
    Key("location", POSE, POSE_ZERO, "m, rad", "actuator frame on the parent"),
    Key("visible", F, False, doc="draw the actuator in the window"),
    Key("visible size", N, 0.02, "m", "radius of the marker"),
    Key("ligature slip", MAP, doc="hold by friction between pads normal to z, not rigidly", status=Status.OURS),
    Key("ligature slip.normal force", N, unit="N", doc="of the pads", required=True, status=Status.OURS, least=0.0),
    Key("ligature slip.friction", N, 0.5, doc="of a pad; times the body's", status=Status.OURS, least=0.0),
    Key("ligature slip.half width", N, 0.00125, "m", "of the pads", status=Status.OURS, least=1e-6),
    Key("ligature slip.reach", N, 0.01, "m", "way that a body slips until it is lost", status=Status.OURS, least=0.0),
    *ignored(("max impulse", "tau"), "of AMBF 1.0; the constraint is rigid"),
)


def _resolution(block: str, default: tuple[int, int] | None, doc: str) -> tuple[Key, ...]:
    width, height = default or (None, None)
    return (
        Key(block, MAP, doc=doc),
        Key(f"{block}.width", U, width, "px", "width", required=True, least=1, most=WIDEST),
        Key(f"{block}.height", U, height, "px", "height", required=True, least=1, most=WIDEST),
    )


CAMERA = (
    *IDENTITY,
    *PARENT,
    Key("location", V, ZERO, "m", "position in the parent's frame"),
    Key("look at", V, ZERO, "m", "target point in the parent's frame"),
    Key("up", V, (0.0, 0.0, 1.0), doc="up direction"),
    Key("clipping plane", MAP, doc="nearest and farthest distance seen"),
    Key("clipping plane.near", N, 0.1, "m", "nearest distance seen", required=True),
    Key("clipping plane.far", N, 10.0, "m", "farthest distance seen", required=True, most=math.inf),
    Key("field view angle", N, 0.7, "rad", "vertical field of view", fault=Fault.VALUE, least=1e-3, most=3.14),
    Key("orthographic view width", N, unit="m", doc="orthographic when present", fault=Fault.VALUE, least=1e-6),
    Key("stereo", MAP, doc="two eyes side by side"),
    *unused((Key("stereo.mode", T, doc="any text", required=True),)),
    Key("stereo.eye separation", N, 0.2, "m", "distance of the eyes", required=True),
    Key("stereo.focal length", N, 0.5, "m", "distance of the common plane", required=True, least=1e-6),
    Key("monitor", U, 0, doc="monitor of the camera's own window; the first if there are fewer"),
    Key("visible", F, True, doc="false: no window; images are published all the same"),
    *unused((Key("multipass", F, False, doc="draw transparent things in several passes; they are sorted here"),)),
    Key("controlling devices", Type.TEXTS, (), doc="in the title of the camera's own window"),
    Key("publish image", F, False, doc="publish colour images"),
    Key("publish image interval", U, 1, "frames", "publish every n-th image"),
    *_resolution("publish image resolution", (640, 480), "size of the published images"),
    Key("publish depth", F, False, doc="publish a cloud of points"),
    Key("publish depth interval", U, 10, "frames", "publish every n-th cloud"),
    *ignored(("publish depth resolution",), "the image resolution is used"),
    Key("publish depth noise", MAP, doc="Gaussian noise of the cloud along the optical axis"),
    Key("publish depth noise.mean", N, 0.1, "m", "mean", required=True),
    Key("publish depth noise.std_dev", N, unit="m", doc="standard deviation; 0.001 when absent"),
    Key("publish depth noise.std dev", N, unit="m", doc="the same"),
    Key("publish depth noise.bias", N, 0.0, "m", "bias"),
    *shaders("preprocessing shaders", "shader program of the published image"),
    *shaders("depth compute shaders", "shader program that makes points of depths"),
    Key("mouse control multipliers", MAP, doc="factors on the mouse's gains"),
    *each(("pan", "rotate", "scroll", "arcball"), N, "mouse control multipliers.{}", 1.0, doc="factor of {}"),
    *_resolution("window resolution", None, "size of the camera's own window, and of images unless they have theirs"),
    Key("camera intrinsics", MAP, doc="pinhole parameters; take precedence over the field of view"),
    *each(("fx", "fy", "f"), N, "camera intrinsics.{}", unit="px", doc="focal length {}; 100 when absent", least=1e-3),
    *each(("cx", "cy", "s"), N, "camera intrinsics.{}", unit="px", doc="{}; 0 when absent"),
    Key("projection matrix", Type.MATRIX, doc="rows of the OpenGL projection", fault=Fault.VALUE),
)
LIGHT = (
    *IDENTITY,
    *PARENT,
    Key("location", V, ZERO, "m", "position in the parent's frame"),
    Key("location.orientation", Type.RPY, ZERO, "rad", "orientation; the light shines along its +x"),
    Key("direction", V, doc="direction of the light; takes precedence over the orientation"),
    Key("spot exponent", N, 0.7, doc="OpenGL's spot exponent"),
    Key("cutoff angle", N, 0.7, "rad", "half angle, at most 90°"),
    Key("shadow quality", U, 0, doc="0 none … 5 very high"),
    Key("attenuation", MAP, doc="weakening with distance d: 1 / (constant + linear·d + quadratic·d²)"),
    Key("attenuation.constant", N, 1.0, doc="constant part"),
    Key("attenuation.linear", N, 0.0, "1/m", "linear part"),
    Key("attenuation.quadratic", N, 0.0, "1/m²", "quadratic part"),
)
VOLUME = (
    *unused(IDENTITY, "passive", "publish frequency", "publish frequency.low", "publish frequency.high"),
    *PARENT,
    *COLOUR,
    *unused(shaders("shaders", "shader program of the volume")),
    Key("location", POSE, POSE_ZERO, "m, rad", "pose in the parent's frame"),
    Key("scale", N, 1.0, doc="factor on the dimensions"),
    Key("images", MAP, doc="stack of slices", required=True, fault=Fault.OBJECT),
    Key("images.path", P, doc="folder of the slices", required=True, fault=Fault.OBJECT),
    Key("images.prefix", T, doc="file name before the number", required=True, fault=Fault.OBJECT),
    Key("images.format", T, doc="file name after the dot", required=True, fault=Fault.OBJECT),
    Key("images.count", Type.UNSIGNED, doc="last number", required=True, fault=Fault.OBJECT),
    Key("dimensions", V, (1.0, 1.0, 1.0), "m", "full size of the box, centred"),
    Key("iso-surface value", N, 0.5, doc="level of the surface, above 0 to 1"),
    Key("optical density", N, 1.0, "1/mm", "extinction where opacity is 1; with a transfer function", least=0.0),
    Key("quality", N, 0.5, doc="samples a voxel of rays, divided by 4"),
    Key(
        "ligature rendering",
        C,
        "RAYS",
        doc="surface by rays or as a mesh, or all values by a transfer function",
        choices=RENDERINGS,
        status=Status.OURS,
    ),
    Key("ligature transfer function", Type.MAPS, doc="opacity and colour by value, low to high", status=Status.OURS),
    Key(
        "ligature transfer function[].value", N, doc="of voxels", required=True, status=Status.OURS, least=0.0, most=1.0
    ),
    Key(
        "ligature transfer function[].opacity", N, doc="0 to 1", required=True, status=Status.OURS, least=0.0, most=1.0
    ),
    *each(
        "rgb",
        N,
        "ligature transfer function[].{}",
        1.0,
        doc="factor on the material's {}",
        status=Status.OURS,
        least=0.0,
        most=1.0,
    ),
)
