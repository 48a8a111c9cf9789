"""What an arm publishes at a steady rate: topic, message type, and how the state record fills a message.

Radians, metres, N·m, N; frames as in the dVRK (docs/arms.md).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from ligature.model.scene import ArmKind

Record = Any
Fill = Callable[[Any, Record], None]


class Reading:
    """One topic of an arm: ``message`` is made once and filled anew by `fill` for each publication."""

    def __init__(self, topic: str, message: Any, fill: Fill) -> None:
        self.topic, self.message, self._fill = topic, message, fill

    def filled(self, record: Record, stamp: Any) -> Any:
        """The message of a state record."""
        header = getattr(self.message, "header", None)
        if header is not None:
            header.stamp = stamp
        self._fill(self.message, record)
        return self.message


def readings(kind: ArmKind, joint_names: tuple[str, ...], base: str) -> list[Reading]:
    """All readings of an arm whose base frame is called ``base``."""
    n = len(joint_names)
    found = [
        _joints("setpoint_js", "setpoint_js", joint_names, n),
        _joints("measured_js", "measured_js", joint_names, n),
        _pose("measured_cp", base, True),
        _pose("setpoint_cp", base, True),
        _pose("local/measured_cp", base, False),
        _pose("local/setpoint_cp", base, False),
        _twist("measured_cv", base, True),
        _twist("local/measured_cv", base, False),
        _wrench("body/measured_cf", base),
        _wrench("spatial/measured_cf", base),
        _jacobian("body/jacobian", n),
        _jacobian("spatial/jacobian", n),
        _gravity(joint_names),
    ]
    if kind is ArmKind.PSM:
        found += [
            _one("jaw/measured_js", "jaw", "jaw_measured_js", 3),
            _one("jaw/setpoint_js", "jaw", "jaw_setpoint_js", 1),
        ]
    if kind is ArmKind.MTM:
        found.append(_one("gripper/measured_js", "gripper", "jaw_measured_js", 3))
    return found


def _joints(topic: str, field: str, names: tuple[str, ...], n: int) -> Reading:
    def fill(message: Any, record: Record) -> None:
        position, velocity, effort = record[field][:, :n].tolist()
        message.position, message.velocity, message.effort = position, velocity, effort

    return Reading(topic, JointState(name=list(names)), fill)


def _one(topic: str, name: str, field: str, rows: int) -> Reading:
    """A single joint, with the first ``rows`` of position, velocity and effort."""

    def fill(message: Any, record: Record) -> None:
        values = record[field].tolist()
        message.position = [values[0]]
        if rows == 3:
            message.velocity, message.effort = [values[1]], [values[2]]
        else:
            message.effort = [values[2]]

    return Reading(topic, JointState(name=[name]), fill)


def _gravity(names: tuple[str, ...]) -> Reading:
    def fill(message: Any, record: Record) -> None:
        message.effort = record["gravity_jf"][: len(names)].tolist()

    return Reading("gravity_compensation/setpoint_js", JointState(name=list(names)), fill)


def _frame(message: Any, record: Record, base: str, referred: bool) -> None:
    """Name the frame of a message: the base, or for what is ``referred`` that of ``set_base_frame``, if it was set."""
    reference = record["reference"] if referred else b""
    message.header.frame_id = reference.decode("utf-8", "replace") if reference else base


def _pose(topic: str, base: str, referred: bool) -> Reading:
    field = topic.replace("/", "_")

    def fill(message: Any, record: Record) -> None:
        _frame(message, record, base, referred)
        set_pose(message.pose, record[field])

    return Reading(topic, PoseStamped(), fill)


def set_pose(pose: Any, values: Any) -> None:
    """Write (7,) numbers into a ``geometry_msgs/Pose``."""
    p, q = pose.position, pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = values.tolist()


def _twist(topic: str, base: str, referred: bool) -> Reading:
    field = topic.replace("/", "_")

    def fill(message: Any, record: Record) -> None:
        _frame(message, record, base, referred)
        v, w = message.twist.linear, message.twist.angular
        v.x, v.y, v.z, w.x, w.y, w.z = record[field].tolist()

    return Reading(topic, TwistStamped(), fill)


def _wrench(topic: str, base: str) -> Reading:
    field = topic.replace("/", "_")

    def fill(message: Any, record: Record) -> None:
        _frame(message, record, base, True)
        f, t = message.wrench.force, message.wrench.torque
        f.x, f.y, f.z, t.x, t.y, t.z = record[field].tolist()

    return Reading(topic, WrenchStamped(), fill)


def _jacobian(topic: str, n: int) -> Reading:
    field = topic.replace("/", "_")

    def fill(message: Any, record: Record) -> None:
        message.data = record[field][:, :n].reshape(-1).tolist()

    message = Float64MultiArray()
    message.layout.dim = [MultiArrayDimension("rows", 6, 6 * n), MultiArrayDimension("columns", n, n)]
    return Reading(topic, message, fill)
