"""Rows of the schema for bodies, joints, ghosts, soft bodies, vehicles and sutures."""

from __future__ import annotations

from dataclasses import replace

from ligature.adf.schema.blocks import (
    COLLISION,
    COLOUR,
    IDENTITY,
    LOOKS,
    OUTPUT_TYPE,
    PARENT,
    F,
    N,
    P,
    T,
    U,
    V,
    gains,
    shaders,
)
from ligature.adf.schema.keys import (
    HEAVIEST,
    LONGEST_ARM,
    POSE_ZERO,
    STRONGEST,
    ZERO,
    Fault,
    Key,
    Status,
    Type,
    each,
    ignored,
    unused,
)

C, I, MAP, POSE = Type.CHOICE, Type.INTEGER, Type.MAP, Type.POSE

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
ROD = Key("ligature rod", F, True, doc="false: never part of a rod", status=Status.OURS)

TISSUE = (
    Key("ligature tissue.stiffness", N, unit="N/m", doc="sideways", status=Status.OURS, least=0.0),
    Key("ligature tissue.strength", N, unit="N", doc="sideways force that tears it", status=Status.OURS, least=0.0),
    Key("ligature tissue.friction", N, unit="N", doc="along the needle or thread", status=Status.OURS, least=0.0),
    Key("ligature tissue.drag", N, unit="N s/m", doc="along the needle or thread", status=Status.OURS, least=0.0),
)

_TISSUES = {name: name for name in ("silicone pad", "skin", "fat", "stomach", "liver")}


def _material(block: str) -> tuple[Key, ...]:
    """Keys of a tissue material; numbers that the file gives override those of the named material."""

    def number(name: str, unit: str, doc: str, least: float = 0.0, most: float | None = None) -> Key:
        path = f"{block}.{name}"
        return Key(path, N, unit=unit, doc=doc, least=least, most=most, status=Status.OURS, fault=Fault.OBJECT)

    doc = "named material, which gives the defaults of the other keys"
    return (
        Key(f"{block}.material", C, doc=doc, choices=_TISSUES, status=Status.OURS, fault=Fault.OBJECT),
        number("youngs modulus", "Pa", "Young's modulus", 1.0, 1e9),
        number("poisson ratio", "", "Poisson's ratio, at most 0.499", 0.0, 0.499),
        number("density", "kg/m³", "density", 1.0),
        number("damping time", "s", "viscous over elastic stress"),
        number("puncture force", "N", "force at which a needle's tip enters"),
        number("exit force", "N", "force at which it leaves, in addition to cutting"),
        number("cutting force", "N", "at the tip while it cuts"),
        number("friction", "N/m", "along needle or thread, for each metre inside"),
        number("strength", "N/m", "load across, for each metre, that tears"),
        number("least angle", "rad", "to the surface; flatter tips slide", 0.0, 1.57),
    )


SOFT_TISSUE = (
    Key("ligature tissue", MAP, doc="the body is soft tissue, docs/tissue.md", status=Status.OURS),
    *_material("ligature tissue"),
    Key("ligature tissue.cell size", N, unit="m", least=1e-5, status=Status.OURS, fault=Fault.OBJECT,
        doc="edge length of cells; default for 600 cells, 150 without fixed faces"),
    Key("ligature tissue.fixed", Type.TEXTS, ("-z",), doc="faces fixed to its rigid body, of -x +x -y +y -z +z",
        status=Status.OURS),
    Key("ligature tissue.carried by", T, "", doc="body that it is fixed to", status=Status.OURS),
    Key("ligature tissue.surface friction", N, None, doc="coefficient of its surface; `friction.static` when absent",
        least=0.0, status=Status.OURS, fault=Fault.OBJECT),
    Key("ligature tissue.slits", Type.MAPS, doc="slits, and wounds without tissue", status=Status.OURS),
    Key("ligature tissue.slits[].from", V, unit="m", doc="corner of a box in B; flat along one axis it is a slit",
        required=True, status=Status.OURS, fault=Fault.OBJECT),
    Key("ligature tissue.slits[].to", V, unit="m", doc="opposite corner", required=True,
        status=Status.OURS, fault=Fault.OBJECT),
    Key("ligature tissue.layers", Type.MAPS, doc="layers from the top (+z of B) down", status=Status.OURS),
    Key("ligature tissue.layers[].thickness", N, unit="m", doc="thickness; the lowest layer takes the rest", least=0.0,
        status=Status.OURS, fault=Fault.OBJECT),
    *_material("ligature tissue.layers[]"),
)  # fmt: skip

