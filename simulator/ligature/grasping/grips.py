"""One body between two pads, and what several pairs of them do to it in a tick. World axes, SI units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse, pose7_matrix
from ligature.physics import World
from ligature.suture.grasp import Grasp, Hands, Patch
from ligature.suture.motion import Motion

Array = NDArray[np.float64]


@dataclass
class Grip:
    """The scene's ``body`` held by friction; the pads sit on the body ``holder``.

    ``ride`` (6,) is the holder's velocity at the body's centre in the last tick.
    """

    body: int
    holder: int
    grasp: Grasp
    ride: Array


def begin(world: World, holder: int, body: int, patch: Patch) -> tuple[Grasp, Array]:
    """A grasp of ``body`` where it is now, and the `Grip.ride` that it begins with."""
    at = Motion(*world.motion(holder), 0.0, np.zeros(3))
    T_world_body = pose7_matrix(world.motion(body)[0])
    grasp = Grasp(patch, inverse(pose7_matrix(at.pose)) @ T_world_body)
    grasp.begin(at)
    return grasp, at.velocity_at(T_world_body[:3, 3])


class Exchange:
    """Exchanges impulses between held bodies and what holds them."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._hands: dict[int, Hands] = {}

    def between(self, grips: Sequence[Grip]) -> None:
        """Let ``grips``, all of one body, act on it and on their holders in the coming tick."""
        world, body = self._world, grips[0].body
        if len(grips) not in self._hands:
            self._hands[len(grips)] = Hands(len(grips))
        hands = self._hands[len(grips)]
        at = hands.motions
        world.read_motion(body, at.body_pose, at.body_twist)
        for g, grip in enumerate(grips):
            world.read_motion(grip.holder, at.holder_pose[g], at.holder_twist[g])
            at.ride[g] = grip.ride
        mass, inertia = world.mass_of(body)
        at.inverse[0], at.inverse[1:], at.pending[:] = 1.0 / mass, 1.0 / inertia, world.pending(body)
        described = world.scene.bodies[body]
        world.carry(body, hands.let_free(described.mass, described.gravity, world.dt))
        for g, grip in enumerate(grips):
            grip.ride[:] = at.ride[g]
        impulses = hands.hold([grip.grasp for grip in grips], world.dt)
        world.apply_impulse(body, impulses[0, :3], impulses[0, 3:])
        for grip, impulse in zip(grips, impulses[1:], strict=True):
            world.apply_impulse(grip.holder, impulse[:3], impulse[3:])
