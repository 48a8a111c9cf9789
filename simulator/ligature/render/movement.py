"""Where everything stood in the picture before, for optical flow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.render.batches import Instances
from ligature.render.camera import CameraView


class Movement:
    """Matrices from pieces to clip coordinates of the last picture of each size."""

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], NDArray[np.float32]] = {}

    def before(self, instances: Instances, view: CameraView) -> NDArray[np.float32]:
        """The matrices (n, 4, 4) of the picture before, columns first; those of this one when it is the first.

        A thread counts as standing still in itself, since its surface has no fixed points.
        """
        now = (view.projection @ view.view @ instances.T_world_piece).swapaxes(1, 2).astype("f4")
        size = (view.width, view.height)
        last = self._last.get(size, now)
        self._last[size] = now
        return last
