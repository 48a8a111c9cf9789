"""What stands still before a camera that stands still, kept so that it is not drawn again.

On a software rasteriser most of a picture's time goes into light, and most of a picture shows tables, phantoms and
walls. A picture of these alone is kept, with its depth. The next pictures begin with it; what moves is drawn over it,
and what stands still only in the pixels where something that moves may throw a shadow on it or off it. All others
would be the same to the last bit.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.render.batches import Batch, Instances
from ligature.render.lights import Lights, ShadowView
from ligature.render.stirred import cells_of, chosen, stir, stirred_cells
from ligature.render.target import Target

MOST, MOST_PIXELS = 8, 4_200_000
"""Pictures that are kept, of all cameras together, and their pixels, of which each takes 20 bytes; with more cameras
that take turns, none would be there any more when it is needed, and none is kept."""

Draw = Callable[[Target, moderngl.Framebuffer], None]

Box = tuple[int, int, int, int]
"""Left, bottom, width and height in pixels."""


@dataclass(frozen=True, eq=False)
class Kept:
    """A picture of ``batches`` alone: what is in a target's textures, and which cell of each shadow map a pixel reads.

    ``depths`` (h, w) and ``cells`` (h, w) for each shadow map count rows upwards.
    """

    batches: frozenset[Batch]
    contents: dict[str, NDArray[Any]]
    depths: NDArray[np.float32]
    cells: tuple[NDArray[np.int32], ...]

    def begin(self, target: Target, stirred: Sequence[NDArray[np.uint8]]) -> Box | None:
        """Begin a picture with this one; returns where it is still to be drawn, about the cells that are ``stirred``.

        Pixels that read such a cell are given the greatest depth.
        """
        depths, box = self.depths, None
        for cells, places in zip(stirred, self.cells, strict=True):
            depths, (left, low, right, high) = chosen(depths, places, cells.reshape(-1))
            if left <= right:
                corner = (left, low, right, high) if box is None else (
                    min(left, box[0]), min(low, box[1]), max(right, box[2]), max(high, box[3])
                )  # fmt: skip
                box = corner
        target.fill(self.contents, depths)
        return None if box is None else (box[0], box[1], box[2] - box[0] + 1, box[3] - box[1] + 1)


class Keeper:
    """The pictures that are kept of one scene."""

    def __init__(self, context: moderngl.Context, lights: Lights) -> None:
        self._context, self._lights = context, lights
        self._kept: OrderedDict[Hashable, Kept] = OrderedDict()
        self._seen_once: OrderedDict[Hashable, None] = OrderedDict()
        self._stirred: dict[Hashable, NDArray[np.uint8]] = {}
        self._moment = b""

    def __len__(self) -> int:
        return len(self._kept)

    def forget(self) -> None:
        """Keep nothing: surfaces have changed."""
        self._kept.clear()
        self._seen_once.clear()

    def kept(
        self, target: Target, picture: Hashable, keepable: frozenset[Batch], instances: Instances, draw: Draw
    ) -> Kept | None:
        """What is kept of ``keepable`` for a ``picture`` that is drawn to ``target``; None for nothing.

        ``picture`` names all that it depends on beside lights and places. When it is asked for the second time, the
        picture to keep is drawn: ``draw`` draws it, in the shadows of what stands still alone, to a target and the
        places in shadow maps that it reads to a buffer.
        """
        slots = min(MOST, MOST_PIXELS // (target.size[0] * target.size[1]))
        if not slots:
            return None
        key = (target.size, tuple(target.passes), picture, keepable, self._standing(instances))
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        if key not in self._seen_once:
            _add(self._seen_once, key, None, slots)
            return None
        del self._seen_once[key]
        places = self._context.texture(target.size, 4, dtype="f4")
        blank = Target(self._context, target.size, target.passes, 0)
        draw(blank, blank.with_places(places))
        width, height = target.size
        read = np.frombuffer(places.read(), dtype="f4").reshape(height, width, 4)
        cells = tuple(
            cells_of(read[..., 2 * k : 2 * k + 2], shadow.size) for k, shadow in enumerate(self._lights.shadow_views)
        )
        kept = Kept(keepable, blank.contents(), blank.depths().copy(), cells)  # `chosen` takes what can be written
        _add(self._kept, key, kept, slots)
        return kept

    def _standing(self, instances: Instances) -> Hashable:
        """Where everything stands that stands still, and all that the lights do."""
        still = instances.still
        return still.tobytes(), instances.T_world_piece[still].tobytes(), self._lights.content()

    def stirred(self, moment: bytes, casters: Sequence[Batch], instances: Instances) -> list[NDArray[np.uint8]]:
        """The cells of each shadow map that those of ``casters`` that move at ``moment`` may reach; once for it."""
        if moment != self._moment:
            self._moment, self._stirred = moment, {}
        moving = [batch for batch in casters if not is_still(batch, instances)]
        return [self._stirred_by(moving, instances, shadow) for shadow in self._lights.shadow_views]

    def _stirred_by(self, moving: Sequence[Batch], instances: Instances, shadow: ShadowView) -> NDArray[np.uint8]:
        key = (shadow.index, shadow.size, shadow.projection.tobytes(), shadow.view.tobytes())
        if key not in self._stirred:
            cells = self._stirred[key] = stirred_cells(shadow.size)
            for batch in moving:
                triangles = batch.triangles
                for T_world_piece in instances.T_world_piece[batch.rows]:
                    to_clip = (shadow.projection @ shadow.view @ T_world_piece)[[0, 1, 3]]
                    stir(cells, triangles.positions @ to_clip[:, :3].T + to_clip[:, 3], triangles.faces)
        return self._stirred[key]


def is_still(batch: Batch, instances: Instances) -> bool:
    """Whether nothing of a batch has moved for long."""
    return batch.rays is None and bool(instances.still[batch.rows].all())


def _add(least_recent_first: OrderedDict[Hashable, Any], key: Hashable, value: Any, most: int) -> None:
    least_recent_first[key] = value
    while len(least_recent_first) > most:
        least_recent_first.popitem(last=False)
