"""Handles of the legacy ``Object`` messages, which other simulators of the AMBF family still publish."""

from __future__ import annotations

from ambf_msgs.msg import ObjectCmd, ObjectState
from geometry_msgs.msg import Point, Pose, Quaternion

from ligature.client.euler import quaternion_from_euler
from ligature.client.joints import JointedObject


class Object(JointedObject):
    """A body with one mask that selects which joints are driven to positions, the others by efforts."""

    State = ObjectState
    Command = ObjectCmd

    def pose_command(
        self, px: float, py: float, pz: float, roll: float, pitch: float, yaw: float, *joints: float
    ) -> None:
        """Command a pose, and the positions of the first ``joints`` (rad, m).

        At ``px``, ``py``, ``pz`` (m), turned by ``roll``, ``pitch``, ``yaw`` (rad) as in `RigidBody.pose_command`.
        """
        rotation = Quaternion(*quaternion_from_euler(roll, pitch, yaw, "szyx"))
        self.set_pose(Pose(Point(float(px), float(py), float(pz)), rotation))
        with self._lock:
            self._cmd.joint_cmds = [float(value) for value in joints]
            self._cmd.position_controller_mask = [True] * len(joints)

    def set_joint_pos(self, joint_name_or_idx: str | int, pos: float) -> None:
        """Command the position ``pos`` (rad, m) of the joint ``joint_name_or_idx``."""
        self._command_joint(joint_name_or_idx, pos, True)

    def set_joint_effort(self, joint_name_or_idx: str | int, effort: float) -> None:
        """Command the ``effort`` (N m, N) of the joint ``joint_name_or_idx``."""
        self._command_joint(joint_name_or_idx, effort, False)

    def _pose_commanded(self) -> None:
        self._cmd.enable_position_controller = True

    def _wrench_commanded(self) -> None:
        self._cmd.enable_position_controller = False

    def _command_joint(self, joint: str | int, value: float, position: bool) -> None:
        self._write_joint(joint, value, "position_controller_mask", position, False)
