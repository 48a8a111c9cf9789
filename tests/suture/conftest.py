"""Rods and bodies that the tests of the suture package share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ligature.model.frames import matrix_pose7, pose7_matrix
from ligature.model.scene import Body, Identity, Scene, WorldSettings
from ligature.model.shapes import Collider, Shape
from ligature.suture.colliders import Colliders
from ligature.suture.description import RodDescription, from_material
from ligature.suture.partners import Partner
from ligature.suture.rod import Rod

DT = 1e-3


class Bench:
    """Rods among rigid bodies without contacts of their own: what the engine is in a simulation.

    Bodies with mass are integrated freely from impulses and gravity; those without move as commanded.
    """

    def __init__(self, bodies: Sequence[Body], gravity: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        self.scene = Scene("bench", WorldSettings(), (), tuple(bodies), ())
        self.gravity = np.array(gravity)
        self.colliders = Colliders(self.scene, DT)
        self.pose = {b.index: matrix_pose7(b.T_world_body) for b in bodies}
        self.twist = {b.index: np.zeros(6) for b in bodies}
        self.rods: list[Rod] = []

    def add(self, description: RodDescription) -> Rod:
        partners = [
            Partner(b.index, b.mass, b.inertia, np.eye(4), self.gravity, fixed=b.static) for b in self.scene.bodies
        ]
        rod = Rod(description, partners, self.colliders.shapes(len(description.mass)), DT)
        self.rods.append(rod)
        return rod

    def motion(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        return self.pose[body].copy(), self.twist[body].copy()

    def read_motions(self, bodies: np.ndarray, out: np.ndarray) -> None:
        for row, body in zip(out, bodies.tolist(), strict=True):
            row[:7], row[7:] = self.motion(body)

    def driven(self, body: int) -> bool:
        return False

    def apply_impulse(self, body: int, impulse: np.ndarray, moment: np.ndarray) -> None:
        b = self.scene.bodies[body]
        R = pose7_matrix(self.pose[body])[:3, :3]
        self.twist[body][:3] += impulse / b.mass
        self.twist[body][3:] += R @ ((R.T @ moment) / b.inertia)

    def step(self, ticks: int = 1, each: Callable[[], Any] | None = None) -> None:
        for _ in range(ticks):
            if each is not None:
                each()
            for rod in self.rods:
                near = self.colliders.update(self, rod.box())
                rod.meet(self.colliders, near, self)
                rod.step()
                for body, impulse in rod.pushes():
                    self.apply_impulse(body, impulse[:3], impulse[3:])
            for b in self.scene.bodies:
                if not b.static:
                    self.twist[b.index][:3] += self.gravity * DT
                self._drift(b.index)

    def _drift(self, body: int) -> None:
        pose, twist = self.pose[body], self.twist[body]
        pose[:3] += DT * twist[:3]
        half = 0.5 * DT * twist[3:]
        x, y, z, w = pose[3:]
        a, b, c = half
        turned = [
            x + a * w + b * z - c * y,
            y + b * w + c * x - a * z,
            z + c * w + a * y - b * x,
            w - a * x - b * y - c * z,
        ]
        pose[3:] = np.array(turned) / np.linalg.norm(turned)


def body(
    index: int,
    shape: Shape | None,
    at: Sequence[float] = (0.0, 0.0, 0.0),
    mass: float = 0.0,
    inertia: float = 1e-6,
    friction: float = 0.5,
    R: np.ndarray | None = None,
) -> Body:
    """A body with one shape at its origin; static without mass."""
    T = np.eye(4)
    T[:3, 3] = at
    if R is not None:
        T[:3, :3] = R
    return Body(
        index, Identity(f"b{index}", f"b{index}", f"/b{index}", f"/b{index}", 0), mass, np.full(3, inertia),
        np.eye(4), T,
        np.zeros(3), (Collider(shape, np.eye(4)),) if shape is not None else (), friction=friction,
    )  # fmt: skip


def line(n: int, length: float, axis: int = 0, start: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Points (n + 1, 3) along an axis."""
    points = np.tile(np.asarray(start, dtype=float), (n + 1, 1))
    points[:, axis] += np.linspace(0.0, length, n + 1)
    return points


def damped(description: RodDescription, lost: float = 0.9999) -> RodDescription:
    """The same rod, losing the fraction ``lost`` of its speed in a second."""
    return replace(description, damping=np.full((len(description.mass), 2), lost))


def energy(rod: Rod) -> float:
    """Kinetic, potential and elastic energy of a rod in joules."""
    d, joints = rod.description, rod.joints
    twists = rod.twists
    kinetic = 0.5 * float(d.mass @ (twists[:, :3] ** 2).sum(axis=1))
    for e, q in enumerate(rod.orientations):
        R = pose7_matrix(np.r_[0.0, 0.0, 0.0, q])[:3, :3]
        kinetic += 0.5 * float(d.inertia[e] @ (R.T @ twists[e, 3:]) ** 2)
    fall = -float((d.mass[:, None] * d.gravity * rod.positions).sum())
    bend = 0.5 * float((joints.stiffness * (joints.angle - joints.rest) ** 2).sum())
    stretch = 0.5 * float((joints.compliance * (joints.load[:, :3] ** 2).sum(axis=1)).sum()) / DT**4
    return kinetic + fall + bend + stretch


@pytest.fixture
def kit() -> SimpleNamespace:
    """The builders above."""
    return SimpleNamespace(
        Bench=Bench, body=body, line=line, damped=damped, energy=energy, from_material=from_material, DT=DT
    )
