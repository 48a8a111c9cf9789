"""Bodies of tissue in 3D: surfaces that moved are sent anew, at most ten times a second. World axes, metres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from viser import ViserServer

from ligature.cockpit.looks import mean_colour
from ligature.model.scene import Scene
from ligature.model.state import MAX_PUNCTURES, new_state
from ligature.render.tissue import Marks, tissue_surfaces
from ligature.render.visuals import VisualLoader

Array = NDArray[np.float64]

TURNS = 2
"""Updates of the stage for each of the tissues'."""

FINENESS = 1.0
"""Longest edge of a triangle in cells: a quarter of the triangles that pictures have."""

STILL = 2e-5
"""Metres below which a surface counts as not moved."""

CORNERS, LIFT = 12, 1e-4
"""Corners of the mark of a puncture, and its height above the surface."""

DARK = (60, 15, 15)
"""Colour of marks."""


class TissueStage:
    """All bodies of tissue of a scene on the page."""

    def __init__(self, server: ViserServer, scene: Scene) -> None:
        rest = new_state(scene)["tissue_node"][0]
        self._surfaces = tissue_surfaces(scene, VisualLoader(scene.roots).of_scene(scene), FINENESS)
        self._meshes = [
            server.scene.add_mesh_simple(
                f"/tissue/{number}", surface.places(rest).astype(np.float32), surface.smooth_faces.astype(np.uint32),
                color=mean_colour(surface.piece.surface), side="double", cast_shadow=False,
            )
            for number, surface in enumerate(self._surfaces)
        ]  # fmt: skip
        self._marks = [Marks(scene, tissue) for tissue in scene.tissues]
        fans = fan(MAX_PUNCTURES)
        self._discs = [
            server.scene.add_mesh_simple(
                f"/punctures/{number}", discs(np.zeros((0, 8)), np.zeros(3)), fans, color=DARK, side="double",
                cast_shadow=False,
            )
            for number in range(len(scene.tissues))
        ]  # fmt: skip
        self._rows = [tissue.rows for tissue in scene.tissues]
        self._nodes = np.full_like(rest, np.inf)
        self._counts = [0] * len(scene.tissues)
        self._turn = 0

    def update(self, state: NDArray[np.void]) -> int:
        """Show ``state`` (1,) when it is time; returns how many meshes were sent."""
        self._turn += 1
        if self._turn % TURNS:
            return 0
        nodes, sent = state["tissue_node"][0], 0
        for index, rows in enumerate(self._rows):
            count = int(state["puncture_count"][0, index])
            if np.abs(nodes[rows] - self._nodes[rows]).max(initial=0.0) <= STILL and count == self._counts[index]:
                continue
            self._nodes[rows], self._counts[index] = nodes[rows], count
            for surface, mesh in zip(self._surfaces, self._meshes, strict=True):
                if surface.index == index:
                    mesh.vertices = surface.places(nodes).astype(np.float32)
                    sent += 1
            self._discs[index].vertices = discs(self._marks[index].of(state), nodes[rows.start])
            sent += 1
        return sent


def discs(marks: Array, elsewhere: Array) -> NDArray[np.float32]:
    """Corners (MAX_PUNCTURES (CORNERS + 1), 3) of the discs ``marks`` (n, 8); missing ones lie in one point."""
    found = np.tile(elsewhere, (MAX_PUNCTURES, CORNERS + 1, 1))
    normals = marks[:, 4:7]
    across = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    angles = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)[None, :, None]
    ring = np.cos(angles) * across[:, None] + np.sin(angles) * np.cross(normals, across)[:, None]
    middle = marks[:, :3] + LIFT * normals
    found[: len(marks), 0] = middle
    found[: len(marks), 1:] = middle[:, None] + marks[:, 3, None, None] * ring
    return found.reshape(-1, 3).astype(np.float32)


def fan(count: int) -> NDArray[np.uint32]:
    """Triangles (count CORNERS, 3) of `discs`."""
    ring = np.arange(CORNERS)
    one = np.stack([np.zeros_like(ring), 1 + ring, 1 + (ring + 1) % CORNERS], axis=1)
    return (one[None] + (CORNERS + 1) * np.arange(count)[:, None, None]).reshape(-1, 3).astype(np.uint32)
