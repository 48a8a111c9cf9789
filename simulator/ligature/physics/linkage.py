"""Mechanisms as arrays for compiled code: trees that loops join, where their ends meet, and single trees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from ligature.model.mechanism import LEAST_SIZE
from ligature.physics.divergence import joined
from ligature.physics.engine import Engine
from ligature.physics.loop_arrays import Loops, loops

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class End:
    """Where a closing joint meets its outer body: ``rows`` of both, and the frames (7,) in them that are to coincide.

    ``trees`` are those of both, ``mechanism`` all moving ones that loops join to them. A ``point`` does not hold turns.
    """

    joint: int
    trees: tuple[int, int]
    mechanism: tuple[int, ...]
    rows: tuple[int, int]
    frames: tuple[Array, Array]
    point: bool


def moving_trees(engine: Engine, trees: Sequence[int]) -> tuple[int, ...]:
    """The trees that move and that loops join to ``trees``, sorted."""
    moves = [not tree.static or bool(tree.axes) for tree in engine.trees]
    return tuple(sorted(k for k in joined(engine, [k for k in trees if moves[k]]) if moves[k]))


def lay_out(engine: Engine, ends: Sequence[End]) -> Loops:
    """The arrays of the mechanisms of ``ends``, which are sorted by mechanism, and of all other trees with joints."""
    groups = [(mechanism, list(members)) for mechanism, members in groupby(ends, key=lambda end: end.mechanism)]
    trees, motions = engine.trees, engine.motions
    looped = {k for mechanism, _ in groups for k in mechanism}
    groups += [((k,), []) for k, tree in enumerate(trees) if tree.axes and k not in looped]
    sizes = [sum(_coordinates(engine, k) for k in mechanism) for mechanism, _ in groups]
    most = max(sizes, default=1), max((len(members) for _, members in groups), default=1)
    count = sum(len(mechanism) for mechanism, _ in groups)
    arrays = loops(len(groups), count, len(ends), len(motions.pose), len(motions.position), most)
    arrays.tree[:] = [k for mechanism, _ in groups for k in mechanism]
    arrays.tree_begin[1:] = np.cumsum([len(mechanism) for mechanism, _ in groups])
    arrays.begin[1:] = np.cumsum([len(members) for _, members in groups])
    arrays.size[:] = sizes
    arrays.extent[:] = [_extent(engine, mechanism) for mechanism, _ in groups]
    arrays.low[:] = [-np.inf if axis.low is None else axis.low for tree in trees for _, _, axis, _ in tree.axes]
    arrays.high[:] = [np.inf if axis.high is None else axis.high for tree in trees for _, _, axis, _ in tree.axes]
    for mechanism, _ in groups:
        begin = 0
        for k in mechanism:
            base = motions.row(k, -1)
            arrays.column[base], arrays.width[base] = begin, 0 if trees[k].static else 6
            begin += int(arrays.width[base])
            for link, *_ in trees[k].axes:
                row = motions.row(k, link)
                arrays.column[row], arrays.width[row] = begin, 1
                begin += 1
    for c, end in enumerate(ends):
        arrays.end_row[c], arrays.end_frame[c], arrays.point[c] = end.rows, end.frames, end.point
    return arrays


def _coordinates(engine: Engine, tree: int) -> int:
    return len(engine.trees[tree].axes) + (0 if engine.trees[tree].static else 6)


def _extent(engine: Engine, mechanism: Sequence[int]) -> float:
    """Extent in metres of a mechanism as it stands now: of its joints and bodies."""
    motions = engine.motions
    rows = []
    for k in mechanism:
        motions.links(k)
        rows += list(range(motions.row(k, -1), motions.row(k, len(engine.trees[k].frames))))
    places = np.concatenate([motions.trees.frame[rows, :3], motions.pose[rows, :3]])
    return max(float(np.ptp(places, axis=0).max()), LEAST_SIZE)
