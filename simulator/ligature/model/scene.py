"""The resolved scene: what a launch file means, after every default, reference and path is settled.

Frames: W world; B body frame (mesh origin, the frame of ``location``, pivots, axes and published
poses); I inertial frame (centre of mass, principal axes). ``T_x_y`` is the 4x4 homogeneous pose of
frame y expressed in frame x. Units are SI: metres, kilograms, seconds, radians. Everything here is
immutable and knows nothing of Bullet; objects refer to each other by their index in the scene.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Mark
from ligature.model.axis import Axis
from ligature.model.piercing import Hole, Needle, Tissue
from ligature.model.plugins import PluginEntry
from ligature.model.shapes import Collider, ShaderFiles, Visual
from ligature.model.soft import TissueBody, TissueForm
from ligature.model.voxels import VolumeBody, VolumeForm

Array = NDArray[np.float64]
"""A float64 array; the docstring beside each use gives its shape and frame."""


@dataclass(frozen=True)
class Identity:
    """How an object is called (as in AMBF).

    ``identifier`` is the qualified identifier with its remap suffix, for example
    ``/ambf/env/phantom/BODY Needle``; ``topic`` is the ROS name below which its topics live, for
    example ``/ambf/env/phantom/Needle``; ``name`` is the bare name without blanks; ``namespace`` is what
    the files state, without the prefix of the scene.
    """

    key: str
    name: str
    identifier: str
    topic: str
    model: int
    passive: bool = False
    publish_low: int = 50
    publish_high: int = 1000
    parent_text: str = ""
    mark: Mark | None = None
    namespace: str = ""


class OutputType(enum.Enum):
    """What a controller's output is applied as (as in AMBF)."""

    FORCE = "force"
    VELOCITY = "velocity"


@dataclass(frozen=True)
class Gains:
    """Gains of one PID loop; units follow from the error and the output type."""

    p: float = 10.0
    i: float = 0.0
    d: float = 1.0


@dataclass(frozen=True)
class CartesianController:
    """Cartesian controller of a body (as in AMBF)."""

    linear: Gains = Gains()
    angular: Gains = Gains()
    linear_output: OutputType = OutputType.VELOCITY
    angular_output: OutputType = OutputType.VELOCITY


@dataclass(frozen=True, eq=False)
class Body:
    """One rigid body.

    ``inertia`` (3,) are the principal moments about I; ``T_body_inertial`` is I in B;
    ``T_world_body`` the initial pose; ``gravity`` (3,) in world axes is already settled (body over
    model over world). ``joints`` are the active descendant joints in the order of AMBF's
    joint commands, ``children`` the matching child bodies. ``no_collision_with`` holds the
    bodies whose contacts with this one are switched off by joints, files or groups. ``needle`` is what
    the file states of `ligature.model.needles`, None for nothing. ``inertia_estimated``: the file gave none.
    ``tissue`` is what a body of soft tissue consists of; its shapes and visual are then those of the body at rest.
    ``volume`` are the voxels of a volume; shapes and visual are those of its surface at the start.
    """

    index: int
    identity: Identity
    mass: float
    inertia: Array
    T_body_inertial: Array
    T_world_body: Array
    gravity: Array
    colliders: tuple[Collider, ...] = ()
    visual: Visual = Visual()
    collision_margin: float = 0.001
    friction: float = 0.5
    rolling_friction: float = 0.01
    restitution: float = 0.1
    linear_damping: float = 0.04
    angular_damping: float = 0.1
    controller: CartesianController = CartesianController()
    publish_children_names: bool = False
    publish_joint_names: bool = True
    publish_joint_positions: bool = True
    joints: tuple[int, ...] = ()
    children: tuple[int, ...] = ()
    no_collision_with: frozenset[int] = frozenset()
    needle: bool | None = None
    inertia_estimated: bool = False
    tissue: TissueForm | None = None
    volume: VolumeForm | None = None
    extra: dict[str, Any] = field(default_factory=dict)

    @property
    def static(self) -> bool:
        """Whether the body never moves by forces (ADF ``mass: 0``); commands may still move it."""
        return self.mass == 0.0


class JointType(enum.Enum):
    """Joint types of the format; the values are the canonical ADF spellings."""

    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"
    FIXED = "fixed"
    LINEAR_SPRING = "linear spring"
    TORSION_SPRING = "torsion spring"
    P2P = "p2p"
    CONE_TWIST = "cone twist"
    SIX_DOF = "six dof"
    SIX_DOF_SPRING = "six dof spring"


