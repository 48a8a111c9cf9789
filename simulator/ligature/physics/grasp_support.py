"""What grasping needs of Bullet: nearby bodies, gaps, stopped joints, disabled collisions, added mass.

Mixed into `World`. World axes, SI units.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.scene import Scene
from ligature.physics.articulation import Tree, inertia_of, is_alone
from ligature.physics.bodies import Placement
from ligature.physics.control import FREE, TreeControl

Array = NDArray[np.float64]

MIN_HELD_MASS = 0.05
"""Minimum mass in kg of a held body in its response to forces; its weight stays its own, the rest moves with the
holder.

The holder is an arm of kilograms. Stiff pads and a taut thread would throw a needle of 0.1 g from one to the other
within a tick: a force F meets the next reaction only after F dt²/m, 11 mm for 1 N.
"""

MIN_COMMANDED_MASS = 0.5
"""Minimum mass in kg of a body whose velocity a command sets in each tick: that of the challenge's needle.

Such a body pushes with its own momentum: one of 0.1 g with 3 mN at 30 mm/s, which does not open the rim of a hole.
"""


@dataclass(frozen=True, eq=False)
class Gaps:
    """Pairs of nearest points of one body with another, nearest first.

    ``distance`` (n,), ``point`` (n, 3) on the one, and ``normal`` (n, 3) from the other to the one.
    """

    distance: Array
    point: Array
    normal: Array


class GraspSupport:
    """The part of a `World` that grasping needs.

    ``stopped_fingers`` are the fingers whose joints are stopped while they hold a thread, which cannot move them.
    """

    scene: Scene
    client: int
    dt: float
    place_of: dict[int, Placement]
    trees: list[Tree]
    _tree_of_joint: dict[int, TreeControl]
    _body_at: dict[tuple[int, int], int]
    _world_gravity: Array
    _impulses: dict[int, Array]

    def driven(self, body: int) -> bool:
        """Whether a command sets the velocity of a body."""
        raise NotImplementedError

    def _setup_grasp_support(self) -> None:
        self._free_bodies = {tree.root for tree in self.trees if is_alone(tree, self.scene.bodies)}
        self._attached_loads: dict[int, tuple[Placement, Array]] = {}
        self.stopped_fingers: set[int] = set()
        self._disabled_pairs: set[tuple[int, int]] = set()
        self._hold_counts: dict[int, int] = {}
        self._grasp_counts: dict[int, int] = {}

    def surroundings(self, bodies: Collection[int]) -> tuple[list[int], Array]:
        """Bodies whose boxes meet the common box of ``bodies``, in order, and the corners (2, 3) of that."""
        boxes = [
            pybullet.getAABB(place.uid, place.link, physicsClientId=self.client)
            for place in (self.place_of[body] for body in bodies)
        ]
        low = [min(corner) for corner in zip(*(box[0] for box in boxes), strict=True)]
        high = [max(corner) for corner in zip(*(box[1] for box in boxes), strict=True)]
        met = pybullet.getOverlappingObjects(low, high, physicsClientId=self.client) or ()
        found = {self._body_at[at] for at in met if at in self._body_at}
        return sorted(found - set(bodies)), np.array([low, high])

    def gaps(self, body: int, other: int, within: float) -> Gaps | None:
        """Nearest points of the convex parts of two bodies that are closer than ``within``; None without any."""
        a, b = self.place_of[body], self.place_of[other]
        found = pybullet.getClosestPoints(a.uid, b.uid, within, a.link, b.link, physicsClientId=self.client)
        if not found:
            return None
        rows = sorted((row[8], row[5], row[7]) for row in found)
        return Gaps(np.array([r[0] for r in rows]), np.array([r[1] for r in rows]), np.array([r[2] for r in rows]))

    def disable_collision(self, body: int, other: int, disabled: bool) -> None:
        """Disable collision between two bodies, or enable it again unless the scene disables it."""
        (self._disabled_pairs.add if disabled else self._disabled_pairs.discard)((body, other))
        a, b = self.place_of[body], self.place_of[other]
        collide = not disabled and other not in self.scene.bodies[body].no_collision_with
        pybullet.setCollisionFilterPair(a.uid, b.uid, a.link, b.link, int(collide), physicsClientId=self.client)

    def set_stopped(self, fingers: Collection[int], stopped: bool) -> None:
        """Record that ``fingers`` are stopped on a thread, or no longer."""
        self.stopped_fingers = self.stopped_fingers | set(fingers) if stopped else self.stopped_fingers - set(fingers)

    # --- joints -----------------------------------------------------------------------------

    def stop_joint(self, joint: int, position: float, effort: float) -> None:
        """Stop a joint at ``position`` whatever its command; it reports ``effort``."""
        self._tree_of_joint[joint].stop(joint, position, effort)

    def slow_joint(self, joint: int, low: float, high: float, strength: float) -> None:
        """Keep the velocity of a joint's motor between ``low`` and ``high``, and its effort below ``strength``."""
        self._tree_of_joint[joint].slow(joint, low, high, strength)

    def release_joint(self, joint: int) -> None:
        """End `stop_joint` and `slow_joint`."""
        self._tree_of_joint[joint].let(joint)

    def joint_driven(self, joint: int) -> bool:
        """Whether a command drives a joint."""
        control = self._tree_of_joint[joint]
        return bool(control.mode[control.row[joint]] != FREE)

    def joint_position(self, joint: int) -> float:
        """Position of a joint now."""
        control = self._tree_of_joint[joint]
        return float(control.read(np.array([control.row[joint]]))[0, 0])

    def requested_effort(self, joint: int, stiffness: float) -> float:
        """Effort that a joint's command requests; see `TreeControl.pull`."""
        return self._tree_of_joint[joint].pull(joint, stiffness)

    def pending_impulse(self, body: int) -> Array:
        """Impulse and moment (6,) about a body's centre that act in the coming tick so far."""
        return self._impulses.get(body, np.zeros(6))

    # --- mass -------------------------------------------------------------------------------

    def set_held(self, body: int, held: bool, grasped: bool = False) -> None:
        """Count one more holder of ``body``, or one less; a body that pads have ``grasped`` gets added mass.

        A welded body needs none: it is as heavy as its holder.
        """
        change = 1 if held else -1
        for counts in (self._hold_counts, self._grasp_counts) if grasped else (self._hold_counts,):
            counts[body] = counts.get(body, 0) + change
            if counts[body] == 0:
                del counts[body]
        if grasped and body in self._free_bodies:
            self._update_mass(body)

    def _update_mass(self, body: int) -> None:
        """Set the mass of a body in Bullet, and record the force that corrects the weight of the added part.

        A held body keeps its own weight; a commanded body falls as before, and its command corrects that.
        """
        place, commanded = self.place_of[body], self.driven(body)
        least = MIN_COMMANDED_MASS if commanded else MIN_HELD_MASS if body in self._grasp_counts else 0.0
        mass, inertia = self._at_least(least, body)
        pybullet.changeDynamics(
            place.uid, -1, mass=mass, localInertiaDiagonal=inertia.tolist(), physicsClientId=self.client
        )
        extra = mass - place.body.mass
        if extra > 0.0:
            fall = place.body.gravity if commanded else np.zeros(3)
            self._attached_loads[body] = place, extra * (fall - self._world_gravity)
        else:
            self._attached_loads.pop(body, None)

    def mass_of(self, body: int) -> tuple[float, Array]:
        """Mass and principal moments (3,) of a body in its response to forces now."""
        held = body in self._free_bodies and self.is_held(body)
        return self._at_least(MIN_HELD_MASS if held else 0.0, body)

    def _at_least(self, mass: float, body: int) -> tuple[float, Array]:
        """Mass and principal moments (3,) of a body, scaled up to ``mass``."""
        described = self.scene.bodies[body]
        scale = mass / described.mass if mass > described.mass else 1.0
        return scale * described.mass, scale * inertia_of(described)

    def _update_commanded(self, body: int, before: bool) -> None:
        """Update the mass of a light free body after a command that drives it began or ended."""
        light = body in self._free_bodies and self.scene.bodies[body].mass < MIN_COMMANDED_MASS
        if light and self.driven(body) != before:
            self._update_mass(body)

    def is_held(self, body: int) -> bool:
        """Whether something holds a body."""
        return body in self._hold_counts

    def carry(self, body: int, wrench: Array) -> None:
        """Apply ``wrench`` (6,) in the coming tick, which moves the added mass of a body with its holders."""
        if body in self._attached_loads:
            self._attached_loads[body][0].load(wrench.tolist())

    def _apply_attached_loads(self) -> None:
        """Cancel the weight of added mass in the coming tick."""
        for place, lift in self._attached_loads.values():
            place.push(lift)

    def _restore_masses(self) -> None:
        """Set the masses of grasped and commanded bodies in a new Bullet world."""
        for body in sorted(self._free_bodies):
            light = self.scene.bodies[body].mass < MIN_COMMANDED_MASS
            if body in self._grasp_counts or (light and self.driven(body)):
                self._update_mass(body)

    def _restore_disabled_pairs(self) -> None:
        """Repeat every `disable_collision` in a new Bullet world."""
        for body, other in sorted(self._disabled_pairs):
            self.disable_collision(body, other, True)