BODY = (
    *IDENTITY,
    Key("parent", T, "", doc="reference to a parent object, of newer revisions of AMBF", status=Status.IGNORED),
    *LOOKS,
    *COLLISION,
    *shaders("shaders"),
    Key(
        "mass",
        N,
        1.0,
        "kg",
        "0 makes the body static; without it the inertial keys are not read",
        least=0.0,
        most=HEAVIEST,
    ),
    Key("inertia", MAP, doc="principal moments about the inertial frame; estimated when absent"),
    *each(("ix", "iy", "iz"), N, "inertia.{}", unit="kg·m²", doc="principal moment", required=True, least=0.0),
    Key("inertial offset", POSE, None, "m, rad", "inertial frame I in B", most=LONGEST_ARM),
    Key("gravity", V, unit="m/s²", doc="gravity of this body, in world axes", most=STRONGEST),
    Key("location", POSE, POSE_ZERO, "m, rad", "initial pose of B in the world"),
    Key("friction", MAP, doc="surface friction"),
    Key("friction.static", N, 0.5, doc="friction coefficient"),
    Key("friction.rolling", N, 0.01, doc="rolling friction coefficient"),
    *ignored(("friction.linear",), "old name of `static`"),
    Key("damping", MAP, doc="loss of velocity"),
    Key("damping.linear", N, 0.04, doc="velocity × (1 − d)^dt; clipped to 0 to 1"),
    Key("damping.angular", N, 0.1, doc="velocity × (1 − d)^dt; clipped to 0 to 1"),
    Key("restitution", N, 0.1, doc="coefficient of restitution"),
    Key("controller", MAP, doc="Cartesian controller"),
    *gains("controller.linear", "gains of the linear half", required=True),
    *gains("controller.angular", "gains of the angular half", required=True),
    OUTPUT_TYPE,
    Key("publish children names", F, False, doc="list the bodies below this one in its state"),
    Key("publish joint names", F, True, doc="list the joints below this one in its state"),
    Key("publish joint positions", F, True, doc="positions, velocities and efforts of these joints"),
    *ignored(("linear gain", "angular gain"), "old name of the controller's halves"),
    *ignored(("resistive surface", "resistive surface1"), "of AMBF 1.0; sensors of type Resistance replaced it"),
    *ignored(("enable feedback",), "belongs to joints"),
    ROD,
    Key("ligature needle", F, doc="false: not a needle; true: a warning where it is none", status=Status.OURS),
    *SOFT_TISSUE,
)


def _six(block: str, default: float, unit: str, doc: str, least: float | None = None) -> tuple[Key, ...]:
    return (
        Key(
            block,
            Type.NUMBER_OR_MAP,
            unit=unit,
            doc=f"{doc}; of a six-DOF joint a block",
            fault=Fault.VALUE,
            least=least,
        ),
        *(
            key
            for half in ("linear", "angular")
            for key in (
                Key(f"{block}.{half}", MAP, doc=f"{half} axes of a six-DOF joint", fault=Fault.VALUE),
                *each(
                    "xyz", N, f"{block}.{half}.{{}}", default, unit, f"{doc}, axis {{}}", fault=Fault.VALUE, least=least
                ),
            )
        ),
    )


