"""Volumes that plug-ins cut: their current voxels, the overlap with a ball, and their collision surface.

Points are in the frame of a volume, whose origin is in the middle of its box; metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import Scene
from ligature.model.state import StateRecord
from ligature.model.subsystem import Subsystem
from ligature.model.voxels import FULL, Values, VolumeForm
from ligature.physics.chunks import MOST_REPLACED
from ligature.physics.world import World

Array = NDArray[np.float64]

CHECK_INTERVAL = 20
"""Ticks between two checks for cuts; at each, at most one colliding chunk is replaced, which takes 2 to 4 ms."""

SETTLE_TICKS, MAX_DELAY = 100, 500
"""A chunk is replaced this many ticks after its last cut, at the latest this many after its first one."""


@dataclass(frozen=True, eq=False)
class Overlap:
    """What a ball and the inside of a volume share: ``volume``, m³, and ``moment`` (3,) about the ball's middle, m⁴."""

    volume: float
    moment: Array


class Voxels:
    """The values of one volume, which are ``values`` (nx, ny, nz) and cut in place.

    Attributes
    ----------
    form
        What the volume was at the start.
    count, removed
        Voxels inside now, and those removed since the start.
    touched
        Whether values changed since somebody who looked set it back.
    """

    def __init__(self, form: VolumeForm, values: Values) -> None:
        self.form, self.values = form, values
        self._whole = self._count_inside()
        self.count, self.touched = self._whole, False

    def _count_inside(self) -> int:
        return int(np.count_nonzero(self.values >= self.form.level))

    @property
    def removed(self) -> int:
        """Voxels that were removed since the start of the scene."""
        return self._whole - self.count

    def refill(self, values: Values) -> None:
        """Set all values."""
        self.values[...] = values
        self.count, self.touched = self._count_inside(), True

    def cut(self, start: Array, end: Array, radius: float) -> int:
        """Remove the voxels whose middles a ball meets on its way from ``start`` to ``end``, (3,); returns how many.

        The values of those around are lowered where that is needed for the surface to pass where the ball was: they
        rise from the level at its surface to `FULL` over a voxel, and by as much fall inside.
        """
        form = self.form
        reach = radius + float(form.spacing.max())
        part = self._part(np.minimum(start, end) - reach, np.maximum(start, end) + reach)
        if part is None:
            return 0
        depth = self._distance(part, start, end) - radius
        slope = FULL / (2.0 * float(form.spacing.max()))
        values = form.level + slope * depth
        limit = np.where(depth < 0.0, np.ceil(values) - 1.0, np.ceil(values)).clip(0.0, FULL).astype(np.uint8)
        found = self.values[part]
        if not (limit < found).any():
            return 0
        gone = int(np.count_nonzero((found >= form.level) & (limit < form.level)))
        np.minimum(found, limit, out=found)
        self.count -= gone
        self.touched = True
        return gone

    def overlap(self, centre: Array, radius: float) -> Overlap:
        """What a ball at ``centre`` (3,) shares with the inside.

        A voxel counts by the part of it that is in the ball, as if the ball's surface were a plane there, so that the
        overlap has no steps while the ball moves.
        """
        form = self.form
        half = 0.5 * float(form.spacing.max())
        part = self._part(centre - radius - half, centre + radius + half)
        if part is None:
            return Overlap(0.0, np.zeros(3))
        away = self._away(part, centre)
        covered = np.clip(0.5 + (radius - np.sqrt(sum(a * a for a in away))) / (2.0 * half), 0.0, 1.0)
        share = np.where(self.values[part] >= form.level, covered, 0.0) * float(np.prod(form.spacing))
        return Overlap(float(share.sum()), np.array([float((share * a).sum()) for a in away]))

    def _part(self, low: Array, high: Array) -> tuple[slice, slice, slice] | None:
        """The voxels whose middles are between ``low`` and ``high`` (3,); None when there are none."""
        slices = []
        for axis, a, b in zip(self.form.axes, low.tolist(), high.tolist(), strict=True):
            first, last = np.searchsorted(axis, [a, b]).tolist()
            if first >= last:
                return None
            slices.append(slice(first, last))
        return slices[0], slices[1], slices[2]

    def _away(self, part: tuple[slice, slice, slice], point: Array) -> list[Array]:
        """The three coordinates of voxels from ``point``, to be broadcast."""
        axes = [axis[s] - p for axis, s, p in zip(self.form.axes, part, point.tolist(), strict=True)]
        return [axes[0][:, None, None], axes[1][None, :, None], axes[2][None, None, :]]

    def _distance(self, part: tuple[slice, slice, slice], start: Array, end: Array) -> Array:
        """Distance of voxels from the segment between two points."""
        away, along = self._away(part, start), end - start
        square = float(along @ along)
        if square > 0.0:
            share = np.clip(sum(a * d for a, d in zip(away, along.tolist(), strict=True)) / square, 0.0, 1.0)
            away = [a - share * d for a, d in zip(away, along.tolist(), strict=True)]
        distance: Array = np.sqrt(sum(a * a for a in away))
        return distance


