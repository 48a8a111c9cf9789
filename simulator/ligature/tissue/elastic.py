"""A grid of tissue that deforms: its constant matrix, forces, steps and compliance, in world axes and SI units.

The step is linearly implicit with a matrix of the shape at rest that never changes,

    A d = f(x) + M (v / h + g) + external forces,  A = M / h² + (1 + β / h) K + ε Kₛ,  x += d, v = d / h,

with f the corotated elastic forces, K the stiffness at rest, β the material's damping time and Kₛ resistance to local
rotation, which keeps the fixed matrix stable while cells turn. At rest f = 0: neither Kₛ nor β change where tissue
rests, only how it gets there. A⁻¹ is the compliance of the step: what a constant force in it moves. So a step is one
solve, whose work is shared out over its ticks, and contacts add their forces times their `response`.

A cell turned by θ is in some direction about 1 / 3 + sin²θ (λ + 2 μ) / μ times as stiff as the matrix is there, with
Lamé's λ and μ. Nodes of such cells go a part of d: that changes where they rest as little as β does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.spatial.transform import Rotation

from ligature.kernels import kernel
from ligature.mesh.grid import Grid
from ligature.model.material import TissueMaterial
from ligature.tables import opener, table_of
from ligature.tissue import elements
from ligature.tissue.corotation import LANES, add_elastic_forces
from ligature.tissue.factorisation import Factor, shares, solve_in_place, solve_part
from ligature.tissue.floating import add_inertial_forces, frame_modes, without_frame
from ligature.tissue.layout import Elimination

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

STEP = 4e-3
"""Length of a tissue step in seconds."""

ROTATION_RESISTANCE = 1.0
"""The ε above."""

OVERSHOOT = 2.0
"""Largest product of a turned cell's stiffness, over that of the matrix, and of the part of d that its nodes go."""

TABLE_NODES = 1500
"""Free nodes up to which the whole compliance is tabulated."""


KEPT = ("x", "v", "frames", "force", "load", "progress")
"""Attributes of `ElasticGrid` that last from tick to tick."""


class Bulk(NamedTuple):
    """A grid of n nodes (f of them free) and m cells of c kinds, for compiled code."""

    cells: Integers  # (m, 8) nodes, kind by kind
    batches: Integers  # (b, 3) first cell, count and kind of cells that are worked on together
    K: Array  # (c, 8, 3, 3) stiffness, N/m
    size: Array  # (c, 3) edges, m
    edges: Array  # (m, 3) the same of each cell, to the last bit
    x: Array  # (n, 3)
    v: Array  # (n, 3)
    frames: Array  # (b, 4 LANES)
    mass: Array  # (n,)
    gravity: Array  # (3,)
    free: Integers  # (f,)
    factor: Elimination
    shares: Array  # (p,) of a solve's work after each of its parts
    force: Array  # (n, 3) that moves the nodes in this step
    load: Array  # (3 f,) what is solved, and the solution
    progress: Integers  # (1,) parts of the solve that are done
    R: Array  # scratch, and so on
    c: Array
    y: Array
    part: Array  # (n,) of d
    turned: Array  # (c,) how many times as stiff a cell is that has turned by a right angle


def _bulk_example() -> Bulk:
    """The smallest instance, for the types of its arrays."""
    z = np.zeros
    i = lambda *shape: np.zeros(shape, np.int64)  # noqa: E731
    return Bulk(
        i(1, 8), i(1, 3), z((1, 8, 3, 3)), z((1, 3)), z((1, 3)), z((1, 3)), z((1, 3)), z((1, 4)), z(1), z(3), i(1),
        Elimination(i(1, 5), i(1), z(1), z(1), z(1)), z(1), z((1, 3)), z(3), i(1), z(1), z(1), z(1), z(1), z(1),
    )  # fmt: skip


open_bulk = opener(_bulk_example())


