"""An ECM of a scene: one with joints, or only the body that carries its cameras."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic
from ligature.arms.travel import travel
from ligature.model.frames import matrix_pose7
from ligature.model.scene import ArmDescription, Scene
from ligature.physics import World
from ligature.robots import ecm_arm
from ligature.robots.arm import Arm
from ligature.robots.axes import Axes
from ligature.robots.ecm import Ecm
from ligature.robots.ecm_arm import EcmArm
from ligature.robots.fitting import T_TIP_CAMERA, camera_arm_base
from ligature.robots.plant import NO_AXES, Integers

Array = NDArray[np.float64]


def build_ecm(scene: Scene, world: World, description: ArmDescription, problems: list[Diagnostic]) -> Arm:
    """The ECM of ``description``, with the narrower of its own and the scene's joint limits."""
    kinematics = Ecm()
    limits = np.array([kinematics.lower, kinematics.upper])
    if description.joints:
        low, high = travel(scene, description.joints)
        limits = np.array([np.maximum(limits[0], low), np.minimum(limits[1], high)])
        plant: Any = world.drive(description.joints, ecm_arm.SERVO_MAX_VELOCITY, ecm_arm.SERVO_MAX_DECELERATION)
    else:
        plant = CameraPlant(scene, world, description.tip, kinematics, ecm_arm.HOME)
    joints = Axes(kinematics.joint_names, limits, ecm_arm.MAX_VELOCITY, ecm_arm.MAX_ACCELERATION, plant)
    return EcmArm(description.name, kinematics, joints)


class CameraPlant:
    """An ECM of which a scene has only the body that carries the cameras: moved as the arm would move it.

    The base stands where the scene's camera pose is that of the home pose.
    """

    def __init__(self, scene: Scene, world: World, body: int, kinematics: Ecm, start: Array) -> None:
        self._world, self._body, self._kinematics = world, body, kinematics
        self._T_world_base = camera_arm_base(scene, body, kinematics, start)
        self._start = start
        self._state = np.zeros((3, len(start)))
        self._state[0] = start

    def read(self) -> Array:
        """Joint values, velocities and zero efforts (3, 4)."""
        return self._state

    def source(self) -> tuple[Array, Integers]:
        """The same."""
        return self._state, NO_AXES

    def servo(self, position: Array, velocity: Array) -> None:
        """Put the camera where the joint values have it."""
        self._state[1] = velocity
        if (position != self._state[0]).any():
            self._state[0] = position
            pose = self._T_world_base @ self._kinematics.forward(position) @ T_TIP_CAMERA
            self._world.set_pose(self._body, matrix_pose7(pose))

    def push(self, effort: Array) -> None:
        """Nothing pushes a camera without an arm: it stays."""
        self._state[1] = 0.0

    def free(self) -> None:
        """It stays."""
        self._state[1] = 0.0

    def place(self, position: Array) -> None:
        """Put the camera where the joint values have it."""
        self.servo(position, np.zeros(len(position)))

    def reset(self) -> None:
        """The scene put the camera back."""
        self._state[:] = 0.0
        self._state[0] = self._start

    def snapshot(self) -> Array:
        """The joint values that the camera's pose stands for."""
        return self._state.copy()

    def restore(self, snapshot: Array) -> None:
        """Continue from `snapshot`."""
        self._state[:] = snapshot
