"""Where everything stood in the picture before, for optical flow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.render.batches import Batch, Instances
from ligature.render.camera import CameraView


class Movement:
    """Matrices from pieces to clip coordinates, and vertices of what deforms, of the last picture of each size."""

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], tuple[NDArray[np.float32], list[NDArray[np.float64]]]] = {}

    def before(self, instances: Instances, view: CameraView, deforming: Sequence[Batch]) -> NDArray[np.float32]:
        """The matrices (n, 4, 4) of the picture before, columns first; those of this one when it is the first.

        Each of the batches ``deforming`` gets the places that its vertices had. Points of a thread's surface stay on
        their element.
        """
        now = (view.projection @ view.view @ instances.T_world_piece).swapaxes(1, 2).astype("f4")
        places = [batch.triangles.positions for batch in deforming]
        size = (view.width, view.height)
        matrices, past = self._last.get(size, (now, places))
        self._last[size] = now, places
        for batch, positions in zip(deforming, past, strict=True):
            batch.load_past(positions)
        return matrices
