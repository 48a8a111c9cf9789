"""Grasps of threads between the fingers of a jaw: rigid across the pads, frictional along them.

Until both pads touch, the rod's own contacts with the fingers act. Then `ligature.suture.partners.JawPads` replace
them inside the rod's implicit solve; the force between the fingers sets their Coulomb limit. World axes, SI units.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ligature.grasping.fingers import FACING, LEAST_LEVER, TOUCH, Fingers
from ligature.model.frames import pose7_matrix
from ligature.physics import World
from ligature.suture import Rods
from ligature.suture.partners import JawPads
from ligature.suture.rod import Rod

Array = NDArray[np.float64]


@dataclass
class ThreadGrasp:
    """A thread between the pads of one jaw.

    ``rod`` is its number, ``body`` the element between the pads, ``along`` (m) the arc length from the rod's start to
    the pads when the grasp began. ``positions`` (rad) are the joint positions at which the fingers stop, ``lever`` (m)
    is the distance of the thread from their axis. ``points`` (2, 3) and ``normal`` (3,) of the pads are in the first
    finger's inertial frame.
    """

    rod: int
    body: int
    along: float
    positions: tuple[float, float]
    lever: float
    points: Array
    normal: Array
    friction: float
    reach: float
    normal_force: float = 0.0
    force: Array = field(default_factory=lambda: np.zeros(3))
    slip: float = 0.0


def begin(number: int, rods: Rods, world: World, fingers: Fingers, friction: float) -> ThreadGrasp | None:
    """A grasp of a rod when both pads touch it and the commands close the fingers; None otherwise."""
    rod, jaw = rods.rods[number], fingers.jaw
    axis, pivot = fingers.axis()
    touched = [_touched(rod, fingers, finger, axis, pivot) for finger in (0, 1)]
    if touched[0] is None or touched[1] is None or min(fingers.efforts()) <= 0.0:
        return None
    centre = 0.5 * (touched[0] + touched[1])
    lever = centre - pivot
    lever = lever - (lever @ axis) * axis
    normal = fingers.closing(0, axis, lever)
    element, on_rod, tangent, at = rod.nearest(centre)
    along = tangent - (tangent @ normal) * normal
    along *= 0.5 * jaw.half_width / max(float(np.linalg.norm(along)), 1e-12)
    T = pose7_matrix(world.motion(jaw.fingers[0])[0])
    points = (np.array([on_rod - along, on_rod + along]) - T[:3, 3]) @ T[:3, :3]
    return ThreadGrasp(
        number, rod.description.bodies[element], at, fingers.positions(),
        float(np.linalg.norm(lever)), points, T[:3, :3].T @ normal, friction, jaw.half_width,
    )  # fmt: skip


def keep(thread: ThreadGrasp, rods: Rods, world: World, fingers: Fingers) -> JawPads | None:
    """The pads for the coming tick; None when the fingers open or the thread has slipped out."""
    rod, finger = rods.rods[thread.rod], fingers.jaw.fingers[0]
    force = min(fingers.efforts()) / max(thread.lever, LEAST_LEVER)
    T = pose7_matrix(world.motion(finger)[0])
    centre = T[:3, :3] @ (0.5 * (thread.points[0] + thread.points[1])) + T[:3, 3]
    element, on_rod, _, along = rod.nearest(centre)
    if force <= 0.0 or np.linalg.norm(on_rod - centre) > thread.reach:
        return None
    thread.normal_force, thread.body = force, rod.description.bodies[element]
    thread.slip = along - thread.along
    thread.force = rod.grasped(finger)[1]
    fingers.stop(thread.positions, (force * thread.lever, force * thread.lever))
    rods.exclude(thread.rod, fingers.jaw.fingers, element)
    return JawPads(finger, thread.points, thread.normal, 2.0 * thread.friction * force)


def within(rods: Rods, box: Array) -> bool:
    """Whether an element of a rod has its centre within the box (2, 3)."""
    for rod in rods.rods:
        low, high = rod.box().tolist()
        apart = any(a > y or b < x for a, b, x, y in zip(low, high, *box.tolist(), strict=True))
        if not apart and ((rod.positions > box[0]) & (rod.positions < box[1])).all(axis=1).any():
            return True
    return False


def _touched(rod: Rod, fingers: Fingers, finger: int, axis: Array, pivot: Array) -> Array | None:
    """Mean point (3,) of the contacts that face a pad, None unless one of them touches."""
    contacts = rod.contacts
    node = rod.node_of.get(fingers.jaw.fingers[finger], -1)
    rows = np.flatnonzero(contacts.node[: contacts.count[0], 1] == node)
    points = contacts.start[rows, 0]
    levers = points - pivot
    levers -= np.outer(levers @ axis, axis)
    ways = np.array([fingers.closing(finger, axis, lever) for lever in levers]).reshape(-1, 3)
    facing = np.sum(ways * contacts.normal[rows], axis=1) > FACING
    rows, points = rows[facing], points[facing]
    if not len(rows) or not (contacts.closed[rows].any() or contacts.gap[rows].min() < TOUCH):
        return None
    return np.asarray(points.mean(axis=0))
