"""The state of a running scene: one record of numpy arrays with a layout fixed by the scene.

The record is plain memory, so that a snapshot is one copy and another process can map it.
Poses are x y z qx qy qz qw in world axes unless a field sets otherwise; twists are linear then
angular in world axes, the linear part at the centre of mass. SI units.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import Scene

MAX_TOUCHES = 64
"""Most contact points that a watched state lists."""

MAX_CONTACT_EVENTS = 64
"""Most contact points that contact sensors report in one state; more are counted, not listed."""

ARM_JOINTS = 7
"""Most joints of an arm."""

ARM_DTYPE = np.dtype(
    [
        ("operating", "u1"),
        ("homed", "?"),
        ("busy", "?"),
        ("tool_present", "?"),
        ("tool", "i4"),
        ("ratio", "f8", (2,)),
        ("reference", "S64"),
        ("measured_js", "f8", (3, ARM_JOINTS)),
        ("setpoint_js", "f8", (3, ARM_JOINTS)),
        ("jaw_measured_js", "f8", (3,)),
        ("jaw_setpoint_js", "f8", (3,)),
        ("measured_cp", "f8", (7,)),
        ("setpoint_cp", "f8", (7,)),
        ("local_measured_cp", "f8", (7,)),
        ("local_setpoint_cp", "f8", (7,)),
        ("measured_cv", "f8", (6,)),
        ("local_measured_cv", "f8", (6,)),
        ("body_measured_cf", "f8", (6,)),
        ("spatial_measured_cf", "f8", (6,)),
        ("body_jacobian", "f8", (6, ARM_JOINTS)),
        ("spatial_jacobian", "f8", (6, ARM_JOINTS)),
        ("gravity_jf", "f8", (ARM_JOINTS,)),
    ]
)
"""State of one arm, named as CRTK names it; unused joints are zero.

``operating`` is the number of an `OperatingState`; rows of ``*_js`` are position, velocity, effort; ``ratio`` are
those of velocity and acceleration; ``reference`` is the frame of a base frame that was set, else empty; ``tool`` is
the instrument's model number. Local poses are in the arm's base frame. Twists and wrenches are linear then angular.
"""

MAX_INSERTIONS = 64
"""Most passages of needles and threads through tissue holes in one state."""

MAX_LINES = 256
"""Most lines that plug-ins draw."""

MAX_PUNCTURES = 32
"""Most places at which needles have punctured the surface of one body of tissue."""

StateDtype = np.dtype[np.void]
StateRecord = NDArray[np.void]
"""One-element record array of `state_dtype`; index fields by name, then ``[0]``."""


class Field(NamedTuple):
    """One field of a state record: NumPy's type, names or numbers of its sizes, and what it means."""

    name: str
    type: str | np.dtype[np.void]
    shape: tuple[str | int, ...]
    meaning: str


