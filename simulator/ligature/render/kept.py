"""What stands still before a camera that stands still, kept so that it is not drawn again.

On a software rasteriser most of a picture's time goes into light, and most of a picture shows tables, phantoms and
walls. A picture of these alone is kept, with its depth. The next pictures begin with it; what moves is drawn over it,
and what stands still only in the pixels where something that moves may throw a shadow on it or off it. All others
would be the same to the last bit.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.render.batches import Batch, Instances
from ligature.render.context import DepthCopy
from ligature.render.lights import Lights, ShadowView
from ligature.render.stirred import Readers, box_of, cells_of, far_at, stir, stirred_cells
from ligature.render.target import Target

MOST, MOST_PIXELS = 8, 4_200_000
"""Pictures that are kept, of all cameras together, and their pixels, of which each takes 28 bytes; with more cameras
that take turns, none would be there any more when it is needed, and none is kept."""

NOTED = ("places", "facets")
"""Further passes of a picture that is kept: where it reads the shadow maps, and which facet is seen."""

NO_PIXELS = np.zeros(0, dtype=np.int32)

Draw = Callable[[Target, moderngl.Framebuffer], None]

Box = tuple[int, int, int, int]
"""Left, bottom, width and height in pixels."""


@dataclass(frozen=True, eq=False)
class Begun:
    """How a picture begins: with batches that are ``kept``.

    Of these, the faces that ``again`` has for a batch are to be drawn again in a ``box``.
    """

    kept: frozenset[Batch] = frozenset()
    again: Mapping[Batch, NDArray[np.int32]] = field(default_factory=dict)
    box: Box = (0, 0, 0, 0)


@dataclass(frozen=True, eq=False)
class Facets:
    """What a picture of batches shows in each pixel.

    ``numbers`` (h, w) are those of the facets, -1 for none: those of a batch in ``spans``, which begins and counts a
    number for each face and instance.
    """

    numbers: NDArray[np.int32]
    spans: Mapping[Batch, tuple[int, int]]

    @classmethod
    def of(cls, read: NDArray[np.float32], batches: Iterable[Batch], rows: int) -> Facets:
        """Take them from what is ``read`` (h, w, 2) of the pass; there are ``rows`` instances in all."""
        first, spans, count = np.full(rows + 1, -1, dtype=np.int64), {}, 0
        for batch in batches:
            faces, instances = len(batch.triangles.faces), len(batch.pieces)
            first[batch.rows.start + 1 : batch.rows.stop + 1] = count + faces * np.arange(instances)
            spans[batch] = (count, faces * instances)
            count += faces * instances
        start = first[read[..., 0].astype(np.int64)]
        numbers = np.where(start < 0, -1, start + read[..., 1].astype(np.int64))
        return cls(numbers.astype(np.int32), spans)

    def faces(self, batch: Batch, drawn: NDArray[np.bool_]) -> NDArray[np.int32]:
        """The faces (m, 3) of ``batch`` of which some instance is ``drawn``, by numbers."""
        begin, count = self.spans[batch]
        some = drawn[begin : begin + count].reshape(len(batch.pieces), -1).any(axis=0)
        return np.ascontiguousarray(batch.triangles.faces[some], dtype=np.int32)


@dataclass(frozen=True, eq=False)
class Kept:
    """A picture of ``batches`` alone: what is in a target's textures, and which pixels read a cell of each shadow map.

    ``depths`` (h, w), which ``buffer`` holds, and ``facets`` count rows upwards.
    """

    batches: frozenset[Batch]
    contents: dict[str, NDArray[Any]]
    depths: NDArray[np.float32]
    buffer: moderngl.Framebuffer
    readers: tuple[Readers, ...]
    facets: Facets

    def begin(self, target: Target, stirred: Sequence[NDArray[np.uint8]], copy: DepthCopy | None) -> Begun:
        """Begin a picture with this one; returns what is still to be drawn, about the cells that are ``stirred``.

        Pixels that read such a cell are given the greatest depth.
        """
        read = [readers.of(cells) for cells, readers in zip(stirred, self.readers, strict=True)]
        pixels = np.concatenate([NO_PIXELS, *read])
        drawn = np.zeros(sum(count for _, count in self.facets.spans.values()), dtype=np.bool_)
        box = box_of(pixels, self.facets.numbers, drawn)
        target.fill(self.contents)
        if copy is None:
            target.fill_depths(self.depths, 0, 0)
        else:
            target.whole.use()
            copy(self.buffer, target.whole)
        if not len(pixels):
            return Begun(self.batches)
        target.fill_depths(far_at(pixels, self.depths, box), *box[:2])
        faces = ((batch, self.facets.faces(batch, drawn)) for batch in self.batches)
        return Begun(self.batches, {batch: some for batch, some in faces if len(some)}, box)


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
        width, height = target.size
        textures = [self._context.texture(target.size, channels, dtype="f4") for channels in (4, 2)]
        blank = Target(self._context, target.size, target.passes, 0)
        draw(blank, blank.with_more(*textures))
        places, seen = (np.frombuffer(t.read(), dtype="f4").reshape(height, width, -1) for t in textures)
        readers = tuple(
            Readers(cells_of(places[..., 2 * k : 2 * k + 2], shadow.size), shadow.size)
            for k, shadow in enumerate(self._lights.shadow_views)
        )
        facets = Facets.of(seen, keepable, len(instances.ids))
        depths = blank.depths()
        # a texture of its own: Mesa waits for all that is being drawn before it copies what was once drawn into
        buffer = self._context.framebuffer(depth_attachment=self._context.depth_texture(target.size, depths.tobytes()))
        kept = Kept(keepable, blank.contents(), depths, buffer, readers, facets)
        _add(self._kept, key, kept, slots)
        return kept

    def _standing(self, instances: Instances) -> Hashable:
        """Where everything stands that stands still, and all that the lights do."""
        return instances.standing, self._lights.content()

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
                    stir(cells, to_clip, triangles.positions, triangles.faces)
        return self._stirred[key]


def is_still(batch: Batch, instances: Instances) -> bool:
    """Whether nothing of a batch has moved for long."""
    return batch.rays is None and bool(instances.still[batch.rows].all())


def _add(least_recent_first: OrderedDict[Hashable, Any], key: Hashable, value: Any, most: int) -> None:
    least_recent_first[key] = value
    while len(least_recent_first) > most:
        least_recent_first.popitem(last=False)
