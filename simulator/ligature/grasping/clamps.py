"""Constraint actuators that yield: what they hold slips beyond the friction of two pads, and in the end out of them."""

from __future__ import annotations

import numpy as np

from ligature.grasping.grips import Grip, begin
from ligature.model.frames import inverse
from ligature.model.scene import Scene, Slip
from ligature.physics import World
from ligature.suture.grasp import Patch


class Clamps:
    """What the actuators of a scene with ``ligature slip`` hold, by number."""

    def __init__(self, scene: Scene, world: World) -> None:
        self._scene, self._world = scene, world
        self._grips: dict[int, tuple[Grip, float]] = {}
        self._added = 0

    @property
    def grips(self) -> list[Grip]:
        """All grips, oldest first."""
        return [grip for grip, _ in self._grips.values()]

    def add(self, slip: Slip, parent: int, child: int, T_parent_frame: np.ndarray) -> int:
        """Hold ``child`` where it is between pads in a frame of ``parent``, (4, 4) in its frame B; returns a number."""
        bodies = self._scene.bodies
        T_holder_patch = inverse(bodies[parent].T_body_inertial) @ T_parent_frame
        patch = Patch(T_holder_patch, slip.half_width, slip.friction * bodies[child].friction)
        grasp, ride = begin(self._world, parent, child, patch)
        grasp.normal_force = slip.normal_force
        self._added += 1
        self._grips[self._added] = Grip(child, parent, grasp, ride), slip.reach
        self._world.hold_up(child, True, gripped=True)
        return self._added

    def remove(self, number: int) -> None:
        """Let go; nothing happens when that has slipped out already."""
        if number in self._grips:
            grip, _ = self._grips.pop(number)
            self._world.hold_up(grip.body, False, gripped=True)

    def holds(self, number: int) -> bool:
        """Whether it still holds what it was given."""
        return number in self._grips

    def lose(self, body: int | None = None, slipped: bool = False) -> bool:
        """Let go of ``body``, of all bodies for None, or of those alone that have ``slipped`` out; whether any was."""
        lost = [
            number
            for number, (grip, reach) in self._grips.items()
            if body in (None, grip.body) and (not slipped or grip.grasp.slipped[0] > reach)
        ]
        for number in lost:
            self.remove(number)
        return bool(lost)

    def reset(self) -> None:
        """Hold nothing; the world forgets it by itself."""
        self._grips = {}

    def snapshot(self) -> tuple[int, dict[int, tuple[Grip, float]]]:
        """Everything that lasts from tick to tick."""
        return self._added, dict(self._grips)

    def restore(self, snapshot: tuple[int, dict[int, tuple[Grip, float]]]) -> None:
        """Continue from `snapshot`."""
        self._added, self._grips = snapshot[0], dict(snapshot[1])
