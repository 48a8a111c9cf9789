"""Compiles all kernels ahead of the first start: ``python -m ligature.suture.warm``, some 30 seconds once.

Without it the first scene with a thread compiles them; either way the code is kept on disk.
"""

from __future__ import annotations

import numpy as np

from ligature.model.scene import Body, Box, Collider, Identity, Scene, WorldSettings
from ligature.suture.colliders import Colliders
from ligature.suture.description import from_material
from ligature.suture.grasp import warm_up
from ligature.suture.rod import Partner, Rod

DT = 1e-3


class _Still:
    """A world in which nothing moves."""

    def motion(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), np.zeros(6)

    def driven(self, body: int) -> bool:
        return False

    def apply_impulse(self, body: int, impulse: np.ndarray, moment: np.ndarray) -> None:
        raise AssertionError("a static body receives no impulses")


def compile_kernels() -> None:
    """Let a short thread touch a box for one tick."""
    box = Collider(Box(np.full(3, 0.01)), np.eye(4))
    name = Identity("BODY box", "box", "/BODY box", "/box", 0)
    body = Body(0, name, 0.0, np.zeros(3), np.eye(4), np.eye(4), np.zeros(3), (box,))
    colliders = Colliders(Scene("warm", WorldSettings(), (), (body,), ()), DT)
    points = np.array([[-0.002, 0.0, 0.0055], [0.0, 0.0, 0.0055], [0.002, 0.0, 0.0055]])
    partner = Partner(0, 0.0, np.ones(3), np.eye(4), np.zeros(3), fixed=True)
    rod = Rod(from_material(points, 1e-3, 1e8, 1100.0), [partner], colliders.shapes(2), DT)
    rod.meet(colliders, colliders.update(_Still(), rod.box()), _Still())
    rod.step()
    warm_up()


if __name__ == "__main__":
    compile_kernels()
