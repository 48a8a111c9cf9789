"""Kinematics of the patient side manipulator with a three-joint wrist, in closed form.

The base frame sits at the remote centre of motion (RCM), z against the shaft at joints zero. Joints: yaw, pitch,
insertion, roll, wrist pitch, wrist yaw. Points: *palm*, where roll and wrist pitch axes meet at the end of the
shaft; *pinch*, on the wrist yaw axis, ``wrist`` from the palm. Tables: ``PSM.json`` and
``PSM_Si.json`` of the dVRK's sawIntuitiveResearchKit 2.4, and the challenge's own. Equations: Munawar and others,
Open Simulation Environment for Learning and Practice of Robot-Assisted Surgical Suturing (2022), section III-D.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from ligature.kernels import compiled
from ligature.robots.chain import HALF_PI, Array, Chain, Convention, Link, advance, identity
from ligature.robots.instruments import Instrument, instrument
from ligature.robots.inverse import (
    DEGENERATE,
    Answers,
    Integers,
    InverseResult,
    Reason,
    aim_shaft,
    first_outside,
    is_rigid,
    nearest_turn,
    pose_rows,
    seed_rows,
)

JOINT_NAMES = ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")
INSERTION, ROLL = 2, 3

Limits = tuple[float, float]


@dataclass(frozen=True)
class PsmLengths:
    """The three lengths in metres that distinguish one PSM and instrument from another.

    ``rcc`` from the insertion carriage at insertion zero to the RCM, ``shaft`` from the carriage to the palm,
    ``wrist`` from the palm to the wrist yaw axis.
    """

    rcc: float
    shaft: float
    wrist: float

    @property
    def tool_to_rcm(self) -> float:
        """Insertion at which the palm is at the RCM (L_tool2rcm in Munawar and others, eq. 10)."""
        return self.rcc - self.shaft


@dataclass(frozen=True)
class Manipulator:
    """What a PSM is without its instrument: ``rcc`` as in `PsmLengths`, (low, high) of its three joints."""

    rcc: float
    yaw: Limits
    pitch: Limits
    insertion: Limits


MANIPULATORS = MappingProxyType(
    {
        "Classic": Manipulator(0.4318, (-1.588, 1.588), (-0.925025, 0.925025), (0.0, 0.24)),
        "Si": Manipulator(0.4826, (-2.964, 2.964), (-1.265, 1.301), (0.0, 0.29)),
    }
)
"""The manipulators of the research kit."""

SRC_LENGTHS = MappingProxyType({400006: PsmLengths(0.4389, 0.416, 0.009), 420006: PsmLengths(0.4318, 0.4826, 0.009)})
"""Lengths with which the surgical robotics challenge models its two instruments."""

SRC_ROLL = (-3.05433, 3.05433)
"""Roll limits of the challenge's solver."""

MODELS = (*MANIPULATORS, "SRC")
"""Values for the ``model`` of a `Psm`."""


