"""A PSM of a scene, bound to the joints and fingers that it drives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.arms.tip_wrench import TipWrench
from ligature.arms.travel import travel
from ligature.model.scene import ArmDescription, Scene
from ligature.physics import World
from ligature.robots import psm_arm
from ligature.robots.arm import Arm
from ligature.robots.axes import Axes
from ligature.robots.fitting import psm_kinematics
from ligature.robots.instruments import Instrument
from ligature.robots.plant import Integers
from ligature.robots.psm_arm import PsmArm

Array = NDArray[np.float64]

JAW_STIFFNESS = 1.0
"""N·m per radian of following error with which each finger presses: 18 N at the tips of a needle driver at −20°."""


def build_psm(scene: Scene, world: World, description: ArmDescription, problems: list[Diagnostic]) -> Arm:
    """The PSM of ``description``; what does not fit its kinematics is added to ``problems``."""
    kinematics, problem = psm_kinematics(scene, description)
    if problem:
        mark = scene.bodies[description.base].identity.mark
        problems.append(Diagnostic(Severity.WARNING, f"{description.name}: {problem}", mark, code="arm"))
    joints = Axes(
        kinematics.joint_names, travel(scene, description.joints), psm_arm.MAX_VELOCITY, psm_arm.MAX_ACCELERATION,
        world.drive(description.joints, psm_arm.SERVO_MAX_VELOCITY, psm_arm.SERVO_MAX_DECELERATION),
    )  # fmt: skip
    arm = PsmArm(description.name, kinematics, joints, _jaw(world, description, kinematics.instrument))
    parts = [scene.joints[joint].child for joint in description.joints[-1:]]
    parts += [scene.joints[joint].child for joint in description.jaw]
    arm.set_tip_wrench(TipWrench(world, description, parts, arm))
    return arm


def _jaw(world: World, description: ArmDescription, tool: Instrument) -> Axes | None:
    if len(description.jaw) != 2:
        return None
    plant = JawPlant(world, description.jaw)
    limits = np.array(tool.jaw, dtype=float).reshape(2, 1)
    return Axes(("jaw",), limits, [psm_arm.JAW_MAX_VELOCITY], [psm_arm.JAW_MAX_ACCELERATION], plant)


class JawPlant:
    """Two fingers as one jaw: the opening is shared by both, a jaw's effort acts on each (virtual work)."""

    def __init__(self, world: World, fingers: Sequence[int]) -> None:
        self._drive = world.drive(
            fingers,
            np.full(2, psm_arm.SERVO_MAX_VELOCITY[-1]),
            np.full(2, psm_arm.SERVO_MAX_DECELERATION[-1]),
            JAW_STIFFNESS,
        )

    def read(self) -> Array:
        """Opening, its speed, and effort (3, 1)."""
        (q1, q2), (qd1, qd2), (tau1, tau2) = self._drive.read().tolist()
        return np.array([[q1 + q2], [qd1 + qd2], [0.5 * (tau1 + tau2)]])

    def source(self) -> tuple[None, Integers]:
        """Both fingers."""
        return None, self._drive.source()[1][:, 0].reshape(1, 2)

    def servo(self, position: Array, velocity: Array) -> None:
        """Open to ``position`` (1,); below zero the fingers press."""
        half, speed = float(position[0]) / 2.0, float(velocity[0]) / 2.0
        self._drive.servo(np.array([half, half]), np.array([speed, speed]))

    def push(self, effort: Array) -> None:
        """Turn each finger with ``effort`` (1,)."""
        self._drive.push(np.repeat(effort, 2))

    def free(self) -> None:
        """Let the fingers go limp."""
        self._drive.free()

    def place(self, position: Array) -> None:
        """Put the fingers at an opening at once."""
        self._drive.place(np.repeat(np.maximum(position, 0.0) / 2.0, 2))

    def reset(self) -> None:
        """Nothing: the fingers belong to the physics."""

    def snapshot(self) -> None:
        """Nothing: it is part of the physics."""

    def restore(self, snapshot: None) -> None:
        """Nothing."""