def _limits(half: str, unit: str) -> tuple[Key, ...]:
    return (
        Key(f"joint limits.{half}", MAP, doc=f"{half} limits of a six-DOF joint", fault=Fault.VALUE),
        *(
            key
            for end, value in (("low", -1.2), ("high", 1.2))
            for key in (
                Key(
                    f"joint limits.{half}.{end}",
                    MAP,
                    doc="low = high locks an axis, low > high frees it",
                    fault=Fault.VALUE,
                ),
                *each(
                    "xyz",
                    N,
                    f"joint limits.{half}.{end}.{{}}",
                    value,
                    unit,
                    f"{end} end of axis {{}}",
                    fault=Fault.VALUE,
                ),
            )
        ),
    )


JOINT = (
    *IDENTITY,
    Key("parent", T, "", doc="parent body", required=True, fault=Fault.OBJECT),
    Key("child", T, "", doc="child body", required=True, fault=Fault.OBJECT),
    Key("type", C, doc="joint type", required=True, choices=JOINT_TYPES),
    Key("parent pivot", V, unit="m", doc="joint origin in the parent's body frame", required=True, most=LONGEST_ARM),
    Key("child pivot", V, unit="m", doc="joint origin in the child's body frame", required=True, most=LONGEST_ARM),
    Key("parent axis", V, doc="joint axis in the parent's body frame", required=True),
    Key("child axis", V, doc="joint axis in the child's body frame", required=True),
    Key("offset", N, None, "rad", "rotation of the child about the axis at joint position 0"),
    Key("child offset", N, 0.0, "rad", "former name of `offset`, which takes precedence"),
    Key("joint offset", N, 0.0, "rad", "rotation of the constraint frame about the axis"),
    Key("joint limits", MAP, doc="unlimited unless both ends are given"),
    Key("joint limits.low", N, unit="rad, m", doc="lower limit"),
    Key("joint limits.high", N, unit="rad, m", doc="upper limit"),
    *each("xyz", N, "joint limits.{}", 0.7, "rad", "half angle of a cone twist about frame {}", least=0.0),
    *_limits("linear", "m"),
    *_limits("angular", "rad"),
    *gains("controller", "joint PID", required=False),
    OUTPUT_TYPE,
    Key("max motor impulse", N, 0.1, "N·m·s, N·s", "motor strength for each ms"),
    *unused(
        (
            Key("joint erp", N, 0.1, doc="error reduction of the constraint; articulations have no error"),
            Key("joint cfm", N, 0.1, doc="constraint force mixing; articulations do not yield"),
        )
    ),
    *_six("damping", 0.7, "N·s/m, N·m·s/rad", "damper of a spring; revolute and prismatic joints ignore it", 0.0),
    *_six("stiffness", 1.0, "N/m, N·m/rad", "spring", 0.0),
    *_six("equilibrium point", 0.0, "m, rad", "rest position; the middle of the limits when absent"),
    Key("enable feedback", F, False, doc="compute effort and wrench"),
    Key("enable motor", Type.ANY, doc="0 or false: no position commands"),
    Key("ignore inter-collision", F, True, doc="the two bodies do not collide"),
    *ignored(("detached", "redundant", "body rotation"), "hint for importers"),
    *ignored(("controller gains",), "not the controller's key, which is `controller`"),
    *ignored(("origin", "axis"), "of AMBF 1.0; pivots and axes replaced it"),
    ROD,
    Key(
        "ligature yield moment",
        N,
        unit="N·m",
        doc="of a thread's joint: moment above which a bend is permanent; elastic when absent",
        status=Status.OURS,
        least=0.0,
    ),
)
_STATE_OF_JOINTS = ("publish children names", "publish joint names", "publish joint positions", "enable feedback")
"""What the state of a body reports of joints; only rigid bodies have some."""

