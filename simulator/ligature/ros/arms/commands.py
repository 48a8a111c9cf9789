"""What an arm listens to: topic, message type, and the command that a message means."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from crtk_msgs.msg import CartesianImpedance, CartesianState, StringStamped
from geometry_msgs.msg import PoseStamped, Quaternion, TwistStamped, WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Empty, Float64, String

from ligature.model.commands import ArmCommand
from ligature.model.scene import ArmKind

Take = Callable[[Any], ArmCommand]


def listeners(arm: int, kind: ArmKind) -> list[tuple[str, type, Take]]:
    """Topic, type and converter of every command of an arm."""
    table = [*_COMMON, *_OF_KIND[kind]]
    return [(topic, type_, _taker(arm, verb, numbers)) for topic, type_, verb, numbers in table]


def _taker(arm: int, verb: str, numbers: Callable[[Any], tuple[tuple[float, ...], str]]) -> Take:
    def take(message: Any) -> ArmCommand:
        values, text = numbers(message)
        return ArmCommand(arm, verb, values, text)

    return take


Numbers = tuple[tuple[float, ...], str]


def _position(message: Any) -> Numbers:
    return tuple(message.position), ""


def _position_velocity(message: Any) -> Numbers:
    """Positions; velocities behind them when there are as many."""
    position, velocity = tuple(message.position), tuple(message.velocity)
    return (position + velocity if len(velocity) == len(position) else position), ""


def _velocity(message: Any) -> Numbers:
    return tuple(message.velocity), ""


def _effort(message: Any) -> Numbers:
    return tuple(message.effort), ""


def _pose_numbers(pose: Any) -> tuple[float, ...]:
    p, q = pose.position, pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _pose(message: Any) -> Numbers:
    return _pose_numbers(message.pose), ""


def _framed_pose(message: Any) -> Numbers:
    return _pose_numbers(message.pose), message.header.frame_id[:64]


def _six(linear: Any, angular: Any) -> tuple[float, ...]:
    return linear.x, linear.y, linear.z, angular.x, angular.y, angular.z


def _twist(message: Any) -> Numbers:
    return _six(message.twist.linear, message.twist.angular), ""


def _wrench(message: Any) -> Numbers:
    return _six(message.wrench.force, message.wrench.torque), ""


def _flag(message: Any) -> Numbers:
    return (float(message.data),), ""


def _text(message: Any) -> Numbers:
    return (), message.data[:200]


def _stamped_text(message: Any) -> Numbers:
    return (), message.string[:200]


def _nothing(message: Any) -> Numbers:
    return (), ""


def _quaternion(message: Any) -> Numbers:
    return (message.x, message.y, message.z, message.w), ""


def _cartesian_state(message: Any) -> Numbers:
    """Numbers of all three parts; the text names those that are valid (`ligature.robots.dispatch`)."""
    valid = (message.pose_is_valid.data, message.twist_is_valid.data, message.wrench_is_valid.data)
    letters = "".join(letter for letter, given in zip("ptw", valid, strict=True) if given)
    values = _pose_numbers(message.pose) + _six(message.twist.linear, message.twist.angular)
    return values + _six(message.wrench.force, message.wrench.torque), letters


def _impedance(message: Any) -> Numbers:
    """Numbers in the order of `ligature.robots.dispatch`."""
    p = message.force_position
    values: list[float] = [p.x, p.y, p.z]
    for q in (message.force_orientation, message.torque_orientation):
        values += [q.x, q.y, q.z, q.w]
    sides = (
        message.position_positive, message.position_negative, message.orientation_positive,
        message.orientation_negative,
    )  # fmt: skip
    for side in sides:
        for gain in (side.p, side.d, side.bias, side.deadband):
            values += [gain.x, gain.y, gain.z]
    return tuple(values), ""


_COMMON: list[tuple[str, type, str, Callable[[Any], Numbers]]] = [
    ("state_command", StringStamped, "state_command", _stamped_text),
    ("hold", Empty, "hold", _nothing),
    ("free", Empty, "free", _nothing),
    ("servo_jp", JointState, "servo_jp", _position_velocity),
    ("servo_jr", JointState, "servo_jr", _position),
    ("servo_jv", JointState, "servo_jv", _velocity),
    ("servo_jf", JointState, "servo_jf", _effort),
    ("servo_cp", PoseStamped, "servo_cp", _pose),
    ("servo_cv", TwistStamped, "servo_cv", _twist),
    ("servo_cs", CartesianState, "servo_cs", _cartesian_state),
    ("servo_ci", CartesianImpedance, "servo_ci", _impedance),
    ("servo_cf", WrenchStamped, "spatial/servo_cf", _wrench),
    ("spatial/servo_cf", WrenchStamped, "spatial/servo_cf", _wrench),
    ("body/servo_cf", WrenchStamped, "body/servo_cf", _wrench),
    ("body/set_cf_orientation_absolute", Bool, "body/set_cf_orientation_absolute", _flag),
    ("use_gravity_compensation", Bool, "use_gravity_compensation", _flag),
    ("move_jp", JointState, "move_jp", _position),
    ("move_jr", JointState, "move_jr", _position),
    ("move_cp", PoseStamped, "move_cp", _pose),
    ("set_base_frame", PoseStamped, "set_base_frame", _framed_pose),
    ("trajectory_j/set_ratio", Float64, "trajectory_j/set_ratio", _flag),
    ("trajectory_j/set_ratio_v", Float64, "trajectory_j/set_ratio_v", _flag),
    ("trajectory_j/set_ratio_a", Float64, "trajectory_j/set_ratio_a", _flag),
]

_OF_KIND: dict[ArmKind, list[tuple[str, type, str, Callable[[Any], Numbers]]]] = {
    ArmKind.PSM: [
        ("jaw/servo_jp", JointState, "jaw/servo_jp", _position),
        ("jaw/move_jp", JointState, "jaw/move_jp", _position),
        ("jaw/servo_jf", JointState, "jaw/servo_jf", _effort),
        ("set_tool_type", String, "set_tool_type", _text),
        ("emulate_adapter_present", Bool, "emulate_adapter_present", _flag),
        ("emulate_tool_present", Bool, "emulate_tool_present", _flag),
        ("set_adapter_present", Bool, "emulate_adapter_present", _flag),
        ("set_tool_present", Bool, "emulate_tool_present", _flag),
    ],
    ArmKind.ECM: [("set_endoscope_type", String, "set_endoscope_type", _text)],
    ArmKind.MTM: [
        ("lock_orientation", Quaternion, "lock_orientation", _quaternion),
        ("unlock_orientation", Empty, "unlock_orientation", _nothing),
        ("gripper/servo_jp", JointState, "gripper/servo_jp", _position),
    ],
}
