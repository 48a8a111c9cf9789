"""A master tool manipulator as a CRTK arm: gripper and locked orientation. Metres, radians.

It has no bodies: it goes where it is commanded, and yields to efforts and to its weight as a damped inertia.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.model.frames import quaternion_matrix
from ligature.robots.arm import Arm, JointState
from ligature.robots.axes import Axes, Mode
from ligature.robots.mtm import Mtm
from ligature.robots.mtm_weight import MAX_EFFORT, weight
from ligature.robots.operating_state import Rejected
from ligature.robots.plant import IdealPlant
from ligature.robots.poses import numbers_of, rotation_vector

Array = NDArray[np.float64]

HOME = np.zeros(7)
MAX_VELOCITY = np.array([np.pi / 2] * 6 + [2 * np.pi])
MAX_ACCELERATION = np.array([np.pi / 4] * 6 + [2 * np.pi])
"""Limits of moves."""

FOLLOWING_BOUND = np.full(7, np.inf)
INERTIA = np.array([0.15, 0.15, 0.1, 0.02, 0.01, 0.01, 0.005])
DAMPING = np.array([0.6, 0.6, 0.4, 0.1, 0.05, 0.05, 0.03])
"""Of each joint in kg·m² and N·m·s: those of a light arm of half a metre that a hand stops within a second."""

GRIPPER_LIMITS = np.array([[-0.698132], [1.047198]])
"""Opening of the gripper; pressed beyond closed it is negative (as in the dVRK)."""

CLOSED = 0.0
"""Opening at which the gripper counts as closed."""

LOCK_STIFFNESS, LOCK_DAMPING = 3.0, 0.3
"""N·m/rad and N·m·s/rad with which a locked orientation is kept."""


class MtmArm(Arm):
    """A master arm."""

    kind = "MTM"
    kinematics: Mtm

    def __init__(self, name: str, kinematics: Mtm, joints: Axes, gripper: Axes) -> None:
        self.gripper = gripper
        self._closed = False
        self._locked: Array | None = None
        super().__init__(name, kinematics, joints, HOME, FOLLOWING_BOUND)
        gripper.servo(np.zeros(1))

    _KEPT = (*Arm._KEPT, "_closed", "_locked")

    def outline(self) -> tuple[str, ...]:
        """See `Arm.outline`; the gripper's mode, too."""
        return *super().outline(), "gripper.mode"

    def gripper_measured_js(self) -> JointState:
        """Opening of the gripper, its speed and effort, each (1,)."""
        return JointState(*self.gripper.measured().copy())

    def gripper_servo_jp(self, angle: ArrayLike) -> None:
        """Press or open the simulated gripper, as an operator's fingers do."""
        self.gripper.servo(self.gripper.checked(angle, "gripper/servo_jp"))
        closed = bool(self.gripper.measured()[0, 0] <= CLOSED)
        if closed != self._closed:
            self._closed = closed
            self.emit("gripper/closed", closed)
            if closed:
                self.emit("gripper/pinch", None)

    def lock_orientation(self, quaternion: ArrayLike) -> None:
        """Keep an orientation (4,) of `measured_cp` while the arm yields to efforts.

        Raises `Rejected` unless it is a finite quaternion of length 1, to 10 percent.
        """
        values = numbers_of(quaternion, "lock_orientation").reshape(-1)
        if len(values) != 4 or not np.isfinite(values).all() or not 0.9 <= np.linalg.norm(values) <= 1.1:
            raise Rejected(f"lock_orientation takes a quaternion of length 1, not {values.tolist()}")
        R = quaternion_matrix(values / np.linalg.norm(values))
        self._locked = self._T_reference_base[:3, :3].T @ R
        self.emit("orientation_locked", True)

    def unlock_orientation(self) -> None:
        """Let the orientation go."""
        self._locked = None
        self.emit("orientation_locked", False)

    def free(self) -> None:
        """Let the joints move freely, their weight carried; a locked orientation is kept."""
        super().free()
        self.gravity_compensation = True
        self._pushing = "body/servo_cf", np.zeros(6)

    def _wrench_on_tip(self, T: Array, what: str, push: Any) -> Array:
        wrench = super()._wrench_on_tip(T, what, push)
        if self._locked is not None:
            away = rotation_vector(T[:3, :3] @ self._locked.T)
            torque = -LOCK_STIFFNESS * away - LOCK_DAMPING * self.local_measured_cv()[3:]
            wrench[3:] += T[:3, :3].T @ torque
        return wrench

    def gravity_jf(self) -> Array:
        """Efforts (7,) that carry the arm's weight where it is."""
        return weight(self.joints.measured()[0])

    @property
    def is_idle(self) -> bool:
        """See `Device.is_idle`; an arm that yields to efforts is not."""
        return self.joints.mode is not Mode.EFFORT and super().is_idle

    def _advance(self, dt: float) -> None:
        super()._advance(dt)
        plant = self.joints.plant
        assert isinstance(plant, IdealPlant)
        if self.joints.mode is Mode.EFFORT:
            load = self.gravity_jf()
            effort = self.joints.setpoint[2] + load if self.gravity_compensation else self.joints.setpoint[2]
            plant.push(np.clip(effort, -MAX_EFFORT, MAX_EFFORT))
            plant.step(dt, load)
