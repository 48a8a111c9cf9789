"""A pad with a gaping wound, and where a thread goes through its lips."""

from __future__ import annotations

import numpy as np
from ligature.mesh.grid import build_grid
from ligature.model.material import TissueMaterial
from ligature.tissue.block import TissueBlock

from tests.tissue.strings import String

GAP, MIDDLE, TOP, DEEP = 0.004, 0.017, 0.0079, 0.0035
"""Width of the wound and where its middle is; heights of the tissue's top, and of the bites."""


def gaping_pad(gap: float = GAP) -> TissueBlock:
    """45 x 34 x 8 mm of 100 kPa, held below and at two sides, with a gaping wound 30 mm long and 6 mm deep."""
    y = np.concatenate([np.linspace(0.0, MIDDLE - 0.5 * gap, 5), np.linspace(MIDDLE + 0.5 * gap, 2.0 * MIDDLE, 5)])
    filled = np.ones((12, len(y) - 1, 4), dtype=bool)
    filled[2:10, 4, 1:] = False
    grid = build_grid([np.linspace(0.0, 0.045, 13), y, np.linspace(0.0, 0.008, 5)], filled, closing=(1,))
    rim = (grid.nodes[:, 2] < 1e-9) | (grid.nodes[:, 1] < 1e-9) | (grid.nodes[:, 1] > y[-1] - 1e-9)
    return TissueBlock(grid, [TissueMaterial(1e5, friction=2.0, strength=1e4)], rim)


def way_through(x: float, side: int) -> np.ndarray:
    """A thread's way through a lip, (5, 3) from the wall of the wound to the top; ``side`` is -1 or 1."""
    reach = 0.5 * GAP + 0.0045
    across = np.array([0.5 * GAP + 2e-4, reach - 2.6e-3, reach - 1.3e-3, reach - 4e-4, reach])
    return np.column_stack([np.full(5, x), MIDDLE + side * across, [DEEP, DEEP, 0.0044, 0.006, TOP]])


def gap_at(block: TissueBlock, x: float) -> float:
    """How far the lips are apart at a place along the wound, where they are nearest."""
    along = block.elastic.grid.nodes[block.lips.pairs[:, 0], 0]
    return float(block.lips.gaps()[np.abs(along - x) < 2e-3].min())


def held_stitch(block: TissueBlock, x: float, gap: float = GAP) -> String:
    """A loop of thread through both lips, over the wound, whose ends hands hold there; see `draw_together`."""
    top, reach = TOP, 0.5 * gap + 0.0045
    place = lambda y, z: np.array([x, MIDDLE + y, z])  # noqa: E731
    right = [place(reach, top), place(reach - 4e-4, 0.006), place(reach - 1.3e-3, 0.0044),
             place(reach - 2.6e-3, DEEP), place(0.5 * gap + 2e-4, DEEP)]  # fmt: skip
    left = [[x, 2 * MIDDLE - p[1], p[2]] for p in reversed(right)]
    over = [place(y, 0.0088) for y in np.linspace(0.0, reach, 5)]
    points = np.array([*over, *right, place(0.0, DEEP), *left, *([x, 2 * MIDDLE - p[1], p[2]] for p in reversed(over))])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    thread = block.add_thread(1e-4)
    thread.insert(block.lay_path(np.array(right)[::-1], 1e-4), length[5])
    thread.insert(block.lay_path(np.array(left)[::-1], 1e-4), length[11])
    fine = np.column_stack(
        [np.interp(np.arange(0.0, len(points) - 0.99, 0.5), np.arange(len(points)), column) for column in points.T]
    )
    return String(block, thread, fine, stiffness=3e4)


def draw_together(string: String, drawn: float) -> None:
    """Two hands draw the ends of a `held_stitch` past each other over the wound, each by ``drawn`` metres."""
    above, way = np.array([string.x[0, 0], MIDDLE, 0.0088]), np.array([0.0, drawn, 0.0])
    string.held = {0: above - way, len(string.x) - 1: above + way}