class Psm(Chain):
    """A patient side manipulator with an instrument.

    Parameters
    ----------
    tool
        The instrument, or its number or tool type.
    model
        "Classic" or "Si" for the manipulators of the research kit; "SRC" for the arm of the surgical robotics
        challenge, which carries instruments 400006 and 420006 with lengths of its own.
    lengths
        Lengths of this very arm, where they are other than the model's.

    Raises
    ------
    ValueError
        For an unknown instrument or model, and for "SRC" with an instrument that the challenge does not have.
    """

    def __init__(self, tool: Instrument | str | int, model: str = "Classic", lengths: PsmLengths | None = None) -> None:
        self.instrument = tool if isinstance(tool, Instrument) else instrument(tool)
        self.model = model
        self.lengths = lengths or _lengths(self.instrument, model)
        arm = MANIPULATORS.get(model, MANIPULATORS["Classic"])
        limits = [arm.yaw, arm.pitch, arm.insertion, *zip(self.instrument.lower, self.instrument.upper, strict=True)]
        if model == "SRC":
            limits[ROLL] = SRC_ROLL
        tip = np.eye(4)
        tip[:3, :3] = self.instrument.R_wrist_tip
        links = (
            Link(alpha=HALF_PI, theta=HALF_PI),
            Link(alpha=-HALF_PI, theta=-HALF_PI),
            Link(alpha=HALF_PI, d=-self.lengths.rcc, prismatic=True),
            Link(d=self.lengths.shaft),
            Link(alpha=-HALF_PI, theta=-HALF_PI),
            Link(alpha=-HALF_PI, a=self.lengths.wrist, theta=-HALF_PI),
        )
        super().__init__(JOINT_NAMES, links, Convention.MODIFIED, tip, limits)

    def depth(self, q: ArrayLike) -> float:
        """Distance in metres from the RCM to the palm along the shaft; negative above the RCM."""
        return float(np.asarray(q)[INSERTION]) - self.lengths.tool_to_rcm

    def insertion_at(self, depth: float) -> float:
        """Insertion in metres that puts the palm ``depth`` metres below the RCM."""
        return depth + self.lengths.tool_to_rcm

    def inverse(self, T_base_tip: ArrayLike, seed: ArrayLike | None = None) -> InverseResult:
        """Joint values that bring the tip to ``T_base_tip`` (..., 4, 4).

        The positions follow eqs. 4-10 of Munawar and others; roll and wrist follow from the remaining rotation, by
        arctangents alone, so that small angles are not rounded (eqs. 12-14 lose those below 1.4 mrad). The solution is
        unique within the limits but for whole turns of the roll, which stays closest to that of ``seed`` (6,) or
        (..., 6), or zero.
        A pose is singular when the wrist yaw axis or the palm passes through the RCM.
        """
        poses, shape = pose_rows(T_base_tip)
        out = Answers(len(poses), 6, shape)
        _inverse_rows(
            self._table, self.lengths.tool_to_rcm, self._tip, self._limits, poses, seed_rows(seed, 6, len(poses)),
            out.q, out.code, out.joint,
        )  # fmt: skip
        return out.result()

    def solve(self, T_base_tip: Array, seed: Array, q: Array) -> Reason:
        """`inverse` of one pose (4, 4) in a third of the time: it writes ``q`` (6,), and returns its code."""
        code = _inverse_pose(self._table, self.lengths.tool_to_rcm, self._tip, self._limits, T_base_tip, seed, q)
        return Reason(code)


def _lengths(tool: Instrument, model: str) -> PsmLengths:
    if model in MANIPULATORS:
        return PsmLengths(MANIPULATORS[model].rcc, *tool.lengths)
    if model != "SRC":
        raise ValueError(f"unknown PSM model '{model}'; choose one of {', '.join(MODELS)}")
    if tool.id not in SRC_LENGTHS:
        known = " and ".join(map(str, SRC_LENGTHS))
        raise ValueError(f"the arm of the challenge carries instruments {known}, not {tool.type}")
    return SRC_LENGTHS[tool.id]


@compiled
def _inverse_rows(
    table: Array, tool_to_rcm: float, tip: Array, limits: Array, poses: Array, seeds: Array,
    q: Array, code: Integers, joint: Integers,
) -> None:  # fmt: skip
    """Solve each of ``poses`` (m, 4, 4); the last three arrays are written."""
    R, T3, x5, other = np.empty((3, 3)), np.empty((4, 4)), np.empty(3), np.empty(6)
    for k in range(poses.shape[0]):
        T = poses[k]
        roll = seeds[k if seeds.shape[0] > 1 else 0, ROLL]
        joint[k] = -1
        if not is_rigid(T):
            code[k] = Reason.NOT_A_POSE
        elif not _wrist_frame(T, tip, R, x5) or not _branch(
            table, tool_to_rcm, limits, T, R, x5, 1.0, 1.0, roll, T3, q[k]
        ):
            code[k] = Reason.SINGULAR
        else:
            joint[k] = first_outside(q[k], limits)
            if joint[k] < 0:
                code[k] = Reason.REACHED
            elif _reached_above(table, tool_to_rcm, limits, T, R, x5, roll, T3, other):
                joint[k] = -1
                code[k] = Reason.ABOVE_REMOTE_CENTRE
            else:
                code[k] = Reason.OUTSIDE_LIMITS
        if code[k] != Reason.REACHED and code[k] != Reason.OUTSIDE_LIMITS:
            q[k] = np.nan


