"""Factors a symmetric positive definite matrix of grid nodes once and solves with it at every step.

Nodes are ordered by nested dissection of their lattice indices (George, SIAM J. Numer. Anal. 10, 1973, 345): planes of
the lattice split the grid in two until the pieces are small. Each separator or piece is a block of the ordering;
blocks are eliminated from the leaves of the tree to its root (the multifrontal method: Liu, SIAM Review 34, 1992,
82), each by A = [[P, Bᵀ], [B, S]] → D = P⁻¹, U = B D, S - U Bᵀ. A solve then is products of dense blocks with vectors
alone: x₂ -= U b₁ up the tree, x₁ = D b₁ - Uᵀ x₂ down. The loops run in one thread, in one order, without
reductions that a compiler could reorder, so that the bits depend on the input alone. They run over slices: an index
into a long array that could be negative leaves a loop without vectors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from ligature.kernels import inlined, kernel
from ligature.tissue.dense import invert, subtract_product
from ligature.tissue.layout import Elimination

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

LEAF = 12
"""Nodes of a piece that is not split any more; measured by `tests/bench/tissue.py`."""


@dataclass(frozen=True, eq=False)
class Block:
    """Nodes eliminated together (w,), the later nodes that they touch (m,), and the blocks below in the tree."""

    own: Integers
    later: Integers
    children: tuple[int, ...]


def dissect(site: Integers, leaf: int = LEAF) -> list[tuple[Integers, tuple[int, ...]]]:
    """Nested dissection of nodes at lattice indices ``site`` (n, 3): blocks of nodes with their children, leaves first.

    A plane of nodes separates the two sides of it, since cells reach from one plane to the next only.
    """
    blocks: list[tuple[Integers, tuple[int, ...]]] = []

    def split(nodes: Integers) -> int:
        low, high = site[nodes].min(axis=0), site[nodes].max(axis=0)
        extent = high - low
        axis = int(np.argmax(extent))
        if len(nodes) <= leaf or extent[axis] < 2:
            blocks.append((nodes, ()))
            return len(blocks) - 1
        along = site[nodes, axis]
        counts = np.bincount(along - low[axis])
        below = np.cumsum(counts) - counts
        above = len(nodes) - below - counts
        inner = np.arange(1, extent[axis])
        # The smaller the separator and the more equal its sides, the less work.
        cost = np.abs(below - above)[inner] + 4 * counts[inner]
        plane = low[axis] + int(inner[np.argmin(cost)])
        children = tuple(split(part) for part in (nodes[along < plane], nodes[along > plane]) if len(part))
        blocks.append((nodes[along == plane], children))
        return len(blocks) - 1

    if len(site):
        split(np.arange(len(site)))
    return blocks


def analyse(site: Integers, neighbours: csr_matrix, leaf: int = LEAF) -> list[Block]:
    """Blocks in the order of elimination, with what each touches: ``neighbours`` (n, n) has a value where nodes do."""
    order = dissect(site, leaf)
    rank = np.empty(len(site), dtype=np.int64)
    for number, (own, _) in enumerate(order):
        rank[own] = number
    blocks: list[Block] = []
    for number, (own, children) in enumerate(order):
        touched = [neighbours[own].indices.astype(np.int64), *(blocks[c].later for c in children)]
        later = np.unique(np.concatenate(touched))
        later = later[rank[later] > number]
        # By rank, so that what comes from a child lies in few runs.
        blocks.append(Block(own, later[np.lexsort((later, rank[later]))], children))
    return blocks


class Factor:
    """The factor of a matrix with 3 x 3 blocks, one for each pair of nodes.

    Parameters
    ----------
    A
        Symmetric positive definite, (3 n, 3 n), unknowns x, y, z of a node together.
    site
        Lattice indices of the nodes, (n, 3).

    Raises
    ------
    ValueError
        When A is not positive definite.
    """

    def __init__(self, A: csr_matrix, site: Integers, leaf: int = LEAF) -> None:
        n = len(site)
        pattern = csr_matrix((np.ones(A.nnz), A.indices // 3, A.indptr), shape=(3 * n, n))
        joined = csr_matrix(pattern[::3] + pattern[1::3] + pattern[2::3])
        blocks = analyse(site, joined, leaf)
        self.size = 3 * n
        self._blocks = blocks
        dofs = [(_dofs(b.own), _dofs(b.later)) for b in blocks]
        width = np.array([len(own) for own, _ in dofs], dtype=np.int64)
        height = np.array([len(later) for _, later in dofs], dtype=np.int64)
        sizes = np.stack([width + height, height * width, width * width + height * width], axis=1)
        starts = np.cumsum(sizes, axis=0) - sizes
        self.arrays = Elimination(
            np.ascontiguousarray(np.column_stack([width, height, starts])),
            np.concatenate([np.concatenate(pair) for pair in dofs]) if blocks else np.zeros(0, np.int64),
            np.zeros(int((width * width).sum() + (height * width).sum())),
            np.zeros(int((height * width).sum())),
            np.zeros(2 * int((width + height).max(initial=0))),
        )
        self._factor(A, dofs)

    @property
    def nonzeros(self) -> int:
        """Values that a solve reads in its two passes."""
        return len(self.arrays.down) + len(self.arrays.up)

    def _factor(self, A: csr_matrix, dofs: list[tuple[Integers, Integers]]) -> None:
        place = np.zeros(self.size, dtype=np.int64)
        updates: dict[int, Array] = {}
        arrays, down, up = self.arrays, 0, 0
        for number, (own, later) in enumerate(dofs):
            w, m = len(own), len(later)
            front = np.concatenate([own, later])
            place[front] = np.arange(w + m)
            F = np.zeros((w + m, w + m))
            rows = A[own]
            row = np.repeat(np.arange(w), np.diff(rows.indptr))
            # What is eliminated already has no place in this front.
            known = np.isin(rows.indices, front, kind="table")
            F[row[known], place[rows.indices[known]]] = rows.data[known]
            F[w:, :w] = F[:w, w:].T
            for child in self._blocks[number].children:
                at = place[dofs[child][1]]
                F[np.ix_(at, at)] += updates.pop(child)
            D, U = np.empty((w, w)), np.zeros((m, w))
            if not invert(np.ascontiguousarray(F[:w, :w]), D):
                raise ValueError("the matrix of the tissue is not positive definite; check its material and supports")
            B, S = np.ascontiguousarray(F[w:, :w]), np.ascontiguousarray(F[w:, w:])
            subtract_product(-B, D, U)
            subtract_product(U, np.ascontiguousarray(B.T), S)
            updates[number] = S
            arrays.down[down : down + w * w] = D.ravel()
            arrays.down[down + w * w : down + w * w + m * w] = U.ravel()
            arrays.up[up : up + m * w] = U.T.ravel()
            down += w * w + m * w
            up += m * w

    def solve(self, b: Array) -> Array:
        """Solve A x = b for b (3 n,); returns x as a new array."""
        x = np.array(b, dtype=np.float64)
        solve_in_place(self.arrays, x)
        return x


def _dofs(nodes: Integers) -> Integers:
    return (3 * nodes[:, None] + np.arange(3)).ravel()


def shares(factor: Elimination) -> Array:
    """Share of a solve's work that is done after each of its parts, (2 b,); see `solve_part`."""
    w, m = factor.extent[:, 0], factor.extent[:, 1]
    done = np.cumsum(np.concatenate([m * w, (w * w + m * w)[::-1]]), dtype=np.float64)
    return done / done[-1] if len(done) else done


