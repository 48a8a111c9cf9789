"""Scenes with cameras whose pictures are known in closed form."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import ligature
import pytest
from ligature import Simulation
from ligature.render import Renderer

from tests.opengl import opengl

HEAD = (
    "bodies: [Wall, Ball, Bead, Pin]\nlights: [L]\nnamespace: /ambf/env/\n"
    "Wall: {name: Wall, mass: 0, shape: BOX, geometry: {x: 0.2, y: 8, z: 8}, location: {position: {x: -2.1, y: 0, z: 0}}}\n"
    "Ball: {name: Ball, mass: 0, shape: SPHERE, geometry: {radius: 0.3}, location: {position: {x: -1, y: 0, z: 0}}}\n"
    "Bead: {name: Bead, mass: 0, shape: CYLINDER, geometry: {radius: 0.03, height: 0.0002, axis: x}, location: {position: {x: -1.2, y: 0.45, z: 0.3}}}\n"
    "Pin: {name: Pin, mass: 0, shape: CYLINDER, geometry: {radius: 0.03, height: 0.0002, axis: x}, location: {position: {x: -1.5, y: -0.4, z: -0.42}}}\n"
    "L: {name: L, location: {x: 0, y: 0, z: 0}, direction: {x: -1, y: 0, z: 0}, cutoff angle: 1.5}\n"
)
# flat discs that face the cameras: the centre of such a picture is the picture of the centre
BEADS = {"Bead": (-1.2, 0.45, 0.3), "Pin": (-1.5, -0.4, -0.42)}
LENS = (
    "field view angle: 0.9, clipping plane: {near: 0.05, far: 10}, publish image resolution: {width: 320, height: 240}"
)


def camera(name: str, y: float = 0.0, aim: float | None = None, lens: str = LENS) -> str:
    """A camera at (0, y, 0) that looks along -X, or at (-1, aim, 0)."""
    at = y if aim is None else aim
    return (
        f"{name}: {{name: {name}, namespace: cameras/, location: {{x: 0, y: {y}, z: 0}}, "
        f"look at: {{x: -1, y: {at}, z: 0}}, up: {{x: 0, y: 0, z: 1}}, {lens}}}\n"
    )


@pytest.fixture
def simulate(tmp_path: Path) -> Callable[..., Simulation]:
    """Makes a simulation of the wall, the ball and the beads, seen by the cameras given as name and text."""

    def make(**cameras: str) -> Simulation:
        path = tmp_path / "m.yaml"
        path.write_text(HEAD + f"cameras: [{', '.join(cameras)}]\n" + "".join(cameras.values()))
        scene = ligature.load(path)
        with opengl():
            Renderer(scene).release()
        return Simulation(scene)

    return make
