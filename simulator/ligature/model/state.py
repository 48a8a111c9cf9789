"""The state of a running scene: one record of numpy arrays with a layout fixed by the scene.

The record is plain memory, so that a snapshot is one copy and another process can map it.
Poses are x y z qx qy qz qw in world axes unless a field sets otherwise; twists are linear then
angular in world axes, the linear part at the centre of mass. SI units.
"""

from __future__ import annotations

from typing import Any

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


def state_dtype(scene: Scene) -> StateDtype:
    """The memory layout of the state of ``scene``.

    ``tick`` counts ticks, ``update`` counts updates of 1/p seconds (``WorldState.sim_step``);
    ``stamp`` is Unix time of the update that wrote the record, zero in process.
    ``ghost_sensed[g, b]`` reports whether body b overlaps ghost g. ``ray_*`` are the rays of all
    sensors one after the other; ``ray_body`` is -1 for no hit. ``camera_pose`` and ``light_pose``
    are in the parent's frame, as the messages want them; ``*_world`` beside them in world axes.
    Of ``touch_*`` the first ``touch_count`` rows count, while contacts are watched (`WatchContacts`): where bodies
    touch, and the force on one of the two.
    Of ``insertion_*`` the first ``insertion_count`` rows count: hole of the scene, needle or element in it, metres of
    it beyond the hole, where it passes and the force on it there, in world axes. In the body of tissue k the hole is
    -1 - k, the depth is the length inside, and the place is where it went in. ``tissue_node`` are the nodes of all
    bodies of tissue, in rows `TissueBody.rows`. ``tissue_wrench`` is all that needles, threads and bodies do to a
    body of tissue, about the origin of its frame B; ``tissue_peak`` the largest force at one point of it,
    ``tissue_contacts`` at how many points something pushes or rubs it, on its surface and inside. Of
    ``puncture_*`` the first ``puncture_count`` rows of a body count: places on its surface where needles went in or
    out, and the outward normals there.
    ``jaw_body`` is what each jaw holds by friction or -1; ``jaw_force`` presses its fingers together, ``jaw_wrench``
    acts on the body about the patch, ``jaw_slip`` are metres and radians slipped since it was grasped.
    ``volume_value`` are the voxels of the volumes that plug-ins may change, in rows `VolumeBody.rows`.
    ``plugin_value`` is what plug-ins publish, topic after topic; of ``plugin_line`` (ends of lines that they draw) the
    first ``plugin_line_count`` rows count.
    """
    nb, nj = len(scene.bodies), len(scene.joints)
    ng, na = len(scene.ghosts), len(scene.actuators)
    nc, nl = len(scene.cameras), len(scene.lights)
    nr = sum(len(sensor.rays) for sensor in scene.sensors)
    return np.dtype(
        [
            ("tick", "u8"),
            ("update", "u8"),
            ("resets", "u8"),
            ("sim_time", "f8"),
            ("wall_time", "f8"),
            ("stamp", "f8"),
            ("body_pose", "f8", (nb, 7)),
            ("body_twist", "f8", (nb, 6)),
            ("body_wrench", "f8", (nb, 6)),
            ("joint_position", "f8", (nj,)),
            ("joint_velocity", "f8", (nj,)),
            ("joint_effort", "f8", (nj,)),
            ("ghost_world", "f8", (ng, 7)),
            ("ghost_sensed", "?", (ng, nb)),
            ("ray_measurement", "f8", (nr,)),
            ("ray_point", "f8", (nr, 3)),
            ("ray_normal", "f8", (nr, 3)),
            ("ray_body", "i4", (nr,)),
            ("contact_count", "i4"),
            ("contact_sensor", "i4", (MAX_CONTACT_EVENTS,)),
            ("contact_body", "i4", (MAX_CONTACT_EVENTS,)),
            ("contact_distance", "f8", (MAX_CONTACT_EVENTS,)),
            ("contact_point", "f8", (MAX_CONTACT_EVENTS, 3)),
            ("contact_normal", "f8", (MAX_CONTACT_EVENTS, 3)),
            ("touch_count", "i4"),
            ("touch_point", "f8", (MAX_TOUCHES, 3)),
            ("touch_force", "f8", (MAX_TOUCHES, 3)),
            ("actuator_active", "?", (na,)),
            ("actuator_body", "i4", (na,)),
            ("camera_pose", "f8", (nc, 7)),
            ("camera_world", "f8", (nc, 7)),
            ("light_pose", "f8", (nl, 7)),
            ("light_world", "f8", (nl, 7)),
            ("rod_tension", "f8", (nb,)),
            ("insertion_count", "i4"),
            ("insertion_hole", "i4", (MAX_INSERTIONS,)),
            ("insertion_body", "i4", (MAX_INSERTIONS,)),
            ("insertion_depth", "f8", (MAX_INSERTIONS,)),
            ("insertion_point", "f8", (MAX_INSERTIONS, 3)),
            ("insertion_force", "f8", (MAX_INSERTIONS, 3)),
            ("tissue_node", "f8", (scene.tissues[-1].rows.stop if scene.tissues else 0, 3)),
            ("tissue_wrench", "f8", (len(scene.tissues), 6)),
            ("tissue_peak", "f8", (len(scene.tissues),)),
            ("tissue_contacts", "i4", (len(scene.tissues),)),
            ("puncture_count", "i4", (len(scene.tissues),)),
            ("puncture_point", "f8", (len(scene.tissues), MAX_PUNCTURES, 3)),
            ("puncture_normal", "f8", (len(scene.tissues), MAX_PUNCTURES, 3)),
            ("volume_value", "u1", (scene.volumes[-1].rows.stop if scene.volumes else 0,)),
            ("jaw_body", "i4", (len(scene.jaws),)),
            ("jaw_force", "f8", (len(scene.jaws),)),
            ("jaw_wrench", "f8", (len(scene.jaws), 6)),
            ("jaw_slip", "f8", (len(scene.jaws), 2)),
            ("arm", ARM_DTYPE, (len(scene.arms),)),
            ("plugin_value", "f8", (sum(sum(plugin.publishes.values()) for plugin in scene.plugins),)),
            ("plugin_line_count", "i4"),
            ("plugin_line", "f8", (MAX_LINES if scene.plugins else 0, 2, 3)),
            ("plugin_line_colour", "u1", (MAX_LINES if scene.plugins else 0, 3)),
        ]
    )


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
