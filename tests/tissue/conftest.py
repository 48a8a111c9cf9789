"""A pad of tissue and a needle on a spring that the tests of the package share."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from ligature.mesh.grid import build_grid
from ligature.model.material import TissueMaterial
from ligature.tissue.block import TissueBlock
from scipy.spatial.transform import Rotation

DT = 1e-3
SIZE = (0.04, 0.03, 0.01)


def pad(material=None, cells=(10, 8, 3), size=SIZE, **options):
    """A block of ``size`` from z = 0 up, held at its bottom rim and its sides."""
    grid = build_grid([np.linspace(0.0, s, n + 1) for s, n in zip(size, cells, strict=True)])
    rim = (grid.site[:, :2] == 0) | (grid.site[:, :2] == np.array(cells[:2]))
    return TissueBlock(grid, [material or TissueMaterial(1e5)], rim.any(axis=1), dt=DT, **options)


class SprungNeedle:
    """A rigid needle whose centre a spring drags after a pose that moves."""

    def __init__(self, block, tip, tangent, normal=None, radius=0.0, mass=1e-4, stiffness=3000.0, length=None):
        self.block, self.mass, self.stiffness = block, mass, stiffness
        self.curvature = 1.0 / radius if radius else 0.0
        self.length = length or (np.pi * radius if radius else 0.03)
        self.needle = block.add_needle(self.curvature, self.length, 0.25e-3)
        self.tip_local = np.zeros(3)
        t = np.asarray(tangent, dtype=float) / np.linalg.norm(tangent)
        n = np.cross(t, [0.3, 0.5, 0.8]) if normal is None else np.asarray(normal, dtype=float)
        n -= (n @ t) * t
        n /= np.linalg.norm(n)
        self.axes = np.stack([t, n, np.cross(t, n)], axis=1)
        self.lever = np.array([radius and 0.0, radius, 0.0]) if radius else np.array([-0.5 * self.length, 0.0, 0.0])
        self.R = self.axes.copy()
        self.centre = np.asarray(tip, dtype=float) + self.R @ self.lever
        self.goal, self.goal_R = self.centre.copy(), self.R.copy()
        self.v, self.w = np.zeros(3), np.zeros(3)
        self.inertia = mass * (0.3 * self.length) ** 2
        self.turning = stiffness * 1e-4
        self.wrench = np.zeros(6)
        self.free = np.zeros(3)  # motion of the tip in the last tick had there been no tissue
        self.force = 0.0
        self.impulse = np.zeros(3)

    @property
    def tip(self):
        return self.centre - self.R @ self.lever

    def equations(self):
        """The needle's own equations H δ = g, with its springs."""
        damping, twist = 2 * np.sqrt(self.stiffness * self.mass), 2 * np.sqrt(self.turning * self.inertia)
        away = Rotation.from_matrix(self.goal_R @ self.R.T).as_rotvec()
        H, g = np.zeros((6, 6)), np.zeros(6)
        H[:3, :3] = np.eye(3) * (self.mass / DT**2 + damping / DT + self.stiffness)
        H[3:, 3:] = np.eye(3) * (self.inertia / DT**2 + twist / DT + self.turning)
        g[:3] = self.mass * self.v / DT + self.stiffness * (self.goal - self.centre)
        g[3:] = self.inertia * self.w / DT + self.turning * away
        return H, g

    def move(self, delta):
        self.centre = self.centre + delta[:3]
        self.R = Rotation.from_rotvec(delta[3:]).as_matrix() @ self.R
        self.v, self.w = delta[:3] / DT, delta[3:] / DT

    def tick(self):
        H, g = self.equations()
        free = np.linalg.solve(H, g)
        self.free = free[:3] + np.cross(free[3:], self.tip - self.centre)
        delta, self.wrench = self.needle.couple(self.tip, self.R[:, 0], self.R[:, 1], self.centre, H, g)
        self.force = -float(self.wrench[:3] @ self.R[:, 0])
        self.impulse += self.wrench[:3] * DT
        self.move(delta)

    def advance(self, length, speed):
        """Push the goal along the needle by ``length`` (negative: back); returns the force along the needle by tick."""
        ticks = max(1, round(abs(length) / speed / DT))
        forces = []
        for _ in range(ticks):
            part = length / ticks
            if self.curvature:
                # Around the centre of the arc, which is the centre of mass here.
                self.goal_R = Rotation.from_rotvec(part * self.curvature * self.axes[:, 2]).as_matrix() @ self.goal_R
            else:
                self.goal = self.goal + part * self.axes[:, 0]
            self.tick()
            self.block.step()
            forces.append(self.force)
        return np.array(forces)

    def rest(self, ticks):
        forces = []
        for _ in range(ticks):
            self.tick()
            self.block.step()
            forces.append(self.force)
        return np.array(forces)


@pytest.fixture
def kit():
    """The builders above."""
    return SimpleNamespace(pad=pad, SprungNeedle=SprungNeedle, DT=DT, SIZE=SIZE)
