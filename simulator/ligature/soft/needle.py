"""A needle of the scene in a body of tissue: its shape and its own equations, in the axes of the tissue; SI units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import quaternion_matrix
from ligature.model.piercing import Needle
from ligature.model.scene import Body, Box, Capsule, Cone, Cylinder, Scene, Sphere
from ligature.soft.frame import Frame
from ligature.suture.bodies import HeldBodies
from ligature.suture.rod import Rod
from ligature.tissue.block import TissueBlock
from ligature.tissue.needle import OUTSIDE

Array = NDArray[np.float64]

Equations = tuple[Array, Array, Array, Array, Array, Array]
"""Tip, tangent, normal and centre of a needle, and its own H and g, as `NeedleInTissue.couple` takes them."""

THINNEST, THICKEST = 0.05e-3, 1e-3
"""Radii of wire in metres that are taken from collision shapes; thicker shapes are hulls around a thin needle."""

USUAL_RADIUS = 0.25e-3
"""Radius of the wire of a needle whose shapes do not show it, m."""

NEAR = 0.01
"""Distance in metres from the box around the tissue within which a needle is looked at."""


def wire_radius(body: Body) -> float:
    """Radius of a needle's wire: the least of its round shapes and boxes, in metres."""
    radii = []
    for part in body.colliders:
        shape = part.shape
        if isinstance(shape, Sphere | Capsule | Cylinder | Cone):
            radii.append(shape.radius)
        elif isinstance(shape, Box):
            radii.append(0.5 * float(shape.size.min()))
    fitting = [r for r in radii if THINNEST <= r <= THICKEST]
    return min(fitting) if fitting else USUAL_RADIUS


class ScenePiercer:
    """One needle and one body of tissue.

    ``rod`` is the thread that carries the needle as a node of its own solve, None for a needle without one.
    """

    def __init__(self, scene: Scene, needle: Needle, block: TissueBlock, rod: Rod | None, dt: float) -> None:
        arc, self.body = needle.arc, scene.bodies[needle.body]
        self.rod, self._dt = rod, dt
        tip, c, s = arc.point(0.0), np.cos(arc.end), np.sin(arc.end)
        self._local = np.stack([tip, c * arc.y - s * arc.x, (arc.centre - tip) / arc.radius], axis=1)
        self.inside = block.add_needle(1.0 / arc.radius, arc.length, wire_radius(self.body))
        self._size = arc.length + float(np.linalg.norm(tip))
        self._R6 = np.zeros((6, 6))
        self._joint_load = np.zeros(6)
        self.wrench = np.zeros(6)
        self.tip = np.full(3, np.inf)
        self.drift = np.zeros(6)
        self.centre = np.zeros(3)
        self.spring = -1

    @property
    def engaged(self) -> bool:
        """Whether the tissue touches the needle."""
        return self.inside.where != OUTSIDE or self.inside.passages > 0

    def approach(self, bodies: HeldBodies, frame: Frame, box: Array) -> Equations | None:
        """The needle's shape and equations in B for `NeedleInTissue`; None while it is far from ``box`` (2, 3)."""
        pose, twist = bodies.motion(self.body.index)
        centre = frame.into(pose[:3])
        reach = NEAR + self._size
        if not self.engaged and ((centre < box[0] - reach).any() or (centre > box[1] + reach).any()):
            self.inside.forget()
            self.wrench[:] = 0.0
            self.tip[:] = np.inf
            return None
        R = frame.R.T @ quaternion_matrix(pose[3:])
        shape = R @ self._local
        self.centre = centre
        self.tip = centre + shape[:, 0]
        extra, extra_inertia, pull = bodies.attached_load(self.body.index)
        mass, inertia = self.body.mass + extra, self.body.inertia + extra_inertia
        dt = self._dt
        H, g = np.zeros((6, 6)), np.zeros(6)
        H[0, 0] = H[1, 1] = H[2, 2] = mass / dt**2
        moments = (R * inertia) @ R.T
        H[3:, 3:] = moments / dt**2
        v, w = frame.R.T @ twist[:3], frame.R.T @ twist[3:]
        force = pull[:3] + self.body.mass * self.body.gravity + self._joint_load[:3]
        moment = pull[3:] + self._joint_load[3:]
        g[:3] = mass / dt * v + frame.R.T @ force
        g[3:] = moments @ w / dt + frame.R.T @ moment
        self.drift = frame.drift(centre, dt) if frame.moves else np.zeros(6)
        g -= H @ self.drift
        if self.rod is not None and self.engaged:
            fall = (pull[:3] + self.body.mass * self.body.gravity) / mass
            self.rod.pull_partner(self.body.index, fall, mass, inertia)
        return self.tip, shape[:, 1], shape[:, 2], centre, H, g

    # --- with a thread ------------------------------------------------------------------------

    def begin(self, bodies: HeldBodies, frame: Frame, box: Array) -> None:
        """Hand the rod what the tissue does to the needle."""
        self.spring = -1
        assert self.rod is not None
        equations = self.approach(bodies, frame, box)
        if equations is None:
            return
        K, load = self.inside.begin(*equations, dt=self._dt)
        R6 = self._R6
        R6[:3, :3] = R6[3:, 3:] = frame.R
        self.spring = self.rod.add_spring(
            self.rod.node_of[self.body.index], R6 @ K @ R6.T, R6 @ (load + K @ self.drift)
        )

    def end(self, frame: Frame) -> None:
        """Conclude with the motion that the rod's solve found."""
        assert self.rod is not None
        self._joint_load = self.rod.joint_load(self.body.index)
        if self.spring < 0:
            return
        moved = self.rod.moved(self.spring)
        delta = np.concatenate([frame.R.T @ moved[:3], frame.R.T @ moved[3:]]) - self.drift
        self.wrench = frame.turned(self.inside.end(delta))

    # --- alone --------------------------------------------------------------------------------

    def couple(self, bodies: HeldBodies, frame: Frame, box: Array) -> None:
        """Solve with the tissue alone, and push the needle."""
        equations = self.approach(bodies, frame, box)
        if equations is None:
            return
        _, wrench = self.inside.couple(*equations, dt=self._dt)
        self.wrench = frame.turned(wrench)
        if wrench.any():
            bodies.apply_impulse(self.body.index, self._dt * self.wrench[:3], self._dt * self.wrench[3:])

    # --- state --------------------------------------------------------------------------------

    def reset(self) -> None:
        """As at the start; the block resets what is inside."""
        self.wrench[:], self._joint_load[:] = 0.0, 0.0
        self.tip[:] = np.inf

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick, besides what the block keeps."""
        return {name: getattr(self, name).copy() for name in _KEPT}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for name in _KEPT:
            setattr(self, name, snapshot[name].copy())


_KEPT = ("wrench", "tip", "_joint_load")
"""Attributes that last from tick to tick."""
