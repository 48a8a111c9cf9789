"""An MTM of a scene: it has no bodies there, so an ideal plant stands for its mechanics."""

from __future__ import annotations

import numpy as np

from ligature.adf import Diagnostic
from ligature.model.scene import ArmDescription, Scene
from ligature.physics import World
from ligature.robots import mtm_arm
from ligature.robots.arm import NO_WRENCH, Arm
from ligature.robots.axes import Axes
from ligature.robots.fitting import console_pose, master_side
from ligature.robots.mtm import Mtm
from ligature.robots.mtm_arm import MtmArm
from ligature.robots.plant import IdealPlant


def build_mtm(scene: Scene, world: World, description: ArmDescription, problems: list[Diagnostic]) -> Arm:
    """The MTM of ``description``, at the console on its side."""
    side = master_side(description.name)
    kinematics = Mtm(side)
    limits = np.array([kinematics.lower, kinematics.upper])
    start = np.clip(mtm_arm.HOME, limits[0], limits[1])
    plant = IdealPlant(limits[0], limits[1], mtm_arm.INERTIA, mtm_arm.DAMPING, start)
    joints = Axes(kinematics.joint_names, limits, mtm_arm.MAX_VELOCITY, mtm_arm.MAX_ACCELERATION, plant)
    ends = mtm_arm.GRIPPER_LIMITS
    fingers = IdealPlant(ends[0], ends[1], np.full(1, 1e-3), np.full(1, 1e-2), np.zeros(1))
    gripper = Axes(("gripper",), ends, np.full(1, 20.0), np.full(1, 200.0), fingers)
    arm = MtmArm(description.name, kinematics, joints, gripper)
    arm.set_base_frame(console_pose(side), f"{scene.world.frame_prefix}HRSV")
    arm.set_tip_wrench(NO_WRENCH)
    return arm
