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


class Rows(NamedTuple):
    """The nodes of a tick, k of them; in the directions E of a node: along, across, and the third."""

    node: Integers  # (k,)
    segment: Integers  # (k,) of the thread
    part: Array  # (k,) of the segment
    start: Array  # (k, 3)
    E: Array  # (k, 3, 3)
    stretch: Array  # (k, 3) when the tick begins
    soft: Array  # (k, 3, 3) compliance
    limit: Array  # (k, 2) along and across


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
        self._points = np.zeros((2, 3))
        self._tangent = np.zeros((n, 3))
        self._rows = self._gather(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
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
        nodes, segment, part = self._find()
        self._share_out()
        self._rows = self._gather(nodes, segment, part)
        return self._springs()

    def _find(self) -> tuple[Integers, Integers, Array]:
        """Where along the thread its nodes are now, by segment and part of it; those off its ends are let go."""
        nodes = np.flatnonzero(self.engaged)
        if not len(nodes):
            return nodes, nodes, np.zeros(0)
        points, y = self._points, self._interface.points.at[nodes]
        edge = np.diff(points, axis=0)
        size = np.sqrt((edge**2).sum(axis=1))
        begin = np.concatenate([[0.0], np.cumsum(size)])
        away = y[:, None] - points[:-1]
        parts = np.clip((away * edge).sum(axis=2) / size**2, 0.0, 1.0)
        along = begin[:-1] + parts * size
        # The nearest of those that lie near its last place: a thread may pass a node more than once.
        near = np.abs(along - self._at[nodes, None]) < CAPTURE
        square = ((away - parts[:, :, None] * edge) ** 2).sum(axis=2)
        segment = np.argmin(np.where(near, square, np.inf), axis=1)
        row = np.arange(len(nodes))
        part = parts[row, segment]
        off = ((segment == 0) & (part == 0.0)) | ((segment == len(size) - 1) & (part == 1.0)) | ~near.any(axis=1)
        for i in nodes[off].tolist():
            self._drop(i)
        kept = ~off
        nodes, segment, part = nodes[kept], segment[kept], part[kept]
        self._at[nodes] = along[row[kept], segment]
        return nodes, segment, part

    def _drop(self, i: int) -> None:
        self.engaged[i] = 0
        self._interface.points.force[i] = 0.0

    def _share_out(self) -> None:
        """Length of path that each node stands for, and the direction of the path there."""
        self._tangent[:] = 0.0
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
        self._tangent[nodes] = total

    def _gather(self, nodes: Integers, segment: Integers, part: Array) -> Rows:
        """Directions, stretch, compliance and limits of the nodes when the tick begins."""
        interface, p = self._interface, self._interface.points
        first = self._points[segment]
        edge = self._points[segment + 1] - first
        start = first + part[:, None] * edge
        tangent = self._tangent[nodes]
        lone = (tangent == 0.0).all(axis=1)
        tangent[lone] = edge[lone] / np.sqrt((edge[lone] ** 2).sum(axis=1))[:, None]
        whole = p.C[nodes[:, None], nodes].sum(axis=1)
        whole = 0.5 * (whole + whole.transpose(0, 2, 1))
        others = np.flatnonzero((p.status != 0) & (self.engaged == 0))
        change = p.force[others] - p.mean[others]
        base = p.start[nodes] + interface.fraction * p.move[nodes]
        base -= np.einsum("iab,ib->ia", whole, p.mean[nodes])
        base += np.einsum("ijab,jb->ia", p.C[nodes[:, None], others], change)
        across = start - base - self._torn[nodes]
        across -= (across * tangent).sum(axis=1)[:, None] * tangent
        size = np.sqrt((across**2).sum(axis=1))
        other = np.eye(3)[np.argmin(np.abs(tangent), axis=1)]
        normal = np.where((size > 1e-9)[:, None], across, np.cross(tangent, other))
        normal /= np.sqrt((normal**2).sum(axis=1))[:, None]
        E = np.stack([tangent, normal, np.cross(tangent, normal)], axis=1)
        # Along the thread its own length counts: towards its first point the tangent turns round.
        slid = self._anchor[nodes] - self._at[nodes] + (tangent * (p.at[nodes] - base)).sum(axis=1)
        stretch = np.stack([slid, size, np.zeros(len(nodes))], axis=1)
        soft = E @ whole @ E.transpose(0, 2, 1) + p.soft[nodes, None, None] * np.eye(3)
        limit = np.stack([self._friction * p.friction[nodes], p.strength[nodes]], axis=1) * self._share[nodes, None]
        return Rows(nodes, segment, part, start, E, stretch, soft, limit)

    def _law(self) -> tuple[Array, Array]:
        """Force on the tissue at the nodes, in their directions: bias (k, 3), and stiffness (k, 3, 3)."""
        rows = self._rows
        k = len(rows.node)
        side = np.zeros((k, 3))
        side[:, :2] = self._side[rows.node]
        free = side == 0.0
        both = free[:, :, None] & free[:, None, :]
        K = np.where(both, np.linalg.inv(np.where(both, rows.soft, np.eye(3))), 0.0)
        force = np.zeros((k, 3))
        force[:, :2] = side[:, :2] * rows.limit
        force += np.einsum("iab,ib->ia", K, rows.stretch - np.einsum("iab,ib->ia", rows.soft, force))
        return force, K

    def _springs(self) -> Springs:
        rows = self._rows
        force, K = self._law()
        turned = rows.E.transpose(0, 2, 1)
        bias = -np.einsum("iab,ib->ia", turned, force)
        return Springs(rows.segment, rows.part, turned @ K @ rows.E, bias, rows.start)

    def _moved(self, points: Array) -> Array:
        """How far the thread has moved at its nodes, in their directions, (k, 3)."""
        rows = self._rows
        first, last = points[rows.segment], points[rows.segment + 1]
        return np.einsum("iab,ib->ia", rows.E, first + rows.part[:, None] * (last - first) - rows.start)

    def settle(self, points: Array) -> Springs | None:
        """Take the thread's points (n, 3) as solved with the springs; new springs where limits were mistaken, or None.

        After None the forces stand, the anchors have followed, and what has torn is known.
        """
        self._settles += 1
        rows, moved = self._rows, self._moved(points)
        force, K = self._law()
        force = force + np.einsum("iab,ib->ia", K, moved)
        # What the bristles alone are stretched by at the end of the tick.
        excess = rows.stretch + moved - np.einsum("iab,ib->ia", rows.soft, force)
        if self._change_sides(force, excess, self._settles < MOST_SETTLES) and self._settles < 2 * MOST_SETTLES:
            return self._springs()
        self._interface.points.force[rows.node] = np.einsum("iba,ib->ia", rows.E, force)
        self._follow_limits(excess)
        return None

    def _change_sides(self, force: Array, excess: Array, back: bool) -> bool:
        """Which rows are at their limits after a solve, and with ``back`` which are not any more; True on a change."""
        side, limit = self._side[self._rows.node], self._rows.limit
        now = np.where((side == 0) & (np.abs(force[:, :2]) > limit * (1.0 + 1e-9)), np.sign(force[:, :2]), side)
        if back:
            now = np.where((side != 0) & (side * excess[:, :2] < 0.0), 0, now)
        self._side[self._rows.node] = now
        return bool((now != side).any())

    def _follow_limits(self, excess: Array) -> None:
        """Move anchors that slip, and note what tears."""
        rows = self._rows
        side = self._side[rows.node]
        self._anchor[rows.node] -= np.where(side[:, 0] != 0, excess[:, 0], 0.0)
        self._torn[rows.node] += np.where(side[:, 1] != 0, excess[:, 1], 0.0)[:, None] * rows.E[:, 1]

    def conclude(self, points: Array, forces: Array) -> None:
        """End a tick whose springs another solver took as they were.

        Parameters
        ----------
        points
            The thread's points at the end, (n, 3).
        forces
            Of the thread on the tissue at the nodes of the springs, (k, 3), as that solver found them.

        Limits that a force goes beyond act from the next tick on.
        """
        rows = self._rows
        local = np.einsum("iab,ib->ia", rows.E, forces)
        excess = rows.stretch + self._moved(points) - np.einsum("iab,ib->ia", rows.soft, local)
        self._interface.points.force[rows.node] = forces
        self._follow_limits(excess)
        self._change_sides(local, excess, True)

    # --- the tissue step ----------------------------------------------------------------------

    def follow(self) -> None:
        """Tear; after the tissue has moved."""
        tear(self._interface, self._paths, self._torn)
        self.engaged[self._interface.points.status != 1] = 0

    @property
    def shares(self) -> Array:
        """Length of path that each point stands for, (N,) m; it counts where the thread is engaged."""
        return self._share

    def segment_of(self, i: int) -> int:
        """Segment of the thread that was at a point in the last tick."""
        return int(self._rows.segment[self._rows.node == i][:1].sum())

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
