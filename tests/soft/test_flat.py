"""A flat plate on held tissue: it presses with what Hooke's law says, lies on all nodes that it covers, and rests."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from ligature import Simulation

from tests.soft import conftest as kit

GRAVITY = 9.8
WIDE = (0.06, 0.048)
THICK = 0.02


def plate_on_a_pad(mass, cell, size=(0.08, 0.08), material="silicone pad", extra=""):
    """A pad whose bottom is held, and a plate 0.1 mm above it: the simulation, the plate, which nodes are on top."""
    with tempfile.TemporaryDirectory() as folder:
        pad = kit.pad("    fixed: [-z]\n" + extra, size=(*WIDE, THICK), cell=cell, material=material)
        shape = f"shape: BOX, geometry: {{x: {size[0]}, y: {size[1]}, z: 0.01}}"
        plate = kit.body("Plate", shape, (0.0, 0.0, 0.1 + 0.5 * THICK + 0.0051), mass)
        simulation = Simulation(kit.load(Path(folder), pad, plate))
    grid = simulation.tissues.pieces[0].tissue.form.grid
    return simulation, simulation.bodies["BODY Plate"], grid.nodes[:, 2] > grid.nodes[:, 2].max() - 1e-9


@settings(max_examples=6, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(
    youngs=st.floats(5e3, 3e5), cell=st.floats(0.006, 0.012), depth=st.floats(0.3e-3, 2.5e-3),
    speed=st.floats(2e-3, 0.05),
)  # fmt: skip
def test_a_plate_presses_by_hookes_law(youngs, cell, depth, speed):
    """Without lateral strain the pad is a bar: F = E A d / L; with one point a face it bore 0.4 of it at d = 2 mm."""
    extra = f"    youngs modulus: {youngs}\n    poisson ratio: 0.0\n    density: 1\n"
    simulation, plate, top = plate_on_a_pad(0.0, cell, extra=extra)
    start = plate.pose[2]
    for ticks in range(1, round(1e3 * depth / speed) + 1):
        plate.set_pose([0.0, 0.0, start - min(1e-3 * ticks * speed, depth), 0.0, 0.0, 0.0, 1.0])
        simulation.step(1)
    simulation.step(300)
    forces = []
    for _ in range(50):
        simulation.step(1)
        forces.append(-simulation.state["tissue_wrench"][0, 0, 2])
    under = plate.pose[2] - 0.005
    pressed = 0.1 + 0.5 * THICK - under
    hooke = youngs * WIDE[0] * WIDE[1] * pressed / THICK
    assert np.mean(forces) == pytest.approx(hooke, rel=0.02)
    assert np.ptp(forces) < 0.002 * hooke
    nodes = simulation.state["tissue_node"][0][top]
    assert np.abs(nodes[:, 2] - under).max() < 2e-5 + 0.02 * pressed
    assert not simulation.problems


@settings(max_examples=4, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(
    youngs=st.floats(1e4, 3e5), share=st.floats(0.002, 0.05), cell=st.floats(0.006, 0.012),
    size=st.tuples(st.floats(0.03, 0.08), st.floats(0.03, 0.08)),
)  # fmt: skip
def test_a_plate_comes_to_rest_with_its_weight(youngs, share, cell, size):
    """It presses with a ``share`` of Young's modulus; with one point a face plates trembled for ever, at up to 2 rad/s."""
    mass = share * youngs * min(size[0], WIDE[0]) * min(size[1], WIDE[1]) / GRAVITY
    simulation, plate, _ = plate_on_a_pad(mass, cell, size, extra=f"    youngs modulus: {youngs}\n")
    simulation.step(1500)
    moving, forces = [], []
    for _ in range(100):
        simulation.step(1)
        moving.append(np.abs(plate.twist).max())
        forces.append(-simulation.state["tissue_wrench"][0, 0, 2])
    assert max(moving) < 1e-3
    assert np.mean(forces) == pytest.approx(GRAVITY * mass, rel=0.005)