@compiled
def _inverse_pose(
    table: Array, tool_to_rcm: float, tip: Array, limits: Array, pose: Array, seed: Array, q: Array
) -> int:
    """Solve one ``pose`` (4, 4) near ``seed`` (6,); ``q`` (6,) is written, and its code returned."""
    poses, seeds, rows = np.empty((1, 4, 4)), np.zeros((1, 6)), np.empty((1, 6))
    code, joint = np.empty(1, np.int64), np.empty(1, np.int64)
    poses[0] = pose
    if np.isfinite(seed[ROLL]):
        seeds[0, ROLL] = seed[ROLL]
    _inverse_rows(table, tool_to_rcm, tip, limits, poses, seeds, rows, code, joint)
    q[:] = rows[0]
    return code[0]  # type: ignore[no-any-return]


@compiled
def _wrist_frame(T: Array, tip: Array, R: Array, x5: Array) -> bool:
    """Rotation R (3, 3) of the wrist yaw link, and the unit vector x5 (3,) from palm to pinch (eqs. 5, 6).

    The palm lies in the plane of the RCM and the wrist yaw axis, so the vector is the one from the RCM to the pinch
    without its part along that axis. False when nothing is left of it.
    """
    for i in range(3):
        for j in range(3):
            R[i, j] = T[i, 0] * tip[j, 0] + T[i, 1] * tip[j, 1] + T[i, 2] * tip[j, 2]
    along = T[0, 3] * R[0, 2] + T[1, 3] * R[1, 2] + T[2, 3] * R[2, 2]
    for i in range(3):
        x5[i] = T[i, 3] - along * R[i, 2]
    length = np.sqrt(x5[0] ** 2 + x5[1] ** 2 + x5[2] ** 2)
    if length < DEGENERATE:
        return False
    for i in range(3):
        x5[i] /= length
    return True


@compiled
def _branch(
    table: Array, tool_to_rcm: float, limits: Array, T: Array, R: Array, x5: Array, towards: float, side: float,
    roll: float, T3: Array, q: Array,
) -> bool:  # fmt: skip
    """Joint values of one branch; False with the palm at the RCM.

    ``towards`` is the sign of x5, ``side`` +1 for the palm below the RCM and -1 above.
    """
    reach = towards * table[5, 2]
    px, py, pz = T[0, 3] - reach * x5[0], T[1, 3] - reach * x5[1], T[2, 3] - reach * x5[2]
    distance = np.sqrt(px * px + py * py + pz * pz)
    if distance < DEGENERATE:
        return False
    aim_shaft(side * px, side * py, side * pz, q)
    q[2] = side * distance + tool_to_rcm
    identity(T3)
    for j in range(3):
        advance(table[j], True, q[j], T3)
    # the wrist is bent by more than a right angle where the pinch lies behind the palm
    bent = 1.0 if towards * side * (px * x5[0] + py * x5[1] + pz * x5[2]) >= 0.0 else -1.0
    # T3ᵀ R = RotZ(q4) [s5 s6, s5 c6, c5; c6, -s6, 0; c5 s6, c5 c6, -s5] names these entries
    m02 = bent * (T3[0, 0] * R[0, 2] + T3[1, 0] * R[1, 2] + T3[2, 0] * R[2, 2])
    m12 = bent * (T3[0, 1] * R[0, 2] + T3[1, 1] * R[1, 2] + T3[2, 1] * R[2, 2])
    m20 = bent * (T3[0, 2] * R[0, 0] + T3[1, 2] * R[1, 0] + T3[2, 2] * R[2, 0])
    m21 = bent * (T3[0, 2] * R[0, 1] + T3[1, 2] * R[1, 1] + T3[2, 2] * R[2, 1])
    m22 = T3[0, 2] * R[0, 2] + T3[1, 2] * R[1, 2] + T3[2, 2] * R[2, 2]
    q[3] = nearest_turn(np.arctan2(m12, m02), roll, limits[0, 3], limits[1, 3])
    q[4] = np.arctan2(-m22, bent * np.sqrt(m02 * m02 + m12 * m12))
    q[5] = np.arctan2(m20, m21)
    return True


@compiled
def _reached_above(
    table: Array, tool_to_rcm: float, limits: Array, T: Array, R: Array, x5: Array, roll: float, T3: Array, q: Array
) -> bool:
    """Whether a palm above the RCM would do, whatever the insertion."""
    for towards in (1.0, -1.0):
        if _branch(table, tool_to_rcm, limits, T, R, x5, towards, -1.0, roll, T3, q):
            q[INSERTION] = limits[0, INSERTION]
            if first_outside(q, limits) < 0:
                return True
    return False
