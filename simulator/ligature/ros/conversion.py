"""Between state records and AMBF messages: plain functions and message templates, no ROS node.

Poses are x y z qx qy qz qw. Rigid bodies report world poses; everything attached reports its pose
in its parent's frame (as in AMBF).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import rospy
from ambf_msgs.msg import (
    ActuatorCmd,
    ActuatorState,
    CameraState,
    ContactData,
    ContactEvent,
    ContactSensorState,
    GhostObjectState,
    LightState,
    RigidBodyCmd,
    RigidBodyState,
    SensorState,
    WorldState,
)
from geometry_msgs.msg import Pose
from numpy.typing import NDArray
from std_msgs.msg import String

from ligature.model.commands import ActuatorCommand, BodyCommand, CommandType, PlaceCommand
from ligature.model.frames import matrix_pose7
from ligature.model.scene import Body, Identity, Scene, Sensor, SensorType
from ligature.model.state import MAX_CONTACT_EVENTS

Record = NDArray[np.void]

SMALLEST_QUATERNION = 0.1
"""Quaternions shorter than this are taken as no rotation (as in AMBF)."""


def fill_pose(message: Pose, pose: Sequence[float]) -> None:
    """Write a pose (7,) into a message."""
    p, q = message.position, message.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = pose


def pose7(message: Pose) -> tuple[float, ...]:
    """Pose (7,) of a message, with a unit quaternion."""
    p, q = message.position, message.orientation
    length = math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)
    if length < SMALLEST_QUATERNION:
        return (p.x, p.y, p.z, 0.0, 0.0, 0.0, 1.0)
    return (p.x, p.y, p.z, q.x / length, q.y / length, q.z / length, q.w / length)


class Template:
    """One message that is filled again for every publication; ``kind`` and ``index`` state of what."""

    kind = ""

    def __init__(self, scene: Scene, index: int, identity: Identity, message: Any) -> None:
        self.scene, self.index, self.identity, self.message = scene, index, identity, message
        message.identifier.data = identity.identifier
        message.name.data = identity.name

    def fill(self, state: Record, stamp: rospy.Time) -> Any:
        """The message of ``state`` (a record scalar)."""
        message = self.message
        message.header.stamp = stamp
        message.sim_step = int(state["update"]) % 2**32
        message.wall_time = state["wall_time"]
        message.sim_time = state["sim_time"]
        self.content(message, state)
        return message

    def content(self, message: Any, state: Record) -> None:
        """Fill what is particular to the kind."""


class BodyTemplate(Template):
    """``RigidBodyState``; joint and children names appear when the file or a command asks for them."""

    kind = "body"

    def __init__(self, scene: Scene, body: Body) -> None:
        super().__init__(scene, body.index, body.identity, RigidBodyState())
        self.message.mass = body.mass
        p = self.message.pInertia
        p.x, p.y, p.z = body.inertia.tolist()
        self._joints = np.array(body.joints, dtype=np.int64)
        self._joint_names = [scene.joints[j].identity.name for j in body.joints]
        self._children = [scene.bodies[c].identity.name for c in body.children]
        self._wanted = (body.publish_children_names, body.publish_joint_names, body.publish_joint_positions)

    def ask(self, children: bool, names: bool, positions: bool) -> bool:
        """Switch lists on; a command cannot switch them off (as in AMBF). Whether there are more now.

        Commands come in on other threads: the message itself is written in `content` alone, so that no client sees
        names without positions.
        """
        before = self._wanted
        self._wanted = (before[0] or children, before[1] or names, before[2] or positions)
        return self._wanted != before

    def content(self, message: RigidBodyState, state: Record) -> None:
        """Pose, twist, wrench and joints."""
        fill_pose(message.pose, state["body_pose"][self.index].tolist())
        twist, wrench = message.twist, message.wrench
        v, w = twist.linear, twist.angular
        v.x, v.y, v.z, w.x, w.y, w.z = state["body_twist"][self.index].tolist()
        f, t = wrench.force, wrench.torque
        f.x, f.y, f.z, t.x, t.y, t.z = state["body_wrench"][self.index].tolist()
        children, names, positions = self._wanted
        if children:
            message.children_names = self._children
        if names:
            message.joint_names = self._joint_names
        if positions and len(self._joints):
            message.joint_positions = state["joint_position"][self._joints].tolist()
            message.joint_velocities = state["joint_velocity"][self._joints].tolist()
            message.joint_efforts = state["joint_effort"][self._joints].tolist()


class _Attached(Template):
    """Message of an object on a parent: constant parent name, pose in the parent's frame."""

    def __init__(self, scene: Scene, index: int, identity: Identity, message: Any, pose: Sequence[float]) -> None:
        super().__init__(scene, index, identity, message)
        message.parent_name.data = identity.parent_text
        fill_pose(message.pose, pose)