class ElasticGrid:
    """Tissue that is held at some of its nodes, or at none: then it deforms in a frame that goes along with it.

    Parameters
    ----------
    grid
        Cells and nodes at rest.
    materials
        Those that ``grid.layer`` counts.
    fixed
        Nodes that do not move, (n,).
    gravity
        (3,) m/s².
    h
        Length of a tissue step, s.

    Attributes
    ----------
    x, v
        Positions and velocities of the nodes, (n, 3).
    frames
        Rotations of the cells as quaternions x y z w, batch by batch, (b, 4 `LANES`).
    force
        What moves the nodes in this step: elastic forces, gravity, momentum and others, (n, 3) N.
    load, progress
        The solve of this step, and how many of its parts are done.
    free
        Indices of the nodes that move, (f,); `row` (n,) is the inverse, -1 for fixed nodes.
    modes
        What a step leaves to the frame, see `ligature.tissue.floating`: (6, n, 3); (0, n, 3) for tissue that is held.
    spin
        Angular velocity (3,) of the frame in rad/s, by which tissue that nothing holds feels how it turns.
    """

    def __init__(
        self,
        grid: Grid,
        materials: Sequence[TissueMaterial],
        fixed: NDArray[np.bool_],
        gravity: Sequence[float] = (0.0, 0.0, 0.0),
        h: float = STEP,
    ) -> None:
        n = len(grid.nodes)
        if grid.layer.max() >= len(materials) or grid.layer.min() < 0:
            raise ValueError(f"the grid has layers up to {grid.layer.max()}; only {len(materials)} materials are given")
        self.grid, self.materials, self.h = grid, tuple(materials), h
        self.free: Integers = np.flatnonzero(~np.asarray(fixed, dtype=bool))
        self.row = np.full(n, -1)
        self.row[self.free] = np.arange(len(self.free))
        self.gravity = np.array(gravity, dtype=np.float64)
        self._kinds()
        self.mass = np.zeros(n)
        np.add.at(self.mass, grid.cells, (self._cell_mass / 8.0)[:, None])
        self._factor = Factor(self._matrix(), grid.site[self.free])
        self.modes = frame_modes(self._factor.solve, self.mass, grid.nodes) if self.floats else np.zeros((0, n, 3))
        self.spin = np.zeros(3)
        self._responses: Array | None = None
        self.x, self.v = grid.nodes.copy(), np.zeros((n, 3))
        self.force, self.load = np.zeros((n, 3)), np.zeros(3 * len(self.free))
        self.progress = np.zeros(1, dtype=np.int64)
        order = np.argsort(self._kind, kind="stable")
        batches = _batches(self._kind[order])
        self.frames = np.zeros((len(batches), 4 * LANES))
        self._bulk = Bulk(
            np.ascontiguousarray(grid.cells[order]), batches, np.array([elements.blocks(K) for K in self._K]),
            self._size, np.ascontiguousarray(grid.sizes[order]), self.x, self.v, self.frames, self.mass, self.gravity,
            self.free, self._factor.arrays, shares(self._factor.arrays), self.force, self.load, self.progress,
            np.zeros(9 * LANES), np.zeros(24 * LANES), np.zeros(24 * LANES), np.zeros(n), self._turned,
        )  # fmt: skip
        self._bulk_table = table_of(self._bulk)
        self.reset()

    def _kinds(self) -> None:
        """Cells of one size and material share their matrices."""
        sizes = self.grid.sizes
        key = np.column_stack([np.round(sizes / sizes.max(), 9), self.grid.layer])
        _, first, kind = np.unique(key, axis=0, return_index=True, return_inverse=True)
        self._kind = kind.reshape(-1).astype(np.int64)
        self._size = np.ascontiguousarray(sizes[first])
        made_of = [self.materials[i] for i in self.grid.layer[first]]
        pairs = list(zip(self._size, made_of, strict=True))
        moduli = np.array([elements.lame(m.youngs, m.poisson) for m in made_of])
        self._turned = moduli[:, 0] / moduli[:, 1] + 2.0
        self._K = np.array([elements.stiffness(s, m.youngs, m.poisson) for s, m in pairs])
        skew = np.array([elements.skew_stiffness(s, m.youngs, m.poisson) for s, m in pairs])
        lag = np.array([1.0 + m.damping / self.h for m in made_of])
        self._step_K = lag[:, None, None] * self._K + ROTATION_RESISTANCE * skew
        self._cell_mass = (sizes.prod(axis=1)) * np.array([m.density for m in made_of])[self._kind]

    def _matrix(self) -> csr_matrix:
        """A over the free unknowns."""
        dofs = (3 * self.row[self.grid.cells][:, :, None] + np.arange(3)).reshape(-1, 24)
        known = np.repeat(self.row[self.grid.cells] >= 0, 3, axis=1)
        values = self._step_K[self._kind]
        keep = known[:, :, None] & known[:, None, :]
        row = np.broadcast_to(dofs[:, :, None], values.shape)[keep]
        column = np.broadcast_to(dofs[:, None, :], values.shape)[keep]
        size = 3 * len(self.free)
        A = coo_matrix((values[keep], (row, column)), shape=(size, size)).tocsr()
        A = (A + diags(np.repeat(self.mass[self.free], 3) / self.h**2)).tocsr()
        A.sort_indices()
        return A

    @property
    def floats(self) -> bool:
        """Whether nothing holds it."""
        return len(self.free) == len(self.row)

    # --- the step -----------------------------------------------------------------------------

    def begin(self, external: Array | None = None) -> None:
        """Find the `force` of the next step, and turn the cells' frames; `solve` then finds what it does.

        ``external`` (n, 3) are forces beside gravity; what contacts add is found by superposition of `response`.
        """
        self.force[:] = 0.0 if external is None else external
        if self.spin.any():
            add_inertial_forces(self.mass, self.x, self.v, self.spin, self.h, self.force)
        begin(self._bulk_table, self.h)

    def solve(self, share: float) -> None:
        """Go on with the solve until this share of its work is done, 1 for all."""
        solve_share(self._bulk_table, share)

    def displacement(self) -> Array:
        """Displacements of all nodes in the step that is solved, (n, 3) m."""
        d = np.zeros_like(self.x)
        d[self.free] = self.load.reshape(-1, 3)
        if self.floats:
            without_frame(self.modes, d, self.force)
        return d

    def predict(self, external: Array | None = None) -> Array:
        """Displacement of all nodes in the next step, (n, 3) m: `begin`, the whole `solve`, `displacement`."""
        self.begin(external)
        self.solve(1.0)
        return self.displacement()

    def advance(self, d: Array) -> None:
        """Move the nodes by a step's displacements (n, 3), those of cells that have turned far by a part of them."""
        advance(self._bulk_table, d, self.h)

    def elastic_forces(self) -> Array:
        """Elastic forces on all nodes, those of supports included, (n, 3) N; turns the cells' frames."""
        f = np.zeros_like(self.x)
        elastic_forces(self._bulk_table, f)
        return f

    def energy(self) -> float:
        """Kinetic, elastic and potential energy in joules; turns the cells' frames."""
        self.elastic_forces()
        b = self._bulk
        elastic = 0.0
        for (first, count, kind), q in zip(b.batches.tolist(), self.frames, strict=True):
            R = Rotation.from_quat(q.reshape(4, LANES)[:, :count].T).as_matrix()
            cells = b.cells[first : first + count]
            x, rest = self.x[cells], self.grid.nodes[cells]
            y = ((x - x[:, :1]) @ R - (rest - rest[:, :1])).reshape(count, 24)
            elastic += 0.5 * float(np.einsum("ci,ij,cj->", y, self._K[kind], y))
        height = (self.x - self.grid.nodes) @ self.gravity
        return 0.5 * float(self.mass @ (self.v**2).sum(axis=1)) + elastic - float(self.mass @ height)

    # --- compliance ---------------------------------------------------------------------------

    def response(self, nodes: Integers, weights: Array) -> Array:
        """Displacements of all nodes in a step for forces of 1 N along x, y, z on a point, (3, n, 3) m/N.

        The point is the mean of ``nodes`` (k,) with ``weights`` (k,).
        """
        out = np.zeros((3, *self.x.shape))
        table = self.responses
        if len(table):
            for node, weight in zip(self.row[nodes].tolist(), weights.tolist(), strict=True):
                if node >= 0 and weight != 0.0:
                    out += weight * table[node]
            return out
        for axis in range(3):
            load = np.zeros((len(self.free), 3))
            for node, weight in zip(self.row[nodes].tolist(), weights.tolist(), strict=True):
                if node >= 0:
                    load[node, axis] += weight
            out[axis, self.free] = self._factor.solve(load.reshape(-1)).reshape(-1, 3)
            if self.floats:
                without_frame(self.modes, out[axis], load)
        return out

    @property
    def factor(self) -> Elimination:
        """The factor of A over the free unknowns."""
        return self._factor.arrays

    @property
    def responses(self) -> Array:
        """Displacements of all nodes for 1 N along x, y, z on each free node, (f, 3, n, 3) m/N.

        Made when it is first asked for; (0, 3, n, 3) for a grid that is too large for it.
        """
        if self._responses is None:
            f = len(self.free) if len(self.free) <= TABLE_NODES else 0
            self._responses = np.zeros((f, 3, *self.x.shape))
            tabulate(self._bulk_table, self._responses)
            if f and self.floats:
                self._responses -= np.einsum("kfa,knb->fanb", self.modes, self.modes)
        return self._responses

    # --- state --------------------------------------------------------------------------------

    def reset(self) -> None:
        """Return to rest."""
        self.x[:], self.v[:], self.force[:], self.load[:], self.progress[:] = self.grid.nodes, 0.0, 0.0, 0.0, 0
        self.frames[:] = np.repeat([0.0, 0.0, 0.0, 1.0], LANES)


