"""Kinematics of the endoscope manipulator (ECM) and of the camera of the suturing challenge, in closed form.

The base frame of the ECM sits at the remote centre of motion (RCM), z against the shaft at joints zero. The tip frame
of an endoscope looks along its +z, x to the right and y down in the image; that of the challenge's camera looks along
its -z, y up. Joints: yaw, pitch, insertion, roll. Tables:
``ECM.json`` and ``ECM_Si.json`` of the dVRK's sawIntuitiveResearchKit 2.4, and the challenge's ``ecmFK``.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from ligature.kernels import compiled
from ligature.model.frames import axis_rotation, frame
from ligature.robots.chain import HALF_PI, Array, Chain, Convention, Link, advance, identity
from ligature.robots.inverse import (
    DEGENERATE,
    Answers,
    Integers,
    InverseResult,
    Reason,
    aim_shaft,
    first_outside,
    is_rigid,
    pose_rows,
)

JOINT_NAMES = ("yaw", "pitch", "insertion", "roll")
INSERTION, ROLL = 2, 3

RCC, SHAFT = 0.3822, 0.3829
"""Lengths in metres from the carriage to the RCM, and from the carriage to the tip of a scope."""

_LENGTHS = {"Classic_SD": 0.0, "Classic_HD": 0.0, "Si_HD": 0.0, "Custom": 0.18}
_ANGLES = {"STRAIGHT": 0.0, "UP": -np.deg2rad(30.0), "DOWN": np.deg2rad(30.0)}
_FACING = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

ENDOSCOPES = MappingProxyType(
    {
        f"{family}_{view}": frame(_FACING @ axis_rotation((1.0, 0.0, 0.0), angle), (0.0, 0.0, length))
        for family, length in _LENGTHS.items()
        for view, angle in _ANGLES.items()
    }
)
"""Pose T_link4_tip (4, 4) of each endoscope by its CRTK name."""

LIMITS = MappingProxyType(
    {
        "Classic": ((-1.5708, 1.5708), (-0.76794, 1.1344), (0.0, 0.255), (-1.552, 1.552)),
        "Si": ((-2.964, 2.964), (-1.10, 1.04), (0.001, 0.259), (-1.54, 1.54)),
    }
)
"""(low, high) of the joints of each manipulator."""

SRC_LIMITS = ((-1.5, 1.5), (-1.5, 1.5), (-0.1, 0.1), (-1.57, 1.57))
"""(low, high) of the joints of the challenge's camera."""

OFF_THE_LINE = 1e-6
"""Metres by which a pose may miss the line of sight of the challenge's camera."""


def _links(rcc: float, shaft: float) -> tuple[Link, ...]:
    return (
        Link(alpha=HALF_PI, theta=HALF_PI),
        Link(alpha=-HALF_PI, theta=-HALF_PI),
        Link(alpha=HALF_PI, d=-rcc, prismatic=True),
        Link(d=shaft),
    )


