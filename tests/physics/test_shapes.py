"""Collision shapes as Bullet sees them: parts of links keep their size."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from ligature import Simulation

Make = Callable[[str], Simulation]


@pytest.mark.parametrize("thickness", [0.02, 0.001])
def test_a_ball_rests_on_a_thin_part_of_a_link(simulate: Make, thickness: float) -> None:
    """Bullet's own margin of 1 mm would turn a pad of 1 mm inside out."""
    plate = (
        f"compound collision shape: [{{shape: BOX, geometry: {{x: 0.02, y: 0.02, z: {thickness}}}, offset: {{}}}}, "
        "{shape: SPHERE, geometry: {radius: 0.001}, offset: {position: {x: 0.1, y: 0, z: 0}}}]"
    )
    text = (
        "bodies: [Base, Plate, Ball]\njoints: [J]\nBase: {name: Base, mass: 0}\n"
        f"Plate: {{name: Plate, mass: 1, inertia: {{ix: 1, iy: 1, iz: 1}}, inertial offset: {{}}, collision margin: 0.0001, {plate}}}\n"
        "Ball: {name: Ball, mass: 0.01, collision shape: SPHERE, collision geometry: {radius: 0.002}, inertial offset: {}, "
        f"collision margin: 0.0001, restitution: 0, location: {{position: {{x: 0, y: 0, z: {thickness / 2 + 0.004}}}}}}}\n"
        "J: {name: J, type: fixed, parent: Base, child: Plate, parent pivot: {x: 0, y: 0, z: 0}, child pivot: {x: 0, y: 0, z: 0}, "
        "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}}\n"
    )
    sim = simulate(text)
    sim.step(300)
    assert sim.bodies["Ball"].pose[2] == pytest.approx(thickness / 2 + 0.002, abs=3e-5)
