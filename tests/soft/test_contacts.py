"""Rigid bodies on tissue: they rest, press, rub, and lift it between two fingers."""

from __future__ import annotations

import numpy as np
import pytest

SOFT = "    youngs modulus: 30000\n"


def test_bodies_that_do_not_roll_rest_with_their_weight(kit):
    shapes = {
        "Peg": "shape: BOX, geometry: {x: 0.01, y: 0.01, z: 0.006}",
        "Disc": "shape: CYLINDER, geometry: {radius: 0.005, height: 0.004}",
        "Log": "shape: CAPSULE, geometry: {radius: 0.003, height: 0.014, axis: X}",
    }  # fmt: skip
    blocks = [
        kit.body(name, shape, (0.015 * (i % 2) - 0.008, 0.016 * (i // 2) - 0.008, 0.1095), 0.01)
        for i, (name, shape) in enumerate(shapes.items())
    ]
    simulation = kit.run(kit.pad(SOFT), *blocks)
    simulation.step(1500)
    forces = {simulation.scene.bodies[b].identity.name: f for b, f in simulation.tissues.pieces[0].contacts.forces}
    assert forces.keys() == shapes.keys()
    for name, force in forces.items():
        assert -force[2] == pytest.approx(0.01 * 9.8, rel=0.1), name
        height = simulation.bodies[f"BODY {name}"].pose[2]
        assert 0.105 < height < 0.1095, name
    np.testing.assert_allclose(simulation.state["tissue_wrench"][0, 0, 2], -0.03 * 9.8, rtol=0.1)


def test_a_ball_presses_with_its_weight(kit):
    ball = kit.body("Ball", "shape: SPHERE, geometry: {radius: 0.004}", (0.001, 0.002, 0.1095), 0.01)
    simulation = kit.run(kit.pad(SOFT), ball)
    presses = []
    for _ in range(300):
        simulation.step(1)
        presses.append(-simulation.state["tissue_wrench"][0, 0, 2])
    assert np.mean(presses[100:]) == pytest.approx(0.01 * 9.8, rel=0.15)


@pytest.mark.parametrize("at", [(0.001, 0.002), (0.0037, -0.0041)])
def test_a_ball_comes_to_rest_where_it_was_put(kit, at):
    ball = kit.body("Ball", "shape: SPHERE, geometry: {radius: 0.004}", (*at, 0.1095), 0.01)
    simulation = kit.run(kit.pad(SOFT), ball)
    ball = simulation.bodies["BODY Ball"]
    simulation.step(1200)
    before = ball.pose[:3]
    assert np.linalg.norm(before[:2] - at) < 4e-3  # less than the edge of a cell
    simulation.step(500)
    np.testing.assert_allclose(ball.pose[:3], before, atol=1e-5)
    assert simulation.state["tissue_wrench"][0, 0, 2] == pytest.approx(-0.01 * 9.8, rel=0.01)


@pytest.mark.parametrize(("slope", "slides"), [(0.2, False), (0.8, True)])
def test_friction_holds_a_peg_on_a_slope_up_to_its_coefficient(kit, slope, slides):
    g = 9.8 * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    peg = kit.body("Peg", "shape: BOX, geometry: {x: 0.01, y: 0.01, z: 0.006}", (0, 0, 0.108), 0.01, 1.0)
    peg = peg.replace("  friction", f"  gravity: {{x: {g[0]}, y: 0, z: {g[2]}}}\n  friction")
    simulation = kit.run(kit.pad(SOFT), peg)  # coefficient 0.5
    simulation.step(400)
    before = simulation.bodies["BODY Peg"].pose[0]
    simulation.step(300)
    moved = simulation.bodies["BODY Peg"].pose[0] - before
    assert (moved > 5e-3) if slides else (abs(moved) < 0.2e-3)


def test_a_fast_tool_does_not_tunnel_and_the_tissue_recovers(kit):
    tool = kit.body("Tool", "shape: CAPSULE, geometry: {radius: 0.002, height: 0.03, axis: Z}", (0, 0, 0.125), 0.1)
    simulation = kit.run(kit.pad(SOFT), tool)
    tool, piece = simulation.bodies["BODY Tool"], simulation.tissues.pieces[0]
    tool.command_twist([0, 0, -0.1, 0, 0, 0])
    simulation.step(70)
    tool.command_twist([0, 0, 0, 0, 0, 0])
    simulation.step(200)
    lowest = tool.pose[2] - 0.015
    assert lowest < 0.1035
    top = simulation.state["tissue_node"][0, piece.tissue.form.grid.nodes[:, 2] == 0.005]
    near = np.linalg.norm(top[:, :2], axis=1) < 0.001
    assert near.any()
    # The tool stands in a pit with straight walls from node to node, whose bottom may be a little deeper.
    assert lowest - 0.5e-3 < top[near, 2] < lowest + 0.1e-3
    assert simulation.state["tissue_wrench"][0, 0, 2] < -0.2
    tool.command_twist([0, 0, 0.1, 0, 0, 0])
    simulation.step(1500)
    assert np.abs(piece.block.positions - piece.block.elastic.grid.nodes).max() < 0.1e-3


def test_two_fingers_lift_a_ridge_by_friction(kit):
    ridge = kit.pad(SOFT + "    fixed: [-z]\n", size=(0.04, 0.006, 0.016), cell=0.003)
    fingers = [
        kit.body(name, "shape: BOX, geometry: {x: 0.01, y: 0.004, z: 0.008}", (0, y, 0.106), 0.1, 2.0)
        for name, y in (("Left", 0.0056), ("Right", -0.0056))
    ]
    simulation = kit.run(ridge, *fingers)
    left, right = simulation.bodies["BODY Left"], simulation.bodies["BODY Right"]
    left.command_twist([0, -0.01, 0, 0, 0, 0])
    right.command_twist([0, 0.01, 0, 0, 0, 0])
    simulation.step(150)
    left.command_twist([0, 0, 0.02, 0, 0, 0])
    right.command_twist([0, 0, 0.02, 0, 0, 0])
    top = simulation.tissues.pieces[0].tissue.form.grid.nodes[:, 2] > 0.0079
    before = simulation.state["tissue_node"][0, top, 2].max()
    simulation.step(60)
    lifted = simulation.state["tissue_node"][0, top, 2].max() - before
    # Where points of contact begin and end decides how much slips: 0.4 to 0.9 mm for squeezes that differ by a tenth.
    assert lifted > 0.25 * 0.02 * 60e-3
    assert simulation.state["tissue_wrench"][0, 0, 2] > 0.1


def test_runs_repeat_to_the_bit_and_looking_changes_nothing(kit):
    scene = kit.load(
        kit.pad(SOFT), kit.body("Ball", "shape: SPHERE, geometry: {radius: 0.004}", (0.001, 0.002, 0.115), 0.02)
    )
    hashes = []
    for calls in ([300], [1] * 300, [7, 93, 200]):
        simulation = kit.Simulation(scene)
        for ticks in calls:
            simulation.step(ticks)
            simulation.state_hash(), simulation.step(0)
        hashes.append(simulation.state_hash())
    assert len(set(hashes)) == 1
    simulation = kit.Simulation(scene)
    simulation.step(121)
    taken = simulation.snapshot()
    simulation.step(50)
    other = kit.Simulation(scene)
    other.restore(taken)
    other.step(50)
    assert other.state_hash() == simulation.state_hash()
