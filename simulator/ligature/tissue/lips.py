"""Contact of the lips of a cut or wound: facing nodes may part but not pass each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel
from ligature.tissue.elastic import ElasticGrid

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

SWEEPS = 10
"""Gauss–Seidel sweeps of a step, from the pressures of the last one."""

MARGIN = 1.5e-3
"""Gap in metres above which a pair is not looked at."""

ASIDE = 1.5
"""Distance across the normal, over the longest edge of a cell, from which nodes do not face each other any more."""


class Lips:
    """Pressures between facing nodes.

    The axis across the cut at rest is the normal of a pair. Each step solves for forces p ≥ 0 with gaps g ≥ 0 and
    p g = 0 at its end, g = g₀ + B p: B is the pairs' block of the compliance of the step.

    Attributes
    ----------
    pairs
        Nodes that face each other, (p, 2).
    force
        Force that keeps a pair apart, (p,) N.
    """

    def __init__(self, elastic: ElasticGrid) -> None:
        grid = elastic.grid
        self._elastic = elastic
        moves = (elastic.row[grid.lips] >= 0).any(axis=1)
        self.pairs, self._axis = np.ascontiguousarray(grid.lips[moves]), np.ascontiguousarray(grid.lip_axis[moves])
        n = len(self.pairs)
        self.force = np.zeros(n)
        self._response = np.zeros((n, *elastic.x.shape))
        one = np.ones(1)
        for i, ((a, b), axis) in enumerate(zip(self.pairs, self._axis.tolist(), strict=True)):
            self._response[i] = elastic.response(b[None], one)[axis] - elastic.response(a[None], one)[axis]
        index = np.arange(n)
        self._B = np.ascontiguousarray(
            (self._response[:, self.pairs[:, 1], self._axis] - self._response[:, self.pairs[:, 0], self._axis]).T
        ) if n else np.zeros((0, 0))  # fmt: skip
        assert n == 0 or self._B[index, index].min() > 0.0
        self._aside = ASIDE * float(grid.sizes.max())
        self._near = np.zeros(n, dtype=np.bool_)
        self._gap = np.zeros(n)

    def expect(self, external: Array) -> None:
        """Add to the forces ``external`` (n, 3) of the next step those that kept the lips apart in the last one."""
        push_apart(self.force, self.pairs, self._axis, external)

    def close(self, d: Array) -> None:
        """Find the forces of a step with displacements ``d`` (n, 3) and add what changes of those of `expect` do."""
        before = self.force.copy()
        relax(
            self._elastic.x, d, self.pairs, self._axis, self._B, MARGIN, self._aside, SWEEPS, self._near, self._gap,
            self.force,
        )  # fmt: skip
        add_responses(self.force - before, self._response, d)

    def gaps(self) -> Array:
        """Distances across the lips, negative where they overlap, (p,) m."""
        x = self._elastic.x
        index = np.arange(len(self.pairs))
        return (x[self.pairs[:, 1]] - x[self.pairs[:, 0]])[index, self._axis]

    def reset(self) -> None:
        """Forget all forces."""
        self.force[:] = 0.0


@kernel
def relax(
    x: Array, d: Array, pairs: Integers, axis: Integers, B: Array, margin: float, far: float, sweeps: int,
    near: NDArray[np.bool_], gap: Array, force: Array,
) -> None:  # fmt: skip
    """Projected Gauss–Seidel: the forces (p,) of the pairs after displacements ``d`` that hold the old forces' part."""
    n = pairs.shape[0]
    for i in range(n):
        a, b = pairs[i, 0], pairs[i, 1]
        near[i] = True
        for k in range(3):
            apart = x[b, k] - x[a, k]
            if k == axis[i]:
                gap[i] = apart + d[b, k] - d[a, k]
                near[i] = near[i] and (apart < margin or gap[i] < margin)
            else:
                near[i] = near[i] and abs(apart) < far
    # Pairs that have parted push no more; the others feel it.
    for j in range(n):
        if not near[j] and force[j] != 0.0:
            for i in range(n):
                gap[i] -= B[i, j] * force[j]
            force[j] = 0.0
    for _ in range(sweeps):
        for i in range(n):
            if near[i]:
                p = force[i] - gap[i] / B[i, i]
                p = p if p > 0.0 else 0.0
                change = p - force[i]
                if change != 0.0:
                    for j in range(n):
                        gap[j] += B[j, i] * change
                    force[i] = p


@kernel
def push_apart(force: Array, pairs: Integers, axis: Integers, external: Array) -> None:
    """external (n, 3) += the forces (p,) on the nodes of the pairs."""
    for i in range(force.shape[0]):
        external[pairs[i, 0], axis[i]] -= force[i]
        external[pairs[i, 1], axis[i]] += force[i]


@kernel
def add_responses(force: Array, response: Array, d: Array) -> None:
    """d += the displacements that the forces (p,) make by their responses (p, n, 3)."""
    for i in range(force.shape[0]):
        f = force[i]
        if f != 0.0:
            R = response[i]
            for k in range(d.shape[0]):
                d[k, 0] += f * R[k, 0]
                d[k, 1] += f * R[k, 1]
                d[k, 2] += f * R[k, 2]
