"""Soft bodies of AMBF: the tissue that they become, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.adf import Severity
from ligature.cli.check import findings
from ligature.model.scene import Body

TEXT = """
soft bodies: [BODY Lump]
namespace: /env/
BODY Lump:
  name: lump
  mesh: lump.obj
  mass: {mass}
  location: {{position: {{x: 0.1, y: 0.2, z: {height}}}, orientation: {{r: 0, p: 0, y: 0.5}}}}
  config: {{{config}}}
{more}"""
TABLE = """
bodies: [BODY Table]
BODY Table:
  name: Table
  mass: 0
  collision shape: BOX
  collision geometry: {x: 1, y: 1, z: 0.1}
  friction: {static: 1.0, rolling: 0.0}
  location: {position: {x: 0, y: 0, z: -0.05}, orientation: {r: 0, p: 0, y: 0}}
"""

shapes = settings(
    max_examples=15, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def write(folder: Path, mesh: trimesh.Trimesh, config: str = "kLST: 0.1", mass: float = 0.2, more: str = "",
          height: float = 1.0) -> Path:  # fmt: skip
    mesh.export(folder / "lump.obj")
    (folder / "m.yaml").write_text(TEXT.format(mass=mass, config=config, more=more, height=height))
    return folder / "m.yaml"


def body(folder: Path, mesh: trimesh.Trimesh, config: str = "kLST: 0.1", mass: float = 0.2, more: str = "") -> Body:
    scene = ligature.load(write(folder, mesh, config, mass, more))
    assert not [d for d in scene.diagnostics if d.severity >= Severity.WARNING], scene.diagnostics
    return scene.bodies[0]


def modulus(found: Body) -> float:
    assert found.tissue is not None
    (material,) = found.tissue.materials
    return material.youngs


def ball(radius: float = 0.05) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(2, radius)


@shapes
@given(mass=st.floats(0.01, 2.0), radius=st.floats(0.02, 0.2), friction=st.floats(0.0, 1.0))
def test_mass_place_and_friction_are_the_files(tmp_path: Path, mass: float, radius: float, friction: float) -> None:
    found = body(tmp_path, ball(radius), f"kDF: {friction}, kMT: 0.05", mass)
    assert found.tissue is not None
    assert found.mass == mass and found.tissue.cell_masses.sum() == pytest.approx(mass)
    np.testing.assert_allclose(found.T_world_body[:3, 3], [0.1, 0.2, 1.0])
    np.testing.assert_allclose(found.inertia, 0.4 * mass * radius**2, rtol=0.25)  # of cubes that fill a ball
    assert found.friction == friction and found.identity.passive and not found.static
    assert not found.tissue.fixed.any() and not len(found.tissue.pins.nodes)


def pulled(share: float, iterations: int, mass: float) -> float:
    """Stiffness of one spring between two nodes that position-based steps of 1 ms pull apart by forces of 1 N."""
    length, x, v = 1.0, np.array([0.0, 1.0]), np.zeros(2)
    for _ in range(4000):
        before = x.copy()
        v += np.array([-1.0, 1.0]) / mass * 1e-3
        x = x + v * 1e-3
        for _ in range(iterations):
            x += 0.5 * share * (x[1] - x[0] - length) * np.array([1.0, -1.0])
        v = 0.9 * (x - before) / 1e-3
    return float(1.0 / (x[1] - x[0] - length))


@pytest.mark.parametrize(("share", "iterations"), [(0.05, 1), (0.3, 1), (0.1, 4)])
def test_stiffness_is_that_of_a_cube_whose_springs_position_based_steps_shorten(
    tmp_path: Path, share: float, iterations: int
) -> None:
    cube, mass = trimesh.creation.box((0.1, 0.1, 0.1)).subdivide().subdivide(), 0.05
    found = modulus(body(tmp_path, cube, f"kLST: {share}, piterations: {iterations}", mass))
    spring = pulled(share, iterations, mass / len(cube.vertices))
    # The four walls along a pull are 4 L wide in all, across L²; a sheet has 2 k / √3.
    assert found == pytest.approx(4.0 / 0.1 * 2.0 * spring / np.sqrt(3.0), rel=0.02)


@shapes
@given(share=st.floats(0.001, 0.5), iterations=st.integers(1, 8), mass=st.floats(0.01, 1.0), scale=st.floats(0.5, 2.0))
def test_stiffness_grows_with_shares_and_mass_and_falls_with_size(
    tmp_path: Path, share: float, iterations: int, mass: float, scale: float
) -> None:
    low, high = 4.0 * 2.0 * mass / 0.0005 * 9.8 * 0.1 * 16.0, 1e6  # twice the mass in half the size may be bounded
    found = modulus(body(tmp_path, ball(), f"kLST: {share}, piterations: {iterations}", mass))
    for config, m, radius, factor in (
        (f"kLST: {share}, piterations: {iterations}", 2.0 * mass, 0.05, 2.0),
        (f"kLST: {share}, piterations: {iterations}", mass, 0.05 * scale, 1.0 / scale),
    ):
        other = modulus(body(tmp_path, ball(radius), config, m))
        if low < found < high and low < other < high:
            assert other == pytest.approx(factor * found, rel=1e-6)
    assert modulus(body(tmp_path, ball(), f"kLST: {share}, piterations: {iterations + 1}", mass)) >= found
    assert modulus(body(tmp_path, ball(), f"kLST: {share}, piterations: {iterations}, kMT: 0.01", mass)) >= found


def test_rigid_springs_get_the_stiffest_tissue_and_a_word_about_it(tmp_path: Path) -> None:
    found = findings(write(tmp_path, ball(), "kLST: 1.0"), (), False)
    assert any("gets a Young's modulus of 1e+06 Pa; its 'config' amounts to inf" in d.message for d in found)
    assert not [d for d in found if d.severity >= Severity.WARNING]


def test_the_own_block_comes_before_config(tmp_path: Path) -> None:
    more = "  ligature tissue: {youngs modulus: 12345, poisson ratio: 0.4, cell size: 0.03, surface friction: 0.7}"
    found = body(tmp_path, ball(), "kLST: 1.0", 0.2, more)
    assert found.tissue is not None
    assert modulus(found) == 12345.0 and found.tissue.materials[0].poisson == 0.4 and found.friction == 0.7
    assert found.tissue.cell_masses.sum() == pytest.approx(0.2)


@shapes
@given(seed=st.integers(0, 10**6), count=st.integers(1, 6))
def test_fixed_nodes_are_vertices_as_the_file_numbers_them(tmp_path: Path, seed: int, count: int) -> None:
    mesh, rng = ball(), np.random.default_rng(seed)
    order = rng.permutation(len(mesh.vertices))
    mixed = trimesh.Trimesh(mesh.vertices[order], np.argsort(order)[mesh.faces], process=False)
    held = rng.choice(len(order), count, replace=False)
    found = body(tmp_path, mixed, f"fixed nodes: {held.tolist()}, kMT: 0.05")
    assert found.tissue is not None
    places = found.tissue.pins.positions(found.tissue.grid.nodes)
    expected = mixed.vertices[held]
    np.testing.assert_allclose(
        places[np.lexsort(places.round(6).T)], expected[np.lexsort(expected.round(6).T)], atol=1e-6
    )


def test_many_fixed_nodes_hold_the_grid(tmp_path: Path) -> None:
    mesh = trimesh.creation.box((0.1, 0.1, 0.1)).subdivide().subdivide().subdivide()
    low = np.flatnonzero(mesh.vertices[:, 2] < -0.049)
    found = body(tmp_path, mesh, f"fixed nodes: {low.tolist()}, kMT: 0.05")
    assert found.tissue is not None and found.static
    grid = found.tissue.grid
    assert (grid.nodes[found.tissue.fixed][:, 2] < -0.049).all()
    assert found.tissue.fixed.sum() == (grid.nodes[:, 2] < -0.049).sum()


@pytest.mark.parametrize(
    ("mesh", "config", "mass", "message"),
    [
        (trimesh.creation.box((0.1, 0.1, 0.1)).slice_plane([0, 0, 0], [0, 0, 1]), "kLST: 0.1", 0.2,
         "is cloth: 'lump.obj' has"),
        (ball(), "kLST: 0.1", 0.0, "'mass' of soft body"),
        (ball(), "kLST: 0.1", -1.0, "'mass' of soft body"),
    ],
)  # fmt: skip
def test_what_cannot_be_simulated_is_refused_with_a_reason(
    tmp_path: Path, mesh: trimesh.Trimesh, config: str, mass: float, message: str
) -> None:
    found = [d for d in findings(write(tmp_path, mesh, config, mass), (), False) if d.severity >= Severity.ERROR]
    assert any(message in d.message and d.hint for d in found), found


@pytest.mark.parametrize("key", ["kLST", "kMT", "kDP"])
@pytest.mark.parametrize(("value", "taken"), [(1.5, 1), (-1.0, 0), (-0.5, 0), (2.0, 1), (1.0, None), (0.0, None)])
def test_a_share_beyond_0_and_1_is_reported(tmp_path: Path, key: str, value: float, taken: float | None) -> None:
    found = findings(write(tmp_path, ball(), f"{key}: {value}"), (), False)
    messages = [d.message for d in found if d.severity >= Severity.WARNING]
    expected = [] if taken is None else [f"soft body 'BODY Lump' has the {key} {value:g}; {taken:g} is taken"]
    assert messages == expected


def test_a_node_that_does_not_exist_ends_the_list(tmp_path: Path) -> None:
    scene = ligature.load(write(tmp_path, ball(), "fixed nodes: [3, 100000, 4], kMT: 0.05"))
    assert any("has no node 100000 to fix" in d.message for d in scene.diagnostics)
    assert scene.bodies[0].tissue is not None and len(scene.bodies[0].tissue.pins.nodes) == 1


def test_a_soft_body_falls_rests_and_hangs_by_its_fixed_nodes(tmp_path: Path) -> None:
    write(tmp_path, ball(0.03), "kMT: 0.2, kDF: 0.5", 0.05, height=0.05)
    text = (tmp_path / "m.yaml").read_text()
    (tmp_path / "m.yaml").write_text(text + TABLE)
    simulation = Simulation(ligature.load(tmp_path / "m.yaml"))
    simulation.step(1500)
    nodes = simulation.state["tissue_node"][0]
    assert -1e-4 < nodes[:, 2].min() < 0.0 and nodes[:, 2].max() > 0.04
    assert simulation.state["tissue_wrench"][0, 0, 2] == pytest.approx(0.05 * 9.8, rel=0.01)

    top = int(np.argmax(ball(0.03).vertices[:, 2]))
    hanging = Simulation(
        ligature.load(write(tmp_path, ball(0.03), f"kMT: 0.2, kDP: 0.003, fixed nodes: [{top}]", 0.05))
    )
    hanging.step(1500)
    assert hanging.state["tissue_wrench"][0, 0, 2] == pytest.approx(0.05 * 9.8, rel=0.01)
    assert hanging.state["tissue_node"][0, :, 2].max() == pytest.approx(1.03, abs=0.01)


def test_damping_slows_the_fall_as_bullet_does(tmp_path: Path) -> None:
    share = 0.004
    simulation = Simulation(ligature.load(write(tmp_path, ball(), f"kMT: 0.2, kDP: {share}")))
    before = simulation.state["tissue_node"][0, :, 2].mean()
    simulation.step(600)
    v = z = 0.0
    for _ in range(600):
        v = (v - 9.8e-3) * (1.0 - share)
        z += v * 1e-3
    assert simulation.state["tissue_node"][0, :, 2].mean() - before == pytest.approx(z, rel=0.01)


@settings(shapes, max_examples=25)
@given(mass=st.floats(-300, 5), young=st.floats(-6, 11), poisson=st.sampled_from([0.0, 0.3, 0.45, 0.499]))
def test_what_check_passes_can_be_simulated_at_any_mass_and_stiffness(
    tmp_path: Path, mass: float, young: float, poisson: float
) -> None:
    more = f"  ligature tissue: {{youngs modulus: {10**young:e}, poisson ratio: {poisson}, cell size: 0.05}}\n"
    try:
        scene = ligature.load(write(tmp_path, trimesh.creation.box((0.1, 0.1, 0.1)), "", 10**mass, more))
    except ligature.SceneError as refused:
        assert refused.diagnostics
        assert all(d.mark is not None and d.hint for d in refused.diagnostics), refused
        return
    simulation = Simulation(scene)
    simulation.step(20)
    assert np.isfinite(simulation.state["tissue_node"]).all() and not simulation.problems
    simulation.close()
