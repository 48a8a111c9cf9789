"""Bodies of tissue that nothing holds: they fall, turn, rest, are squeezed and recover."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from ligature import Simulation
from scipy.spatial.transform import Rotation

from tests.soft.conftest import body, load

GRAVITY = 9.8
TABLE = body("Table", "shape: BOX, geometry: {x: 0.6, y: 0.6, z: 0.1}", (0.0, 0.0, -0.05), 0.0, 1.0)
FLOATING = "  gravity: {x: 0, y: 0, z: 0}\n  mass:"

SIZES = st.tuples(*[st.floats(0.02, 0.06)] * 3)
ANGLES = st.tuples(*[st.floats(-3.0, 3.0)] * 3)
HEAVIEST = 0.15
"""Greatest pressure of a body's own weight, in parts of Young's modulus."""
YOUNGS, DENSITIES = st.floats(3.3, 6.0).map(lambda e: 10.0**e), st.floats(2.0, 3.5).map(lambda e: 10.0**e)

few = settings(
    max_examples=4, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def block(
    size=(0.04, 0.04, 0.04), young=1e4, density=1000.0, at=(0.0, 0.0, 0.1), rpy=(0.0, 0.0, 0.0), cell=None, poisson=0.3
):
    """A box of tissue that nothing holds and no air brakes."""
    x, y, z = size
    return f"""
BODY Block:
  name: Block
  mass: {density * x * y * z}
  shape: BOX
  geometry: {{x: {x}, y: {y}, z: {z}}}
  friction: {{static: 1.0, rolling: 0.0}}
  damping: {{linear: 0.0, angular: 0.0}}
  location: {{position: {{x: {at[0]}, y: {at[1]}, z: {at[2]}}}, orientation: {{r: {rpy[0]}, p: {rpy[1]}, y: {rpy[2]}}}}}
  ligature tissue:
    youngs modulus: {young}
    poisson ratio: {poisson}
    cell size: {cell or np.cbrt(x * y * z / 60.0)}
    fixed: []