def _batches(kind: Integers) -> Integers:
    """First cell, count and kind of batches of at most `LANES` cells of one kind, for ascending ``kind`` (m,)."""
    ends = np.append(np.flatnonzero(np.diff(kind)) + 1, len(kind)).tolist()
    found = []
    for begin, end in zip([0, *ends[:-1]], ends, strict=True):
        found += [(first, min(LANES, end - first), int(kind[begin])) for first in range(begin, end, LANES)]
    return np.array(found, dtype=np.int64).reshape(-1, 3)


@kernel
def elastic_forces(table: Integers, f: Array) -> None:
    """f (n, 3) -= the elastic forces on all nodes."""
    b = open_bulk(table)
    add_elastic_forces(b.cells, b.batches, b.K, b.size, b.edges, b.x, b.frames, f, b.R, b.c, b.y)


@kernel
def begin(table: Integers, h: float) -> None:
    """Add to the external forces in ``force`` all that moves the nodes in a step of ``h`` s, and load its solve."""
    b = open_bulk(table)
    for i in range(b.x.shape[0]):
        for a in range(3):
            b.force[i, a] += b.mass[i] * (b.v[i, a] / h + b.gravity[a])
    add_elastic_forces(b.cells, b.batches, b.K, b.size, b.edges, b.x, b.frames, b.force, b.R, b.c, b.y)
    for k in range(b.free.shape[0]):
        for a in range(3):
            b.load[3 * k + a] = b.force[b.free[k], a]
    b.progress[0] = 0


