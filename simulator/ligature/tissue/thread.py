"""A thread in the paths that needles have left: friction along it, hold across it, tearing; world axes, SI units.

The thread is a chain of points with a solver of its own. To that solver each node of a path is a spring between a
point of the thread and the tissue there, whose compliance is the node's own and that of the tissue: the sum C of the
blocks that belong to the nodes of the same thread, which is as stable as all of them together and needs no
joint solve. The force is limited along by friction and across by the tissue's strength.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.tissue.interface import Interface
from ligature.tissue.needle import CAPTURE
from ligature.tissue.paths import Paths
from ligature.tissue.puncture import NeedleInTissue
from ligature.tissue.tearing import tear

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST_SETTLES = 8
"""Repetitions for the limits of a tick, after which none is lifted any more."""


class Springs(NamedTuple):
    """What holds a thread in a tick, at k nodes: force = bias - stiffness (p - start), p the point of the thread.

    ``segment`` (k,) counts the thread's segments, ``share`` (k,) is 0 at its start and 1 at its end; ``stiffness``
    (k, 3, 3) N/m, ``bias`` (k, 3) N, ``start`` (k, 3) where the point is when the tick begins.
    """

    segment: Integers
    share: Array
    stiffness: Array
    bias: Array
    start: Array


class ThreadInTissue:
    """One thread of a block of tissue.

    Parameters
    ----------
    interface
        The points of the tissue.
    paths
        Its paths.
    radius
        Of the thread, m.
    friction
        Its friction along a path, over that of a needle.
    """

    def __init__(self, interface: Interface, paths: Paths, radius: float, friction: float = 1.0) -> None:
        n = len(interface.points.status)
        self._interface, self._paths, self.radius, self._friction = interface, paths, radius, friction
        self.engaged = np.zeros(n, dtype=np.int64)
        self._at, self._anchor = np.zeros(n), np.zeros(n)
        self._share = np.zeros(n)
        self._torn = np.zeros((n, 3))
        self._side = np.zeros((n, 2), dtype=np.int64)
        self._points = np.zeros((0, 3))
        self._rows: dict[int, tuple[Array, ...]] = {}
        self._tangents: dict[int, Array] = {}
        self._settles = 0

    # --- the tick -----------------------------------------------------------------------------

    def insert(self, path: int, at: float) -> None:
        """Put the thread into a path: the length ``at`` from its first point stands at the path's exit."""
        n = int(self._paths.count[path])
        for k in range(n):
            i = int(self._paths.node[path, k])
            self._engage(i, at + float(self._paths.s[path, n - 1] - self._paths.s[path, k]))

    def draw_in(self, needle: NeedleInTissue) -> None:
        """Follow a needle: take over the nodes that its tail has left, with the thread's first point at its tail."""
        for i, beyond in needle.take_left_behind():
            if not self.engaged[i]:
                self._engage(i, beyond)

    def _engage(self, i: int, at: float) -> None:
        self.engaged[i], self._at[i], self._anchor[i] = 1, at, at
        self._torn[i], self._side[i] = 0.0, 0

    def springs(self, points: Array) -> Springs:
        """Springs of a tick that begins with the thread's points at ``points`` (n, 3)."""
        self._points = np.array(points, dtype=np.float64)
        self._settles = 0
        self._find(points)
        self._share_out()
        nodes = np.flatnonzero(self.engaged)
        self._rows = {int(i): self._row(int(i), nodes) for i in nodes}
        return self._springs()

    def _find(self, points: Array) -> None:
        """Where along the thread its nodes are now; those off its ends are let go."""
        edge = np.diff(points, axis=0)
        size = np.sqrt((edge**2).sum(axis=1))
        begin = np.concatenate([[0.0], np.cumsum(size)])
        for i in np.flatnonzero(self.engaged).tolist():
            y = self._interface.points.at[i]
            part = np.clip(((y - points[:-1]) * edge).sum(axis=1) / size**2, 0.0, 1.0)
            away = ((points[:-1] + part[:, None] * edge - y) ** 2).sum(axis=1)
            along = begin[:-1] + part * size
            # The nearest of those that lie near its last place: a thread may pass a node more than once.
            near = np.abs(along - self._at[i]) < CAPTURE
            if not near.any():
                self._drop(i)
                continue
            k = int(np.flatnonzero(near)[np.argmin(away[near])])
            self._at[i] = along[k]
            if (k == 0 and part[k] == 0.0) or (k == len(size) - 1 and part[k] == 1.0):
                self._drop(i)

    def _drop(self, i: int) -> None:
        self.engaged[i] = 0
        self._interface.points.force[i] = 0.0

    def _share_out(self) -> None:
        """Length of path that each node stands for, and the direction of the path there."""
        self._tangents.clear()
        for path in np.flatnonzero(self._paths.count).tolist():
            n = int(self._paths.count[path])
            nodes, s = self._paths.node[path, :n], self._paths.s[path, :n]
            kept = np.flatnonzero(self.engaged[nodes])
            if not len(kept):
                continue
            self._direct(nodes[kept])
            # Up to the path's ends where the thread leaves, half-way to the neighbours inside.
            edges = np.concatenate([[0.0], 0.5 * (s[kept][1:] + s[kept][:-1]), [0.0]])
            length = self._paths.length[path] if np.isfinite(self._paths.length[path]) else self._paths.cut[path]
            edges[0] = 0.0 if kept[0] == 0 else s[kept[0]]
            edges[-1] = max(float(length), float(s[kept[-1]])) if kept[-1] == n - 1 else s[kept[-1]]
            self._share[nodes[kept]] = np.diff(edges)

    def _direct(self, nodes: Integers) -> None:
        """Direction of a path at its nodes towards the thread's last point; a thread may turn where it enters."""
        if len(nodes) < 2:
            return
        at = self._interface.points.at[nodes]
        turned = 1.0 if self._at[nodes[-1]] > self._at[nodes[0]] else -1.0
        edge = np.diff(at, axis=0)
        edge *= turned / np.sqrt((edge**2).sum(axis=1))[:, None]
        total = np.concatenate([edge[:1], edge[1:] + edge[:-1], edge[-1:]])
        total /= np.sqrt((total**2).sum(axis=1))[:, None]
        self._tangents.update(zip(nodes.tolist(), total, strict=True))

    def _row(self, i: int, nodes: Integers) -> tuple[Array, ...]:
        """Directions (3, 3), stretch at the start, compliance in those directions, limits along and across, place."""
        interface, p = self._interface, self._interface.points
        points = self._points
        begin = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)))])
        k = int(np.clip(np.searchsorted(begin, self._at[i], side="right") - 1, 0, len(begin) - 2))
        share = (self._at[i] - begin[k]) / (begin[k + 1] - begin[k])
        start = points[k] + share * (points[k + 1] - points[k])
        tangent = self._tangents.get(i, (points[k + 1] - points[k]) / (begin[k + 1] - begin[k]))
        whole = p.C[i, nodes].sum(axis=0)
        whole = 0.5 * (whole + whole.T)
        base = p.start[i] + interface.fraction * p.move[i] - whole @ p.mean[i]
        for j in np.flatnonzero(p.status).tolist():
            if not self.engaged[j]:
                base = base + p.C[i, j] @ (p.force[j] - p.mean[j])
        across = start - base - self._torn[i]
        across -= (across @ tangent) * tangent
        size = np.sqrt((across**2).sum())
        other = np.eye(3)[int(np.argmin(np.abs(tangent)))]
        normal = across / size if size > 1e-9 else np.cross(tangent, other)
        normal /= np.sqrt((normal**2).sum())
        E = np.stack([tangent, normal, np.cross(tangent, normal)])
        # Along the thread its own length counts: towards its first point the tangent turns round.
        slid = self._anchor[i] - self._at[i] + float(tangent @ (p.at[i] - base))
        stretch = np.array([slid, size, 0.0])
        soft = E @ whole @ E.T + p.soft[i] * np.eye(3)
        limit = np.array([self._friction * p.friction[i], p.strength[i]]) * self._share[i]
        return E, stretch, soft, limit, start, np.array([k, share])

    def _law(self, i: int) -> tuple[Array, Array]:
        """Force on the tissue at a node, in its directions: bias (3,), and stiffness (3, 3)."""
        _, stretch, soft, limit, _, _ = self._rows[i]
        fixed = np.array([self._side[i, 0], self._side[i, 1], 0]) != 0
        force = np.zeros(3)
        force[:2] = self._side[i] * limit
        K = np.zeros((3, 3))
        free = np.flatnonzero(~fixed)
        K[np.ix_(free, free)] = np.linalg.inv(soft[np.ix_(free, free)])
        force[free] = K[np.ix_(free, free)] @ (stretch[free] - soft[np.ix_(free, np.flatnonzero(fixed))] @ force[fixed])
        return force, K

    def _springs(self) -> Springs:
        k = len(self._rows)
        out = Springs(np.zeros(k, np.int64), np.zeros(k), np.zeros((k, 3, 3)), np.zeros((k, 3)), np.zeros((k, 3)))
        for row, (i, (E, _, _, _, start, place)) in enumerate(self._rows.items()):
            force, K = self._law(i)
            out.segment[row], out.share[row], out.start[row] = int(place[0]), place[1], start
            out.bias[row], out.stiffness[row] = -E.T @ force, E.T @ K @ E
        return out

    def settle(self, points: Array) -> Springs | None:
        """Take the thread's points (n, 3) as solved with the springs; new springs where limits were mistaken, or None.

        After None the forces stand, the anchors have followed, and what has torn is known.
        """
        changed = False
        self._settles += 1
        ends = []
        for i, (E, stretch, soft, limit, start, place) in self._rows.items():
            k, share = int(place[0]), place[1]
            moved = E @ (points[k] + share * (points[k + 1] - points[k]) - start)
            force, K = self._law(i)
            force = force + K @ moved
            # What the bristles alone are stretched by at the end of the tick.
            excess = stretch + moved - soft @ force
            for row in range(2):
                side = self._side[i, row]
                if side == 0 and abs(force[row]) > limit[row] * (1.0 + 1e-9):
                    self._side[i, row], changed = int(np.sign(force[row])), True
                elif side != 0 and side * excess[row] < 0.0 and self._settles < MOST_SETTLES:
                    self._side[i, row], changed = 0, True
            ends.append((i, E, force, excess))
        if changed and self._settles < 2 * MOST_SETTLES:
            return self._springs()
        for i, E, force, excess in ends:
            self._interface.points.force[i] = E.T @ force
            if self._side[i, 0]:
                self._anchor[i] -= excess[0]
            if self._side[i, 1]:
                self._torn[i] += excess[1] * E[1]
        return None

    # --- the tissue step ----------------------------------------------------------------------

    def follow(self) -> None:
        """Tear; after the tissue has moved."""
        tear(self._interface, self._paths, self._torn)
        self.engaged[self._interface.points.status != 1] = 0

    # --- state --------------------------------------------------------------------------------

    def reset(self) -> None:
        """Take the thread out without a trace."""
        for array in self._state().values():
            array[:] = 0

    def snapshot(self) -> dict[str, Array]:
        """Everything that lasts from tick to tick."""
        return {name: array.copy() for name, array in self._state().items()}

    def restore(self, snapshot: dict[str, Array]) -> None:
        """Continue from `snapshot`."""
        for name, array in self._state().items():
            array[:] = snapshot[name]

    def _state(self) -> dict[str, NDArray[Any]]:
        return {
            "engaged": self.engaged, "at": self._at, "anchor": self._anchor, "torn": self._torn, "side": self._side,
        }  # fmt: skip
