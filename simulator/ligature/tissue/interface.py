"""Points of tissue that something pushes: coupled every tick through the compliance of the tissue's step.

Within a tissue step of m ticks a point is at

    y = p + s u + C (λ - λ̄),   s = tick / m,

with p its place at the start, u where the step would take it under the forces λ̄, the mean of the last step, and C the
compliance of the step. At the end of the step the mean of the ticks' forces moves the nodes. So impulses balance, and a
force that lasts moves a point in a tick as far as in a step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel
from ligature.model.material import TissueMaterial
from ligature.tissue.elastic import ElasticGrid

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

CAPACITY = 160
"""Most points at one time."""

SPACING = 1.6e-3
"""Length of a path between its nodes, m."""

HARD = 1e-5
"""Least compliance of a bristle, m/N."""

UNUSED, USED, LEAVING = 0, 1, 2
"""A point that leaves has forces of this step to hand over, and pushes no more."""


class Points(NamedTuple):
    """N points, in world axes and SI units."""

    status: Integers  # (N,)
    nodes: Integers  # (N, 8)
    weights: Array  # (N, 8)
    start: Array  # (N, 3) p above
    move: Array  # (N, 3) u above
    force: Array  # (N, 3) on the tissue in this tick
    mean: Array  # (N, 3) over the last step
    total: Array  # (N, 3) over the ticks of this step
    at: Array  # (N, 3) at the end of the last tick
    C: Array  # (N, N, 3, 3) m/N
    soft: Array  # (N,) local compliance of the bristle, m/N
    friction: Array  # (N,) N for each metre of needle
    strength: Array  # (N,) N for each metre of needle or thread
    puncture: Array  # (N,) force at which a tip enters, N
    cutting: Array  # (N,) and gets further
    exit: Array  # (N,) beyond that, and leaves


def points(capacity: int = CAPACITY) -> Points:
    """Room for ``capacity`` points, none yet."""
    N, z = capacity, np.zeros
    return Points(
        np.zeros(N, np.int64), np.zeros((N, 8), np.int64), z((N, 8)), z((N, 3)), z((N, 3)), z((N, 3)), z((N, 3)),
        z((N, 3)), z((N, 3)), z((N, N, 3, 3)), z(N), z(N), z(N), z(N), z(N), z(N),
    )  # fmt: skip


class Interface:
    """The points of one grid.

    Parameters
    ----------
    elastic
        The tissue.
    ticks
        Ticks of a step.
    """

    def __init__(self, elastic: ElasticGrid, ticks: int, capacity: int = CAPACITY) -> None:
        self.elastic, self.ticks = elastic, ticks
        self.points = points(capacity)
        self.expected = np.zeros_like(elastic.x)
        self.tick = 0
        self.cell_of = np.zeros(capacity, np.int64)
        self._response = np.zeros((capacity, 3, *elastic.x.shape))

    @property
    def fraction(self) -> float:
        """Share of the step that has passed when this tick ends."""
        return (self.tick + 1) / self.ticks

    # --- points -------------------------------------------------------------------------------

    def add(self, nodes: Integers, weights: Array) -> int:
        """Couple the mean of ``nodes`` (k ≤ 8,) with ``weights`` (k,); returns the index of the point.

        Raises
        ------
        RuntimeError
            When all points are in use.
        """
        unused = np.flatnonzero(self.points.status == UNUSED)
        if not len(unused):
            raise RuntimeError(f"all {len(self.points.status)} points of contact with tissue are in use")
        i = int(unused[0])
        p = self.points
        p.status[i] = USED
        for array in (p.force, p.mean, p.total):
            array[i] = 0.0
        self.place(i, nodes, weights)
        p.at[i] = p.start[i] + (self.tick / self.ticks) * p.move[i]
        return i

    def place(self, i: int, nodes: Integers, weights: Array) -> None:
        """Move a point to another place in the material."""
        p = self.points
        p.nodes[i], p.weights[i] = nodes[0], 0.0
        p.nodes[i, : len(nodes)], p.weights[i, : len(nodes)] = nodes, weights
        self._couple(i)
        p.start[i] = p.weights[i] @ self.elastic.x[p.nodes[i]]
        p.move[i] = p.weights[i] @ self.expected[p.nodes[i]]
        for j in np.flatnonzero(p.status):
            p.move[i] += p.C[i, j] @ p.mean[j]

    def _couple(self, i: int) -> None:
        """Compliance between a point and all others."""
        p = self.points
        self._response[i] = self.elastic.response(p.nodes[i], p.weights[i])
        used = np.flatnonzero(p.status)
        # Displacement of the others along a (last axis) for forces on this one along b (first).
        block = np.einsum("jk,bjka->jab", p.weights[used], self._response[i][:, p.nodes[used]])
        p.C[used, i] = block
        p.C[i, used] = block.transpose(0, 2, 1)

    def release(self, i: int) -> None:
        """Let a point go when this tick ends; what it pushed in this step still counts."""
        self.points.status[i] = LEAVING

    def equip(self, i: int, cell: int, radius: float) -> None:
        """Give a point the strength of its cell's material, for a needle or thread of ``radius`` metres.

        Around a slender inclusion of radius r tissue yields by (ln(d / r) + 0.19) / (4 π G d) under a force on a
        length d, Kelvin's solution integrated along it; the grid has a part of it, the bristle has the rest.
        """
        self.cell_of[i] = cell
        material, p = self.material_of(i), self.points
        p.friction[i], p.strength[i] = material.friction, material.strength
        p.puncture[i], p.cutting[i], p.exit[i] = material.puncture_force, material.cutting_force, material.exit_force
        target = (np.log(SPACING / radius) + 0.19) / (4.0 * np.pi * material.shear * SPACING)
        p.soft[i] = max(target - float(np.trace(p.C[i, i])) / 3.0, HARD)

    def material_of(self, i: int) -> TissueMaterial:
        """What the tissue around a point is made of."""
        return self.elastic.materials[int(self.elastic.grid.layer[self.cell_of[i]])]

    # --- the tick -----------------------------------------------------------------------------

    def count(self) -> bool:
        """End a tick: add its forces up; True when the step is complete."""
        place_points(self.points, self.fraction)
        self.points.force[self.points.status == LEAVING] = 0.0
        self.tick += 1
        return self.tick == self.ticks

    def push(self, d: Array) -> None:
        """Add to a step's displacements ``d`` (n, 3) what the points' mean forces do, and forget those that left."""
        p = self.points
        self.tick = 0
        used = np.flatnonzero(p.status)
        push_nodes(used, p.total, self._response, 1.0 / self.ticks, d)
        p.mean[:] = p.total / self.ticks
        p.total[:] = 0.0
        left = p.status == LEAVING
        p.status[left] = UNUSED
        p.mean[left] = 0.0

    def begin(self, expected: Array) -> None:
        """Begin a step in which the nodes move by ``expected`` (n, 3) without forces on the points."""
        self.expected[:] = expected
        begin_points(self.points, self.elastic.x, expected)

    # --- state --------------------------------------------------------------------------------

    def reset(self) -> None:
        """Let all points go."""
        for array in self.points:
            array[:] = 0
        self.expected[:] = 0.0
        self.cell_of[:] = 0
        self.tick = 0

    def snapshot(self) -> dict[str, Array]:
        """Everything that lasts from tick to tick."""
        return {
            "tick": np.array([self.tick]),
            "expected": self.expected.copy(),
            "cell_of": self.cell_of.copy(),
            **{name: array.copy() for name, array in zip(self.points._fields, self.points, strict=True)},
        }

    def restore(self, snapshot: dict[str, Array]) -> None:
        """Continue from `snapshot`."""
        self.tick = int(snapshot["tick"][0])
        self.expected[:] = snapshot["expected"]
        self.cell_of[:] = snapshot["cell_of"]
        for name, array in zip(self.points._fields, self.points, strict=True):
            array[:] = snapshot[name]
        for i in np.flatnonzero(self.points.status):
            self._response[i] = self.elastic.response(self.points.nodes[i], self.points.weights[i])


@kernel
def place_points(points, s):
    """Where all points are at the share ``s`` of the step, and the sums of their forces."""
    for i in range(points.status.shape[0]):
        if points.status[i] == 0:
            continue
        for a in range(3):
            points.at[i, a] = points.start[i, a] + s * points.move[i, a]
            points.total[i, a] += points.force[i, a]
        for j in range(points.status.shape[0]):
            if points.status[j] == 0:
                continue
            C = points.C[i, j]
            for b in range(3):
                change = points.force[j, b] - points.mean[j, b]
                for a in range(3):
                    points.at[i, a] += C[a, b] * change


@kernel
def push_nodes(used, total, response, scale, d):
    """d += the nodes' displacements for the points' forces ``total`` times ``scale``."""
    for i in used:
        for a in range(3):
            f = scale * total[i, a]
            if f != 0.0:
                R = response[i, a]
                for k in range(d.shape[0]):
                    d[k, 0] += f * R[k, 0]
                    d[k, 1] += f * R[k, 1]
                    d[k, 2] += f * R[k, 2]


@kernel
def begin_points(points, x, expected):
    """Places of all points at the start of a step, and where it would take them under the last step's forces."""
    n = points.status.shape[0]
    for i in range(n):
        if points.status[i] == 0:
            continue
        for a in range(3):
            p, u = 0.0, 0.0
            for k in range(8):
                p += points.weights[i, k] * x[points.nodes[i, k], a]
                u += points.weights[i, k] * expected[points.nodes[i, k], a]
            points.start[i, a], points.move[i, a] = p, u
        for j in range(n):
            if points.status[j] == 0:
                continue
            for a in range(3):
                for b in range(3):
                    points.move[i, a] += points.C[i, j, a, b] * points.mean[j, b]
