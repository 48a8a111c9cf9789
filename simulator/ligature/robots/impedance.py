"""Springs and dampers around a pose, of different stiffness on the two sides of each axis. SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.robots.poses import rotation_vector

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CartesianImpedance:
    """Springs and dampers around a pose, as ``crtk_msgs/CartesianImpedance`` describes them.

    ``force_position`` (3,) is where the springs rest and ``R_force`` (3, 3) the axes they act along; ``R_torque``
    (3, 3) is the orientation at which the torsion springs rest, in the reference frame. ``gains`` (4, 4, 3) hold
    stiffness, damping, bias and dead band along x, y, z on the positive and negative side of the position, then of
    the orientation; negative stiffness pulls back, negative damping brakes.
    """

    force_position: Array
    R_force: Array
    R_torque: Array
    gains: Array

    def wrench(self, T_base_reference: Array, T_base_tip: Array, twist: Array) -> Array:
        """Wrench (6,) in base axes about the tip, for a tip that moves with ``twist`` (6,) in base axes."""
        R = T_base_reference[:3, :3]
        axes = R @ self.R_force
        goal = T_base_reference[:3, :3] @ self.force_position + T_base_reference[:3, 3]
        force = axes @ _half_planes(axes.T @ (T_base_tip[:3, 3] - goal), axes.T @ twist[:3], *self.gains[:2])
        axes = R @ self.R_torque
        turned_by = rotation_vector(axes.T @ T_base_tip[:3, :3])
        torque = axes @ _half_planes(turned_by, axes.T @ twist[3:], *self.gains[2:])
        return np.concatenate([force, torque])


def _half_planes(offset: Array, speed: Array, positive: Array, negative: Array) -> Array:
    """Force (3,) of springs that differ on their two sides; gains (4, 3) as in `CartesianImpedance`."""
    p, d, bias, band = np.where(offset >= 0.0, positive, negative)
    beyond = np.sign(offset) * np.maximum(np.abs(offset) - band, 0.0)
    pulled: Array = p * beyond + d * speed + bias
    return pulled