class Ecm(Chain):
    """An endoscope camera manipulator.

    Parameters
    ----------
    endoscope
        Name of the endoscope, one of `ENDOSCOPES`.
    model
        "Classic" or "Si". They differ in their limits; the lengths of the Si are not published with them, and are
        those of the Classic here.

    Raises
    ------
    ValueError
        For an unknown endoscope or model.
    """

    def __init__(self, endoscope: str = "Classic_HD_STRAIGHT", model: str = "Classic") -> None:
        if endoscope not in ENDOSCOPES:
            raise ValueError(f"unknown endoscope '{endoscope}'; choose one of {', '.join(ENDOSCOPES)}")
        if model not in LIMITS:
            raise ValueError(f"unknown ECM model '{model}'; choose one of {', '.join(LIMITS)}")
        self.endoscope, self.model = endoscope, model
        super().__init__(JOINT_NAMES, _links(RCC, SHAFT), Convention.MODIFIED, ENDOSCOPES[endoscope], LIMITS[model])

    @property
    def tool_to_rcm(self) -> float:
        """Insertion in metres at which the tip is at the RCM."""
        return RCC - SHAFT - float(self._tip[2, 3])

    @property
    def shaft_in_tip(self) -> Array:
        """Direction (3,) of the shaft, away from the carriage, in axes of the tip."""
        return self._tip[2, :3].copy()

    def depth(self, q: ArrayLike) -> float:
        """Distance in metres from the RCM to the tip along the shaft; negative above the RCM."""
        return float(np.asarray(q)[INSERTION]) - self.tool_to_rcm

    def insertion_at(self, depth: float) -> float:
        """Insertion in metres that puts the tip ``depth`` metres below the RCM."""
        return depth + self.tool_to_rcm

    def inverse(self, T_base_tip: ArrayLike, seed: ArrayLike | None = None) -> InverseResult:
        """Joint values that bring the tip to the position of ``T_base_tip`` (..., 4, 4) and turn the picture alike.

        Four joints cannot give six coordinates: yaw, pitch and insertion take the position, the roll the closest
        orientation; ``residual`` is the angle that remains. ``seed`` is not used: there is one solution. A pose is
        singular with the tip at the RCM, or looking back along the shaft.
        """
        poses, shape = pose_rows(T_base_tip)
        out = Answers(len(poses), 4, shape)
        _inverse_rows(
            self._table, self.tool_to_rcm, self._tip, self._limits, poses, out.q, out.code, out.joint, out.residual
        )
        return out.result()


class SrcCamera(Chain):
    """The camera of the surgical robotics challenge: four joints that displace it from where the scene has it.

    Poses are those of the camera in its initial frame. The challenge's fixed fifth link (alpha pi, theta pi/2) is the
    tip.
    """

    def __init__(self) -> None:
        tip = frame(np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), (0.0, 0.0, 0.0))
        super().__init__(JOINT_NAMES, _links(0.0, 0.0), Convention.MODIFIED, tip, SRC_LIMITS)

    def inverse(self, T_initial_camera: ArrayLike, seed: ArrayLike | None = None) -> InverseResult:
        """Joint values that bring the camera to ``T_initial_camera`` (..., 4, 4).

        The orientation gives yaw, pitch and roll, the way along the line of sight the insertion. A position off that
        line is unreachable. ``seed`` is not used: there is one solution.
        """
        poses, shape = pose_rows(T_initial_camera)
        out = Answers(len(poses), 4, shape)
        _sight_rows(self._table, self._tip, self._limits, poses, out.q, out.code, out.joint)
        return out.result()


@compiled
def _inverse_rows(
    table: Array, tool_to_rcm: float, tip: Array, limits: Array, poses: Array,
    q: Array, code: Integers, joint: Integers, residual: Array,
) -> None:  # fmt: skip
    """Solve each of ``poses`` (m, 4, 4) for the ECM; the last four arrays are written."""
    T3, R4, other = np.empty((4, 4)), np.empty((3, 3)), np.empty(4)
    for k in range(poses.shape[0]):
        T = poses[k]
        joint[k] = -1
        if not is_rigid(T):
            code[k] = Reason.NOT_A_POSE
            q[k] = np.nan
            continue
        below = _branch(table, tool_to_rcm, tip, T, 1.0, T3, R4, q[k])
        if below:
            residual[k] = _remaining_angle(R4, T3)
            joint[k] = first_outside(q[k], limits)
        if below and joint[k] < 0:
            code[k] = Reason.REACHED
        elif _reached_above(table, tool_to_rcm, tip, limits, T, residual[k] if below else np.pi, T3, R4, other):
            code[k] = Reason.ABOVE_REMOTE_CENTRE
        else:
            code[k] = Reason.OUTSIDE_LIMITS if below else Reason.SINGULAR
        if code[k] != Reason.REACHED and code[k] != Reason.OUTSIDE_LIMITS:
            q[k], joint[k], residual[k] = np.nan, -1, 0.0