@kernel
def solve_in_place(factor: Elimination, x: Array) -> None:
    """Replace ``x`` (n,) by the solution of A x = b for the b that it holds."""
    solve_part(factor, x, 0, 2 * factor.extent.shape[0])


@kernel
def solve_part(factor: Elimination, x: Array, begin: int, end: int) -> None:
    """Do the parts from ``begin`` to ``end`` of what `solve_in_place` does: up the tree block by block, then down."""
    blocks = factor.extent.shape[0]
    for part in range(begin, min(end, blocks)):
        _eliminate(factor, x, part)
    for part in range(max(begin, blocks), end):
        _substitute(factor, x, 2 * blocks - 1 - part)


@inlined
def _eliminate(factor: Elimination, x: Array, block: int) -> None:
    """Take from the later unknowns of a block what its own do to them."""
    index, up, u = factor.index, factor.up, factor.work
    w, m, at, start = factor.extent[block, 0], factor.extent[block, 1], factor.extent[block, 2], factor.extent[block, 3]
    # A load on few nodes leaves most blocks alone on the way up.
    loaded = False
    for j in range(w):
        loaded = loaded or x[index[at + j]] != 0.0
    if not loaded:
        return
    u = u[:m]
    for i in range(m):
        u[i] = 0.0
    j = 0
    while j + 4 <= w:
        p, q, r, s = x[index[at + j]], x[index[at + j + 1]], x[index[at + j + 2]], x[index[at + j + 3]]
        k = start + j * m
        a, b, c, d = up[k : k + m], up[k + m : k + 2 * m], up[k + 2 * m : k + 3 * m], up[k + 3 * m : k + 4 * m]
        for i in range(m):
            u[i] += p * a[i] + q * b[i] + r * c[i] + s * d[i]
        j += 4
    while j < w:
        p, k = x[index[at + j]], start + j * m
        a = up[k : k + m]
        for i in range(m):
            u[i] += p * a[i]
        j += 1
    for i in range(m):
        x[index[at + w + i]] -= u[i]


@inlined
def _substitute(factor: Elimination, x: Array, block: int) -> None:
    """Find the own unknowns of a block from the later ones."""
    index, down = factor.index, factor.down
    half = factor.work.shape[0] // 2
    w, m, at, start = factor.extent[block, 0], factor.extent[block, 1], factor.extent[block, 2], factor.extent[block, 4]
    u, b = factor.work[:w], factor.work[half:]
    for j in range(w):
        b[j] = x[index[at + j]]
        u[j] = 0.0
    # The rows of D, then those of U with the values above them.
    for j in range(m):
        b[w + j] = -x[index[at + w + j]]
    j = 0
    while j + 4 <= w + m:
        p, q, r, s = b[j], b[j + 1], b[j + 2], b[j + 3]
        k = start + j * w
        c, d, e, f = down[k : k + w], down[k + w : k + 2 * w], down[k + 2 * w : k + 3 * w], down[k + 3 * w : k + 4 * w]
        for i in range(w):
            u[i] += p * c[i] + q * d[i] + r * e[i] + s * f[i]
        j += 4
    while j < w + m:
        p, k = b[j], start + j * w
        c = down[k : k + w]
        for i in range(w):
            u[i] += p * c[i]
        j += 1
    for j in range(w):
        x[index[at + j]] = u[j]
