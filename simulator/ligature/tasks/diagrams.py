"""Diagrams of closed polygons, and what they say of the knot: its determinant, signature, three-colourings.

A diagram is the shadow of a polygon (n, 3) on a plane, with what passes over at each of its crossings.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


class Crossing(NamedTuple):
    """Where along the polygon, in edges from its start, one strand passes ``under`` the other that passes ``over``.

    ``sign`` is 1 where the upper strand turns left to the direction of the lower one, else -1.
    """

    under: float
    over: float
    sign: int


def crossings(points: Array, seed: int = 0) -> list[Crossing]:
    """The crossings of the shadow of a closed polygon (n, 3) on a random plane."""
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    a = points @ turn
    d = np.roll(a, -1, axis=0) - a
    low, high = (bound(a[:, :2], a[:, :2] + d[:, :2]).T[:, None] for bound in (np.minimum, np.maximum))
    near = (low <= high.swapaxes(1, 2)).all(axis=0)
    near &= near.T
    near[0, -1] = False  # neighbours meet, the last edge and the first one too
    first, second = np.nonzero(np.triu(near, 2))
    r, s, q = d[first], d[second], a[second] - a[first]
    with np.errstate(all="ignore"):
        per = r[:, 0] * s[:, 1] - r[:, 1] * s[:, 0]
        t, u = (q[:, 0] * s[:, 1] - q[:, 1] * s[:, 0]) / per, (q[:, 0] * r[:, 1] - q[:, 1] * r[:, 0]) / per
        cross = (t >= 0.0) & (t < 1.0) & (u >= 0.0) & (u < 1.0)
    found: list[Crossing] = []
    for k in np.flatnonzero(cross):
        if abs(per[k]) <= 1e-9 * np.linalg.norm(r[k]) * np.linalg.norm(s[k]):
            continue
        i, j = int(first[k]), int(second[k])
        below = a[i, 2] + t[k] * r[k, 2] < a[j, 2] + u[k] * s[k, 2]
        here, there, turns = i + float(t[k]), float(j + u[k]), int(np.sign(per[k]))
        found.append(Crossing(here, there, -turns) if below else Crossing(there, here, turns))
    return found


@dataclass(frozen=True)
class Diagram:
    """The diagram of a knot, coloured like a chessboard (Gordon, Litherland, Inventiones mathematicae 47, 1978).

    Its regions are black or white, the outer one either. The Goeritz matrix of the white ones presents the homology
    of the double cover of the sphere, branched along the knot.
    """

    crossings: tuple[Crossing, ...]

    @classmethod
    def of(cls, points: Array, seed: int = 0) -> Diagram:
        """The diagram of a closed polygon (n, 3) on a random plane."""
        return cls(tuple(crossings(points, seed)))

    @property
    def determinant(self) -> int:
        """Determinant of the knot: 1 without a knot, 3 for a trefoil."""
        return abs(round(float(np.linalg.det(self._goeritz[0])))) if len(self._goeritz[0]) else 1

    @property
    def signature(self) -> int:
        """Signature of the knot: -2 for a right-handed trefoil, 2 for its mirror image, their sum for a sum."""
        goeritz, correction = self._goeritz
        values = np.linalg.eigvalsh(goeritz) if len(goeritz) else np.zeros(0)
        return int(np.sign(values).sum()) - correction

    @property
    def colourings(self) -> int:
        """Three-colourings of the knot: 3 without a knot, 9 for a trefoil, 27 for the sum of two."""
        return int(3 ** (1 + len(self._goeritz[0]) - _rank(np.rint(self._goeritz[0]).astype(np.int64), 3)))

    @property
    def kind(self) -> tuple[int, int, int]:
        """Determinant, signature and three-colourings of the knot: together they tell many knots apart."""
        return self.determinant, self.signature, self.colourings

    @cached_property
    def _goeritz(self) -> tuple[Array, int]:
        """Goeritz matrix of the white regions but one, and the correction of its signature."""
        corners, black = self._regions()
        white = np.flatnonzero(~black)
        row = {int(face): i for i, face in enumerate(white)}
        matrix, correction = np.zeros((len(white), len(white))), 0
        for crossing, faces in zip(self.crossings, corners, strict=True):
            # Turned left, the upper strand sweeps the corners 0 and 2.
            swept = bool(black[faces[0]])
            kind = 1 if swept else -1
            i, j = (row[int(face)] for face in (faces[1::2] if swept else faces[::2]))
            if i != j:
                matrix[[i, j], [j, i]] -= kind
                matrix[[i, j], [i, j]] += kind
            # The black surface twists against the direction of the strands.
            correction += kind * (swept == (crossing.sign > 0))
        return matrix[1:, 1:], correction

    def _regions(self) -> tuple[Integers, NDArray[np.bool_]]:
        """The regions at the corners (m, 4) of each crossing, from the upper strand on to the left; which are black."""
        m = len(self.crossings)
        visits = sorted((at, c, over) for c, (*ends, _) in enumerate(self.crossings) for over, at in enumerate(ends))
        visit = {(c, over): v for v, (_, c, over) in enumerate(visits)}
        sides = [4 * m + 2 * edge for edge in range(2 * m)]
        same = list(range(8 * m))

        def root(x: int) -> int:
            while same[x] != x:
                x = same[x]
            return x

        for c, crossing in enumerate(self.crossings):
            under, over = ((visit[c, k], (visit[c, k] - 1) % (2 * m)) for k in (0, 1))
            ring = [(over[0], True), (under[0], True), (over[1], False), (under[1], False)]
            if crossing.sign < 0:
                ring[1], ring[3] = ring[3], ring[1]
            for k, (edge, leaves) in enumerate(ring):
                left, right = (k, (k - 1) % 4) if leaves else ((k - 1) % 4, k)
                same[root(4 * c + left)] = root(sides[edge])
                same[root(4 * c + right)] = root(sides[edge] + 1)
        number = {face: i for i, face in enumerate(sorted({root(x) for x in range(8 * m)}))}
        face = np.array([number[root(x)] for x in range(8 * m)], dtype=np.int64)
        black = np.zeros(len(number), dtype=np.bool_)
        # Corners side by side differ; along the knot each crossing shares an edge with the next one.
        done: set[int] = set()
        for _, c, _ in visits:
            faces = face[4 * c : 4 * c + 4]
            known = [k for k in range(4) if int(faces[k]) in done]
            first = bool(black[faces[known[0]]]) ^ bool(known[0] % 2) if known else False
            black[faces[::2]], black[faces[1::2]] = first, not first
            done.update(int(f) for f in faces)
        return face[: 4 * m].reshape(m, 4), black


def _rank(matrix: Integers, p: int) -> int:
    """Rank of an integer matrix modulo a prime ``p``."""
    left, rank = matrix % p, 0
    for column in range(left.shape[1]):
        pivots = np.flatnonzero(left[rank:, column])
        if not len(pivots):
            continue
        left[[rank, rank + pivots[0]]] = left[[rank + pivots[0], rank]]
        left[rank] = left[rank] * pow(int(left[rank, column]), -1, p) % p
        others = np.arange(len(left)) != rank
        left[others] = (left[others] - np.outer(left[others, column], left[rank])) % p
        rank += 1
        if rank == len(left):
            break
    return rank
