"""World poses of ghosts, cameras and lights: objects without mass, mounted on bodies or on each other.

Poses are x y z qx qy qz qw; ``local`` is in the parent's frame (body frame B, or the frame of the
parent camera, light or ghost), ``world`` in world axes. Lengths in metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import compiled
from ligature.model.frames import matrix_pose7
from ligature.model.poses import compose
from ligature.model.scene import Attachment, Scene
from ligature.model.state import StateRecord
from ligature.model.subsystem import Subsystem

KINDS = ("ghost", "camera", "light")


@compiled
def _update(
    body_pose: NDArray[np.float64],
    local: NDArray[np.float64],
    parents: NDArray[np.int64],
    order: NDArray[np.int64],
    world: NDArray[np.float64],
) -> None:
    n_bodies = body_pose.shape[0]
    for i in order:
        parent = parents[i]
        if parent < 0:
            world[i] = local[i]
        elif parent < n_bodies:
            compose(body_pose[parent], local[i], world[i])
        else:
            compose(world[parent - n_bodies], local[i], world[i])


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

    def of(self, kind: str) -> slice:
        """Rows of the objects of ``kind`` (ghost, camera or light) in ``local`` and ``world``."""
        return self._slices[kind]

    def update(self, body_pose: NDArray[np.float64]) -> None:
        """Move every object with its parent; ``body_pose`` (bodies, 7) in world axes."""
        _update(body_pose, self.local, self._parents, self._order, self.world)

    def place(self, kind: str, index: int, pose: tuple[float, ...] | None) -> None:
        """Put one object at ``pose`` (7,) in its parent's frame; None leaves it where it is."""
        if pose is not None:
            self.local[self._slices[kind].start + index] = pose

    def adopt(self, kind: str, index: int, body: int | None) -> None:
        """Mount one object on ``body``, or on the world; its pose in the parent's frame stays."""
        self._parents[self._slices[kind].start + index] = -1 if body is None else body
        self._order = self._parents_first()

    def reset(self) -> None:
        """Put every object back to the pose and parent that the scene states."""
        self.local[:] = self._initial
        self._parents[:] = self._initial_parents
        self._order = self._parents_first()

    def sense(self, state: StateRecord) -> None:
        """Move every object with its parent, and write the poses."""
        self.update(state["body_pose"][0])
        state["ghost_world"][0] = self.world[self.of("ghost")]
        for kind in ("camera", "light"):
            state[f"{kind}_pose"][0] = self.local[self.of(kind)]
            state[f"{kind}_world"][0] = self.world[self.of(kind)]

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """Everything that lasts from tick to tick."""
        return {"local": self.local, "parents": self._parents}

    def restore(self, snapshot: Mapping[str, NDArray[Any]]) -> None:
        """Continue from `snapshot`."""
        self.local[:], self._parents[:] = snapshot["local"], snapshot["parents"]
        self._order = self._parents_first()

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
