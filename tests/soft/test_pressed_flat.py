"""Whatever presses tissue flat is stopped by what holds the tissue: nothing falls through it, and the tissue recovers."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.model.material import MATERIALS

from tests.soft import conftest as kit

THICK, CELL = 0.012, 0.004
TOP, BOTTOM = 0.1 + 0.5 * THICK, 0.1 - 0.5 * THICK

REST = 2e-3
"""Most that a body moves in the last half second, m: small balls that got into the tissue creep by 1 mm."""


def on_a_pad(material, shape, at, mass):
    """A body above a pad whose bottom is held."""
    with tempfile.TemporaryDirectory() as folder:
        pad = kit.pad("    fixed: [-z]\n", size=(0.048, 0.048, THICK), cell=CELL, material=material)
        return Simulation(kit.load(Path(folder), pad, kit.body("Body", shape, at, mass)))


@cache
def undisturbed(material):
    """Nodes of such a pad under its own weight alone."""
    simulation = on_a_pad(material, "shape: SPHERE, geometry: {radius: 0.01}", (0.0, 0.0, 1.0), 0.01)
    simulation.step(400)
    return simulation.tissues.pieces[0].block.positions.copy()


def drop(material, shape, half, mass, at, speed, seconds=3.0):
    """Let a body whose lowest point is ``half`` below its centre fall on a pad; simulation, and these points."""
    simulation = on_a_pad(material, shape, (*at, TOP + half + 5e-4), mass)
    falling = simulation.bodies["BODY Body"]
    falling.command_twist([0.0, 0.0, -speed, 0.0, 0.0, 0.0])
    simulation.step(1)
    falling.release()
    points = []
    for _ in range(round(50 * seconds)):
        simulation.step(20)
        points.append(falling.pose[:3] - [0.0, 0.0, half])
    return simulation, np.array(points)


def check(material, simulation, points):
    """Nothing is below what holds the tissue, all is at rest, and the tissue recovers when the body is gone."""
    falling = simulation.bodies["BODY Body"]
    assert np.isfinite(simulation.state["tissue_node"]).all()
    assert np.abs(points[:, :2]).max() < 0.024
    assert points[:, 2].min() > BOTTOM
    assert points[-1, 2] < TOP + 2e-3
    assert np.linalg.norm(points[-1] - points[-25]) < REST
    assert not simulation.problems
    falling.set_pose([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    simulation.step(600)
    nodes = simulation.tissues.pieces[0].block.positions
    np.testing.assert_allclose(nodes, undisturbed(material), atol=1e-4)


SMALL = st.floats(-0.008, 0.008)


@settings(max_examples=3, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(
    material=st.sampled_from(sorted(MATERIALS)), radius=st.floats(0.003, 0.012), density=st.floats(2.7, 4.8),
    speed=st.floats(0.0, 2.0), at=st.tuples(SMALL, SMALL),
)  # fmt: skip
@example(material="liver", radius=0.008, density=4.668, speed=0.0, at=(0.0, 0.0))
@example(material="stomach", radius=0.003, density=4.8, speed=2.0, at=(0.002, 0.001))
def test_no_ball_falls_through_held_tissue(material, radius, density, speed, at):
    """From cork to three times the density of gold: a ball of 8 mm with 100 g fell through liver once."""
    mass = 10.0**density * 4.0 / 3.0 * np.pi * radius**3
    shape = f"shape: SPHERE, geometry: {{radius: {radius}}}"
    check(material, *drop(material, shape, radius, mass, at, speed))


def test_a_box_is_stopped_too():
    check("fat", *drop("fat", "shape: BOX, geometry: {x: 0.02, y: 0.012, z: 0.01}", 0.005, 0.5, (0.0, 0.0), 1.0))


def test_a_light_ball_rests_on_the_tissue_and_not_on_what_holds_it():
    _, points = drop("liver", "shape: SPHERE, geometry: {radius: 0.008}", 0.008, 0.01, (0.0, 0.0), 0.0)
    assert points[-1] == pytest.approx(points[-20], abs=1e-5)
    assert points[-1, 2] > BOTTOM + 0.5 * THICK
