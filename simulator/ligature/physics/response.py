"""How much a spring or damper on one axis of a joint has to move, for limits on what explicit ticks can bear.

Frames I and A as in `ligature.model.scene`; SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.adf.frames import axis_rotation
from ligature.model.axis import Axis

Array = NDArray[np.float64]

TURNS = np.linspace(0.0, 2.0 * np.pi, 4, endpoint=False)
"""Positions of a turning axis at which the moved inertia is looked at: it varies with the angle between the arms."""


def moved_inertia(
    masses: tuple[float, float], inertias: tuple[Array, Array], T_inertial_frames: tuple[Array, Array],
    axes: tuple[Axis, ...], index: int,
) -> float:  # fmt: skip
    """Mass, or moment of inertia, that an effort along ``axes[index]`` between two free bodies moves at least.

    By Gauss's principle every further joint of either body only adds to it, so that it holds in any tree.

    Parameters
    ----------
    masses, inertias
        Of both bodies; principal moments (3,) about their inertial frames.
    T_inertial_frames
        The joint's frames (4, 4) in the two inertial frames; they coincide at joint position zero.
    axes
        The free axes of the joint, in order; directions in the joint's frame.
    index
        The axis in question.
    """
    turning = [axis.direction for axis in axes if not axis.prismatic]
    angles = [(direction, angle) for direction in turning for angle in TURNS] or [(np.eye(3)[2], 0.0)]
    return 1.0 / max(
        _response(masses, inertias, T_inertial_frames, axes, index, axis_rotation(*turn)) for turn in angles
    )


def _response(
    masses: tuple[float, float], inertias: tuple[Array, Array], T_inertial_frames: tuple[Array, Array],
    axes: tuple[Axis, ...], index: int, turn: Array,
) -> float:  # fmt: skip
    """Acceleration along an axis for a unit of effort, with the second body turned by ``turn`` (3, 3)."""
    compliance = np.zeros((6, 6))
    for mass, inertia, T, R in zip(masses, inertias, T_inertial_frames, (np.eye(3), turn), strict=True):
        arm = R @ T[:3, :3].T @ T[:3, 3]
        into = R @ T[:3, :3].T
        across = np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])
        rotary = (into / inertia) @ into.T
        compliance[:3, :3] += np.eye(3) / mass + across @ rotary @ across.T
        compliance[:3, 3:] += across @ rotary
        compliance[3:, :3] += rotary @ across.T
        compliance[3:, 3:] += rotary
    free = np.zeros((6, len(axes)))
    for column, axis in enumerate(axes):
        free[slice(0, 3) if axis.prismatic else slice(3, 6), column] = axis.direction
    # Efforts of the locked directions keep the motion within the free ones: M = F' C^-1 F.
    stiff = free.T @ np.linalg.solve(compliance, free)
    return float(np.linalg.inv(stiff)[index, index])
