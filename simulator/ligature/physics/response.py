"""How much a spring or damper on one axis of a joint has to move, for limits on what explicit ticks can bear.

Frames I and A as in `ligature.model.scene`; SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.adf.frames import axis_rotation
from ligature.model.axis import Axis

Array = NDArray[np.float64]

TURNS = (-np.pi / 2, 0.0, np.pi / 2, np.pi)
"""Positions of a turning axis, or its limits before, at which the moved inertia is looked at: it varies with them."""

MAX_COUPLING = 2.0
"""By how much efforts along several axes may help each other: a damper that stops an axis within 1.25 ticks is stable
with twice its damping."""


def moved_inertias(
    masses: tuple[float, float], inertias: tuple[Array, Array], T_inertial_frames: tuple[Array, Array],
    axes: tuple[Axis, ...],
) -> Array:  # fmt: skip
    """Masses, or moments of inertia, (n,) that efforts along the ``axes`` of a joint move at least, all acting at once.

    By Gauss's principle every further joint of either body only adds to them, so that they hold in any tree. Efforts
    along several axes help each other where the body turns about a centre of mass away from the joint: with M the
    mass matrix of the axes and D that of the returned values, no eigenvalue of M^-1 D exceeds `MAX_COUPLING`, so that
    springs and dampers which are stable for each of them alone are so together.

    Parameters
    ----------
    masses, inertias
        Of both bodies; principal moments (3,) about their inertial frames. A body of mass 0 stays where it is.
    T_inertial_frames
        The joint's frames (4, 4) in the two inertial frames; they coincide at joint position zero.
    axes
        The free axes of the joint, in order; directions in the joint's frame. Only those with springs act.
    """
    turning = [axis for axis in axes if not axis.prismatic]
    angles = [(axis.direction, _clamped(axis, angle)) for axis in turning for angle in TURNS] or [(np.eye(3)[2], 0.0)]
    sprung = np.array([axis.sprung for axis in axes])
    responses = [_response(masses, inertias, T_inertial_frames, axes, axis_rotation(*turn)) for turn in angles]
    moved = 1.0 / np.max([np.diag(response) for response in responses], axis=0)
    scale = np.sqrt(moved[sprung])
    together = [np.linalg.eigvalsh(scale[:, None] * response[np.ix_(sprung, sprung)] * scale) for response in responses]
    moved[sprung] /= max(1.0, float(np.max(together, initial=1.0)) / MAX_COUPLING)
    return np.asarray(moved)


def _clamped(axis: Axis, angle: float) -> float:
    """``angle``, clipped to the limits of an axis."""
    return angle if axis.low is None or axis.high is None else min(max(angle, axis.low), axis.high)


def _response(
    masses: tuple[float, float], inertias: tuple[Array, Array], T_inertial_frames: tuple[Array, Array],
    axes: tuple[Axis, ...], turn: Array,
) -> Array:  # fmt: skip
    """Accelerations (n, n) along the axes for units of effort; the second body is turned by ``turn`` (3, 3)."""
    compliance = np.zeros((6, 6))
    for mass, inertia, T, R in zip(masses, inertias, T_inertial_frames, (np.eye(3), turn), strict=True):
        if mass == 0.0:
            continue
        arm = R @ T[:3, :3].T @ T[:3, 3]
        R_joint_inertial = R @ T[:3, :3].T
        skew = np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])
        inverse_inertia = (R_joint_inertial / inertia) @ R_joint_inertial.T
        compliance[:3, :3] += np.eye(3) / mass + skew @ inverse_inertia @ skew.T
        compliance[:3, 3:] += skew @ inverse_inertia
        compliance[3:, :3] += inverse_inertia @ skew.T
        compliance[3:, 3:] += inverse_inertia
    free = np.zeros((6, len(axes)))
    for column, axis in enumerate(axes):
        free[slice(0, 3) if axis.prismatic else slice(3, 6), column] = axis.direction
    # Efforts of the locked directions keep the motion within the free ones: M = F' C^-1 F.
    return np.asarray(np.linalg.inv(free.T @ np.linalg.solve(compliance, free)))
