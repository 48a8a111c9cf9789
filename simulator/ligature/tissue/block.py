"""A block of soft tissue: steps with the simulation's ticks, coupled with needles and threads at each of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.tissue.elastic import STEP, ElasticGrid
from ligature.tissue.grid import Grid
from ligature.tissue.interface import Interface
from ligature.tissue.lips import Lips
from ligature.tissue.material import TissueMaterial
from ligature.tissue.paths import paths
from ligature.tissue.puncture import NeedleInTissue

Array = NDArray[np.float64]


class TissueBlock:
    """Tissue that deforms, is punctured and closes again.

    In each tick, first every needle is coupled (`NeedleInTissue.couple`), then `step` ends the tick.

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
        self.interface = Interface(self.elastic, ticks)
        self.paths = paths()
        self.needles: list[NeedleInTissue] = []
        self._begin()

    def add_needle(self, curvature: float, length: float, radius: float) -> NeedleInTissue:
        """Let a needle puncture the block; see `NeedleInTissue`."""
        needle = NeedleInTissue(self.interface, self.paths, curvature, length, radius)
        self.needles.append(needle)
        return needle

    def step(self) -> None:
        """End a tick; every few of them the nodes move."""
        if not self.interface.count():
            return
        d = self.interface.expected.copy()
        self.interface.push(d)
        self.lips.close(d)
        self.elastic.advance(d)
        self._begin()
        for needle in self.needles:
            needle.follow()

    def _begin(self) -> None:
        d = self.elastic.predict()
        self.lips.expect(d)
        self.interface.begin(d)

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
        self.paths.length[:] = np.inf
        for needle in self.needles:
            needle.reset()
        self._begin()

    def snapshot(self) -> dict[str, Array]:
        """Everything that lasts from tick to tick, as named arrays."""
        kept = {name: getattr(self.elastic, name).copy() for name in ("x", "v", "frames")}
        kept["lip_force"] = self.lips.force.copy()
        kept.update({f"point_{name}": array for name, array in self.interface.snapshot().items()})
        kept.update({f"path_{name}": array.copy() for name, array in zip(self.paths._fields, self.paths, strict=True)})
        for number, needle in enumerate(self.needles):
            kept.update({f"needle_{number}_{name}": array for name, array in needle.snapshot().items()})
        return kept

    def restore(self, snapshot: dict[str, Array]) -> None:
        """Continue from `snapshot`, to the bit.

        Raises
        ------
        KeyError
            When the snapshot is of a block with fewer needles.
        """
        for name in ("x", "v", "frames"):
            getattr(self.elastic, name)[:] = snapshot[name]
        self.lips.force[:] = snapshot["lip_force"]
        self.interface.restore(_with_prefix(snapshot, "point_"))
        for name, array in zip(self.paths._fields, self.paths, strict=True):
            array[:] = snapshot[f"path_{name}"]
        for number, needle in enumerate(self.needles):
            needle.restore(_with_prefix(snapshot, f"needle_{number}_"))


def _with_prefix(snapshot: dict[str, Array], prefix: str) -> dict[str, Array]:
    return {name.removeprefix(prefix): array for name, array in snapshot.items() if name.startswith(prefix)}
