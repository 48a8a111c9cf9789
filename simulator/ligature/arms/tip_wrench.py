"""What contacts, grasps and threads exert on an instrument, for ``measured_cf``."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.model.scene import ArmDescription
from ligature.physics import World
from ligature.robots.arm import Arm

Array = NDArray[np.float64]


class TipWrench:
    """What the world exerts on the instrument, in base axes about the tip."""

    def __init__(self, world: World, description: ArmDescription, bodies: Sequence[int], arm: Arm) -> None:
        self._world, self._base, self._bodies, self._arm = world, description.base, tuple(bodies), arm

    @cached_property
    def group(self) -> int:
        """The bit in `ContactWrenches.felt` without which it is zero."""
        return self._world.wrenches.group(self._bodies)

    def __call__(self) -> Array:
        """Force (N) and moment (N m), (6,)."""
        wrenches = self._world.wrenches
        if not wrenches.felt() & self.group:
            return np.zeros(6)
        T_world_base = pose7_matrix(self._world.pose7(self._base))
        tip = T_world_base @ self._arm.kinematics.forward(self._arm.joints.measured()[0])
        wrench = wrenches.on(self._bodies, tip[:3, 3])
        R = T_world_base[:3, :3].T
        return np.concatenate([R @ wrench[:3], R @ wrench[3:]])