class GhostTemplate(_Attached):
    """``GhostObjectState`` with the identifiers of what overlaps."""

    kind = "ghost"

    def __init__(self, scene: Scene, index: int) -> None:
        ghost = scene.ghosts[index]
        super().__init__(
            scene,
            index,
            ghost.identity,
            GhostObjectState(),
            matrix_pose7(ghost.attachment.T_parent_object).tolist(),
        )
        self._names = [String(body.identity.identifier) for body in scene.bodies]

    def content(self, message: GhostObjectState, state: Record) -> None:
        """Sensed objects."""
        message.sensed_objects = [self._names[b] for b in np.flatnonzero(state["ghost_sensed"][self.index])]


class ActuatorTemplate(_Attached):
    """``ActuatorState``."""

    kind = "actuator"

    def __init__(self, scene: Scene, index: int) -> None:
        actuator = scene.actuators[index]
        super().__init__(
            scene, index, actuator.identity, ActuatorState(), matrix_pose7(actuator.T_body_actuator).tolist()
        )
        self.message.type.data = "CONSTRAINT"

    def content(self, message: ActuatorState, state: Record) -> None:
        """Whether something is held; AMBF never fills it in; clients need it."""
        message.actuated = bool(state["actuator_active"][self.index])


class PlacedTemplate(_Attached):
    """``CameraState`` and ``LightState``."""

    def __init__(self, scene: Scene, kind: str, index: int) -> None:
        item = scene.cameras[index] if kind == "camera" else scene.lights[index]
        message = CameraState() if kind == "camera" else LightState()
        super().__init__(scene, index, item.identity, message, matrix_pose7(item.attachment.T_parent_object).tolist())
        self.kind = kind

    def content(self, message: Any, state: Record) -> None:
        """Pose in the parent's frame."""
        fill_pose(message.pose, state[f"{self.kind}_pose"][self.index].tolist())


class RayTemplate(_Attached):
    """``SensorState`` of a proximity or resistance sensor; ``start`` is its first ray in the record."""

    kind = "sensor"

    def __init__(self, scene: Scene, sensor: Sensor, start: int) -> None:
        super().__init__(
            scene, sensor.index, sensor.identity, SensorState(), matrix_pose7(sensor.T_body_sensor).tolist()
        )
        self.message.type.data = sensor.type.value
        self.message.count = len(sensor.rays)
        self.message.range = [sensor.range]
        self._rays = slice(start, start + len(sensor.rays))

    def content(self, message: SensorState, state: Record) -> None:
        """Triggers, measurements, sensed bodies and which of them each ray hit."""
        bodies = state["ray_body"][self._rays]
        distinct = sorted({int(b) for b in bodies if b >= 0})
        message.triggered = (bodies >= 0).tolist()
        message.measurement = state["ray_measurement"][self._rays].tolist()
        message.sensed_objects = [String(self.scene.bodies[b].identity.identifier) for b in distinct]
        message.sensed_objects_map = bytes(distinct.index(int(b)) if b >= 0 else 255 for b in bodies)


class ContactTemplate(Template):
    """``ContactSensorState``."""

    kind = "sensor"

    def __init__(self, scene: Scene, sensor: Sensor) -> None:
        super().__init__(scene, sensor.index, sensor.identity, ContactSensorState())
        self.message.type.data = sensor.type.value
        self.message.parent_name.data = sensor.identity.parent_text

    def content(self, message: ContactSensorState, state: Record) -> None:
        """One event for each touched body."""
        rows = np.flatnonzero(
            state["contact_sensor"][: min(int(state["contact_count"]), MAX_CONTACT_EVENTS)] == self.index
        )
        events: dict[int, ContactEvent] = {}
        for row in rows:
            body = int(state["contact_body"][row])
            if body not in events:
                events[body] = ContactEvent()
                events[body].object_name.data = self.scene.bodies[body].identity.identifier
            data = ContactData()
            data.distance.data = float(state["contact_distance"][row])
            p, n = data.contact_point, data.contact_normal
            p.x, p.y, p.z = state["contact_point"][row].tolist()
            n.x, n.y, n.z = state["contact_normal"][row].tolist()
            events[body].contact_data.append(data)
        message.contact_events = list(events.values())


