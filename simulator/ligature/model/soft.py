"""Bodies of soft tissue, as descriptions.

A body with a block ``ligature tissue`` is tissue. Its rigid body stays, as the frame B that the tissue deforms in and
that its fixed nodes belong to. It has no collision shapes, for the surface of the tissue takes their place. SI units,
frames as in `ligature.model.scene`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ligature.mesh.grid import Grid
from ligature.mesh.voxels import NOWHERE, Embedding, embed
from ligature.model.material import TissueMaterial

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class TissueForm:
    """What a body of tissue is.

    Parameters
    ----------
    grid
        Cells and nodes at rest in the body frame B.
    materials
        Those that ``grid.layer`` counts.
    fixed
        Nodes that belong to the rigid body, (n,).
    support
        Text that names the body that carries this one; empty for none.
    own_density
        Whether the file gives the density, or a material that has one.
    slits
        Boxes (2, 3) from corner to corner at rest in B, m, that cut the body; one that is flat along an axis is a slit.
    pins
        Material points that stay where they are in the world, of tissue without fixed nodes.
    """

    grid: Grid
    materials: tuple[TissueMaterial, ...]
    fixed: NDArray[np.bool_]
    support: str = ""
    own_density: bool = False
    slits: tuple[Array, ...] = ()
    pins: Embedding = NOWHERE

    @property
    def cell_masses(self) -> Array:
        """Mass of each cell, (m,) kg."""
        density = np.array([material.density for material in self.materials])
        return np.asarray(self.grid.sizes.prod(axis=1) * density[self.grid.layer])

    @property
    def triangles(self) -> Integers:
        """Nodes of the triangles of the grid's surface, (2 q, 3), counter-clockwise from outside."""
        return self.grid.faces[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)

    def with_mass(self, mass: float) -> TissueForm:
        """The form with densities that make up ``mass`` kilograms; itself where the file gives them, or it is held."""
        if self.own_density or self.fixed.any() or not mass > 0.0:
            return self
        return self.scaled(mass)

    def scaled(self, mass: float) -> TissueForm:
        """The form with densities that make up ``mass`` kilograms."""
        scale = mass / float(self.cell_masses.sum())
        return replace(self, materials=tuple(replace(m, density=scale * m.density) for m in self.materials))

    def embed(self, points: Array, beside: Array | None = None) -> Embedding:
        """Bind points (v, 3) at rest in the body frame to the nodes, as `ligature.mesh.voxels.embed` does."""
        return embed(self.grid, points, beside)


@dataclass(frozen=True, eq=False)
class TissueBody:
    """A body of tissue in a scene.

    ``index`` counts them, ``body`` is the rigid body's index, ``rows`` are its nodes in a state's ``tissue_node``.
    """

    index: int
    body: int
    rows: slice
    form: TissueForm
