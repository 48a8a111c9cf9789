"""What a suturing task is about: the needle with its points, the pairs of holes, the arms. Metres, world axes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import quaternion_matrix
from ligature.model.scene import ArmKind, Scene

Array = NDArray[np.float64]

_HOLE = re.compile(r"(?P<side>Entry|Exit)(?P<number>\d+)\Z")


class MissingBodies(ValueError):
    """A scene that a task cannot be done in; the message names what it lacks."""


@dataclass(frozen=True, eq=False)
class Scenery:
    """Indices of the bodies of a task.

    ``needle`` is a body; ``points`` (3, 3) are base, middle and tip of its centre line in its body frame. ``entries``
    and ``exits`` are bodies, pair by pair. ``tips`` are the tool bodies of the arms, ``thread`` the bodies of the
    needle's thread.
    """

    needle: int
    points: Array
    entries: tuple[int, ...]
    exits: tuple[int, ...]
    tips: tuple[int, ...]
    thread: tuple[int, ...]

    @classmethod
    def of(cls, scene: Scene, pairs: int = 1) -> Scenery:
        """What ``scene`` has; raises `MissingBodies` when it has no needle, or fewer than ``pairs`` pairs of holes."""
        if not scene.needles:
            raise MissingBodies(
                f"the scene '{scene.name}' has no needle: add a free body whose shapes lie along an arc"
            )
        needle = scene.needles[0]
        T = scene.bodies[needle.body].T_body_inertial
        arc = needle.arc
        along = np.array([arc.point(depth) for depth in (arc.length, 0.5 * arc.length, 0.0)])
        holes = _pairs(scene)
        if len(holes) < pairs:
            raise MissingBodies(
                f"the scene '{scene.name}' has {len(holes)} pairs of holes Entry1, Exit1, …; the task needs {pairs}"
            )
        thread = next((rod.bodies for rod in scene.rods if _attached(scene, rod, needle.body)), ())
        tips = tuple(arm.tip for arm in scene.arms if arm.kind is ArmKind.PSM)
        return cls(
            needle.body, along @ T[:3, :3].T + T[:3, 3], tuple(a for a, _ in holes), tuple(b for _, b in holes), tips,
            tuple(thread),
        )  # fmt: skip

    def needle_points(self, body_pose: Array) -> Array:
        """Base, middle and tip (3, 3) of the needle with bodies at ``body_pose`` (bodies, 7)."""
        pose = body_pose[self.needle]
        return np.asarray(self.points @ quaternion_matrix(pose[3:]).T + pose[:3])


def _pairs(scene: Scene) -> list[tuple[int, int]]:
    """Entry and exit of each pair, in the order of their numbers."""
    found: dict[int, dict[str, int]] = {}
    for body in scene.bodies:
        match = _HOLE.match(body.identity.name)
        if match is not None:
            found.setdefault(int(match["number"]), {})[match["side"]] = body.index
    return [(pair["Entry"], pair["Exit"]) for _, pair in sorted(found.items()) if len(pair) == 2]


def _attached(scene: Scene, rod: Any, body: int) -> bool:
    """Whether a rod is anchored to a body."""
    return any(body in (scene.joints[j].parent, scene.joints[j].child) for j in rod.anchors)
