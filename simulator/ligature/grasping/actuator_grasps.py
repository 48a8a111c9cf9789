"""Constraint actuators that grasp: a body slips beyond the friction of two pads, and in the end out of them."""

from __future__ import annotations

import numpy as np

from ligature.grasping.grasp import Patch
from ligature.grasping.impulses import BodyGrasp, begin
from ligature.model.frames import inverse
from ligature.model.scene import Scene, Slip
from ligature.physics import World


class ActuatorGrasps:
    """The grasps of those actuators of ``scene`` that have ``ligature slip``, by number; they act on ``world``."""

    def __init__(self, scene: Scene, world: World) -> None:
        self._scene, self._world = scene, world
        self._grasps: dict[int, tuple[BodyGrasp, float]] = {}
        self._added = 0

    def __len__(self) -> int:
        return len(self._grasps)

    @property
    def grasps(self) -> list[BodyGrasp]:
        """All grasps, oldest first."""
        return [grasp for grasp, _ in self._grasps.values()]

    def add(self, slip: Slip, parent: int, child: int, T_parent_frame: np.ndarray) -> int:
        """Grasp a body where it is.

        Parameters
        ----------
        slip
            Normal force, friction and size of the pads.
        parent, child
            Indices of the body that holds and of the body that is held.
        T_parent_frame
            Frame (4, 4) of the pads in the parent's body frame B.

        Returns
        -------
        int
            The number of the grasp, for `holds` and `remove`.
        """
        bodies = self._scene.bodies
        T_palm_patch = inverse(bodies[parent].T_body_inertial) @ T_parent_frame
        patch = Patch(T_palm_patch, slip.half_width, slip.friction * bodies[child].friction)
        grasp, ride = begin(self._world, parent, child, patch)
        grasp.normal_force = slip.normal_force
        self._added += 1
        self._grasps[self._added] = BodyGrasp(child, parent, grasp, ride), slip.reach
        self._world.masses.set_held(child, True, grasped=True)
        return self._added

    def remove(self, number: int) -> None:
        """Release the body; does nothing when it has slipped out already."""
        if number in self._grasps:
            grasp, _ = self._grasps.pop(number)
            self._world.masses.set_held(grasp.body, False, grasped=True)

    def holds(self, number: int) -> bool:
        """Whether the grasp still holds its body."""
        return number in self._grasps

    def release(self, body: int | None = None, slipped: bool = False) -> bool:
        """Release ``body``, all bodies for None, or only those that have ``slipped`` out.

        Returns whether there was any.
        """
        released = [
            number
            for number, (grasp, reach) in self._grasps.items()
            if body in (None, grasp.body) and (not slipped or grasp.grasp.slipped[0] > reach)
        ]
        for number in released:
            self.remove(number)
        return bool(released)

    def reset(self) -> None:
        """Hold nothing; the world's own reset clears what it knows of grasps."""
        self._grasps = {}

    def snapshot(self) -> tuple[int, dict[int, tuple[BodyGrasp, float]]]:
        """Everything that lasts from tick to tick."""
        return self._added, dict(self._grasps)

    def restore(self, snapshot: tuple[int, dict[int, tuple[BodyGrasp, float]]]) -> None:
        """Continue from `snapshot`."""
        self._added, self._grasps = snapshot[0], dict(snapshot[1])
