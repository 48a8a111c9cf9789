"""Brings the needle of `soft_suturing` on its circle into the pad, through the wound and into the other lip."""

from __future__ import annotations

import numpy as np
from ligature import Simulation
from ligature.model.frames import frame, inverse, matrix_pose7, pose7_matrix
from ligature.model.scene import Scene
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEPTH, SPEED, ALONG = 0.005, 0.03, 0.006
"""Metres of the circle's lowest point below the top, metres a second of the tip, metres from the wound's middle."""

BEFORE, TURN, EVERY = 0.06, 2.2, 5
"""Radians before the top at which the tip begins, radians that it turns, and ticks of a command."""

FIRM = 20.0
"""Metres a second by which the needle goes back for each metre that it is beside its circle."""

STEP = EVERY * 1e-3 * SPEED
"""Metres of the tip between two commands."""


class WayThroughWound:
    """The circle of the scene's needle across its wound: where the needle is and how it moves at an angle of its tip."""

    def __init__(self, scene: Scene) -> None:
        needle, pad = scene.needles[0], scene.tissues[0]
        self.body, self.arc = scene.bodies[needle.body], needle.arc
        place = scene.bodies[pad.body].T_world_body[:3, 3]
        self.top = float(place[2] + pad.form.grid.nodes[:, 2].max())
        self._centre = np.array([place[0], place[1] + ALONG, self.top + self.arc.radius - DEPTH])
        self._local = np.column_stack([self.arc.x, self.arc.y, np.cross(self.arc.x, self.arc.y)])
        self.begin = float(np.pi + np.arcsin(1.0 - DEPTH / self.arc.radius) - BEFORE)
        self.spin = np.array([0.0, -SPEED / self.arc.radius, 0.0])
        self.step = STEP / self.arc.radius
        """Radians between two commands."""

    def _inertial(self, angle: float) -> Array:
        """The needle's inertial frame (4, 4) with its tip at ``angle`` from x towards z."""
        x, y, z = np.eye(3)
        phi = angle - self.arc.end
        R = np.column_stack([np.cos(phi) * x + np.sin(phi) * z, -np.sin(phi) * x + np.cos(phi) * z, -y]) @ self._local.T
        return frame(R, self._centre - R @ self.arc.centre)

    def pose(self, angle: float) -> Array:
        """The needle's pose (7,) with its tip at an angle."""
        return matrix_pose7(self._inertial(angle) @ inverse(self.body.T_body_inertial))

    def twist(self, angle: float, pose: Array) -> Array:
        """The twist (6,) that turns the needle on from an angle, and back to its circle from where it is, (7,)."""
        now = (pose7_matrix(pose) @ self.body.T_body_inertial)[:3, 3]
        back = FIRM * (self._inertial(angle)[:3, 3] - now)
        return np.array([*(np.cross(self.spin, now - self._centre) + back), *self.spin])


def pass_through_the_wound(simulation: Simulation) -> float:
    """Turn the needle about the centre of its arc, across the wound; returns the height of the pad's top."""
    way, driven = WayThroughWound(simulation.scene), simulation.bodies["Needle"]
    driven.set_pose(way.pose(way.begin))
    for angle in np.arange(way.begin, way.begin + TURN, way.step):
        driven.command_twist(way.twist(angle, driven.pose))
        simulation.step(EVERY)
    driven.command_twist(np.zeros(6))
    simulation.step(EVERY)
    return way.top
