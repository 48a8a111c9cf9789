"""Joints as chains of single axes: how a joint of the format becomes links of a Bullet tree.

A joint relates constraint frame A (on the parent) to frame B (on the child): ``D = A^-1 B`` has the
translation (x, y, z) along A and the rotation ``Rz(θz) Ry(θy) Rx(θx)`` (as in AMBF).
Axes are unit vectors in frame A; coordinates 0-2 are metres, 3-5 radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.model.axis import Axis
from ligature.model.scene import Joint, JointType

Array = NDArray[np.float64]

_ORDER = (0, 1, 2, 5, 4, 3)
"""Translations first, then rotations about z, y and x, each in the frame that the former ones made."""


def axes_of(joint: Joint) -> tuple[Axis, ...] | None:
    """The free axes of a joint in order; empty when it locks the bodies, None when it is no tree joint."""
    x, z = np.eye(3)[0], np.eye(3)[2]
    if joint.type is JointType.REVOLUTE:
        return (Axis(False, z, *_useful(joint.low, joint.high)),)
    if joint.type is JointType.PRISMATIC:
        return (Axis(True, x, joint.low, joint.high),)
    if joint.type is JointType.FIXED:
        return ()
    if joint.type in (JointType.LINEAR_SPRING, JointType.TORSION_SPRING):
        if joint.low is None and not joint.freed:
            return ()
        linear = joint.type is JointType.LINEAR_SPRING
        return (Axis(linear, z, joint.low, joint.high, joint.stiffness, joint.damping, joint.equilibrium),)
    if joint.type is JointType.CONE_TWIST:
        assert joint.cone_twist is not None
        limits = joint.cone_twist
        return tuple(Axis(False, np.eye(3)[i], -limits[i], limits[i]) for i in (2, 1, 0))
    if joint.type in (JointType.SIX_DOF, JointType.SIX_DOF_SPRING):
        return _six(joint)
    return None


def _useful(low: float | None, high: float | None) -> tuple[float | None, float | None]:
    """Limits of a revolute joint that allow a full turn are none."""
    if low is None or high is None or high - low >= 2 * np.pi:
        return None, None
    return low, high


def _six(joint: Joint) -> tuple[Axis, ...]:
    """Free axes; one that is locked elsewhere than at zero is an axis whose limits meet there."""
    six = joint.six_dof
    assert six is not None
    axes = []
    for i in _ORDER:
        low, high = float(six.low[i]), float(six.high[i])
        if low == high == 0.0:
            continue
        limits: tuple[float | None, float | None] = (None, None) if low > high else (low, high)
        axes.append(
            Axis(
                i < 3, np.eye(3)[i % 3], limits[0],
                limits[1], float(six.stiffness[i]), float(six.damping[i]),
                float(six.equilibrium[i]),
            )
        )  # fmt: skip
    return tuple(axes)
