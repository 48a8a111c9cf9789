"""Tearing: where a load across a path exceeds the tissue's strength, the node moves through the material."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.tissue.interface import Interface
from ligature.tissue.layout import Paths
from ligature.tissue.location import locate
from ligature.tissue.paths import remove_node

Array = NDArray[np.float64]

SLACK = 0.02
"""Distance outside a cell, in edges, within which a point belongs to it: surface points lie on its face."""


def tear(interface: Interface, paths: Paths, torn: Array) -> None:
    """Move the points of paths by what has torn since the last step, (N, 3) m; one that is torn out is let go.

    ``torn`` is cleared. Positions are those at the start of a step.
    """
    if not torn.any():
        return
    weights = np.zeros(8)
    elastic, points = interface.elastic, interface.points
    for i in np.flatnonzero((torn != 0.0).any(axis=1)).tolist():
        cell = int(locate(elastic.x, elastic.grid.cells, points.start[i] + torn[i], SLACK, weights))
        torn[i] = 0.0
        if cell >= 0:
            interface.place(i, elastic.grid.cells[cell], weights)
            points.cell[i] = cell
        else:
            remove_node(paths, i)
            interface.release(i)