@dataclass(frozen=True, eq=False)
class SixDof:
    """Limits and springs of a six-DOF joint, each (6,): linear xyz then angular xyz, in frame A.

    ``low == high`` locks an axis, ``low > high`` frees it. Springs are zero for plain ``six dof``. In a
    thread, a rotation that needs more than ``yield_moment`` (N m) stays.
    """

    low: Array
    high: Array
    stiffness: Array
    damping: Array
    equilibrium: Array
    yield_moment: float = math.inf


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint between two bodies (as in AMBF).

    ``axis`` (3,) is a_A, the unit joint axis in the parent's inertial frame. ``T_parent_a`` is the
    constraint frame A in the parent's inertial frame, ``T_child_b`` frame B in the child's inertial
    frame. ``T_parent_child_zero`` is the child's body frame in the parent's body frame at
    joint position zero. ``low``/``high`` are None when the joint has no limits. Springs without limits are locked,
    unless ``freed``: the file gives them the wrong way round, which frees the axis (as in Bullet). One between a body
    and a thread lets go above a pull of ``release`` newtons.
    """

    index: int
    identity: Identity
    type: JointType
    parent: int
    child: int
    axis: Array
    T_parent_a: Array
    T_child_b: Array
    T_parent_child_zero: Array
    low: float | None = None
    high: float | None = None
    controller: Gains = Gains()
    output: OutputType = OutputType.VELOCITY
    max_motor_impulse: float = 0.1
    erp: float = 0.1
    cfm: float = 0.1
    stiffness: float = 0.0
    damping: float = 0.0
    equilibrium: float = 0.0
    freed: bool = False
    six_dof: SixDof | None = None
    cone_twist: tuple[float, float, float] | None = None
    motor_enabled: bool = True
    feedback: bool = False
    passive: bool = False
    release: float = math.inf
    extra: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Attachment:
    """Where an object without mass sits: ``T_parent_object`` (4, 4) in its parent's frame.

    ``parent`` is the kind (``"body"``, ``"camera"``, ``"light"``, ``"ghost"``, ``"volume"``) and
    index of the parent; None means the world.
    """

    parent: tuple[str, int] | None
    T_parent_object: Array


@dataclass(frozen=True, eq=False)
class Ghost:
    """A volume that senses what overlaps it and never produces a contact force.

    ``hole`` is what the file states of `ligature.model.holes`, None for nothing.
    """

    index: int
    identity: Identity
    attachment: Attachment
    colliders: tuple[Collider, ...]
    visual: Visual
    collision_groups: tuple[int, ...] = ()
    collision_margin: float = 0.001
    hole: bool | None = None
    tissue: Tissue = Tissue()


class SensorType(enum.Enum):
    """Sensor types; the values are those of the ``type`` field of the messages."""

    PROXIMITY = "PROXIMITY"
    RESISTANCE = "RESISTANCE"
    CONTACT = "CONTACT"


@dataclass(frozen=True)
class Resistance:
    """Parameters of a resistance sensor."""

    static_friction: float = 0.0
    damping: float = 0.1
    dynamic_friction: float = 0.0
    variable: bool = False
    contact_area: float = 0.1
    contact_stiffness: float = 0.0


@dataclass(frozen=True, eq=False)
class Sensor:
    """A ray or contact sensor on a body.

    ``rays`` (n, 2, 3) are start and end points in the sensor frame S; ``T_body_sensor`` (4, 4).
    """

    index: int
    identity: Identity
    type: SensorType
    parent: int
    T_body_sensor: Array
    rays: Array
    range: float = 0.5
    resistance: Resistance = Resistance()
    distance_threshold: float = 0.0
    contact_details: bool = True
    visible: bool = False
    visible_size: float = 0.02


@dataclass(frozen=True)
class Slip:
    """Two pads of an actuator that hold by friction.

    ``normal_force`` (N) between them, ``friction`` of a pad, to be multiplied by the body's, ``half_width`` (m), and
    the way (m) that a body may slip until it is released.
    """

    normal_force: float
    friction: float
    half_width: float
    reach: float


@dataclass(frozen=True, eq=False)
class Actuator:
    """A constraint actuator; ``T_body_actuator`` (4, 4) in the parent's body frame.

    It holds rigidly, or with ``slip`` between pads that are normal to its z axis.
    """

    index: int
    identity: Identity
    parent: int
    T_body_actuator: Array
    visible: bool = False
    visible_size: float = 0.02
    slip: Slip | None = None


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera; the camera frame looks along -X, +Y is image right, +Z is image up."""

    index: int
    identity: Identity
    attachment: Attachment
    near: float = 0.1
    far: float = 10.0
    field_of_view: float = 0.7
    orthographic_width: float | None = None
    stereo: tuple[float, float] | None = None
    intrinsics: dict[str, float] | None = None
    projection: Array | None = None
    resolution: tuple[int, int] = (640, 480)
    publish_image: bool = False
    image_interval: int = 1
    publish_depth: bool = False
    depth_interval: int = 10
    depth_noise: tuple[float, float, float] | None = None
    multipass: bool = False
    visible: bool = True
    monitor: int = 0
    window_size: tuple[int, int] | None = None
    controlling_devices: tuple[str, ...] = ()
    preprocessing_shaders: ShaderFiles | None = None
    depth_shaders: ShaderFiles | None = None
    mouse_multipliers: dict[str, float] = field(default_factory=dict)
    extra: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Light:
    """A spot light shining along the +X axis of its frame."""

    index: int
    identity: Identity
    attachment: Attachment
    spot_exponent: float = 0.7
    cutoff: float = 0.7
    shadow_quality: int = 0
    attenuation: tuple[float, float, float] = (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class InputDevice:
    """An input device of the launch file, as written; teleoperation gives it a meaning.

    ``proxy`` is the body that its hand drives, the root link of its proxy; -1 when that was not asked for.
    """

    key: str
    hardware_name: str
    root_link: str
    settings: dict[str, Any]
    mark: Mark | None = None
    proxy: int = -1


@dataclass(frozen=True)
class Model:
    """One model file of the scene; index 0 is the environment when the world has one."""

    index: int
    path: Path
    namespace: str


@dataclass(frozen=True, eq=False)
class Link:
    """A body inside an articulation, with the joint that carries it (None for the root)."""

    body: int
    joint: int | None
    parent_link: int


@dataclass(frozen=True, eq=False)
class Articulation:
    """A spanning tree of bodies joined by any joints but point-to-point ones, root first."""

    links: tuple[Link, ...]


@dataclass(frozen=True, eq=False)
class Start:
    """Where the articulations start.

    ``coordinates`` are the positions of a joint's free axes (`ligature.model.axes`) by joint, of trees and loops;
    ``roots`` the pose T_world_body (4, 4) of each articulation's first body by body.
    """

    coordinates: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    roots: Mapping[int, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Closure:
    """How a joint that closes a loop is held: from body ``inner`` it leads to ``outer``.

    Along the ``free`` axes, in the joint's frame on ``inner``, the other joints hold the two already; there they may
    differ, by up to ``slack`` metres.
    """

    joint: int
    inner: int
    outer: int
    free: tuple[Axis, ...] = ()
    slack: float = 0.0


@dataclass(frozen=True, eq=False)
class RodChain:
    """A chain of bodies that is simulated as one elastic rod from end to end (docs/suture.md).

    ``bodies`` are the elements in order, ``joints`` the joints between neighbours. ``anchors`` are
    the joints that attach an element to a body outside the chain. ``radius`` in metres, ``lengths``
    (n,) the rest length of each element between its joint pivots, along the element's local axis.
    """

    name: str
    bodies: tuple[int, ...]
    joints: tuple[int, ...]
    anchors: tuple[int, ...]
    radius: float
    lengths: Array


@dataclass(frozen=True, eq=False)
class WorldSettings:
    """What the world file states: ``gravity`` (3,), namespace, and limits of the loop.

    ``prefix`` stands before every namespace of the scene (``--ns``); ``topic`` has it already.
    """

    namespace: str = "/ambf/env/"
    prefix: str = ""
    topic: str = "/ambf/env/World"
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.8]))
    max_substeps: int = 10
    shaders: ShaderFiles | None = None
    skybox: dict[str, Path] | None = None
    extra: dict[str, Any] = field(default_factory=dict)

    @property
    def frame_prefix(self) -> str:
        """What frames of this scene begin with on ROS, such as ``left/``; empty without a prefix."""
        return "".join(f"{part}/" for part in self.prefix.split("/") if part)

    @property
    def root(self) -> str:
        """What topics beside those of objects begin with on ROS, ``/`` or such as ``/left/``."""
        return "/" + self.frame_prefix