"""


def nodes(simulation):
    """Places (n, 3) of all nodes now, in world axes."""
    return simulation.state["tissue_node"][0].copy()


def moment_of_momentum(simulation, dt=1e-4):
    """Of all nodes about their centre, (3,), found from where they are and how body and tissue move."""
    piece = simulation.tissues.pieces[0]
    mass, elastic, R = piece.block.elastic.mass, piece.block.elastic, piece.frame.R
    twist = simulation.bodies["BODY Block"].twist
    x = (elastic.x - mass @ elastic.x / mass.sum()) @ R.T
    v = np.cross(twist[3:], x) + elastic.v @ R.T
    return mass @ np.cross(x, v)


@few
@given(size=SIZES, rpy=ANGLES, young=YOUNGS, density=DENSITIES)
def test_it_falls_with_g_and_keeps_its_shape(tmp_path, size, rpy, young, density):
    simulation = Simulation(load(tmp_path, block(size, young, density, (0.0, 0.0, 2.0), rpy)))
    before = nodes(simulation)
    simulation.step(300)
    way = nodes(simulation) - before
    np.testing.assert_allclose(way[:, :2], 0.0, atol=1e-12)
    # Velocities change before places do: n (n + 1) / 2 ticks.
    np.testing.assert_allclose(way[:, 2], -GRAVITY * 1e-6 * 300 * 301 / 2, rtol=1e-9)


@few
@given(size=SIZES, young=st.floats(4.0, 6.0).map(lambda e: 10.0**e), spin=st.tuples(*[st.floats(1.0, 8.0)] * 3))
def test_it_spins_on_and_its_momentum_stays(tmp_path, size, young, spin):
    text = block(size, young, at=(0.0, 0.0, 1.0)).replace("  mass:", FLOATING)
    simulation = Simulation(load(tmp_path, text))
    simulation.bodies["BODY Block"].command_twist([0.0, 0.0, 0.0, *spin])
    simulation.step(2)
    simulation.bodies["BODY Block"].command_wrench([0.0] * 6)
    simulation.step(100)
    first, spun = moment_of_momentum(simulation), np.linalg.norm(simulation.bodies["BODY Block"].twist[3:])
    simulation.step(1000)
    after = moment_of_momentum(simulation)
    # Bullet integrates gyroscopic moments explicitly, which costs bodies of unequal moments of inertia something.
    np.testing.assert_allclose(after, first, atol=0.03 * np.linalg.norm(first))
    assert np.linalg.norm(simulation.bodies["BODY Block"].twist[3:]) > 0.9 * spun


@pytest.mark.parametrize("young", [1e4, 1e5, 1e6])
def test_it_sinks_on_a_smooth_table_as_a_column_does_and_lies_still(tmp_path, young):
    smooth = TABLE.replace("static: 1.0", "static: 0.0")
    simulation = Simulation(load(tmp_path, block(young=young, at=(0.0, 0.0, 0.0202), cell=0.04 / 6), smooth))
    simulation.step(900)
    rest = simulation.tissues.pieces[0].tissue.form.grid.nodes
    top, bottom = rest[:, 2] > 0.0199, rest[:, 2] < -0.0199
    x = nodes(simulation)
    sunk = 0.04 - (x[top, 2].mean() - x[bottom, 2].mean())
    # Hooke: ρ g L² / 2 E; the cells of six layers take 1 - 1/72 of it.
    assert sunk == pytest.approx(1000.0 * GRAVITY * 0.04**2 / (2.0 * young), rel=0.02)
    assert -2e-5 < x[:, 2].min() < 0.0
    assert simulation.state["tissue_wrench"][0, 0, 2] == pytest.approx(0.064 * GRAVITY, rel=1e-6)
    energy = simulation.tissues.pieces[0].block.elastic.energy()
    simulation.step(600)
    np.testing.assert_allclose(nodes(simulation), x, atol=1e-9)
    assert simulation.tissues.pieces[0].block.elastic.energy() <= energy * (1.0 + 1e-6)


@few
@given(size=SIZES, rpy=ANGLES, young=YOUNGS, density=DENSITIES)
def test_dropped_it_comes_to_rest_with_its_weight_and_does_not_sink(tmp_path, size, rpy, young, density):
    # what its own weight would press flat sinks by millimetres as it falls
    assume(density * GRAVITY * max(size) < HEAVIEST * young)
    simulation = Simulation(load(tmp_path, block(size, young, density, (0.0, 0.0, 0.07), rpy), TABLE))
    lowest = 0.0
    for _ in range(60):
        simulation.step(50)
        lowest = min(lowest, float(nodes(simulation)[:, 2].min()))
    assert lowest > -0.1e-3
    weight = density * np.prod(size) * GRAVITY
    assert simulation.state["tissue_wrench"][0, 0, 2] == pytest.approx(weight, rel=1e-3)
    x = nodes(simulation)
    simulation.step(500)
    np.testing.assert_allclose(nodes(simulation), x, atol=1e-6)


def test_energy_never_grows_after_a_fall(tmp_path):
    simulation = Simulation(load(tmp_path, block(young=2e4, at=(0.0, 0.0, 0.04), rpy=(0.4, 0.3, 0.2)), TABLE))
    piece, scene = simulation.tissues.pieces[0], simulation.scene
    mass, inertia = scene.bodies[0].mass, scene.bodies[0].inertia[0]  # a cube's are all alike

    def energy():
        pose, twist = simulation.bodies["BODY Block"].pose, simulation.bodies["BODY Block"].twist
        rigid = 0.5 * mass * twist[:3] @ twist[:3] + 0.5 * inertia * twist[3:] @ twist[3:]
        return rigid + mass * GRAVITY * pose[2] + piece.block.elastic.energy()

    most = energy()
    for _ in range(100):
        simulation.step(10)
        now = energy()
        assert now < most + 2e-5 * abs(most)
        most = min(most, now)


@pytest.mark.parametrize(
    ("jaw", "still"),
    [
        (0.05, 0.05e-3),
        (0.03, 3e-3),  # sharp edges in cells of 10 mm: the tissue trembles around them for up to a second
    ],
)
def test_a_gripper_squeezes_lifts_and_puts_it_down_and_it_recovers(tmp_path, jaw, still):
    fingers = [
        body(
            name,
            f"shape: BOX, geometry: {{x: {jaw}, y: 0.006, z: {jaw}}}",
            (0.0, side * 0.0235, 0.003 + jaw / 2),
            0.1,
            1.0,
        )
        for name, side in (("Left", 1), ("Right", -1))
    ]
    simulation = Simulation(load(tmp_path, block(young=1e4, density=400.0, at=(0.0, 0.0, 0.0201)), TABLE, *fingers))
    left, right = simulation.bodies["BODY Left"], simulation.bodies["BODY Right"]

    def move(closing, rising, ticks):
        left.command_twist([0.0, -closing, rising, 0.0, 0.0, 0.0])
        right.command_twist([0.0, closing, rising, 0.0, 0.0, 0.0])
        simulation.step(ticks)

    simulation.step(200)
    rest = nodes(simulation)
    middle = (np.abs(rest[:, 0]) < 0.007) & (np.abs(rest[:, 2] - 0.02) < 0.007)
    move(0.02, 0.0, 200)
    squeezed = nodes(simulation)
    assert np.ptp(squeezed[middle, 1]) < 0.037  # of 0.040
    move(0.0, 0.05, 300)
    move(0.0, 0.0, 300)
    held = nodes(simulation)
    assert held[:, 2].min() > 0.010  # lifted by 15 mm
    move(0.0, 0.0, 500)
    np.testing.assert_allclose(nodes(simulation), held, atol=still)
    move(0.0, -0.05, 300)
    move(-0.02, 0.0, 200)
    move(0.0, 0.0, 800)
    after = nodes(simulation)
    assert np.ptp(after[middle, 1]) == pytest.approx(np.ptp(rest[middle, 1]), abs=0.1e-3)
    # The table's friction holds its base as the jaws put it down.
    fit, _ = Rotation.align_vectors(after - after.mean(axis=0), rest - rest.mean(axis=0))
    np.testing.assert_allclose(fit.apply(rest - rest.mean(axis=0)), after - after.mean(axis=0), atol=0.8e-3)
    assert simulation.state["tissue_wrench"][0, 0, 2] == pytest.approx(0.0256 * GRAVITY, rel=0.01)


@few
@given(size=SIZES, young=st.floats(4.0, 5.5).map(lambda e: 10.0**e), squeeze=st.floats(0.02, 0.1))
def test_squeezed_without_weight_it_springs_back_to_its_shape(tmp_path, size, young, squeeze):
    jaws = [
        body(
            name, "shape: BOX, geometry: {x: 0.2, y: 0.01, z: 0.2}", (0.0, side * (size[1] / 2 + 0.0055), 0.1), 0.1, 1.0
        )
        for name, side in (("Left", 1), ("Right", -1))
    ]
    simulation = Simulation(load(tmp_path, block(size, young).replace("  mass:", FLOATING), *jaws))
    left, right = simulation.bodies["BODY Left"], simulation.bodies["BODY Right"]
    way = 0.0005 + squeeze * size[1] / 2
    for sign, ticks in ((1, 200), (-1, 200)):
        left.command_twist([0.0, -sign * way / 0.2, 0.0, 0.0, 0.0, 0.0])
        right.command_twist([0.0, sign * way / 0.2, 0.0, 0.0, 0.0, 0.0])
        simulation.step(ticks)
        if sign > 0:
            assert np.ptp(nodes(simulation)[:, 1]) == pytest.approx((1.0 - squeeze) * size[1], abs=0.2e-3)
    simulation.step(500)
    piece = simulation.tissues.pieces[0]
    np.testing.assert_allclose(piece.block.positions, piece.tissue.form.grid.nodes, atol=0.02e-3)


def test_a_ball_rests_on_it(tmp_path):
    ball = body("Ball", "shape: SPHERE, geometry: {radius: 0.01}", (0.002, -0.003, 0.0505), 0.01)
    simulation = Simulation(load(tmp_path, block(young=2e4, at=(0.0, 0.0, 0.02)), TABLE, ball))
    simulation.step(2000)
    assert 0.045 < simulation.bodies["BODY Ball"].pose[2] < 0.051
    forces = dict(simulation.tissues.pieces[0].contacts.forces)
    assert -forces[simulation.scene.body_index["BODY Ball"]][2] == pytest.approx(0.01 * GRAVITY, rel=0.05)


def test_runs_repeat_to_the_bit_and_go_on_from_snapshots(tmp_path):
    scene = load(tmp_path, block(young=2e4, at=(0.0, 0.0, 0.05), rpy=(0.4, 0.3, 0.2)), TABLE)
    hashes = []
    for calls in ([400], [1] * 400, [7, 93, 300]):
        simulation = Simulation(scene)
        for ticks in calls:
            simulation.step(ticks)
            simulation.state_hash()
        hashes.append(simulation.state_hash())
    assert len(set(hashes)) == 1
    for at in (60, 131, 290):  # in flight, at the blow, at rest
        simulation, other = Simulation(scene), Simulation(scene)
        simulation.step(at)
        taken = simulation.snapshot()
        other.restore(taken)
        for each in (simulation, other):
            each.step(70)
        assert simulation.state_hash() == other.state_hash()
    simulation.reset()
    fresh = Simulation(scene)
    for each in (simulation, fresh):
        each.step(200)
    assert simulation.state_hash(clock=False) == fresh.state_hash(clock=False)


def test_two_processes_have_the_same_bits(tmp_path):
    load(tmp_path, block(young=2e4, at=(0.0, 0.0, 0.03), rpy=(0.4, 0.3, 0.2)), TABLE)
    code = (
        "import sys, ligature; s = ligature.Simulation(ligature.load(sys.argv[1])); s.step(250); print(s.state_hash())"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "m.yaml")]
    hashes = {subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in range(2)}
    assert len(hashes) == 1 and len(hashes.pop()) > 10


def test_a_needle_goes_through_it(kit):
    free = kit.pad("    youngs modulus: 30000\n    fixed: []\n", mass="0.02", size=(0.04, 0.03, 0.01), at=(0, 0, 0.005))
    simulation = kit.run(free, TABLE, kit.needle())
    simulation.step(100)
    bite = kit.Bite(simulation, top=0.01)
    for _ in range(30):
        simulation.step(10)
        assert np.isfinite(nodes(simulation)).all()
    assert bite.inside.depth > 0.005
    simulation.step(500)
    assert np.abs(nodes(simulation)).max() < 0.05
