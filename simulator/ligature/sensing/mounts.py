"""World poses of ghosts, cameras and lights: objects without mass, mounted on bodies or on each other.

Poses are x y z qx qy qz qw; ``local`` is in the parent's frame (body frame B, or the frame of the
parent camera, light or ghost), ``world`` in world axes. Lengths in metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel
from ligature.model.frames import matrix_pose7
from ligature.model.poses import compose
from ligature.model.scene import Attachment, Scene
from ligature.model.state import FieldViews, StateRecord
from ligature.model.subsystem import Subsystem
from ligature.tables import opener, table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

KINDS = ("ghost", "camera", "light")


class Mounted(NamedTuple):
    """The mounted objects, n of them."""

    local: Array  # (n, 7) in the parent's frame
    parents: Integers  # (n,) among bodies followed by mounted objects; -1 is the world
    order: Integers  # (n,) parents first
    world: Array  # (n, 7)


class Fields(NamedTuple):
    """What of the state record objects are placed by, and what is written."""

    body_pose: Array
    ghost_world: Array
    camera_world: Array
    light_world: Array
    camera_pose: Array
    light_pose: Array


_one = np.zeros(1, dtype=np.int64)
_open_mounted = opener(Mounted(np.zeros((1, 7)), _one, _one, np.zeros((1, 7))))
_open_fields = opener(Fields(*np.zeros((6, 1, 7))))


@kernel
def _place_all(mounted_table: Integers, field_table: Integers) -> None:
    """Move every object with its parent, and write the poses: ghosts come first, then cameras, then lights."""
    m, out = _open_mounted(mounted_table), _open_fields(field_table)
    bodies = out.body_pose.shape[0]
    for i in m.order:
        parent = m.parents[i]
        if parent < 0:
            for a in range(7):
                m.world[i, a] = m.local[i, a]
        elif parent < bodies:
            compose(out.body_pose[parent], m.local[i], m.world[i])
        else:
            compose(m.world[parent - bodies], m.local[i], m.world[i])
    ghosts, cameras = out.ghost_world.shape[0], out.camera_world.shape[0]
    for i in range(m.world.shape[0]):
        for a in range(7):
            if i < ghosts:
                out.ghost_world[i, a] = m.world[i, a]
            elif i < ghosts + cameras:
                out.camera_world[i - ghosts, a], out.camera_pose[i - ghosts, a] = m.world[i, a], m.local[i, a]
            else:
                k = i - ghosts - cameras
                out.light_world[k, a], out.light_pose[k, a] = m.world[i, a], m.local[i, a]


class Mounts(Subsystem):
    """The mounted objects of a scene, ghosts first, then cameras, then lights.

    ``local`` and ``world`` are (n, 7) arrays over all of them; `of` gives the slice of one kind.
    """

    def __init__(self, scene: Scene) -> None:
        counts = [len(scene.ghosts), len(scene.cameras), len(scene.lights)]
        starts = np.concatenate([[0], np.cumsum(counts)])
        self._slices = {kind: slice(int(starts[i]), int(starts[i + 1])) for i, kind in enumerate(KINDS)}
        mounts = [item.attachment for items in (scene.ghosts, scene.cameras, scene.lights) for item in items]
        self._n_bodies = len(scene.bodies)
        self._parents = np.array([self._parent_index(a) for a in mounts], dtype=np.int64)
        self._initial_parents = self._parents.copy()
        self._order = self._parents_first()
        self._initial = np.array([matrix_pose7(a.T_parent_object) for a in mounts]).reshape(-1, 7)
        self.local = self._initial.copy()
        self.world = self._initial.copy()
        self._table = table_of(Mounted(self.local, self._parents, self._order, self.world))
        self._fields, self._field_table = FieldViews(*Fields._fields), np.zeros(0, dtype=np.int64)

    def of(self, kind: str) -> slice:
        """Rows of the objects of ``kind`` (ghost, camera or light) in ``local`` and ``world``."""
        return self._slices[kind]

    def place(self, kind: str, index: int, pose: tuple[float, ...] | None) -> None:
        """Put one object at ``pose`` (7,) in its parent's frame; None leaves it where it is."""
        if pose is not None:
            self.local[self._slices[kind].start + index] = pose

    def adopt(self, kind: str, index: int, body: int | None) -> None:
        """Mount one object on ``body``, or on the world; its pose in the parent's frame stays."""
        self._parents[self._slices[kind].start + index] = -1 if body is None else body
        self._order[:] = self._parents_first()

    def reset(self) -> None:
        """Put every object back to the pose and parent that the scene states."""
        self.local[:] = self._initial
        self._parents[:] = self._initial_parents
        self._order[:] = self._parents_first()

    def sense(self, state: StateRecord) -> None:
        """Move every object with its parent, and write the poses."""
        fields = self._fields.of(state)
        if self._fields.fresh:
            self._field_table = table_of(Fields(*fields))
        _place_all(self._table, self._field_table)

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """Everything that lasts from tick to tick."""
        return {"local": self.local, "parents": self._parents}

    def restore(self, snapshot: Mapping[str, NDArray[Any]]) -> None:
        """Continue from `snapshot`."""
        self.local[:], self._parents[:] = snapshot["local"], snapshot["parents"]
        self._order[:] = self._parents_first()

    def _parent_index(self, attachment: Attachment) -> int:
        """Index of the parent among bodies followed by mounted objects; -1 for the world."""
        if attachment.parent is None:
            return -1
        kind, index = attachment.parent
        if kind == "body":
            return index
        if kind not in self._slices:
            return -1
        return self._n_bodies + int(self._slices[kind].start) + index

    def _parents_first(self) -> NDArray[np.int64]:
        """Evaluation order in which a parent comes before its children."""
        depth = np.zeros(len(self._parents), dtype=np.int64)
        for i in range(len(self._parents)):
            parent = self._parents[i]
            while parent >= self._n_bodies and depth[i] <= len(self._parents):
                depth[i] += 1
                parent = self._parents[parent - self._n_bodies]
        return np.argsort(depth, kind="stable").astype(np.int64)
