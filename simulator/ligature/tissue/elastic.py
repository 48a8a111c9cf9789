"""A grid of tissue that deforms: its constant matrix, forces, steps and compliance, in world axes and SI units.

The step is linearly implicit with a matrix of the shape at rest that never changes,

    A d = f(x) + M (v / h + g) + external forces,  A = M / h² + (1 + β / h) K + ε Kₛ,  x += d, v = d / h,

with f the corotated elastic forces, K the stiffness at rest, β the material's damping time and Kₛ resistance to local
rotation, which keeps the fixed matrix stable while cells turn. At rest f = 0: neither Kₛ nor β change where tissue
rests, only how it gets there. A⁻¹ is the compliance of the step: what a constant force in it moves. So a step is the
one solve of `predict`, to which contacts add their forces times their `response`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, diags

from ligature.kernels import kernel
from ligature.mesh.grid import Grid
from ligature.model.material import TissueMaterial
from ligature.tables import opener, table_of
from ligature.tissue import elements
from ligature.tissue.corotation import add_elastic_forces
from ligature.tissue.factorisation import Factor, solve_in_place
from ligature.tissue.layout import Elimination

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

STEP = 4e-3
"""Length of a tissue step in seconds."""

ROTATION_RESISTANCE = 1.0
"""The ε above."""

TABLE_NODES = 1500
"""Free nodes up to which the whole compliance is tabulated."""


class Bulk(NamedTuple):
    """A grid of n nodes (f of them free) and m cells of c kinds, for compiled code."""

    cells: Integers  # (m, 8)
    kind: Integers  # (m,)
    K: Array  # (c, 24, 24) stiffness, N/m
    size: Array  # (c, 3) edges, m
    rest: Array  # (n, 3) nodes at rest
    x: Array  # (n, 3)
    v: Array  # (n, 3)
    frames: Array  # (m, 4)
    mass: Array  # (n,)
    gravity: Array  # (3,)
    free: Integers  # (f,)
    factor: Elimination
    force: Array  # (n, 3) scratch, and so on
    load: Array  # (3 f,)
    R: Array  # (3, 3)
    F: Array  # (3, 3)
    y: Array  # (24,)
    g: Array  # (24,)


def _bulk_example() -> Bulk:
    """The smallest one: what counts is the types of its arrays."""
    z = np.zeros
    i = lambda *shape: np.zeros(shape, np.int64)  # noqa: E731
    return Bulk(
        i(1, 8), i(1), z((1, 24, 24)), z((1, 3)), z((1, 3)), z((1, 3)), z((1, 3)), z((1, 4)), z(1), z(3), i(1),
        Elimination(i(1, 2), i(1), z(1), z(1), z(1)), z((1, 3)), z(3), z((3, 3)), z((3, 3)), z(24), z(24),
    )  # fmt: skip


open_bulk = opener(_bulk_example())


class ElasticGrid:
    """Tissue that is held at some of its nodes.

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
        Rotations of the cells as quaternions x y z w, (m, 4).
    free
        Indices of the nodes that move, (f,); `row` (n,) is the inverse, -1 for fixed nodes.
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
        self._responses: Array | None = None
        self.x, self.v = grid.nodes.copy(), np.zeros((n, 3))
        self.frames = np.zeros((len(grid.cells), 4))
        cells, rest, n_free = np.ascontiguousarray(grid.cells), np.ascontiguousarray(grid.nodes), len(self.free)
        self._bulk = Bulk(
            cells, self._kind, self._K, self._size, rest, self.x, self.v, self.frames, self.mass, self.gravity,
            self.free, self._factor.arrays, np.zeros((n, 3)), np.zeros(3 * n_free), np.zeros((3, 3)),
            np.zeros((3, 3)), np.zeros(24), np.zeros(24),
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

    # --- the step -----------------------------------------------------------------------------

    def predict(self, external: Array | None = None) -> Array:
        """Displacement of all nodes in the next step, (n, 3) m; turns the cells' frames.

        ``external`` (n, 3) are forces beside gravity; what contacts add is found by superposition of `response`.
        """
        d = np.zeros_like(self.x) if external is None else np.array(external, dtype=np.float64)
        predict(self._bulk_table, self.h, d)
        return d

    def advance(self, d: Array) -> None:
        """Move the nodes by a step's displacements (n, 3)."""
        self.x += d
        np.divide(d, self.h, out=self.v)

    def _elastic_forces(self, f: Array) -> float:
        return float(elastic_forces(self._bulk_table, f))

    def elastic_forces(self) -> Array:
        """Elastic forces on all nodes, those of supports included, (n, 3) N."""
        f = np.zeros_like(self.x)
        self._elastic_forces(f)
        return f

    def energy(self) -> float:
        """Kinetic, elastic and potential energy in joules."""
        elastic = self._elastic_forces(np.zeros_like(self.x))
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
        return self._responses

    # --- state --------------------------------------------------------------------------------

    def reset(self) -> None:
        """Return to rest."""
        self.x[:], self.v[:] = self.grid.nodes, 0.0
        self.frames[:] = [0.0, 0.0, 0.0, 1.0]


@kernel
def elastic_forces(table: Integers, f: Array) -> float:
    """f (n, 3) -= the elastic forces on all nodes; returns the elastic energy in J."""
    b = open_bulk(table)
    return add_elastic_forces(b.cells, b.kind, b.K, b.size, b.rest, b.x, b.frames, f, b.R, b.F, b.y, b.g)


@kernel
def predict(table: Integers, h: float, d: Array) -> None:
    """Replace the external forces ``d`` (n, 3) by the displacements in a step of ``h`` seconds."""
    b = open_bulk(table)
    for i in range(b.x.shape[0]):
        for a in range(3):
            b.force[i, a] = b.mass[i] * (b.v[i, a] / h + b.gravity[a]) + d[i, a]
            d[i, a] = 0.0
    add_elastic_forces(b.cells, b.kind, b.K, b.size, b.rest, b.x, b.frames, b.force, b.R, b.F, b.y, b.g)
    for k in range(b.free.shape[0]):
        for a in range(3):
            b.load[3 * k + a] = b.force[b.free[k], a]
    solve_in_place(b.factor, b.load)
    for k in range(b.free.shape[0]):
        for a in range(3):
            d[b.free[k], a] = b.load[3 * k + a]


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
