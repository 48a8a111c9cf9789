"""Services of an arm: its state on demand, forward and inverse kinematics (as in the dVRK)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
from cisst_msgs.srv import ConvertFloat64Array, ConvertFloat64ArrayResponse
from crtk_msgs.srv import (
    QueryForwardKinematics,
    QueryForwardKinematicsResponse,
    QueryInverseKinematics,
    QueryInverseKinematicsResponse,
    TriggerOperatingState,
    TriggerOperatingStateResponse,
)
from geometry_msgs.msg import Pose
from numpy.typing import NDArray
from std_srvs.srv import Trigger, TriggerResponse

from ligature.model.frames import matrix_pose7, pose7_matrix
from ligature.robots.arm import Kinematics
from ligature.ros.arms.events import EventTopics
from ligature.ros.arms.readings import set_pose

Array = NDArray[np.float64]
CRTK_VERSION = "1.1.0"

SERVICES: dict[str, type] = {
    "operating_state": TriggerOperatingState,
    "crtk_version": Trigger,
    "forward_kinematics": QueryForwardKinematics,
    "local/forward_kinematics": QueryForwardKinematics,
    "inverse_kinematics": QueryInverseKinematics,
    "actuator_to_joint_position": ConvertFloat64Array,
}
"""Services of every arm."""


class Services:
    """The services of one arm.

    ``kinematics`` answers with those of the instrument that is on now, ``base`` with the pose (4, 4) of the base in
    the reference frame.
    """

    def __init__(
        self, root: str, events: EventTopics, kinematics: Callable[[], Kinematics], base: Callable[[], Array]
    ) -> None:
        self._kinematics, self._base = kinematics, base
        answers: dict[str, Callable[[Any], Any]] = {
            "operating_state": lambda _: TriggerOperatingStateResponse(events.state()),
            "crtk_version": lambda _: TriggerResponse(True, CRTK_VERSION),
            "forward_kinematics": lambda request: self._forward(request, self._base()),
            "local/forward_kinematics": lambda request: self._forward(request, np.eye(4)),
            "inverse_kinematics": self._inverse,
            "actuator_to_joint_position": self._convert,
        }
        self._services = [rospy.Service(f"{root}/{name}", type_, answers[name]) for name, type_ in SERVICES.items()]

    def close(self) -> None:
        """Answer no more; a service that another node has registered since is left to it."""
        for service in self._services:
            service.shutdown()

    def _forward(self, request: Any, base: Array) -> QueryForwardKinematicsResponse:
        kinematics, cp = self._kinematics(), Pose()
        cp.orientation.w = 1.0
        n = len(kinematics.joint_names)
        jp = np.array(request.jp, dtype=float)
        if len(jp) > n:
            return QueryForwardKinematicsResponse(cp, False, "too many joints")
        if not np.isfinite(jp).all():
            return QueryForwardKinematicsResponse(cp, False, "joint values must be finite")
        set_pose(cp, matrix_pose7(base @ kinematics.forward(np.concatenate([jp, np.zeros(n - len(jp))]))))
        return QueryForwardKinematicsResponse(cp, True, "")

    def _inverse(self, request: Any) -> QueryInverseKinematicsResponse:
        kinematics = self._kinematics()
        p, q = request.cp.position, request.cp.orientation
        pose = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
        if len(request.jp) != len(kinematics.joint_names):
            return QueryInverseKinematicsResponse([], False, "incorrect number of joints")
        if not np.isfinite(pose).all() or not 0.9 < np.linalg.norm(pose[3:]) < 1.1:
            return QueryInverseKinematicsResponse([], False, "inverse kinematics failed: not a pose")
        pose[3:] /= np.linalg.norm(pose[3:])
        result = kinematics.inverse(pose7_matrix(pose), np.array(request.jp, dtype=float))
        if not result.ok:
            return QueryInverseKinematicsResponse([], False, f"inverse kinematics failed: {result.reason}")
        return QueryInverseKinematicsResponse(result.q.tolist(), True, "")

    def _convert(self, request: Any) -> ConvertFloat64ArrayResponse:
        """Return the input: actuators of the simulated arm are its joints."""
        return ConvertFloat64ArrayResponse(request.input)