class WorldTemplate:
    """``WorldState`` of a run with a number of input ``devices``; rates come with the figures of the bus."""

    kind = "world"
    index = 0

    def __init__(self, devices: int = 0) -> None:
        self.message = WorldState(n_devices=min(devices, 255))
        self.loop_hz = self.pictures_hz = 0.0

    def fill(self, state: Record, stamp: rospy.Time) -> WorldState:
        """The message of ``state``."""
        message = self.message
        message.header.stamp = stamp
        message.dynamic_loop_freq = max(round(self.loop_hz), 0)
        message.graphics_loop_freq = max(round(self.pictures_hz), 0)
        message.sim_step = int(state["update"]) % 2**32
        message.wall_time = state["wall_time"]
        message.sim_time = state["sim_time"]
        return message


def templates(scene: Scene) -> list[Template]:
    """One template for every object that is not passive, in the order of the scene."""
    found: list[Template] = [BodyTemplate(scene, b) for b in scene.bodies if not b.identity.passive]
    found += [GhostTemplate(scene, g.index) for g in scene.ghosts if not g.identity.passive]
    found += [ActuatorTemplate(scene, a.index) for a in scene.actuators if not a.identity.passive]
    found += [PlacedTemplate(scene, "camera", c.index) for c in scene.cameras if not c.identity.passive]
    found += [PlacedTemplate(scene, "light", light.index) for light in scene.lights if not light.identity.passive]
    start = 0
    for sensor in scene.sensors:
        if sensor.type is SensorType.CONTACT:
            if not sensor.identity.passive:
                found.append(ContactTemplate(scene, sensor))
            continue
        if not sensor.identity.passive:
            found.append(RayTemplate(scene, sensor, start))
        start += len(sensor.rays)
    return found


def body_command(message: RigidBodyCmd, body: Body) -> BodyCommand:
    """The command of a ``RigidBodyCmd``; raises ValueError naming what is wrong."""
    kinds = {int(kind) for kind in CommandType}
    if message.cartesian_cmd_type not in kinds:
        raise ValueError(
            f"cartesian_cmd_type is {message.cartesian_cmd_type}; it must be 0 (force), 1 (position) or 2 (velocity)"
        )
    kind = CommandType(message.cartesian_cmd_type)
    if kind is CommandType.POSITION:
        target = pose7(message.pose)
    elif kind is CommandType.VELOCITY:
        target = _six(message.twist.linear, message.twist.angular)
    else:
        target = _six(message.wrench.force, message.wrench.torque)
    count = min(len(message.joint_cmds), len(body.joints))
    types = list(message.joint_cmds_types[:count])
    types += [int(CommandType.FORCE)] * (count - len(types))
    if not set(types) <= kinds:
        raise ValueError("joint_cmds_types must hold 0 (force), 1 (position) or 2 (velocity)")
    return BodyCommand(
        body.index, kind, target, tuple(CommandType(t) for t in types), tuple(message.joint_cmds[:count])
    )


def wishes(message: RigidBodyCmd) -> tuple[bool, bool, bool]:
    """Which lists a command asks for: children names, joint names, joint positions."""
    return message.publish_children_names, message.publish_joint_names, message.publish_joint_positions


def actuator_command(message: ActuatorCmd, index: int) -> ActuatorCommand:
    """The command of an ``ActuatorCmd``."""
    return ActuatorCommand(
        index,
        bool(message.actuate),
        message.body_name.data,
        pose7(message.body_offset) if message.use_offset else None,
        message.sensor_identifier.data if message.use_sensor_data else None,
    )


def place_command(message: Any, kind: str, index: int) -> PlaceCommand:
    """The command of a ``CameraCmd`` or ``LightCmd``."""
    return PlaceCommand(kind, index, pose7(message.pose) if message.enable_position_controller else None)


def _six(linear: Any, angular: Any) -> tuple[float, ...]:
    return (linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