class ArmKind(enum.Enum):
    """Manipulators of the da Vinci Research Kit; the values are the words of the launch file."""

    PSM = "psm"
    ECM = "ecm"
    MTM = "mtm"


@dataclass(frozen=True)
class ArmDescription:
    """Which bodies are an arm (as in the dVRK).

    ``base`` is the body whose frame the arm stands in, ``joints`` the joints of the chain from the base outwards,
    ``jaw`` the finger joints, ``tip`` the body that the chain ends in, ``tool`` the instrument's model number or
    type. An ECM without joints moves ``tip``, the body that carries the cameras. An MTM has no bodies. Bodies that
    do not exist are -1.
    """

    name: str
    kind: ArmKind
    base: int = -1
    joints: tuple[int, ...] = ()
    jaw: tuple[int, ...] = ()
    tip: int = -1
    tool: str = ""


@dataclass(frozen=True, eq=False)
class Jaw:
    """Two fingers on one body.

    ``palm`` is that body, ``fingers`` the two others, ``joints`` theirs; ``opening`` (2,) is +1 where the jaw
    opens as the joint's position grows, else -1. ``axis`` (3,) and ``pivot`` (3,) are the axis of the fingers in
    the holder's inertial frame. ``half_width`` is half the width of the pads along it, ``reach`` the length of
    the fingers. ``name`` is that of the arm, else the holder's identifier.
    """

    name: str
    palm: int
    fingers: tuple[int, int]
    joints: tuple[int, int]
    opening: tuple[float, float]
    axis: Array
    pivot: Array
    half_width: float
    reach: float


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything a launch file describes, ready for physics, sensing, robots and drawing.

    ``articulations`` cover every non-rod body once (a lone body is an articulation of one link);
    ``loops`` are the joints that close a kinematic loop or that an articulation cannot express and
    that constraints must hold, as ``closures`` state; ``start`` is where all of them start; ``rods``
    are the recognised sutures, ``arms`` the recognised manipulators, ``jaws`` what can grasp.
    ``diagnostics`` are all the findings of reading and resolving, in order. ``roots`` are the folders
    below which a scene file may have other files opened. ``plugins`` are what the files name; nothing of it is loaded.
    """

    name: str
    world: WorldSettings
    models: tuple[Model, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    ghosts: tuple[Ghost, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    actuators: tuple[Actuator, ...] = ()
    cameras: tuple[Camera, ...] = ()
    lights: tuple[Light, ...] = ()
    input_devices: tuple[InputDevice, ...] = ()
    articulations: tuple[Articulation, ...] = ()
    loops: tuple[int, ...] = ()
    start: Start = Start()
    closures: tuple[Closure, ...] = ()
    rods: tuple[RodChain, ...] = ()
    needles: tuple[Needle, ...] = ()
    holes: tuple[Hole, ...] = ()
    arms: tuple[ArmDescription, ...] = ()
    jaws: tuple[Jaw, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    roots: tuple[Path, ...] = ()
    plugins: tuple[PluginEntry, ...] = ()

    @cached_property
    def body_index(self) -> dict[str, int]:
        """Body index by qualified identifier."""
        return {body.identity.identifier: body.index for body in self.bodies}

    @cached_property
    def drawn_names(self) -> dict[int, str]:
        """Identifiers of bodies, from 1 on, then of ghosts, by the numbers that pictures show; 0 is the background."""
        things = [body.identity for body in self.bodies] + [ghost.identity for ghost in self.ghosts]
        return {number: identity.identifier for number, identity in enumerate(things, 1)}

    @cached_property
    def tissues(self) -> tuple[TissueBody, ...]:
        """The bodies of soft tissue, in order of their bodies."""
        soft = [(body.index, body.tissue) for body in self.bodies if body.tissue is not None]
        ends = np.cumsum([0] + [len(form.grid.nodes) for _, form in soft]).tolist()
        return tuple(
            TissueBody(index, body, slice(*ends[index : index + 2]), form) for index, (body, form) in enumerate(soft)
        )

    @cached_property
    def volumes(self) -> tuple[VolumeBody, ...]:
        """The volumes that change, in order of their bodies; a scene whose plug-ins do not run has none."""
        found = [(body.index, body.volume) for body in self.bodies if body.volume is not None and self.plugins]
        ends = np.cumsum([0] + [form.values.size for _, form in found]).tolist()
        return tuple(
            VolumeBody(index, body, slice(*ends[index : index + 2]), form) for index, (body, form) in enumerate(found)
        )

    @cached_property
    def rod_bodies(self) -> frozenset[int]:
        """Indices of the bodies that are elements of a rod."""
        return frozenset(index for rod in self.rods for index in rod.bodies)
