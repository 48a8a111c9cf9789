"""A needle and the tissue around it: where its tip is, what holds it, which way it cuts.

The tip presses a point of the surface until the force along it reaches the puncture force; then it is inside and cuts,
against the cutting force, while friction grows with the length inside. The far surface bulges until it takes the exit
force beyond cutting; then the way is open and friction alone remains, also in every later pass. A
tip at less than the least angle to the surface slides over it instead. World axes, SI units.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.tables import table_of
from ligature.tissue import needle as states
from ligature.tissue.interface import HARD, SPACING, Interface
from ligature.tissue.layout import MOST_NODES, USED, Paths
from ligature.tissue.location import cross_surface, locate
from ligature.tissue.needle import begin_coupling, couple, end_coupling, look_for_surface, needle_arrays
from ligature.tissue.paths import begin_path, extend_path
from ligature.tissue.surface import mean_normal
from ligature.tissue.tearing import tear

Array = NDArray[np.float64]

FADE = 0.05
"""Time in seconds in which tissue takes the shape of a needle that passes beside a node."""

FOLDED = 3.0
"""Strain along a path above which the tissue is folded: the cell around the tip is not the one that it has come to."""

AROUND = 5e-3
"""Distance in metres within which the surface says at which angle a tip meets it, not the dent that the tip makes."""


class NeedleInTissue:
    """One needle of a block of tissue.

    Parameters
    ----------
    interface
        The points of the tissue.
    paths
        Its paths.
    curvature
        Of the needle's arc, 1/m; 0 for a straight needle.
    length
        Of the needle from tip to tail, m.
    radius
        Of its wire, m.

    Attributes
    ----------
    arrays
        Where it is, what holds it and its own equations, for compiled code; ``table`` has their addresses.
    """

    def __init__(self, interface: Interface, paths: Paths, curvature: float, length: float, radius: float) -> None:
        if not (length > 0.0 and radius > 0.0 and curvature >= 0.0):
            raise ValueError(
                f"a needle has length and radius above 0 and curvature from 0, not {length}, {radius} and {curvature}"
            )
        self._interface, self._paths, self.radius = interface, paths, radius
        self.arrays = needle_arrays()
        self.table = table_of(self.arrays)
        self._held, self._rows, self._shape = self.arrays.held, self.arrays.rows, self.arrays.shape
        self._shape[9], self._shape[10] = curvature, length
        self._weights8, self._weights4, self._normal = np.zeros(8), np.zeros(4), np.zeros(3)
        self._before = np.full(3, np.nan)
        self._left, self._count = -1, 0

    # --- the tick -----------------------------------------------------------------------------

    def couple(
        self, tip: Array, tangent: Array, normal: Array, centre: Array, H: Array, g: Array, dt: float = 1e-3
    ) -> tuple[Array, Array]:
        """Solve for the needle's motion in this tick, together with the tissue.

        Parameters
        ----------
        tip, tangent, normal
            Where the tip is, the direction in which it points, and the direction from it to the centre of its
            arc, (3,) each.
        centre
            The centre of mass, (3,).
        H, g
            The needle's own equations, H δ = g, for its displacement and turn δ (6,) about the centre of mass in this
            tick: for a free needle the spatial mass over dt², and momentum over dt with the forces on it.
        dt
            Length of the tick, s.

        Returns
        -------
        The motion δ (6,), and the force and moment (6,) of the tissue on the needle.

        Raises
        ------
        FloatingPointError
            When the needle's equations are singular or not finite.
        """
        self._take(tip, tangent, normal, centre, H, g)
        self.solve(dt)
        return self.arrays.delta.copy(), self.arrays.wrench.copy()

    def solve(self, dt: float) -> None:
        """`couple` with what `arrays` hold: shape and equations; they have motion and wrench then.

        Raises FloatingPointError when they have no finite solution.
        """
        if self._held.tip[0] == states.OUTSIDE:
            self._look_for_surface()
        left, fate = couple(self._interface.table, self.table, dt)
        self._check(fate >= 0)
        self._conclude(left, fate > 0)

    def begin(
        self, tip: Array, tangent: Array, normal: Array, centre: Array, H: Array, g: Array, dt: float = 1e-3
    ) -> tuple[Array, Array]:
        """Begin a tick of a needle whose motion another solver finds, such as that of its thread; see `couple`.

        Returns
        -------
        Stiffness (6, 6) and load (6,) of the tissue: the needle feels load - stiffness δ.

        Raises
        ------
        FloatingPointError
            When the needle's equations are singular or not finite.
        """
        self._take(tip, tangent, normal, centre, H, g)
        self.prepare(dt)
        return self._rows.K.copy(), self._rows.load.copy()

    def prepare(self, dt: float) -> None:
        """`begin` with what `arrays` hold: shape and equations; their rows have stiffness and load then.

        Raises FloatingPointError when they have no finite solution.
        """
        if self._held.tip[0] == states.OUTSIDE:
            self._look_for_surface()
        self._left, self._count = begin_coupling(self._interface.table, self.table, dt)
        self._check(self._count >= 0)

    def _check(self, solved: bool) -> None:
        """Raise FloatingPointError unless the equations were ``solved``, with a finite motion."""
        if not (solved and math.isfinite(self.arrays.delta.sum())):
            raise FloatingPointError("the equations of the needle in tissue have no finite solution")

    def end(self, delta: Array) -> Array:
        """End a tick in which the needle moved by ``delta`` (6,); returns force and moment (6,) of the tissue on it."""
        self.arrays.delta[:] = delta
        self.finish()
        return self.arrays.wrench.copy()

    def finish(self) -> None:
        """`end` with the motion that `arrays` hold; they have the wrench then."""
        self._conclude(self._left, end_coupling(self._interface.table, self.table, self._count))

    @property
    def before(self) -> Array:
        """Where the tip was as the last tick began, (3,); nowhere while the needle is far from the tissue."""
        return self._before

    def _take(self, tip: Array, tangent: Array, normal: Array, centre: Array, H: Array, g: Array) -> None:
        self._shape[:3], self._shape[3:6], self._shape[6:9], self._shape[11:] = tip, tangent, normal, centre
        self.arrays.H[:], self.arrays.g[:] = H, g

    def _conclude(self, left: int, through: bool) -> None:
        """Update the path after a tick: the tip left the tissue, punctured or cut, or left the surface."""
        h = self._held
        if left >= 0:
            self._lay_exit(left)
        if through:
            self._get_through()
        elif h.tip[0] in (states.TOUCHES, states.SLIDES) and h.tip_side[0] < 0:
            self._let_go()
        self._before[:] = self._shape[:3]

    def _look_for_surface(self) -> None:
        """Begin a contact where the tip came through the surface in the last tick."""
        face = look_for_surface(self._interface.table, self.table, self._before, self._weights4, self._normal)
        if face >= 0:
            self._meet(face)

    def _meet(self, face: int) -> None:
        """Begin a contact where the tip comes through a face: in a path that opens there, or on the surface."""
        x, grid = self._interface.elastic.x, self._interface.elastic.grid
        h = self._held
        crossing = self._weights4 @ x[grid.faces[face]]
        path, sense = self._opening(crossing)
        if path >= 0:
            h.passing[path], h.tip[1] = sense, path
            h.tip[0] = states.OPEN if np.isfinite(self._paths.length[path]) else states.CUTS
            end = int(self._paths.node[path, 0 if sense > 0 else self._paths.count[path] - 1])
            self._hold(end)
            return
        point = self._interface.add(grid.faces[face], self._weights4)
        self._interface.equip(point, int(grid.face_cell[face]), self.radius)
        self._interface.points.soft[point] = HARD
        h.offset[point], h.torn[point], h.tip_side[:] = 0.0, 0.0, 0
        h.normal[:], h.pressed[0], h.limit[0], h.tip[2] = self._normal_around(crossing), 0.0, 0.0, point
        h.tip[0] = states.TOUCHES if self._steep() else states.SLIDES

    def _steep(self) -> bool:
        sine = -float((self._shape[3:6] * self._held.normal).sum())
        return sine >= math.sin(self._interface.material_of(self._held.tip[2]).least_angle)

    def _normal_around(self, at: Array) -> Array:
        """Outward normal of the surface near a point of it, (3,)."""
        elastic, normal = self._interface.elastic, np.empty(3)
        mean_normal(elastic.x, elastic.grid.faces, at, AROUND, self._normal, normal)
        return normal

    def _opening(self, at: Array) -> tuple[int, int]:
        """Path that opens within reach of a point of the surface, and 1 at its entry, -1 at its exit."""
        best, found = states.CAPTURE, (-1, 0)
        for path in np.flatnonzero(self._paths.count).tolist():
            if self._held.passing[path]:
                continue
            ends = [(0, 1)]
            if np.isfinite(self._paths.length[path]):
                ends.append((int(self._paths.count[path]) - 1, -1))
            for k, sense in ends:
                away = float(np.linalg.norm(self._interface.points.at[self._paths.node[path, k]] - at))
                if away < best:
                    best, found = away, (path, sense)
        return found

    def _get_through(self) -> None:
        """Puncture, cut on or leave, after the tip's force reached its limit."""
        h, paths = self._held, self._paths
        if h.tip[0] == states.TOUCHES:
            point = int(h.tip[2])
            h.drop[0] = self._drop_of(point)
            path = begin_path(paths, point)
            h.passing[path], h.tip[:] = 1, [states.CUTS, path, -1]
            h.engaged[point], h.anchor[point], h.sigma[point], h.share[point] = 1, 0.0, 0.0, 0.0
            self._interface.equip(point, self._interface.points.cell[point], self.radius)
            # The bristle takes over the force that is left, so that the tip does not leap by what it yields.
            paths.cut[path] = -float(h.limit[0] * self._interface.points.soft[point])
            self._find_far_surface()
        elif h.tip[0] == states.TENTS:
            h.tip[0] = states.LEAVES

    def _drop_of(self, point: int) -> float:
        """Time in seconds in which the force on an indented point falls."""
        dent = self._interface.points.at[point] - self._at_rest(point)
        return max(states.DROP, float(np.linalg.norm(dent)) / states.RECOIL)

    def _at_rest(self, point: int) -> Array:
        """Position (3,) of a point in the tissue at rest."""
        p = self._interface.points
        return np.asarray(p.weights[point] @ self._interface.elastic.grid.nodes[p.nodes[point]])

    def _let_go(self) -> None:
        """End the contact of the tip with the surface."""
        self._interface.release(int(self._held.tip[2]))
        self._held.tip[0], self._held.tip[2] = states.OUTSIDE, -1

    def take_left_behind(self) -> list[tuple[int, float]]:
        """Points that the tail has passed since the last call, and how far beyond it they are, m."""
        left = np.flatnonzero(self._held.left).tolist()
        self._held.left[:] = 0
        return [(i, float(self._held.sigma[i] - self._shape[10])) for i in left]

    # --- the tissue step ----------------------------------------------------------------------

    def follow(self) -> None:
        """Lay and move nodes; after the tissue has moved."""
        h = self._held
        h.offset[:] *= math.exp(-self._interface.elastic.h / FADE)
        tear(self._interface, self._paths, h.torn)
        h.engaged[self._interface.points.status != USED] = 0
        if h.tip[0] in (states.CUTS, states.TENTS):
            self._lay_node()
            self._find_far_surface()
        elif h.tip[0] in (states.TOUCHES, states.SLIDES):
            self._slide()
        elif h.tip[0] == states.OUTSIDE and not np.isnan(self._before).any():
            self._look_inside()

    def _lay_node(self) -> None:
        h, paths = self._held, self._paths
        path = int(h.tip[1])
        k = int(paths.count[path]) - 1
        front = int(paths.node[path, k])
        s = float(paths.s[path, k] + h.sigma[front])
        if not h.engaged[front] or s < paths.s[path, k] + SPACING or k + 2 >= MOST_NODES or h.tip[0] == states.TENTS:
            return
        cell = self._locate(self._shape[:3])
        if cell < 0 or self._away(cell, front) > FOLDED * (s - paths.s[path, k]):
            return
        point = self._add(cell)
        extend_path(paths, path, point, s)
        self._hold(point)
        # The new node takes over the tip's force. It would have to give way first, as the old one has: the tip stands
        # that much further beyond the cut.
        p, t = self._interface.points, self._shape[3:6]
        yields = t @ (p.C[point, point] - p.C[point, front]) @ t + p.soft[point] - p.soft[front]
        paths.cut[path] -= yields * h.load[0]

    def _away(self, cell: int, point: int) -> float:
        """Distance of the place that `_locate` has found in a cell from a point, in the tissue at rest, m."""
        grid = self._interface.elastic.grid
        there = self._weights8 @ grid.nodes[grid.cells[cell]]
        return float(np.linalg.norm(there - self._at_rest(point)))

    def _hold(self, point: int) -> None:
        """Engage a node at the tip, which holds the needle from now on."""
        h = self._held
        h.engaged[point], h.anchor[point], h.sigma[point] = 1, 0.0, 0.0
        h.offset[point] = self._shape[:3] - self._interface.points.at[point]
        h.torn[point], h.side[point], h.across[point] = 0.0, 0, 0.0

    def _lay_exit(self, path: int) -> None:
        """End a path where the needle comes through the far surface; `engage` finds how far it has."""
        x, grid, paths = self._interface.elastic.x, self._interface.elastic.grid, self._paths
        k = int(paths.count[path]) - 1
        behind = max(float(self._held.sigma[paths.node[path, k]]), 0.0)
        start = self._shape[:3] - behind * self._shape[3:6]
        face, ahead = cross_surface(
            x, grid.faces, start, self._shape[3:6], behind + 5e-3, 1.0, self._weights4, self._normal
        )
        s = float(paths.s[path, k]) + (ahead if face >= 0 else 0.0)
        paths.length[path] = max(s, 1e-6)
        if face < 0 or ahead < 0.25 * SPACING:
            return
        point = self._interface.add(grid.faces[face], self._weights4)
        self._interface.equip(point, int(grid.face_cell[face]), self.radius)
        extend_path(paths, path, point, s)
        self._held.engaged[point] = 0

    def _find_far_surface(self) -> None:
        """Length of the path at which the line ahead of the tip leaves the tissue."""
        h, x, grid = self._held, self._interface.elastic.x, self._interface.elastic.grid
        path = int(h.tip[1])
        k = int(self._paths.count[path]) - 1
        front = int(self._paths.node[path, k])
        sigma = max(float(h.sigma[front]), 0.0)
        back = min(sigma, 2e-3)
        tip, tangent = self._shape[:3], self._shape[3:6]
        face, ahead = cross_surface(
            x, grid.faces, tip - back * tangent, tangent, 0.2, 1.0, self._weights4, self._normal
        )
        h.room[0] = self._paths.s[path, k] + sigma - back + ahead if face >= 0 else np.inf

    def _slide(self) -> None:
        """Follow a tip that slides over the surface; the angle decides whether it does."""
        h, x, grid = self._held, self._interface.elastic.x, self._interface.elastic.grid
        point = int(h.tip[2])
        if h.tip[0] == states.SLIDES:
            outside = self._shape[:3] + 3e-3 * h.normal
            face, _ = cross_surface(x, grid.faces, outside, -h.normal, 6e-3, -1.0, self._weights4, self._normal)
            if face < 0:
                self._let_go()
                return
            h.normal[:] = self._normal_around(self._weights4 @ x[grid.faces[face]])
            # A point on the normal through the tip keeps the pressure; its place across starts anew.
            self._interface.place(point, grid.faces[face], self._weights4)
            h.offset[point] = (h.offset[point] @ h.normal) * h.normal
            self._interface.points.cell[point] = int(grid.face_cell[face])
        # A tip that sticks keeps the normal with which it met the surface: that of the dent says nothing of the angle.
        steep = states.TOUCHES if self._steep() else states.SLIDES
        if steep != h.tip[0]:
            h.tip[0], h.tip_side[:], h.drop[0] = steep, 0, self._drop_of(point)
            p = self._interface.points
            h.offset[point] = self._moved_tip() - p.start[point] - p.soft[point] * p.force[point]

    def _look_inside(self) -> None:
        """Begin a contact with tissue that has come over the tip."""
        h, tip, tangent = self._held, self._shape[:3], self._shape[3:6]
        near = h.engaged.astype(bool) & (np.abs(h.sigma) < 3e-3)
        if near.any() or self._locate(tip) < 0:
            return
        elastic, start = self._interface.elastic, tip - 2e-3 * tangent
        face, _ = cross_surface(elastic.x, elastic.grid.faces, start, tangent, 2e-3, -1.0, self._weights4, self._normal)
        if face >= 0:
            self._meet(face)
            point = int(h.tip[2])
            if point >= 0:
                # The surface gives way to the tip by and by, as `follow` lets the offset fade.
                h.offset[point] = self._moved_tip() - self._interface.points.at[point]

    def _moved_tip(self) -> Array:
        """Where the tip is after the last tick, (3,)."""
        tip, centre, delta = self._shape[:3], self._shape[11:], self.arrays.delta
        return np.asarray(tip + delta[:3] + np.cross(delta[3:], tip - centre))

    def _locate(self, at: Array) -> int:
        elastic = self._interface.elastic
        return int(locate(elastic.x, elastic.grid.cells, np.ascontiguousarray(at), 1e-6, self._weights8))

    def _add(self, cell: int) -> int:
        point = self._interface.add(self._interface.elastic.grid.cells[cell], self._weights8)
        self._interface.equip(point, cell, self.radius)
        return point

    # --- state --------------------------------------------------------------------------------

    @property
    def where(self) -> int:
        """Where the tip is, one of the states of `ligature.tissue.needle`."""
        return int(self._held.tip[0])

    @property
    def first_point(self) -> int:
        """Point of the interface at which the needle went in, or which its tip touches; -1 for a needle outside."""
        inside = np.flatnonzero(self._held.engaged)
        return int(inside[0]) if len(inside) else int(self._held.tip[2])

    def is_in(self, path: int) -> bool:
        """Whether the needle is in a path, or may come back to it in this step."""
        return bool(self._held.passing[path]) or int(self._held.tip[1]) == path

    @property
    def passages(self) -> int:
        """Nodes of paths that hold the needle."""
        return int(self._held.engaged.sum())

    @property
    def engaged(self) -> NDArray[np.int64]:
        """Points of the interface that hold the needle, (N,) of 0 and 1."""
        return self._held.engaged

    @property
    def depth(self) -> float:
        """Insertion depth: length of needle inside the tissue, m."""
        return float(self._held.load[3])

    @property
    def tip_force(self) -> float:
        """Force of the tip on the tissue along itself, N."""
        return float(self._held.load[0])

    @property
    def friction(self) -> float:
        """Force of the shaft on the tissue along itself, N."""
        return float(self._held.load[1])

    def withdraw(self) -> None:
        """Take the needle out at once; its path stays."""
        h, p = self._held, self._interface.points
        if h.tip[0] in (states.TOUCHES, states.SLIDES):
            self._let_go()
        p.force[h.engaged == 1] = 0.0
        self.reset()

    def reset(self) -> None:
        """Take the needle out without a trace."""
        for array in self._held:
            array[:] = 0
        self._held.tip[:], self._held.drop[0] = [states.OUTSIDE, -1, -1], states.DROP
        self._before[:] = np.nan
        self.arrays.delta[:], self._shape[:9], self._shape[11:] = 0.0, 0.0, 0.0

    def snapshot(self) -> dict[str, Array]:
        """Everything that lasts from tick to tick."""
        kept = {name: array.copy() for name, array in zip(self._held._fields, self._held, strict=True)}
        return {**kept, "before": self._before.copy(), "delta": self.arrays.delta.copy(), "shape": self._shape.copy()}

    def restore(self, snapshot: dict[str, Array]) -> None:
        """Continue from `snapshot`."""
        for name, array in zip(self._held._fields, self._held, strict=True):
            array[:] = snapshot[name]
        self._before[:], self._shape[:] = snapshot["before"], snapshot["shape"]
        self.arrays.delta[:] = snapshot["delta"]
