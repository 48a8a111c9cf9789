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

from ligature.tables import table_of
from ligature.tissue.interface import Interface
from ligature.tissue.layout import USED, Paths
from ligature.tissue.puncture import NeedleInTissue
from ligature.tissue.strand import conclude, find_springs, settle, strand
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

    Attributes
    ----------
    engaged
        Points of the interface that hold the thread, (N,) of 0 and 1.
    table
        Its arrays for compiled code, see `ligature.tissue.strand`.
    """

    def __init__(self, interface: Interface, paths: Paths, radius: float, friction: float = 1.0) -> None:
        self._interface, self._paths, self.radius = interface, paths, radius
        self._strand = strand(len(interface.points.status))
        self._strand.friction[0] = friction
        self._held = self._strand.held
        self.table = table_of(self._strand)
        self.engaged = self._held.engaged
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
        h = self._held
        h.engaged[i], h.at[i], h.anchor[i] = 1, at, at
        h.torn[i], h.side[i] = 0.0, 0

    def springs(self, points: Array) -> Springs:
        """Springs of a tick that begins with the thread's points at ``points`` (n, 3)."""
        self._settles = 0
        find_springs(self._interface.table, self.table, np.array(points, dtype=np.float64))
        return self._springs()

    def _springs(self) -> Springs:
        rows = self._strand.rows
        k = int(rows.filled[0])
        return Springs(
            rows.segment[:k].copy(), rows.part[:k].copy(), rows.stiffness[:k].copy(), rows.bias[:k].copy(),
            rows.start[:k].copy(),
        )  # fmt: skip

    def settle(self, points: Array) -> Springs | None:
        """Take the thread's points (n, 3) as solved with the springs; new springs where limits were mistaken, or None.

        After None the forces stand, the anchors have followed, and what has torn is known.
        """
        self._settles += 1
        again = self._settles < 2 * MOST_SETTLES
        at = np.array(points, dtype=np.float64)
        if settle(self._interface.table, self.table, at, self._settles < MOST_SETTLES, again):
            return self._springs()
        return None

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
        self._strand.rows.force[: len(forces)] = forces
        conclude(self._interface.table, self.table, np.array(points, dtype=np.float64))

    # --- the tissue step ----------------------------------------------------------------------

    def follow(self) -> None:
        """Tear; after the tissue has moved."""
        tear(self._interface, self._paths, self._held.torn)
        self.engaged[self._interface.points.status != USED] = 0

    @property
    def shares(self) -> Array:
        """Length of path that each point stands for, (N,) m; it counts where the thread is engaged."""
        return self._held.share

    def segment_of(self, i: int) -> int:
        """Segment of the thread that was at a point in the last tick."""
        return int(self._held.segment[i])

    # --- state --------------------------------------------------------------------------------

    def reset(self) -> None:
        """Take the thread out without a trace."""
        for array in self._held:
            array[:] = 0

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """Everything that lasts from tick to tick."""
        return {name: array.copy() for name, array in zip(self._held._fields, self._held, strict=True)}

    def restore(self, snapshot: dict[str, NDArray[Any]]) -> None:
        """Continue from `snapshot`."""
        for name, array in zip(self._held._fields, self._held, strict=True):
            array[:] = snapshot[name]
