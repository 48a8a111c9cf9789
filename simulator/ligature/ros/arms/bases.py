"""Base frames that follow the camera, as the console of a dVRK with set-up joints keeps them. Metres.

The tip of one arm, the reference, is the frame in which all others report and take their poses; the reference itself is
in the frame of the cart, which coincides with the world, as in the dVRK.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.model.scene import ArmKind
from ligature.robots.commands import ArmCommand, SetBaseFrame
from ligature.ros.arms.outlet import ArmOutlet

Array = NDArray[np.float64]

CART = "Cart"
MOVED = 1e-9
"""Metres, and parts of an axis, by which a base must have moved in the reference frame to be reported again."""


def bases(outlets: Sequence[ArmOutlet], state: Any) -> dict[str, Array]:
    """Where the bases of arms stand in the world (4, 4), by the arms' names."""
    found = {}
    for outlet in outlets:
        body = outlet.description.base
        found[outlet.description.name] = outlet.T_base if body < 0 else pose7_matrix(state["body_pose"][body])
    return found


def tip(outlets: Sequence[ArmOutlet], state: Any, name: str) -> Array | None:
    """Where the tip of an arm is in the world (4, 4); None when it is not among ``outlets``."""
    for outlet in outlets:
        if outlet.description.name == name:
            local = pose7_matrix(state["arm"][outlet.index]["local_measured_cp"])
            return np.asarray(bases([outlet], state)[name] @ local)
    return None


class BaseFrames:
    """Keeps the base frames of arms; ``push`` sends commands to them."""

    def __init__(
        self, reference: str, outlets: Sequence[ArmOutlet], frame_prefix: str, push: Callable[[ArmCommand], None]
    ) -> None:
        self._reference, self._frame_prefix, self._push = reference, frame_prefix, push
        self._outlets = [outlet for outlet in outlets if outlet.description.kind is not ArmKind.MTM]
        self._sent: dict[str, Array] = {}

    def follow(self, state: Any) -> None:
        """Tell each arm where its base stands in the reference frame, when that has changed."""
        T_world_tip = tip(self._outlets, state, self._reference)
        if T_world_tip is None:
            return
        for name, T_world_base in bases(self._outlets, state).items():
            own = name == self._reference
            T = T_world_base if own else inverse(T_world_tip) @ T_world_base
            if np.abs(T - self._sent.get(name, np.inf)).max() > MOVED:
                self._sent[name] = T
                frame = self._frame_prefix + (CART if own else self._reference)
                index = next(outlet.index for outlet in self._outlets if outlet.description.name == name)
                self._push(SetBaseFrame(index, tuple(matrix_pose7(T).tolist()), frame))
