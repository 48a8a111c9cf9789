"""Random paths of needles through tissue: angle, depth, curvature, twist, speed, what the needle and the tissue are.

Path N is the same in every run. The needle's pose is driven by a spring; where its wire lies in the tissue is found
from its shape and the nodes alone, and compared with what the tissue says that it holds. SI units.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

import numpy as np
from ligature.model.material import TissueMaterial
from ligature.tissue.location import locate
from scipy.spatial.transform import Rotation

from tests.tissue.conftest import DT, SIZE, SprungNeedle, pad

LEAP = 5e-4
"""Most that a tip moves in a tick, and the tissue around it in a tick of its step, m."""

NEAR, END = 3e-4, 2e-3
"""Distance from a node, m, within which the wire runs through it; length at either end that does not count."""

SAMPLES = 5e-4
"""Distance between the places of the wire that are looked at, m."""

CHECK_INTERVAL = 10
"""Ticks between two checks of the whole wire."""


@dataclass(frozen=True)
class Drive:
    """One path.

    ``radius`` is that of the needle's arc, 0 for a straight one; its ``mass``, and the ``stiffness`` of what drives it.
    ``angle`` and ``azimuth`` (rad) are those of the tip to the surface; it goes ``depth`` m at ``speed``, with a
    ``curvature`` (1/m) and a ``twist`` (rad/m) of its way, then back by the share ``back`` of it, and rests.
    """

    material: TissueMaterial
    cells: tuple[int, int, int]
    radius: float
    length: float
    mass: float
    stiffness: float
    at: tuple[float, float]
    angle: float
    azimuth: float
    depth: float
    speed: float
    curvature: float
    twist: float
    back: float


def drive(number: int) -> Drive:
    """The path with this number."""
    r = random.Random(number)

    def log(low: float, high: float) -> float:
        return float(low * (high / low) ** r.random())

    puncture = log(0.05, 1.0)
    material = TissueMaterial(
        log(2e3, 3e5), poisson=r.uniform(0.3, 0.47), puncture_force=puncture, exit_force=r.uniform(0.0, puncture),
        cutting_force=r.uniform(0.0, 0.4) * puncture, friction=r.uniform(0.0, 30.0), strength=log(100.0, 3000.0),
    )  # fmt: skip
    radius = r.choice([0.0, log(6e-3, 2e-2)])
    own = 1.0 / radius if radius else 0.0
    return Drive(
        material=material, cells=(r.randint(6, 12), r.randint(5, 10), r.randint(2, 4)), radius=radius,
        length=radius * r.uniform(1.5, np.pi) if radius else r.uniform(0.01, 0.04), mass=log(1e-6, 1e-3),
        stiffness=log(300.0, 1e5), at=(r.uniform(0.008, SIZE[0] - 0.008), r.uniform(0.008, SIZE[1] - 0.008)),
        angle=np.deg2rad(r.uniform(10.0, 90.0)), azimuth=r.uniform(0.0, 2.0 * np.pi), depth=log(2e-3, 3e-2),
        speed=log(2e-3, 0.2), curvature=own * r.uniform(0.7, 1.3) + r.choice([0.0, r.uniform(0.0, 40.0)]),
        twist=r.choice([0.0, r.uniform(-200.0, 200.0)]), back=r.choice([0.0, r.random(), 1.2]),
    )  # fmt: skip


class Trial:
    """A drive as it is tried; `fault` says what was wrong, or nothing."""

    def __init__(self, drive: Drive) -> None:
        self.drive = drive
        self.block = pad(drive.material, drive.cells)
        down, along = np.array([0.0, 0.0, -1.0]), np.array([np.cos(drive.azimuth), np.sin(drive.azimuth), 0.0])
        tangent = np.sin(drive.angle) * down + np.cos(drive.angle) * along
        normal = np.cos(drive.angle) * -down + np.sin(drive.angle) * along
        self._tip = np.array([*drive.at, SIZE[2]]) - 5e-4 * tangent
        self.needle = SprungNeedle(
            self.block, self._tip, tangent, normal, drive.radius, drive.mass, drive.stiffness, drive.length
        )
        self._R = self.needle.axes.copy()
        self._held = np.zeros_like(self.needle.needle.engaged)
        self.fault = ""

    def run(self) -> str:
        """Go in, back and rest; returns what was wrong, or nothing."""
        way = self.drive.depth + 5e-4
        ticks = max(1, round(way / self.drive.speed / DT))
        self._advance(way / ticks, ticks)
        self._advance(-way / ticks, round(self.drive.back * ticks))
        self._advance(0.0, 100)
        return self.fault

    def _advance(self, length: float, ticks: int) -> None:
        needle, drive = self.needle, self.drive
        turn = Rotation.from_rotvec(length * np.array([drive.twist, 0.0, drive.curvature])).as_matrix()
        for tick in range(ticks):
            if self.fault:
                return
            self._tip, self._R = self._tip + length * self._R[:, 0], self._R @ turn
            needle.goal, needle.goal_R = self._tip + self._R @ needle.lever, self._R
            before, x = needle.tip, self.block.positions.copy()
            needle.tick()
            self.block.step()
            self._judge(before, x, tick)

    def _judge(self, before: np.ndarray, x: np.ndarray, tick: int) -> None:
        needle, block = self.needle, self.block
        if not (np.isfinite(needle.tip).all() and np.isfinite(block.positions).all()):
            self.fault = "not finite"
            return
        # What its own springs do with a needle that nothing holds is no leap of the tissue's making.
        moved = needle.tip - before
        leap = min(float(np.linalg.norm(moved)), float(np.linalg.norm(moved - needle.free)))
        most = float(np.linalg.norm(block.positions - x, axis=1).max()) / block.interface.ticks
        if leap > LEAP:
            self.fault = f"the tip leaps by {1e3 * leap:.2f} mm"
        elif most > LEAP:
            self.fault = f"the tissue leaps by {1e3 * most:.2f} mm a tick"
        elif tick % CHECK_INTERVAL == 0:
            held = needle.needle.engaged.copy()
            if held.any():
                self._held = held
            elif (through := self._nodes_on_the_wire()) > 0:
                self.fault = f"lost, though its wire still runs through {through} nodes of its path"

    def _nodes_on_the_wire(self) -> int:
        """Nodes that held the needle and hold it no longer, though its wire runs through them away from its ends."""
        wire = self._wire()
        away = [np.linalg.norm(wire - at, axis=1) for at in self.block.interface.points.at[self._held == 1]]
        ends = round(END / SAMPLES)
        return sum(a.min() < NEAR and ends <= a.argmin() < len(wire) - ends for a in away)

    def _wire(self) -> np.ndarray:
        """Places of the needle's wire from its tip to its tail, (n, 3)."""
        needle = self.needle
        k, s = needle.curvature, np.arange(0.0, needle.length, SAMPLES)
        local = np.stack([-np.sin(k * s) / k, (1.0 - np.cos(k * s)) / k, 0 * s] if k else [-s, 0 * s, 0 * s], axis=1)
        return np.asarray(needle.tip + local @ needle.R.T)

    def inside(self) -> float:
        """Length of the wire in the tissue, m: cells that contain its places, whatever holds it."""
        cells, weights = self.block.elastic.grid.cells, np.zeros(8)
        return SAMPLES * sum(locate(self.block.positions, cells, place, 1e-6, weights) >= 0 for place in self._wire())


def fault_of(drive: Drive) -> str:
    """What goes wrong on a path, or nothing."""
    try:
        return Trial(drive).run()
    except FloatingPointError as error:
        return str(error)
