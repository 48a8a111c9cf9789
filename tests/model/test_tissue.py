"""Bodies of soft tissue in scene files: what they become, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.model.material import MATERIALS
from ligature.model.scene import Scene
from ligature.model.state import new_state

PAD = """
bodies: [BODY Pad, BODY Tray]
joints: []
BODY Pad:
  name: Pad
  mass: 0.0
  shape: BOX
  geometry: {x: 0.06, y: 0.04, z: 0.01}
  location: {position: {x: 0.1, y: 0, z: 0.2}, orientation: {r: 0, p: 0, y: 1.0}}
  ligature tissue:
    material: silicone pad
    cell size: 0.005
BODY Tray:
  name: Tray
  mass: 2
  shape: BOX
  geometry: {x: 0.1, y: 0.1, z: 0.01}
  location: {position: {x: 0.1, y: 0, z: 0.18}, orientation: {r: 0, p: 0, y: 0.3}}
"""
LINE = "    cell size: 0.005\n"


def load(folder: Path, text: str) -> Scene:
    (folder / "m.yaml").write_text(text)
    return ligature.load(folder / "m.yaml")


def test_a_body_with_the_block_is_tissue_and_has_no_rigid_shape(tmp_path: Path) -> None:
    scene = load(tmp_path, PAD)
    (tissue,) = scene.tissues
    body = scene.bodies[tissue.body]
    assert body.identity.name == "Pad"
    assert body.colliders == () and body.static
    assert tissue.form.materials == (MATERIALS["silicone pad"],)
    assert (tissue.form.grid.nodes[tissue.form.fixed][:, 2] == -0.005).all()
    assert tissue.form.fixed.sum() == 13 * 9
    np.testing.assert_allclose(np.ptp(tissue.form.grid.nodes, axis=0), (0.06, 0.04, 0.01))
    placed = new_state(scene)["tissue_node"][0] - body.T_world_body[:3, 3]
    np.testing.assert_allclose(placed @ body.T_world_body[:3, :3], tissue.form.grid.nodes, atol=1e-12)


def test_numbers_come_before_those_of_the_named_material(tmp_path: Path) -> None:
    scene = load(tmp_path, PAD.replace(LINE, LINE + "    youngs modulus: 12345\n    least angle: 0.3\n"))
    (material,) = scene.tissues[0].form.materials
    assert material.youngs == 12345.0
    assert material.least_angle == 0.3
    assert material.friction == MATERIALS["silicone pad"].friction


@settings(max_examples=20, deadline=None)
@given(thickness=st.floats(0.001, 0.009), soft=st.floats(1e3, 1e5))
def test_layers_lie_from_the_top_down_with_cells_between_their_borders(
    tmp_path_factory: pytest.TempPathFactory, thickness: float, soft: float
) -> None:
    layers = f"    layers:\n      - {{thickness: {thickness}}}\n      - {{material: fat, youngs modulus: {soft}}}\n"
    (tissue,) = load(tmp_path_factory.mktemp("m"), PAD.replace(LINE, LINE + layers)).tissues
    grid = tissue.form.grid
    assert [m.youngs for m in tissue.form.materials] == [MATERIALS["silicone pad"].youngs, soft]
    height = 0.005 - thickness
    low, high = grid.nodes[grid.cells].min(axis=1)[:, 2], grid.nodes[grid.cells].max(axis=1)[:, 2]
    assert ((low >= height - 1e-9) == (grid.layer == 0)).all()
    assert ((high <= height + 1e-9) == (grid.layer == 1)).all()


def test_a_flat_slit_makes_lips_and_a_box_takes_tissue_away(tmp_path: Path) -> None:
    flat = "    slits: [{from: {x: -0.0123, y: 0.003, z: 0.001}, to: {x: 0.0121, y: 0.003, z: 0.005}}]\n"
    whole, cut = load(tmp_path, PAD).tissues[0].form, load(tmp_path, PAD.replace(LINE, LINE + flat)).tissues[0].form
    nodes = cut.grid.nodes[cut.grid.lips]
    assert len(cut.slits) == 1 and not whole.slits and not len(whole.grid.lips)
    assert (nodes[..., 1] == 0.003).all()
    assert nodes[..., 0].min() > -0.0123 - 1e-12 and nodes[..., 0].max() < 0.0121 + 1e-12
    assert cut.cell_masses.sum() == pytest.approx(whole.cell_masses.sum())
    gap = "    slits: [{from: {x: -0.015, y: -0.002, z: 0.0}, to: {x: 0.015, y: 0.002, z: 0.005}}]\n"
    wound = load(tmp_path, PAD.replace(LINE, LINE + gap)).tissues[0].form
    missing = (whole.cell_masses.sum() - wound.cell_masses.sum()) / MATERIALS["silicone pad"].density
    assert missing == pytest.approx(0.03 * 0.004 * 0.005)
    across = wound.grid.nodes[wound.grid.lips[wound.grid.lip_axis == 1]]
    np.testing.assert_allclose(across[:, 1, 1] - across[:, 0, 1], 0.004, atol=1e-12)


def test_free_tissue_has_the_mass_that_the_file_gives_or_that_of_its_density(tmp_path: Path) -> None:
    free = PAD.replace(LINE, LINE + "    fixed: []\n").replace("material: silicone pad", "youngs modulus: 30000")
    given = load(tmp_path, free.replace("mass: 0.0", "mass: 0.5"))
    assert given.tissues[0].form.cell_masses.sum() == pytest.approx(0.5)
    dense = load(tmp_path, free.replace("  mass: 0.0\n", "").replace(LINE, LINE + "    density: 2000\n"))
    body = dense.bodies[dense.tissues[0].body]
    assert body.mass == pytest.approx(2000 * 0.06 * 0.04 * 0.01)
    x, y, z = 0.06**2, 0.04**2, 0.01**2
    np.testing.assert_allclose(body.inertia, body.mass / 12 * np.array([y + z, x + z, x + y]))


def test_tissue_is_fixed_to_the_body_that_carries_it(tmp_path: Path) -> None:
    text = PAD.replace("  mass: 0.0\n", "").replace(LINE, LINE + "    carried by: BODY Tray\n")
    scene = load(tmp_path, text)
    (joint,) = scene.joints
    names = [scene.bodies[i].identity.name for i in (joint.parent, joint.child)]
    assert names == ["Tray", "Pad"]
    simulation = ligature.Simulation(scene)
    before = simulation.state["body_pose"][0].copy()
    simulation.step(200)
    fallen = simulation.state["body_pose"][0] - before
    assert fallen[0, 2] < -0.1
    np.testing.assert_allclose(fallen[0], fallen[1], atol=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("    material: silicone pad\n", "", "no tissue material"),
        ("silicone pad", "jelly", "'ligature tissue.material'"),
        (LINE, LINE + "    poisson ratio: 0.5\n", "'ligature tissue.poisson ratio'"),
        (LINE, LINE + "    youngs modulus: 0\n", "'ligature tissue.youngs modulus'"),
        (LINE, LINE + "    friction: -1\n", "'ligature tissue.friction'"),
        (LINE, LINE + "    fixed: [bottom]\n", "no face 'bottom'"),
        ("0.005\n", "0.0001\n", "cells of 0.0001 m"),
        ("0.005\n", "0.001\n", "nodes"),
        (LINE, LINE + "    slits: [{from: {x: 0, y: 0, z: 0}}]\n", "lacks the key 'to'"),
        (
            LINE,
            LINE + "    slits: [{from: {x: 0, y: 0.5, z: 0}, to: {x: 1, y: 0.5, z: 1}}]\n",
            "no rectangle or box inside",
        ),
        (
            LINE,
            LINE + "    slits: [{from: {x: 0, y: 0, z: 0}, to: {x: 1, y: 0, z: 0}}]\n",
            "no rectangle or box inside",
        ),
        (LINE, LINE + "    slits: [{from: {x: -1, y: -1, z: 0}, to: {x: 1, y: 1, z: 0}}]\n", "are not held"),
        (LINE, LINE + "    layers: [{material: fat}, {material: skin}]\n", "layer without thickness"),
        (
            LINE,
            LINE + "    fixed: []\n    slits: [{from: {x: 0, y: -1, z: -1}, to: {x: 0, y: 1, z: 1}}]\n",
            "falls into 2",
        ),
        ("cell size: 0.005", "cell size: 0.5\n    fixed: [-z, +z]", "no node that can move"),
        ("shape: BOX\n  geometry: {x: 0.06, y: 0.04, z: 0.01}", "friction: {static: 0.5}", "has no shape"),
        (LINE, LINE + "    carried by: BODY Table\n", "'BODY Table' does not exist"),
        (LINE, LINE + "    carried by: BODY Tray\n", "no mass but is carried"),
    ],
)
def test_what_cannot_be_tissue_is_reported_where_it_stands(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = PAD.replace(old, new, 1)
    assert text != PAD
    (tmp_path / "m.yaml").write_text(text)
    found = ligature.load(tmp_path / "m.yaml").diagnostics
    errors = [d for d in found if d.severity.name == "ERROR"]
    assert any(message in d.message for d in errors), errors
    assert all(d.mark is not None and d.mark.line > 1 and d.hint for d in errors)


def test_an_open_mesh_is_reported(tmp_path: Path) -> None:
    (tmp_path / "open.obj").write_text("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n")
    text = PAD.replace("shape: BOX\n  geometry: {x: 0.06, y: 0.04, z: 0.01}", "mesh: open.obj", 1)
    found = load(tmp_path, text).diagnostics
    assert any("open edges" in d.message and d.severity.name == "ERROR" for d in found)


@pytest.mark.parametrize("shape", ["SPHERE", "CYLINDER", "CAPSULE", "CONE"])
def test_round_shapes_are_filled(tmp_path: Path, shape: str) -> None:
    text = PAD.replace("shape: BOX\n  geometry: {x: 0.06, y: 0.04, z: 0.01}",
                       f"shape: {shape}\n  geometry: {{radius: 0.02, height: 0.05}}", 1)  # fmt: skip
    form = load(tmp_path, text.replace("0.005\n", "0.0035\n", 1)).tissues[0].form
    ball, height = 4 / 3 * np.pi * 0.02**3, np.pi * 0.02**2 * 0.05
    volume = {"SPHERE": ball, "CYLINDER": height, "CAPSULE": np.pi * 0.02**2 * 0.01 + ball, "CONE": height / 3}[shape]
    assert form.grid.sizes.prod(axis=1).sum() == pytest.approx(volume, rel=0.08)
