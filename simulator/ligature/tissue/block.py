"""A block of soft tissue: steps with the simulation's ticks, coupled with needles and threads at each of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.grid import Grid
from ligature.model.material import TissueMaterial
from ligature.tissue import layout
from ligature.tissue.contact import RESERVED
from ligature.tissue.elastic import KEPT, STEP, ElasticGrid
from ligature.tissue.interface import Interface
from ligature.tissue.lips import Lips
from ligature.tissue.location import locate
from ligature.tissue.paths import begin_path, extend_path
from ligature.tissue.puncture import NeedleInTissue
from ligature.tissue.thread import ThreadInTissue

Array = NDArray[np.float64]


class TissueBlock:
    """Tissue that deforms, is punctured and closes again.

    In each tick, first every needle (`NeedleInTissue.couple`) and thread (`ThreadInTissue.springs`,
    `settle`) is coupled, then `step` ends the tick.

    Parameters
    ----------
    grid
        Cells and nodes at rest, world axes, m.
    materials
        Those that ``grid.layer`` counts.
    fixed
        Nodes that do not move, (n,).
    gravity
        (3,) m/s².
    dt
        Length of a tick, s.
    ticks
        Ticks of a tissue step.
    """

    def __init__(
        self,
        grid: Grid,
        materials: Sequence[TissueMaterial],
        fixed: NDArray[np.bool_],
        gravity: Sequence[float] = (0.0, 0.0, 0.0),
        dt: float = 1e-3,
        ticks: int = round(STEP / 1e-3),
    ) -> None:
        self.elastic = ElasticGrid(grid, materials, fixed, gravity, dt * ticks)
        self.lips = Lips(self.elastic)
        self.paths = layout.paths()
        self.interface = Interface(self.elastic, ticks, self.paths)
        self.ages = np.zeros(len(self.paths.count), dtype=np.int64)
        self.needles: list[NeedleInTissue] = []
        self.threads: list[ThreadInTissue] = []
        self._begin()

    def add_needle(self, curvature: float, length: float, radius: float) -> NeedleInTissue:
        """Let a needle puncture the block; see `NeedleInTissue`."""
        needle = NeedleInTissue(self.interface, self.paths, curvature, length, radius)
        self.needles.append(needle)
        return needle

    def add_thread(self, radius: float, friction: float = 1.0) -> ThreadInTissue:
        """Let a thread run through the paths of needles; see `ThreadInTissue`."""
        thread = ThreadInTissue(self.interface, self.paths, radius, friction)
        self.threads.append(thread)
        return thread

    def make_room(self) -> None:
        """Close the oldest ways that nothing is in, where there is too little room for new ones."""
        paths = self.paths
        used = np.flatnonzero(paths.count)
        if not len(used):
            self.ages[:] = 0
            return
        self.ages[used] += 1
        self.ages[paths.count == 0] = 0
        if self.interface.unused >= RESERVED and len(used) < len(paths.count):
            return
        for path in used[np.argsort(-self.ages[used], kind="stable")].tolist():
            if self.interface.unused >= RESERVED and (paths.count == 0).any():
                return
            nodes = paths.node[path, : paths.count[path]]
            inside = [needle.is_in(path) for needle in self.needles]
            if not any(inside) and not any(thread.engaged[nodes].any() for thread in self.threads):
                for i in nodes.tolist():
                    self.interface.release(i)
                paths.count[path], paths.length[path], self.ages[path] = 0, np.inf, 0

    def contains(self, place: Array) -> bool:
        """Whether a place (3,) is in the tissue as it is now."""
        return int(locate(self.elastic.x, self.elastic.grid.cells, place, 0.0, np.zeros(8))) >= 0

    def lay_path(self, places: Array, radius: float) -> int:
        """Make a way through the tissue, for needles and threads of ``radius`` metres; returns the path.

        Parameters
        ----------
        places
            Its nodes now, (k, 3) in order from its entry to its exit.

        Raises
        ------
        ValueError
            When a node lies outside the tissue.
        """
        weights, grid = np.zeros(8), self.elastic.grid
        cells = []
        for place in np.ascontiguousarray(places, dtype=np.float64):
            cells.append(int(locate(self.elastic.x, grid.cells, place, 1e-6, weights)))
            if cells[-1] < 0:
                raise ValueError(f"the node {place} of a path lies outside the tissue")
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
        path = -1
        for place, cell, along in zip(places, cells, s.tolist(), strict=True):
            locate(self.elastic.x, grid.cells, np.ascontiguousarray(place), 1e-6, weights)
            point = self.interface.add(grid.cells[cell], weights)
            self.interface.equip(point, cell, radius)
            if path < 0:
                path = begin_path(self.paths, point)
            else:
                extend_path(self.paths, path, point, along)
        self.paths.length[path] = self.paths.cut[path] = s[-1]
        return path

    def step(self) -> None:
        """End a tick; every few of them the nodes move.

        How they will is found in the ticks before, a share of the work in each, so that no tick takes much longer.
        """
        complete = self.interface.count()
        self.elastic.solve(self.interface.tick / max(self.interface.ticks - 1, 1))
        if not complete:
            return
        d = self.elastic.displacement()
        self.interface.push(d)
        self.lips.close(d)
        self.elastic.advance(d)
        self._begin()
        for _, line in self._lines():
            line.follow()
        self.make_room()

    def _begin(self) -> None:
        external = np.zeros_like(self.elastic.x)
        self.lips.expect(external)
        self.elastic.begin(external)
        self.interface.begin()

    # --- state --------------------------------------------------------------------------------

    @property
    def positions(self) -> Array:
        """Positions of the nodes at the start of the tissue step, (n, 3) m."""
        return self.elastic.x

    def reset(self) -> None:
        """Return to rest, whole and without needles."""
        self.elastic.reset()
        self.lips.reset()
        self.interface.reset()
        for array in self.paths:
            array[:] = 0
        self.ages[:] = 0
        self.paths.length[:] = np.inf
        for _, line in self._lines():
            line.reset()
        self._begin()

    def snapshot(self) -> dict[str, Array]:
        """Everything that lasts from tick to tick, as named arrays."""
        kept = {name: getattr(self.elastic, name).copy() for name in KEPT}
        kept["lip_force"], kept["ages"] = self.lips.force.copy(), self.ages.copy()
        kept.update({f"point_{name}": array for name, array in self.interface.snapshot().items()})
        kept.update({f"path_{name}": array.copy() for name, array in zip(self.paths._fields, self.paths, strict=True)})
        for prefix, line in self._lines():
            kept.update({prefix + name: array for name, array in line.snapshot().items()})
        return kept

    def restore(self, snapshot: dict[str, Array]) -> None:
        """Continue from `snapshot`, to the bit.

        Raises
        ------
        KeyError
            When the snapshot is of a block with fewer needles or threads.
        """
        for name in KEPT:
            getattr(self.elastic, name)[:] = snapshot[name]
        self.lips.force[:], self.ages[:] = snapshot["lip_force"], snapshot["ages"]
        self.interface.restore(_with_prefix(snapshot, "point_"))
        for name, array in zip(self.paths._fields, self.paths, strict=True):
            array[:] = snapshot[f"path_{name}"]
        for prefix, line in self._lines():
            line.restore(_with_prefix(snapshot, prefix))

    def _lines(self) -> list[tuple[str, NeedleInTissue | ThreadInTissue]]:
        """Needles and threads, with what their arrays' names begin with in a snapshot."""
        needles = [(f"needle_{number}_", needle) for number, needle in enumerate(self.needles)]
        return [*needles, *((f"thread_{number}_", thread) for number, thread in enumerate(self.threads))]


def _with_prefix(snapshot: dict[str, Array], prefix: str) -> dict[str, Array]:
    return {name.removeprefix(prefix): array for name, array in snapshot.items() if name.startswith(prefix)}
