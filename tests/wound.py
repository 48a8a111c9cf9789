"""Brings the needle of `soft_suturing` on its circle into the pad, through the wound and into the other lip."""

from __future__ import annotations

import numpy as np
from ligature import Simulation
from ligature.model.frames import frame, inverse, matrix_pose7, pose7_matrix

DEPTH, SPEED, ALONG = 0.005, 0.03, 0.006
"""Metres of the circle's lowest point below the top, metres a second of the tip, metres from the wound's middle."""

BEFORE, TURN, EVERY = 0.06, 2.2, 5
"""Radians before the top at which the tip begins, radians that it turns, and ticks of a command."""


def pass_through_the_wound(simulation: Simulation) -> float:
    """Turn the needle about the centre of its arc, across the wound; returns the height of the pad's top."""
    scene = simulation.scene
    needle, pad = scene.needles[0], scene.tissues[0]
    body, arc, driven = scene.bodies[needle.body], needle.arc, simulation.bodies["Needle"]
    place = scene.bodies[pad.body].T_world_body[:3, 3]
    top = float(place[2] + pad.form.grid.nodes[:, 2].max())
    centre = np.array([place[0], place[1] + ALONG, top + arc.radius - DEPTH])
    x, y, z = np.eye(3)
    local = np.column_stack([arc.x, arc.y, np.cross(arc.x, arc.y)])

    def pose(angle: float) -> np.ndarray:
        """The inertial frame (4, 4) of the needle whose tip is at ``angle`` from x towards z."""
        phi = angle - arc.end
        R = np.column_stack([np.cos(phi) * x + np.sin(phi) * z, -np.sin(phi) * x + np.cos(phi) * z, -y]) @ local.T
        return frame(R, centre - R @ arc.centre)

    begin = np.pi + np.arcsin(1.0 - DEPTH / arc.radius) - BEFORE
    driven.set_pose(matrix_pose7(pose(begin) @ inverse(body.T_body_inertial)))
    spin = np.array([0.0, -SPEED / arc.radius, 0.0])
    for angle in np.arange(begin, begin + TURN, EVERY * 1e-3 * SPEED / arc.radius):
        now = (pose7_matrix(driven.pose) @ body.T_body_inertial)[:3, 3]
        back = 20.0 * (pose(angle)[:3, 3] - now)
        driven.command_twist([*(np.cross(spin, now - centre) + back), *spin])
        simulation.step(EVERY)
    driven.command_twist(np.zeros(6))
    simulation.step(EVERY)
    return top
