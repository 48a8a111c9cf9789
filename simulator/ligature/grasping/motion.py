"""Motion of rigid bodies at a point, and their response to impulses there; world axes, SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import quaternion_matrix

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """A body at the start of a tick.

    ``pose`` (7,) is that of its inertial frame, ``twist`` (6,) the one after the tick without
    further impulses; ``inverse_mass`` and ``inverse_inertia`` (3,) are zero for a body that impulses do not move.
    """

    pose: Array
    twist: Array
    inverse_mass: float
    inverse_inertia: Array

    @property
    def rotation(self) -> Array:
        """Rotation (3, 3) of the inertial frame."""
        return quaternion_matrix(self.pose[3:])

    def velocity_at(self, point: Array) -> Array:
        """Velocity (3,) of the body's material at ``point`` (3,), and its angular velocity (3,): (6,)."""
        arm = point - self.pose[:3]
        return np.concatenate([self.twist[:3] + np.cross(self.twist[3:], arm), self.twist[3:]])

    def admittance_at(self, point: Array) -> Array:
        """Change of `velocity_at` (6, 6) for a unit of impulse and moment at ``point``."""
        S = skew(point - self.pose[:3])
        R = self.rotation
        W = (R * self.inverse_inertia) @ R.T
        out = np.zeros((6, 6))
        out[:3, :3] = self.inverse_mass * np.eye(3) - S @ W @ S
        out[:3, 3:], out[3:, :3], out[3:, 3:] = -S @ W, W @ S, W
        return out

    def about_centre(self, impulse: Array, point: Array) -> Array:
        """Impulse and moment (6,) at ``point``, as impulse and moment about the centre of mass."""
        moment = impulse[3:] + np.cross(point - self.pose[:3], impulse[:3])
        return np.concatenate([impulse[:3], moment])


def skew(r: Array) -> Array:
    """Matrix (3, 3) of the vector product with ``r``."""
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def rotation_vector_of(R: Array) -> Array:
    """Rotation vector (3,) of a rotation (3, 3) below half a turn."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine, cosine = 0.5 * float(np.linalg.norm(axis)), 0.5 * (float(np.trace(R)) - 1.0)
    if sine < 1e-9:
        return 0.5 * axis
    return axis * (np.arctan2(sine, cosine) / (2.0 * sine))