@compiled
def _reached_above(
    table: Array, tool_to_rcm: float, tip: Array, limits: Array, T: Array, below: float,
    T3: Array, R4: Array, q: Array,
) -> bool:  # fmt: skip
    """Whether a tip above the RCM would do, whatever the insertion, and comes closer to the orientation."""
    if not _branch(table, tool_to_rcm, tip, T, -1.0, T3, R4, q):
        return False
    if _remaining_angle(R4, T3) > below:
        return False
    q[INSERTION] = limits[0, INSERTION]
    return bool(first_outside(q, limits) < 0)


@compiled
def _branch(
    table: Array, tool_to_rcm: float, tip: Array, T: Array, side: float, T3: Array, R4: Array, q: Array
) -> bool:
    """Joint values with the tip below (``side`` +1) or above (-1) the RCM; False where they are undefined.

    ``R4`` (3, 3) is the orientation of the roll link that is asked for, ``T3`` (4, 4) the pose of the link before.
    """
    x, y, z = T[0, 3], T[1, 3], T[2, 3]
    distance = np.sqrt(x * x + y * y + z * z)
    if distance < DEGENERATE:
        return False
    aim_shaft(side * x, side * y, side * z, q)
    q[2] = side * distance + tool_to_rcm
    return bool(_roll(table, tip, T, T3, R4, q))


@compiled
def _roll(table: Array, tip: Array, T: Array, T3: Array, R4: Array, q: Array) -> bool:
    """The roll that comes closest to the orientation of ``T``, into ``q``; False when no roll is closest."""
    identity(T3)
    for j in range(3):
        advance(table[j], True, q[j], T3)
    for i in range(3):
        for j in range(3):
            R4[i, j] = T[i, 0] * tip[j, 0] + T[i, 1] * tip[j, 1] + T[i, 2] * tip[j, 2]
    cosine, sine = 0.0, 0.0
    for i in range(3):
        cosine += T3[i, 0] * R4[i, 0] + T3[i, 1] * R4[i, 1]
        sine += T3[i, 1] * R4[i, 0] - T3[i, 0] * R4[i, 1]
    q[ROLL] = np.arctan2(sine, cosine)
    return bool(sine * sine + cosine * cosine > DEGENERATE**2)


@compiled
def _remaining_angle(R4: Array, T3: Array) -> float:
    """Angle in radians that the closest roll leaves to the orientation asked for: the one between the two shafts."""
    across, along = 0.0, 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across += (T3[j, 2] * R4[k, 2] - T3[k, 2] * R4[j, 2]) ** 2
        along += T3[i, 2] * R4[i, 2]
    return float(np.arctan2(np.sqrt(across), along))


@compiled
def _sight_rows(
    table: Array, tip: Array, limits: Array, poses: Array, q: Array, code: Integers, joint: Integers
) -> None:
    """Solve each of ``poses`` (m, 4, 4) for the challenge's camera; the last three arrays are written."""
    T3, R4 = np.empty((4, 4)), np.empty((3, 3))
    for k in range(poses.shape[0]):
        T = poses[k]
        joint[k] = -1
        q[k] = np.nan
        if not is_rigid(T):
            code[k] = Reason.NOT_A_POSE
            continue
        x, y, z = -T[0, 2], -T[1, 2], -T[2, 2]  # the line of sight, which is that of the shaft
        along = T[0, 3] * x + T[1, 3] * y + T[2, 3] * z
        off = (T[0, 3] - along * x) ** 2 + (T[1, 3] - along * y) ** 2 + (T[2, 3] - along * z) ** 2
        if off > OFF_THE_LINE**2:
            code[k] = Reason.UNREACHABLE
            continue
        aim_shaft(x, y, z, q[k])
        q[k, INSERTION] = along
        _roll(table, tip, T, T3, R4, q[k])
        joint[k] = first_outside(q[k], limits)
        code[k] = Reason.REACHED if joint[k] < 0 else Reason.OUTSIDE_LIMITS
