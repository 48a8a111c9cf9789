"""The kinematics of the arms of a scene: which known arm has links of these lengths, and where it stands.

World axes, metres, radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import frame, inverse, rpy_matrix
from ligature.model.scene import ArmDescription, ArmKind, Body, Joint, Scene
from ligature.robots.arm import Kinematics
from ligature.robots.ecm import Ecm
from ligature.robots.ecm_arm import HOME as ECM_HOME
from ligature.robots.instruments import Instrument, instrument
from ligature.robots.mtm import Mtm
from ligature.robots.psm import MODELS, Psm, PsmLengths

Array = NDArray[np.float64]

DEFAULT_TOOL = "400006"
"""The instrument that the suturing challenge assumes where a scene names none."""

ALIKE = 2e-4
"""Metres by which the links of a scene may differ from a known arm's to count as that arm."""

T_TIP_CAMERA = frame(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 0.0))
"""A body that carries cameras looks along -z with y up, the tip of an ECM along +z with y down."""


def kinematics_of(scene: Scene, description: ArmDescription) -> Kinematics:
    """The kinematics of an arm."""
    if description.kind is ArmKind.PSM:
        return psm_kinematics(scene, description)[0]
    return Ecm() if description.kind is ArmKind.ECM else Mtm(master_side(description.name))


def base_pose(scene: Scene, description: ArmDescription) -> Array:
    """Pose (4, 4) of an arm's base in the world, as the scene starts; of a master in the console's frame."""
    if description.kind is ArmKind.MTM:
        return console_pose(master_side(description.name))
    if description.base < 0:
        return camera_arm_base(scene, description.tip, Ecm(), ECM_HOME)
    return scene.bodies[description.base].T_world_body


def master_side(name: str) -> str:
    """Which hand a master arm is for."""
    return "left" if name.upper().endswith("L") else "right"


def console_pose(side: str) -> Array:
    """Where a master stands before the operator's view (as in the dVRK), (4, 4)."""
    x = 0.180 if side == "left" else -0.180
    return frame(rpy_matrix(5.0 * np.pi / 6.0, 0.0, np.pi), (x, 0.400, 0.475))


def camera_arm_base(scene: Scene, body: int, kinematics: Ecm, start: Array) -> Array:
    """Base (4, 4) of an ECM of which there is only the camera body, which the scene has where ``start`` puts it."""
    return scene.bodies[body].T_world_body @ inverse(kinematics.forward(start) @ T_TIP_CAMERA)


def psm_kinematics(scene: Scene, description: ArmDescription) -> tuple[Psm, str]:
    """The PSM with its instrument, and what was wrong with the name of the instrument, if anything."""
    lengths, problem = _lengths(scene, description), ""
    try:
        tool = instrument(description.tool or DEFAULT_TOOL)
    except ValueError as error:
        tool = instrument(DEFAULT_TOOL)
        problem = f"{error}; using {tool.type}"
    return _known(tool, lengths) or Psm(tool, lengths=lengths), problem


def _lengths(scene: Scene, description: ArmDescription) -> PsmLengths:
    """The lengths of an arm as its joints have them, at joint values zero.

    The palm is where the wrist pitch axis passes the roll axis, the RCM the origin of the base body.
    """
    lines = _axis_lines(scene, description)
    origin = scene.bodies[description.base].T_world_body[:3, 3]
    inwards = lines[2][1]
    roll, pitch, yaw = lines[3], lines[4], lines[5]
    palm = _closest(roll, pitch)
    wrist = float(abs(np.dot(yaw[0] - pitch[0], _unit(np.cross(pitch[1], yaw[1])))))
    depth = float(np.dot(palm - origin, inwards))
    rcc = 0.4318
    return PsmLengths(rcc, rcc + depth, wrist)


def _axis_lines(scene: Scene, description: ArmDescription) -> list[tuple[Array, Array]]:
    """A point (3,) and the direction (3,) of each joint axis in world axes, all joints at zero."""
    T = scene.bodies[description.base].T_world_body
    lines = []
    for index in description.joints:
        joint: Joint = scene.joints[index]
        parent: Body = scene.bodies[joint.parent]
        T_inertial = T @ parent.T_body_inertial
        lines.append(((T_inertial @ joint.T_parent_a)[:3, 3], T_inertial[:3, :3] @ joint.axis))
        T = T @ joint.T_parent_child_zero
    return lines


def _closest(line: tuple[Array, Array], other: tuple[Array, Array]) -> Array:
    """The point (3,) of ``line`` that is closest to the ``other`` line."""
    normal = np.cross(line[1], other[1])
    along = float(np.dot(np.cross(other[0] - line[0], other[1]), normal) / np.dot(normal, normal))
    return np.asarray(line[0] + along * line[1])


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _known(tool: Instrument, lengths: PsmLengths) -> Psm | None:
    """The known arm that has these lengths, so that its published values hold to the last digit."""
    for model in reversed(MODELS):
        try:
            known = Psm(tool, model)
        except ValueError:
            continue
        reach = abs(known.lengths.tool_to_rcm - lengths.tool_to_rcm)
        if reach < ALIKE and abs(known.lengths.wrist - lengths.wrist) < ALIKE:
            return known
    return None
