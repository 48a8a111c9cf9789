"""What an arm listens to: topic, message type, and the command that a message means."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from crtk_msgs.msg import CartesianImpedance, CartesianState, StringStamped
from geometry_msgs.msg import PoseStamped, Quaternion, TwistStamped, WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Empty, Float64, String

from ligature.model.scene import ArmKind
from ligature.robots import commands as crtk
from ligature.robots.commands import ArmCommand

Fields = tuple[Any, ...]
Read = Callable[[Any], Fields]
Take = Callable[[Any], ArmCommand]


def listeners(arm: int, kind: ArmKind) -> list[tuple[str, type, Take]]:
    """Topic, type and converter of every command of an arm."""
    return [
        (topic, type_, _taker(arm, command, read))
        for command, type_, read, *aliases in COMMANDS
        if command.kind in (None, kind)
        for topic in (command.verb, *aliases)
    ]


def _taker(arm: int, command: type[ArmCommand], read: Read) -> Take:
    return lambda message: command(arm, *read(message))


def _position(message: Any) -> Fields:
    return (tuple(message.position),)


def _position_velocity(message: Any) -> Fields:
    """Positions; velocities too when there are any."""
    return tuple(message.position), tuple(message.velocity) or None


def _velocity(message: Any) -> Fields:
    return (tuple(message.velocity),)


def _effort(message: Any) -> Fields:
    return (tuple(message.effort),)


def _xyz(v: Any) -> tuple[float, ...]:
    return v.x, v.y, v.z


def _xyzw(q: Any) -> tuple[float, ...]:
    return q.x, q.y, q.z, q.w


def _seven(pose: Any) -> tuple[float, ...]:
    return _xyz(pose.position) + _xyzw(pose.orientation)


def _pose(message: Any) -> Fields:
    return (_seven(message.pose),)


def _framed_pose(message: Any) -> Fields:
    return _seven(message.pose), message.header.frame_id


def _twist(message: Any) -> Fields:
    return (_xyz(message.twist.linear) + _xyz(message.twist.angular),)


def _wrench(message: Any) -> Fields:
    return (_xyz(message.wrench.force) + _xyz(message.wrench.torque),)


def _data(message: Any) -> Fields:
    return (message.data,)


def _text(message: Any) -> Fields:
    return (message.data[:200],)


def _stamped_text(message: Any) -> Fields:
    return (message.string[:200],)


def _nothing(message: Any) -> Fields:
    return ()


def _quaternion(message: Any) -> Fields:
    return (_xyzw(message),)


def _cartesian_state(message: Any) -> Fields:
    """The parts that the message calls valid."""
    return (
        _seven(message.pose) if message.pose_is_valid.data else None,
        _twist(message)[0] if message.twist_is_valid.data else None,
        _wrench(message)[0] if message.wrench_is_valid.data else None,
    )


def _impedance(message: Any) -> Fields:
    sides = (
        message.position_positive, message.position_negative, message.orientation_positive,
        message.orientation_negative,
    )  # fmt: skip
    gains = [sum((_xyz(gain) for gain in (side.p, side.d, side.bias, side.deadband)), ()) for side in sides]
    return _xyz(message.force_position), _xyzw(message.force_orientation), _xyzw(message.torque_orientation), *gains


COMMANDS: list[tuple[Any, ...]] = [
    (crtk.StateCommand, StringStamped, _stamped_text),
    (crtk.Hold, Empty, _nothing),
    (crtk.Free, Empty, _nothing),
    (crtk.ServoJp, JointState, _position_velocity),
    (crtk.ServoJr, JointState, _position),
    (crtk.ServoJv, JointState, _velocity),
    (crtk.ServoJf, JointState, _effort),
    (crtk.ServoCp, PoseStamped, _pose),
    (crtk.ServoCr, PoseStamped, _pose),
    (crtk.ServoCv, TwistStamped, _twist),
    (crtk.ServoCs, CartesianState, _cartesian_state),
    (crtk.ServoCi, CartesianImpedance, _impedance),
    (crtk.SpatialServoCf, WrenchStamped, _wrench, "servo_cf"),
    (crtk.BodyServoCf, WrenchStamped, _wrench),
    (crtk.BodySetCfOrientationAbsolute, Bool, _data),
    (crtk.UseGravityCompensation, Bool, _data),
    (crtk.MoveJp, JointState, _position),
    (crtk.MoveJr, JointState, _position),
    (crtk.MoveCp, PoseStamped, _pose),
    (crtk.SetBaseFrame, PoseStamped, _framed_pose),
    (crtk.TrajectorySetRatio, Float64, _data),
    (crtk.TrajectorySetRatioV, Float64, _data),
    (crtk.TrajectorySetRatioA, Float64, _data),
    (crtk.JawServoJp, JointState, _position),
    (crtk.JawMoveJp, JointState, _position),
    (crtk.JawServoJf, JointState, _effort),
    (crtk.SetToolType, String, _text),
    (crtk.EmulateAdapterPresent, Bool, _data, "set_adapter_present"),
    (crtk.EmulateToolPresent, Bool, _data, "set_tool_present"),
    (crtk.SetEndoscopeType, String, _text),
    (crtk.LockOrientation, Quaternion, _quaternion),
    (crtk.UnlockOrientation, Empty, _nothing),
    (crtk.GripperServoJp, JointState, _position),
]
"""Command, message type, what reads the command's fields from a message, and further topics of the same command."""
