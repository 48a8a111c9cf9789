"""A body of tissue that nothing holds: its rigid body carries the frame that it deforms in; SI units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import Body
from ligature.soft.frame import Frame
from ligature.suture.bodies import SutureBodies
from ligature.tissue.block import TissueBlock
from ligature.tissue.floating import Momentum

Array = NDArray[np.float64]

MAX_SPIN = 100.0
"""Angular velocity in rad/s above which inertial forces of rotation no longer grow."""


class Floating:
    """Hands what a turning frame does to its tissue, and what the tissue's shape does to the turning of the frame."""

    def __init__(self, body: Body, block: TissueBlock) -> None:
        self._body, self._block = body, block
        R = body.T_body_inertial[:3, :3]
        self._inertia = R @ np.diag(body.inertia) @ R.T
        elastic = block.elastic
        self._momentum = Momentum(elastic.mass, elastic.grid.nodes, self._inertia)
        self._share = np.zeros(3)

    def step(self, frame: Frame, moves: bool, bodies: SutureBodies) -> None:
        """End a tick; the nodes ``move`` in every few of them."""
        elastic = self._block.elastic
        if moves:
            speed = float(np.linalg.norm(frame.w))
            elastic.spin[:] = frame.w * min(1.0, MAX_SPIN / max(speed, MAX_SPIN))
        self._block.step()
        if not moves or self._body.static:
            return
        spin, share = self._momentum.share(elastic.x, elastic.v, frame.w, frame.R.T @ self._share)
        self._share[:] = frame.R @ share
        moment = frame.R @ (self._inertia @ (spin - frame.w))
        if moment.any():
            bodies.apply_impulse(self._body.index, np.zeros(3), moment)

    def reset(self) -> None:
        """Forget all motion."""
        self._share[:] = 0.0
        self._block.elastic.spin[:] = 0.0

    def snapshot(self) -> dict[str, Array]:
        """Everything that lasts from tick to tick."""
        return {"share": self._share.copy(), "spin": self._block.elastic.spin.copy()}

    def restore(self, snapshot: dict[str, Array]) -> None:
        """Continue from `snapshot`."""
        self._share[:], self._block.elastic.spin[:] = snapshot["share"], snapshot["spin"]
