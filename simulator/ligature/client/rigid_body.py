"""Handles of rigid bodies: poses, twists and wrenches in world axes, and the joints below the body.

Metres, radians, newtons, newton metres, seconds.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

from ambf_msgs.msg import RigidBodyCmd, RigidBodyState
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3

from ligature.client.euler import quaternion_from_euler
from ligature.client.joints import JointedObject, components, vector

FORCE, POSITION, VELOCITY = RigidBodyCmd.TYPE_FORCE, RigidBodyCmd.TYPE_POSITION, RigidBodyCmd.TYPE_VELOCITY


class RigidBody(JointedObject):
    """A rigid body. Its newest Cartesian setter decides whether pose, twist or wrench is commanded."""

    State = RigidBodyState
    Command = RigidBodyCmd
    object_type, body_type = "RIGID_BODY", "DYNAMIC"
    _twisted = False

    def get_linear_vel(self) -> Vector3:
        """Velocity of the centre of mass."""
        return self._state.twist.linear

    def get_angular_vel(self) -> Vector3:
        """Angular velocity."""
        return self._state.twist.angular

    def get_linear_velocity_command(self) -> Vector3:
        """The commanded velocity, or the measured one while none was commanded."""
        return (self._cmd if self._twisted else self._state).twist.linear

    def get_angular_velocity_command(self) -> Vector3:
        """The commanded angular velocity, or the measured one while none was commanded."""
        return (self._cmd if self._twisted else self._state).twist.angular

    def set_linear_vel(self, vx: float, vy: float, vz: float) -> None:
        """Command a velocity ``vx``, ``vy``, ``vz`` (m/s); the angular one stays the commanded one."""
        self.set_twist(Twist(vector(vx, vy, vz), self._cmd.twist.angular))

    def set_angular_vel(self, ax: float, ay: float, az: float) -> None:
        """Command an angular velocity ``ax``, ``ay``, ``az`` (rad/s); the linear one stays the commanded one."""
        self.set_twist(Twist(self._cmd.twist.linear, vector(ax, ay, az)))

    def set_twist(self, twist: Twist) -> None:
        """Command linear and angular velocity."""
        if not self._takes(*components(twist.linear), *components(twist.angular)):
            return
        with self._lock:
            self._cmd.twist = copy.deepcopy(twist)
            self._cmd.cartesian_cmd_type = VELOCITY
            self._twisted = True

    def velocity_command(
        self, vx: float, vy: float, vz: float, ax: float, ay: float, az: float, *_joints: float
    ) -> None:
        """Command linear ``vx``, ``vy``, ``vz`` (m/s) and angular velocity ``ax``, ``ay``, ``az`` (rad/s)."""
        self.set_twist(Twist(vector(vx, vy, vz), vector(ax, ay, az)))

    def pose_command(
        self, px: float, py: float, pz: float, roll: float, pitch: float, yaw: float, *_joints: float
    ) -> None:
        """Command a pose at ``px``, ``py``, ``pz`` (m).

        Its turns (rad) are about fixed z by ``roll``, y by ``pitch``, x by ``yaw``, in that order.

        AMBF's clients turn so in this call alone; `set_rpy` turns about x, y, z.
        """
        rotation = Quaternion(*quaternion_from_euler(roll, pitch, yaw, "szyx"))
        self.set_pose(Pose(Point(float(px), float(py), float(pz)), rotation))

    def get_joint_vel(self, joint_name_or_idx: str | int) -> float | None:
        """Velocity of a joint; None, with a message, when there is none of that name or index."""
        return self._value(self._listed.joint_velocities, joint_name_or_idx)

    def get_joint_effort(self, joint_name_or_idx: str | int) -> float | None:
        """Torque or force of a joint; None, with a message, when there is none of that name or index."""
        return self._value(self._listed.joint_efforts, joint_name_or_idx)

    def get_all_joint_vel(self) -> list[float]:
        """Velocities of all joints."""
        return list(self._listed.joint_velocities)

    def get_all_joint_effort(self) -> list[float]:
        """Torques and forces of all joints."""
        return list(self._listed.joint_efforts)

    def set_joint_pos(self, joint_name_or_idx: str | int, pos: float) -> None:
        """Command the position ``pos`` (rad, m) of the joint ``joint_name_or_idx``.

        Joints before it that were never commanded are commanded a force of zero: they go limp.
        """
        self._command_joint(joint_name_or_idx, pos, POSITION)

    def set_joint_vel(self, joint_name_or_idx: str | int, vel: float) -> None:
        """Command the velocity ``vel`` (rad/s, m/s) of the joint ``joint_name_or_idx``.

        Other joints as in `set_joint_pos`.
        """
        self._command_joint(joint_name_or_idx, vel, VELOCITY)

    def set_joint_effort(self, joint_name_or_idx: str | int, effort: float) -> None:
        """Command the ``effort`` (N m, N) of the joint ``joint_name_or_idx``; other joints as in `set_joint_pos`."""
        self._command_joint(joint_name_or_idx, effort, FORCE)

    def set_multiple_joint_pos(self, joints_pos: Sequence[float], joints_idx: Sequence[int]) -> None:
        """Command ``joints_pos`` (rad, m).

        One for each of ``joints_idx``, or of all joints, of which ``joints_idx`` are meant.
        """
        self._command_joints(joints_pos, joints_idx, POSITION)

    def set_multiple_joint_vel(self, joints_vel: Sequence[float], joints_idx: Sequence[int]) -> None:
        """Command ``joints_vel`` (rad/s, m/s) of ``joints_idx``, given as in `set_multiple_joint_pos`."""
        self._command_joints(joints_vel, joints_idx, VELOCITY)

    def set_multiple_joint_effort(self, joints_effort: Sequence[float], joints_idx: Sequence[int]) -> None:
        """Command ``joints_effort`` (N m, N) of ``joints_idx``, given as in `set_multiple_joint_pos`."""
        self._command_joints(joints_effort, joints_idx, FORCE)

    def _pose_commanded(self) -> None:
        self._cmd.cartesian_cmd_type = POSITION

    def _wrench_commanded(self) -> None:
        self._cmd.cartesian_cmd_type = FORCE

    def _command_joints(self, values: Sequence[float], joints: Sequence[int], kind: int) -> None:
        if len(values) != len(joints):
            # AMBF's own client reads the values of all joints by index
            if any(joint >= len(values) for joint in joints):
                raise ValueError(
                    f"{self._name}: {len(values)} values cannot command the joints {list(joints)}; give one for each"
                )
            values = [values[joint] for joint in joints]
        with self._lock:
            for joint, value in zip(joints, values, strict=True):
                self._command_joint(joint, value, kind)

    def _command_joint(self, joint: str | int, value: float, kind: int) -> None:
        self._write_joint(joint, value, "joint_cmds_types", kind, FORCE)