FIELDS = (
    Field("tick", "u8", (), "ticks since the start"),
    Field("update", "u8", (), "updates since the start, of 1/p seconds each; ``WorldState.sim_step``"),
    Field("resets", "u8", (), "resets since the start"),
    Field("sim_time", "f8", (), "simulated seconds since the start"),
    Field("wall_time", "f8", (), "wall seconds since the start; zero in process"),
    Field("stamp", "f8", (), "Unix time of the update that wrote the record; zero in process"),
    Field("body_pose", "f8", ("bodies", 7), "pose of each body frame"),
    Field("body_twist", "f8", ("bodies", 6), "velocity of each body"),
    Field("body_wrench", "f8", ("bodies", 6), "reaction on each body of its joints with ``enable feedback``"),
    Field("joint_position", "f8", ("joints",), "rad or m"),
    Field("joint_velocity", "f8", ("joints",), "rad/s or m/s"),
    Field("joint_effort", "f8", ("joints",), "N m or N of joints with ``enable feedback``, else 0"),
    Field("ghost_world", "f8", ("ghosts", 7), "pose of each ghost"),
    Field("ghost_sensed", "?", ("ghosts", "bodies"), "whether a body overlaps a ghost"),
    Field("ray_measurement", "f8", ("rays",), "1 minus the hit fraction, 0 for no hit; rays of all sensors in turn"),
    Field("ray_point", "f8", ("rays", 3), "where each ray hits"),
    Field("ray_normal", "f8", ("rays", 3), "normal of the surface there"),
    Field("ray_body", "i4", ("rays",), "the body that each ray hits, -1 for none"),
    Field("contact_count", "i4", (), "contact points of contact sensors; valid rows of ``contact_*``"),
    Field("contact_sensor", "i4", (MAX_CONTACT_EVENTS,), "index of the sensor"),
    Field("contact_body", "i4", (MAX_CONTACT_EVENTS,), "the body that touches the sensor's body"),
    Field("contact_distance", "f8", (MAX_CONTACT_EVENTS,), "gap; below zero where they overlap"),
    Field("contact_point", "f8", (MAX_CONTACT_EVENTS, 3), "where they touch"),
    Field("contact_normal", "f8", (MAX_CONTACT_EVENTS, 3), "normal there"),
    Field("touch_count", "i4", (), "contact points while `WatchContacts` is on; valid rows of ``touch_*``"),
    Field("touch_point", "f8", (MAX_TOUCHES, 3), "where bodies touch"),
    Field("touch_force", "f8", (MAX_TOUCHES, 3), "force on one of the two"),
    Field("actuator_active", "?", ("actuators",), "whether an actuator holds a body"),
    Field("actuator_body", "i4", ("actuators",), "the body that it holds, -1 for none"),
    Field("camera_pose", "f8", ("cameras", 7), "pose of each camera in its parent's frame, as in messages"),
    Field("camera_world", "f8", ("cameras", 7), "the same in the world"),
    Field("light_pose", "f8", ("lights", 7), "pose of each light in its parent's frame, as in messages"),
    Field("light_world", "f8", ("lights", 7), "the same in the world"),
    Field("rod_tension", "f8", ("bodies",), "tension of each body that is an element of a thread, N"),
    Field("insertion_count", "i4", (), "needles and threads in holes and tissue; valid rows of ``insertion_*``"),
    Field("insertion_hole", "i4", (MAX_INSERTIONS,), "index of the hole; -1 - k in the body of tissue k"),
    Field("insertion_body", "i4", (MAX_INSERTIONS,), "the needle or element in it"),
    Field("insertion_depth", "f8", (MAX_INSERTIONS,), "length beyond the hole; in tissue, length inside"),
    Field("insertion_point", "f8", (MAX_INSERTIONS, 3), "where it passes the hole; in tissue, where it went in"),
    Field("insertion_force", "f8", (MAX_INSERTIONS, 3), "force on it there"),
    Field("tissue_node", "f8", ("tissue nodes", 3), "nodes of all bodies of tissue, in rows `TissueBody.rows`"),
    Field("tissue_wrench", "f8", ("tissues", 6), "total wrench on a body of tissue, about its body's origin"),
    Field("tissue_peak", "f8", ("tissues",), "largest force at one point of it"),
    Field("tissue_contacts", "i4", ("tissues",), "points at which something acts on it, on its surface and inside"),
    Field("puncture_count", "i4", ("tissues",), "punctures of a body of tissue; valid rows of ``puncture_*``"),
    Field("puncture_point", "f8", ("tissues", MAX_PUNCTURES, 3), "places on the surface where needles went in or out"),
    Field("puncture_normal", "f8", ("tissues", MAX_PUNCTURES, 3), "outward normals there"),
    Field("volume_value", "u1", ("voxels",), "voxels of volumes that plug-ins may change, in rows `VolumeBody.rows`"),
    Field("jaw_body", "i4", ("jaws",), "the body that a jaw holds by friction, -1 for none"),
    Field("jaw_force", "f8", ("jaws",), "force that presses its fingers together"),
    Field("jaw_wrench", "f8", ("jaws", 6), "wrench of the jaw on the body, about the contact patch"),
    Field("jaw_slip", "f8", ("jaws", 2), "slip since the body was grasped, m and rad"),
    Field("arm", ARM_DTYPE, ("arms",), "state of each arm, see `ARM_DTYPE`"),
    Field("plugin_value", "f8", ("plug-in values",), "what plug-ins publish, topic by topic"),
    Field("plugin_line_count", "i4", (), "lines that plug-ins draw; valid rows of ``plugin_line*``"),
    Field("plugin_line", "f8", ("plug-in lines", 2, 3), "ends of each line"),
    Field("plugin_line_colour", "u1", ("plug-in lines", 3), "its colour"),
)
"""The fields of a state record in their order. Indices are those of the scene, ``scene.bodies`` and so on."""


def _sizes(scene: Scene) -> dict[str, int]:
    """How many there are of what `FIELDS` name."""
    return {
        "bodies": len(scene.bodies), "joints": len(scene.joints), "ghosts": len(scene.ghosts),
        "rays": sum(len(sensor.rays) for sensor in scene.sensors), "actuators": len(scene.actuators),
        "cameras": len(scene.cameras), "lights": len(scene.lights), "tissues": len(scene.tissues),
        "tissue nodes": scene.tissues[-1].rows.stop if scene.tissues else 0,
        "voxels": scene.volumes[-1].rows.stop if scene.volumes else 0,
        "jaws": len(scene.jaws), "arms": len(scene.arms),
        "plug-in values": sum(sum(plugin.publishes.values()) for plugin in scene.plugins),
        "plug-in lines": MAX_LINES if scene.plugins else 0,
    }  # fmt: skip


def state_dtype(scene: Scene) -> StateDtype:
    """The memory layout of the state of ``scene``, field by field as in `FIELDS`."""
    sizes = _sizes(scene)
    return np.dtype([(f.name, f.type, tuple(sizes[n] if isinstance(n, str) else n for n in f.shape)) for f in FIELDS])


def new_state(scene: Scene) -> StateRecord:
    """A zeroed state record of ``scene`` with identity poses, tissue at rest and volumes whole, shape (1,)."""
    state = np.zeros(1, dtype=state_dtype(scene))
    for field_name in (
        "body_pose",
        "ghost_world",
        "camera_pose",
        "camera_world",
        "light_pose",
        "light_world",
    ):
        state[field_name][..., 6] = 1.0
    for tissue in scene.tissues:
        T = scene.bodies[tissue.body].T_world_body
        state["tissue_node"][0, tissue.rows] = tissue.form.grid.nodes @ T[:3, :3].T + T[:3, 3]
    for volume in scene.volumes:
        state["volume_value"][0, volume.rows] = volume.form.values.ravel()
    state["ray_body"] = -1
    state["actuator_body"] = -1
    state["jaw_body"] = -1
    return state


class FieldViews:
    """Views of the fields ``names`` of a state record: looking one up takes longer than writing it.

    Attributes
    ----------
    fresh
        Whether the record of the last call was another one than that of the call before.
    """

    def __init__(self, *names: str) -> None:
        self._names = names
        self._state: StateRecord | None = None
        self._views: list[NDArray[Any]] = []
        self.fresh = True

    def of(self, state: StateRecord) -> list[NDArray[Any]]:
        """The fields of ``state``, without its leading axis; numbers alone are (1,)."""
        self.fresh = state is not self._state
        if self.fresh:
            self._state = state
            self._views = [state[name][0] if state[name].ndim > 1 else state[name] for name in self._names]
        return self._views
