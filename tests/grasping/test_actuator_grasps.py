"""Constraint actuators with ``ligature slip``: they grasp by friction; the body slips, and in the end slips out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.cli.check import findings
from ligature.model.commands import ActuatorCommand, Release

SCENE = """\
namespace: /ambf/env/
gravity: {{x: 0, y: 0, z: 0}}
bodies: [Tool, Needle]
actuators: [A]
Tool: {{name: Tool, mass: 0, collision shape: SPHERE, collision geometry: {{radius: 0.001}}}}
Needle: {{name: Needle, mass: 0.1, inertia: {{ix: 1.0e-5, iy: 1.0e-5, iz: 1.0e-5}}, inertial offset: {{}}, friction: {{static: 0.5}},
  collision shape: SPHERE, collision geometry: {{radius: 0.001}}, location: {{position: {{x: 0.01, y: 0, z: 0}}}}}}
A: {{name: A, type: Constraint, parent: Tool, location: {{position: {{x: 0.01, y: 0, z: 0}}}}{slip}}}
"""
SLIP = ", ligature slip: {normal force: 8.0, friction: 0.5, reach: 0.005}"
Make = Callable[[str], Simulation]


@pytest.fixture
def simulate(tmp_path: Path) -> Make:
    def make(slip: str) -> Simulation:
        (tmp_path / "m.yaml").write_text(SCENE.format(slip=slip))
        sim = Simulation(ligature.load(tmp_path / "m.yaml"))
        sim.apply(ActuatorCommand(0, True, "Needle"))
        return sim

    return make


def _pulled(sim: Simulation, force: float, ticks: int = 100) -> float:
    """How far the needle goes, metres, while it is pulled along x."""
    needle = sim.bodies["Needle"]
    start = needle.pose[:3].copy()
    needle.command_wrench([force, 0, 0, 0, 0, 0])
    sim.step(ticks)
    return float(np.linalg.norm(needle.pose[:3] - start))


def test_an_actuator_holds_rigidly_without_ligature_slip(simulate: Make) -> None:
    sim = simulate("")
    assert sim.scene.actuators[0].slip is None
    assert _pulled(sim, 10.0) < 0.3e-3
    assert sim.state["actuator_active"][0, 0]


def test_a_body_in_an_actuator_grasp_slips_beyond_the_friction_of_its_pads(simulate: Make) -> None:
    sim = simulate(SLIP)
    limit = 2 * 0.5 * sim.bodies["Needle"].body.friction * 8.0
    # a sudden pull is felt twice
    assert _pulled(sim, 0.45 * limit, 300) < 0.2e-3
    _pulled(sim, limit + 0.5, 10)
    before = sim.bodies["Needle"].twist[0]
    assert _pulled(sim, limit + 0.5, 20) > 1e-3
    # what the pads do not carry accelerates the needle
    assert sim.bodies["Needle"].twist[0] - before == pytest.approx(0.5 / 0.1 * 0.02, rel=0.02)
    assert sim.state["actuator_active"][0, 0]


def test_what_slips_too_far_is_lost_and_can_be_taken_again(simulate: Make) -> None:
    sim = simulate(SLIP)
    _pulled(sim, 20.0, 100)
    assert sim.state["actuator_body"][0, 0] == -1
    free = sim.bodies["Needle"].twist[0]
    sim.bodies["Needle"].command_wrench([0] * 6)
    sim.step(5)
    assert sim.bodies["Needle"].twist[0] == pytest.approx(free, rel=0.01)
    sim.bodies["Needle"].set_pose([0.01, 0, 0, 0, 0, 0, 1])
    sim.apply(ActuatorCommand(0, True, "Needle"))
    sim.step(5)
    assert sim.state["actuator_active"][0, 0]
    sim.apply(Release("actuator", 0))
    sim.step()
    assert not sim.state["actuator_active"][0, 0]


def test_a_snapshot_amid_a_slip_continues_bit_for_bit(simulate: Make) -> None:
    sim = simulate(SLIP)
    _pulled(sim, 6.0, 20)
    snapshot = sim.snapshot()
    hashes = []
    for _ in range(2):
        sim.restore(snapshot)
        sim.step(30)
        hashes.append(sim.state_hash())
    assert hashes[0] == hashes[1]


def test_the_checker_knows_the_key(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(SCENE.format(slip=", ligature slip: {frction: 0.5}"))
    reported = "\n".join(str(d) for d in findings(tmp_path / "m.yaml", [], False))
    assert "unknown key 'ligature slip.frction'" in reported
    assert "friction" in reported
    assert "normal force" in reported
