"""An endoscope camera manipulator as a CRTK arm. Metres, radians."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.robots.arm import Arm, damped_inverse
from ligature.robots.axes import Axes
from ligature.robots.ecm import ENDOSCOPES, INSERTION, Ecm
from ligature.robots.operating_state import Rejected

Array = NDArray[np.float64]

HOME = np.array([0.0, 0.0, 0.12, 0.0])
MAX_VELOCITY = np.array([np.pi / 6, np.pi / 6, 0.06, np.pi / 6])
MAX_ACCELERATION = np.array([np.pi / 2, np.pi / 2, 0.06, np.pi / 2])
"""Limits of moves."""

SERVO_MAX_VELOCITY = np.array([4.0, 4.0, 0.6, 4.0])
SERVO_MAX_DECELERATION = np.array([50.0, 50.0, 20.0, 100.0])
"""Speeds and decelerations with which the drives catch up with a set-point at most."""

FOLLOWING_BOUND = np.array([0.6, 0.6, 0.06, 1.5])

LEAST_INSERTION = 0.04
"""Insertion in metres that inverse kinematics keeps."""


class EcmArm(Arm):
    """An ECM with its endoscope."""

    kind = "ECM"
    kinematics: Ecm

    def __init__(self, name: str, kinematics: Ecm, joints: Axes) -> None:
        super().__init__(name, kinematics, joints, HOME, FOLLOWING_BOUND)
        self.emit("endoscope_type", kinematics.endoscope)

    _KEPT = (*Arm._KEPT, "kinematics")

    def set_endoscope_type(self, endoscope: str) -> None:
        """Change the endoscope, which turns the picture of UP and DOWN scopes; NONE keeps the straight one.

        Raises `Rejected` for an unknown one.
        """
        if endoscope not in ENDOSCOPES:
            raise Rejected(f"unknown endoscope '{endoscope}'; choose one of {', '.join(ENDOSCOPES)}")
        self.kinematics = Ecm(endoscope, self.kinematics.model)
        self.emit("endoscope_type", endoscope)

    def _solve(self, pose: ArrayLike, what: str) -> Array:
        q = super()._solve(pose, what)
        q[INSERTION] = max(q[INSERTION], LEAST_INSERTION)
        return q

    def _joint_velocity(self, q: Array, twist: Array) -> Array:
        """Joint velocities for the tip's velocity and its rotation about the shaft; four joints make no other."""
        shaft = self.kinematics.shaft_in_tip
        jacobian = self.kinematics.jacobian_body(q)
        rows = np.vstack([jacobian[:3], shaft @ jacobian[3:]])
        return damped_inverse(rows, np.append(twist[:3], shaft @ twist[3:]))