class Volumes(Subsystem):
    """All volumes of a scene that plug-ins may cut, with their collision surfaces in ``world``.

    ``of_body`` are the volumes by their bodies.
    """

    def __init__(self, scene: Scene, world: World) -> None:
        self._volumes, self._world = scene.volumes, world
        total = self._volumes[-1].rows.stop if self._volumes else 0
        self._values = np.zeros(total, dtype=np.uint8)
        for volume in self._volumes:
            self._values[volume.rows] = volume.form.values.ravel()
        self._noted = self._values.copy()
        """Values at the last look."""
        self._due: dict[tuple[int, int], tuple[int, int]] = {}
        """Ticks of the first and last look at which volumes' chunks, which collide as before, had been cut."""
        self._replaced = 0
        self.of_body = {
            volume.body: Voxels(volume.form, self._view(self._values, volume.index)) for volume in self._volumes
        }

    def _view(self, values: Values, index: int) -> Values:
        volume = self._volumes[index]
        view: Values = values[volume.rows].reshape(volume.form.values.shape)
        return view

    def step(self, tick: int) -> None:
        """Update the collision surface where voxels were cut, chunk by chunk."""
        if tick % CHECK_INTERVAL:
            return
        self._note(tick)
        for place, (first, last) in self._due.items():
            if tick - last >= SETTLE_TICKS or tick - first >= MAX_DELAY:
                del self._due[place]
                self._replace(*place)
                self._replaced += 1
                break
        if self._replaced >= MOST_REPLACED:
            self._replaced = 0
            self._world.renew()

    def _note(self, tick: int) -> None:
        """Record the chunks that were cut since the last call."""
        for volume in self._volumes:
            voxels = self.of_body[volume.body]
            if voxels.touched:
                voxels.touched = False
                now, before = self._view(self._values, volume.index), self._view(self._noted, volume.index)
                if volume.body in self._world.chunks.bodies:
                    for chunk in volume.form.changed(before, now):
                        first, _ = self._due.get((volume.index, chunk), (tick, tick))
                        self._due[volume.index, chunk] = first, tick
                before[...] = now

    def _replace(self, index: int, chunk: int) -> None:
        body, form = self._volumes[index].body, self._volumes[index].form
        self._world.chunks.replace(body, chunk, *form.surface(self._view(self._values, index), chunk))

    def _replace_all(self) -> None:
        """Bring the whole collision surface up to date with the voxels."""
        self._note(0)
        for index, chunk in sorted(self._due):
            self._replace(index, chunk)
        self._due = {}

    def write_state(self, state: StateRecord) -> None:
        """Write all values."""
        state["volume_value"][0] = self._values

    def reset(self) -> None:
        """Fill all volumes again."""
        for volume in self._volumes:
            self.of_body[volume.body].refill(volume.form.values)
        self._replace_all()
        self._replaced = 0

    def snapshot(self) -> dict[str, Any]:
        """The values; what collides is brought up to date by `restore`."""
        return {"values": self._values, "replaced": self._replaced}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for volume in self._volumes:
            self.of_body[volume.body].refill(self._view(snapshot["values"], volume.index))
        self._replace_all()
        self._replaced = snapshot["replaced"]
