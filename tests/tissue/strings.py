"""A thread of our own for the tests of the package: point masses on springs, solved with what holds it in tissue."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_banded

DT = 1e-3
BAND = 5
"""Diagonals beside the main one: springs join a point to its neighbours, three unknowns each."""

HELD = 1e6
"""Stiffness of what holds a point, N/m."""


class String:
    """Point masses on springs, each tick by Newton's method for its implicit equations, with a thread's springs.

    ``held`` has points that are held somewhere, ``pull`` with which force, ``load`` (n, 3) what pulls all of them.
    """

    def __init__(self, block, thread, points, stiffness=500.0, mass=2e-6):
        self.block, self.thread = block, thread
        self.x = np.array(points, dtype=float)
        self.v = np.zeros_like(self.x)
        self.rest = np.linalg.norm(np.diff(self.x, axis=0), axis=1)
        self.stiffness, self.mass = stiffness, mass
        self.load = np.zeros_like(self.x)
        self.held = {}
        self.pull = {}
        n = len(self.x)
        at = 3 * np.arange(n)[:, None, None]
        row, column = np.arange(3)[:, None], np.arange(3)
        self._diagonal = (BAND + row - column + 0 * at, at + column + 0 * row)
        at = at[:-1]
        self._after = (BAND + row - column - 3 + 0 * at, at + 3 + column + 0 * row)
        self._before = (BAND + row - column + 3 + 0 * at, at + column + 0 * row)

    @property
    def tension(self):
        """Of the springs, (n - 1,) N."""
        return np.maximum(self.stiffness * 1e-3 / self.rest * (np.linalg.norm(np.diff(self.x, axis=0), axis=1) - self.rest), 0.0)  # fmt: skip

    def _forces(self, x):
        """Forces of the springs (n, 3), their stiffness on points (n, 3, 3) and between neighbours (n - 1, 3, 3)."""
        d = np.diff(x, axis=0)
        size = np.linalg.norm(d, axis=1)
        t = d / size[:, None]
        k = self.stiffness * 1e-3 / self.rest  # of a segment; `stiffness` is that of a millimetre
        tension = np.maximum(k * (size - self.rest), 0.0)
        along = t[:, :, None] * t[:, None, :]
        firm = np.where(size > self.rest, k, 1e-3 * k)[:, None, None]
        block = firm * along + (tension / size)[:, None, None] * (np.eye(3) - along)
        f = np.zeros_like(x)
        f[:-1] += tension[:, None] * t
        f[1:] -= tension[:, None] * t
        D = np.zeros((len(x), 3, 3))
        D[:-1] += block
        D[1:] += block
        return f, D, -block

    def _solve(self, springs):
        x = self.x.copy()
        guess = x + DT * self.v
        for _ in range(8):
            f, D, O = self._forces(guess)
            f += self.load - self.mass * ((guess - x) / DT - self.v) / DT - 2e-3 * (guess - x) / DT
            D += (self.mass / DT**2 + 2e-3 / DT) * np.eye(3)
            upper, lower = O.copy(), O.copy()
            for s, u, k, bias, start in zip(*springs, strict=True):
                force = bias - k @ ((1.0 - u) * guess[s] + u * guess[s + 1] - start)
                f[s] += (1.0 - u) * force
                f[s + 1] += u * force
                D[s] += (1.0 - u) ** 2 * k
                D[s + 1] += u**2 * k
                upper[s] += u * (1.0 - u) * k
                lower[s] += u * (1.0 - u) * k.T
            for i, goal in self.held.items():
                D[i] += HELD * np.eye(3)
                f[i] += HELD * (goal - guess[i])
            band = np.zeros((2 * BAND + 1, 3 * len(x)))
            band[self._diagonal], band[self._after], band[self._before] = D, upper, lower
            step = solve_banded((BAND, BAND), band, f.reshape(-1), check_finite=False).reshape(-1, 3)
            guess = guess + step
            if np.abs(step).max() < 1e-12:
                break
        return guess

    def tick(self):
        """A tick of the thread, of those that the block's own follows."""
        springs = self.thread.springs(self.x)
        while springs is not None:
            ends = self._solve(springs)
            springs = self.thread.settle(ends)
        self.v, self.x = (ends - self.x) / DT, ends
        self.pull = {i: HELD * (goal - ends[i]) for i, goal in self.held.items()}