@kernel
def advance(table: Integers, d: Array, h: float) -> None:
    """Move the nodes by their parts of the displacements ``d`` (n, 3) of a step of ``h`` s."""
    b = open_bulk(table)
    b.part[:] = 1.0
    for batch in range(b.batches.shape[0]):
        first, lanes, kind = b.batches[batch]
        for lane in range(lanes):
            half = b.frames[batch, 3 * LANES + lane] ** 2  # cos²(θ / 2)
            turned = 4.0 * half * (1.0 - half) if half > 0.5 else 1.0  # sin²θ, 1 beyond a right angle
            stiffer = 1.0 / 3.0 + turned * b.turned[kind]
            if stiffer > OVERSHOOT:
                for k in range(8):
                    i = b.cells[first + lane, k]
                    b.part[i] = min(b.part[i], OVERSHOOT / stiffer)
    for i in range(b.x.shape[0]):
        for a in range(3):
            way = b.part[i] * d[i, a]
            b.x[i, a] += way
            b.v[i, a] = way / h


@kernel
def solve_share(table: Integers, share: float) -> None:
    """Do the parts of the solve up to this share of its work."""
    b = open_bulk(table)
    end = b.progress[0]
    while end < b.shares.shape[0] and b.shares[end] <= share:
        end += 1
    solve_part(b.factor, b.load, b.progress[0], end)
    b.progress[0] = end


@kernel
def tabulate(table: Integers, responses: Array) -> None:
    """Fill ``responses`` (f, 3, n, 3) with the displacements for unit forces on each free node."""
    b = open_bulk(table)
    for node in range(responses.shape[0]):
        for axis in range(3):
            for k in range(b.load.shape[0]):
                b.load[k] = 0.0
            b.load[3 * node + axis] = 1.0
            solve_in_place(b.factor, b.load)
            for k in range(b.free.shape[0]):
                for a in range(3):
                    responses[node, axis, b.free[k], a] = b.load[3 * k + a]