GHOST = (
    *IDENTITY,
    *PARENT,
    *LOOKS,
    *unused(COLLISION, "collision groups"),
    Key("location", POSE, POSE_ZERO, "m, rad", "pose in the parent's frame"),
    Key("inertial offset", POSE, None, "m, rad", "used when `collision offset` is absent"),
    *ignored(
        ("mass", "inertia", "friction", "damping", "restitution", "gravity", "controller", "controller output type"),
        "a ghost has no mechanics",
    ),
    *ignored(_STATE_OF_JOINTS, "of bodies whose key was moved to the ghost objects"),
    Key("ligature hole", F, doc="whether needle and thread pass here; else recognised", status=Status.OURS),
    Key("ligature tissue", MAP, doc="forces of a hole on needle and thread", status=Status.OURS),
    *TISSUE,
)

_BULLET = {
    "kAST": "angular stiffness", "kVST": "volume stiffness", "kVCF": "velocity correction", "kDG": "drag",
    "kLF": "lift", "kCHR": "rigid contact hardness", "kKHR": "kinetic contact hardness",
    "kSHR": "soft contact hardness", "kAHR": "anchor hardness", "kSRHR_CL": "hardness of cluster against rigid",
    "kSKHR_CL": "hardness of cluster against kinetic", "kSSHR_CL": "hardness of cluster against soft",
    "kSR_SPLT_CL": "impulse split of cluster against rigid", "kSK_SPLT_CL": "impulse split of cluster against kinetic",
    "kSS_SPLT_CL": "impulse split of cluster against soft", "maxvolume": "largest volume ratio",
    "timescale": "time scale",
}  # fmt: skip
_BULLET_INTEGERS = {
    "viterations": "velocity iterations", "diterations": "drift iterations", "citerations": "cluster iterations",
    "flags": "collision flags", "bending constraint": "distance of the bending links",
    "clusters": "number of clusters",
}  # fmt: skip
_OWN_TISSUE = tuple(
    replace(key, default=()) if key.path == "ligature tissue.fixed" else key
    for key in SOFT_TISSUE
    if key.path != "ligature tissue.carried by"
)
"""What a soft body may state of its tissue; nothing holds it unless the file does."""

