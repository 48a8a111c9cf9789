"""The arrays of a block of tissue, grouped for compiled code; world axes, SI units.

Groups that change only in their contents reach kernels as one table of addresses (`ligature.tables`): handing their
arrays over one by one costs more than a tick's own work.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.tables import opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST_POINTS = 320
"""Most points of contact of a block at one time."""

MOST_PATHS, MOST_NODES = 16, 32
"""Paths of a block, and nodes of a path, at most."""

GROUP = 16
"""Faces that share a box in the search for contacts."""

UNUSED, USED, LEAVING = 0, 1, 2
"""A point that leaves has forces of this step to hand over, and pushes no more."""

FRICTION, STRENGTH, PUNCTURE, CUTTING, EXIT, SHEAR = range(6)
"""Columns of `Field.material`."""


class Elimination(NamedTuple):
    """A factor of the step's matrix, see `ligature.tissue.factorisation`."""

    extent: Integers  # (b, 5) own and later unknowns of a block, and where it begins in index, up and down
    index: Integers  # type: ignore[assignment]  # those unknowns, block after block
    down: Array
    up: Array
    work: Array


class Field(NamedTuple):
    """What points of contact need of a grid of n nodes (f of them free), m cells and q faces on the surface."""

    x: Array  # (n, 3) at the start of the step
    force: Array  # (n, 3) that moves the nodes in this step, besides those on the points, N
    cells: Integers  # (m, 8)
    layer: Integers  # (m,)
    faces: Integers  # (q, 4) the faces, and after them the edges i, j, j, i and nodes i, i, i, i that move
    face_cell: Integers  # (q,)
    around: Integers  # (k, 8) the faces around each of these k edges and nodes, -1 for none
    core: Array  # (q,) distance of a held face, m, within which nothing presses the tissue; 0 for faces that move
    face_box: Array  # (q, 2, 3) around the faces at the start of the step, and what is so near
    group_box: Array  # (ceil(q / GROUP), 2, 3) around faces that follow each other
    box: Array  # (2, 3) around all nodes then
    free: Integers  # (f,)
    row: Integers  # (n,) its inverse, -1 for nodes that are held
    table: Array  # (f, 3, n, 3) responses of the free nodes, m/N; or (0, 3, n, 3), and `factor` is used
    factor: Elimination
    load: Array  # (3 f,) scratch
    change: Array  # (N, 3) scratch: forces on the points over their means in the last step
    response: Array  # (N, 3, n, 3) displacements of all nodes for 1 N along x, y, z on a point
    modes: Array  # (6, n, 3) what a step leaves to the frame of tissue that nothing holds; or (0, n, 3)
    material: Array  # (layers, 6)
    clock: Integers  # (2,) ticks of this step that are over, and in all
    found: Integers  # (1,) how often the boxes were found


class Points(NamedTuple):
    """N points, of which the first ``filled`` of ``used`` count."""

    filled: Integers  # (1,)
    used: Integers  # (N,) all that are not `UNUSED`, ascending
    status: Integers  # (N,)
    nodes: Integers  # (N, 8)
    weights: Array  # (N, 8)
    cell: Integers  # (N,) around it, for its material
    start: Array  # (N, 3) place at the start of the step
    move: Array  # (N, 3) motion in the step under the mean forces of the last one
    force: Array  # (N, 3) on the tissue in this tick
    mean: Array  # (N, 3) over the last step
    total: Array  # (N, 3) over the ticks of this step
    at: Array  # (N, 3) at the end of the last tick
    C: Array  # (N, N, 3, 3) m/N
    soft: Array  # (N,) local compliance of the bristle, m/N
    friction: Array  # (N,) N for each metre of needle
    strength: Array  # (N,) N for each metre of needle or thread
    puncture: Array  # (N,) force at which a tip enters, N
    cutting: Array  # (N,) and gets further
    exit: Array  # (N,) beyond that, and leaves


class Paths(NamedTuple):
    """P paths of up to K nodes."""

    count: Integers  # type: ignore[assignment]  # (P,) nodes; 0 for a path that is not in use
    node: Integers  # (P, K) points of the interface, in order from the entry
    s: Array  # (P, K) length of the path up to the node, m
    cut: Array  # (P,) length up to which it is cut
    length: Array  # (P,) length to the exit; infinite before there is one


class Tissue(NamedTuple):
    """A block as needles, threads and bodies meet it."""

    field: Field
    points: Points
    paths: Paths


def points(capacity: int = MOST_POINTS) -> Points:
    """Room for ``capacity`` points, none yet."""
    N, z = capacity, np.zeros
    i = lambda *shape: np.zeros(shape, np.int64)  # noqa: E731
    return Points(
        i(1), i(N), i(N), i(N, 8), z((N, 8)), i(N), z((N, 3)), z((N, 3)), z((N, 3)), z((N, 3)), z((N, 3)), z((N, 3)),
        z((N, N, 3, 3)), z(N), z(N), z(N), z(N), z(N), z(N),
    )  # fmt: skip


def paths(number: int = MOST_PATHS, nodes: int = MOST_NODES) -> Paths:
    """Room for paths, none yet."""
    P, K = number, nodes
    return Paths(np.zeros(P, np.int64), np.zeros((P, K), np.int64), np.zeros((P, K)), np.zeros(P), np.full(P, np.inf))


def _example() -> Tissue:
    """The smallest block, for the types of its arrays."""
    z = np.zeros
    i = lambda *shape: np.zeros(shape, np.int64)  # noqa: E731
    factor = Elimination(i(1, 5), i(1), z(1), z(1), z(1))
    field = Field(
        z((1, 3)), z((1, 3)), i(1, 8), i(1), i(1, 4), i(1), i(1, 8), z(1), z((1, 2, 3)), z((1, 2, 3)), z((2, 3)), i(1),
        i(1), z((1, 3, 1, 3)), factor, z(3), z((1, 3)), z((1, 3, 1, 3)), z((6, 1, 3)), z((1, 6)), i(2), i(1),
    )  # fmt: skip
    return Tissue(field, points(1), paths(1, 1))


open_tissue = opener(_example())