SOFT_BODY = (
    *unused(IDENTITY, "passive", "publish frequency", "publish frequency.low", "publish frequency.high"),
    *unused(PARENT),
    *unused(
        LOOKS, *(key.path for key in LOOKS if key.path.startswith(("shape", "geometry", "compound shape"))),
        "mesh remove duplicates",
    ),
    *unused(COLLISION, *(key.path for key in COLLISION if key.path not in ("collision mesh", "scale"))),
    Key("location", POSE, POSE_ZERO, "m, rad", "initial pose"),
    Key("mass", N, 1.0, "kg", "total mass, above 0", least=0.0, above=True, most=HEAVIEST),
    *unused((Key("randomize constraints", F, doc="any value randomises their order"),)),
    Key("config", MAP, doc="Bullet's soft-body parameters; how they count: docs/tissue.md"),
    Key("config.kLST", N, 1.0, doc="linear stiffness, 0 to 1; gives Young's modulus"),
    Key("config.piterations", I, 1, doc="position iterations; they raise the stiffness"),
    Key("config.kMT", N, 0.0, doc="pose matching, 0 to 1; adds to Young's modulus"),
    Key("config.kVC", N, 0.0, doc="volume conservation: above 0 Poisson's ratio is 0.45, not 0.3"),
    Key("config.kPR", N, 0.0, doc="pressure: above 0 Poisson's ratio is 0.45; it does not inflate"),
    Key("config.kDP", N, 0.0, doc="share of the velocity, 0 to 1, that each millisecond takes"),
    Key("config.kDF", N, 0.2, doc="friction coefficient", least=0.0),
    *unused(Key(f"config.{k}", N, doc=doc) for k, doc in _BULLET.items()),
    *unused(Key(f"config.{k}", I, doc=doc) for k, doc in _BULLET_INTEGERS.items()),
    Key("config.fixed nodes", Type.INTEGERS, (), doc="vertices of the mesh file, from 0, that stay where they are"),
    *ignored(("config.cutting", "config.margin"), "no effect"),
    *ignored(
        (
            "inertial offset", "inertia", "controller", "controller output type", "gravity", "friction", "damping",
            "restitution",
        ),
        "no effect on a soft body",
    ),
    *ignored(_STATE_OF_JOINTS, "of bodies whose key was moved to the soft bodies"),
    *_OWN_TISSUE,
)  # fmt: skip
_STATUS = Status.NOT_SIMULATED
_POWER = ("engine", "brake")
_SUSPENSION = {"stiffness": "N/m", "damping": "N·s/m", "compression": "N·s/m", "rest length": "m"}
VEHICLE = (
    *IDENTITY,
    *PARENT,
    Key("chassis", T, "", doc="chassis body of an earlier file", required=True, fault=Fault.OBJECT, status=_STATUS),
    Key("wheels", Type.MAPS, doc="wheels", status=_STATUS),
    Key("wheels[].body", T, "", doc="body that shows the wheel", status=_STATUS),
    Key("wheels[].mesh", P, "", doc="mesh that shows the wheel", status=_STATUS),
    Key("wheels[].radius", N, unit="m", doc="radius", status=_STATUS),
    *ignored(("wheels[].width",), "no effect"),
    Key("wheels[].friction", N, doc="friction slip of Bullet's vehicle", status=_STATUS),
    Key("wheels[].roll influence", N, doc="share of the rolling moment", status=_STATUS),
    Key("wheels[].suspension", MAP, doc="suspension", status=_STATUS),
    *(
        Key(f"wheels[].suspension.{k}", N, None, unit, k, required=True, status=_STATUS)
        for k, unit in _SUSPENSION.items()
    ),
    Key("wheels[].down direction", V, ZERO, doc="direction of the wheel's ray, in the chassis frame", status=_STATUS),
    Key("wheels[].axel direction", V, ZERO, doc="direction of the axle, in the chassis frame", status=_STATUS),
    Key("wheels[].offset", V, ZERO, "m", "connection point, in the chassis frame", status=_STATUS),
    Key("wheels[].front", F, False, doc="whether the wheel steers", status=_STATUS),
    Key("wheels[].steering limits", MAP, doc="limits of steering", status=_STATUS),
    *each(("low", "high"), N, "wheels[].steering limits.{}", 0.0, "rad", "{} limit", required=True, status=_STATUS),
    *each(_POWER, N, "wheels[].max {} power", 0.0, "N", "largest force", status=_STATUS),
    *ignored(("high resolution path",), "no effect"),
)
SUTURE = (
    *unused(IDENTITY, "passive"),
    Key("length", N, unit="m", doc="length of the thread", required=True),
    Key("diameter", N, unit="m", doc="diameter; or give `USP size`"),
    Key("USP size", T, "", doc="such as 2-0"),
    Key("density", N, 1200.0, "kg/m³", "density", least=0.0, above=True),
    Key("youngs modulus", N, 2.0e9, "Pa", "Young's modulus", least=0.0, above=True),
    Key("poisson ratio", N, 0.4, doc="ratio that gives the shear modulus, at most 0.5 either way", most=0.5),
    Key("damping time", N, 0.002, "s", "bending damping over bending stiffness", least=0.0),
    Key("yield strain", N, doc="strain at the surface above which a bend is permanent; elastic when absent", least=0.0),
    Key("elements", U, 40, doc="number of elements"),
    Key("friction", N, 0.3, doc="friction coefficient", least=0.0),
    Key("location", POSE, POSE_ZERO, "m, rad", "pose of the start; the thread leaves along +z"),
    Key("parent", T, "", doc="body that the start is fixed to; `location` is then in its frame"),
    Key(
        "release force",
        N,
        unit="N",
        doc="pull above which the parent lets go of the start; never when absent",
        least=0.0,
    ),
    Key(
        "way", Type.MAPS, doc="points in the frame of `location` that the thread leads through from its start at first"
    ),
    *each(("x", "y", "z"), N, "way[].{}", unit="m", doc="{} of the point", required=True),
    *(key for key in COLOUR if key.path.startswith("color rgba")),
)
