"""Bodies of soft tissue in scene files: what they become, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.model import tissue
from ligature.model.frames import pose_matrix
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
        ("0.005\n", "0.0001\n", "lies in a grid of"),
        ("0.005\n", "0.001\n", "nodes"),
        (LINE, LINE + "    slits: [{from: {x: 0, y: 0, z: 0}}]\n", "lacks the key 'to'"),
        (
            LINE,
            LINE + "    slits: [{from: {x: 0, y: 0.5, z: 0}, to: {x: 1, y: 0.5, z: 1}}]\n",
            "not a rectangle or box inside",
        ),
        (
            LINE,
            LINE + "    slits: [{from: {x: 0, y: 0, z: 0}, to: {x: 1, y: 0, z: 0}}]\n",
            "not a rectangle or box inside",
        ),
        (LINE, LINE + "    slits: [{from: {x: -1, y: -1, z: 0}, to: {x: 1, y: 1, z: 0}}]\n", "are not held"),
        (LINE, LINE + "    layers: [{material: fat}, {material: skin}]\n", "layer without thickness"),
        (
            "    material: silicone pad\n",
            "    layers: [{thickness: 0.004, material: fat}, {density: 900}]\n",
            "in layer 2",
        ),
        (LINE, LINE + "    fixed:\n", "has no value for 'fixed'"),
        (
            LINE,
            LINE + "    slits: [{from: {x: -1, y: -1, z: -1}, to: {x: 1, y: 1, z: 1}}]\n",
            "its slits leave no cell",
        ),
        (LINE, LINE + "    layers: [{thickness: 0, material: fat}, {material: skin}]\n", "layer without thickness"),
        (
            LINE,
            LINE + "    fixed: []\n    slits: [{from: {x: 0, y: -1, z: -1}, to: {x: 0, y: 1, z: 1}}]\n",
            "consists of 2",
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


def test_a_body_may_have_as_many_nodes_as_are_simulated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A box has all nodes of the grid around it, so that both bounds see the same number."""
    for most, message in (
        (540, ""),
        (539, "has 540 nodes"),
        (27, "has 540 nodes"),
        (26, "lies in a grid of 540 nodes"),
    ):
        monkeypatch.setattr(tissue, "MOST_NODES", most)
        found = load(tmp_path, PAD.replace("x: 0.06, y: 0.04, z: 0.01", "x: 0.095, y: 0.04, z: 0.01", 1))
        errors = [d.message for d in found.diagnostics if d.severity.name == "ERROR"]
        assert (message in errors[0] and not found.tissues) if message else (not errors and found.tissues), most


NUMBER = st.floats(-1.0, 1.0)


@settings(max_examples=30, deadline=None)
@given(
    low=st.tuples(*[NUMBER] * 3), at=st.tuples(*[NUMBER] * 3), turn=st.tuples(*[NUMBER] * 3), mass=st.floats(0.01, 10.0)
)
def test_moments_about_any_frame_are_those_of_a_box_with_steiners_share(
    tmp_path_factory: pytest.TempPathFactory, low: tuple[float, ...], at: tuple[float, ...], turn: tuple[float, ...],
    mass: float,
) -> None:  # fmt: skip
    """I = R' (I_box + m (|p|² 1 - p p')) R, of whose matrix a body keeps the diagonal."""
    folder, edges = tmp_path_factory.mktemp("m"), np.array((0.06, 0.04, 0.01))
    trimesh.creation.box(bounds=np.array((low, low + edges))).export(folder / "pad.obj", digits=12)
    offset = (
        f"  inertial offset: {{position: {{x: {at[0]}, y: {at[1]}, z: {at[2]}}}, "
        f"orientation: {{r: {turn[0]}, p: {turn[1]}, y: {turn[2]}}}}}\n"
    )
    text = PAD.replace("  mass: 0.0\n", f"  mass: {mass}\n{offset}", 1)
    scene = load(folder, text.replace("shape: BOX\n  geometry: {x: 0.06, y: 0.04, z: 0.01}", "mesh: pad.obj", 1))
    body = scene.bodies[scene.tissues[0].body]
    T = pose_matrix(at, turn)
    np.testing.assert_allclose(body.T_body_inertial, T, atol=1e-12)
    p = np.array(low) + edges / 2 - at
    about = np.diag(edges @ edges - edges**2) / 12 + p @ p * np.eye(3) - np.outer(p, p)
    np.testing.assert_allclose(body.inertia, mass * np.diag(T[:3, :3].T @ about @ T[:3, :3]), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("stated", "density"),
    [
        ("youngs modulus: 30000", None),
        ("youngs modulus: 30000, density: 2000", 2000.0),
        ("material: fat", MATERIALS["fat"].density),
        ("material: fat, density: 2000", 2000.0),
    ],
)
def test_a_stated_density_or_material_holds_beside_a_mass(tmp_path: Path, stated: str, density: float | None) -> None:
    block = f"  ligature tissue: {{{stated}, cell size: 0.005, fixed: []}}\n"
    start, end = PAD.index("  ligature tissue:"), PAD.index("BODY Tray:\n")
    text = (PAD[:start] + block + PAD[end:]).replace("mass: 0.0", "mass: 0.5")
    (found,) = load(tmp_path, text).tissues
    volume = 0.06 * 0.04 * 0.01
    assert found.form.cell_masses.sum() == pytest.approx(0.5 if density is None else density * volume)


def test_a_finding_states_nodes_cells_and_stiffness_of_every_body_of_tissue(tmp_path: Path) -> None:
    layers = "    layers: [{thickness: 0.004}, {youngs modulus: 1234}]\n"
    text = PAD.replace(LINE, LINE + layers).replace("z: 0.01}", "z: 0.008}", 1)
    (found,) = [d for d in load(tmp_path, text).diagnostics if "soft tissue" in d.message]
    young = f"{MATERIALS['silicone pad'].youngs:.3g} and 1.23e+03"
    assert found.message == (f"'BODY Pad' is soft tissue: 351 nodes, cells of 5 x 5 x 4 mm, Young's modulus {young} Pa")
    assert (found.severity.name, found.hint) == ("INFO", "docs/tissue.md")
    assert found.mark is not None and found.mark.line == text[: text.index("BODY Pad:")].count("\n") + 2


def test_an_open_mesh_is_reported(tmp_path: Path) -> None:
    (tmp_path / "open.obj").write_text("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n")
    text = PAD.replace("shape: BOX\n  geometry: {x: 0.06, y: 0.04, z: 0.01}", "mesh: open.obj", 1)
    found = load(tmp_path, text).diagnostics
    assert any("open edges" in d.message and d.severity.name == "ERROR" for d in found)


@given(
    st.tuples(*[st.floats(0.01, 0.1)] * 3), st.sampled_from([1.0, -1.0, 0.5, -2.0]), st.booleans(),
    st.sampled_from(["box", "icosphere", "torus"]),
)  # fmt: skip
@settings(max_examples=20)
def test_a_mirrored_or_inverted_mesh_is_filled_as_any_other(
    tmp_path_factory: pytest.TempPathFactory, size: tuple[float, ...], scale: float, inverted: bool, shape: str
) -> None:
    folder = tmp_path_factory.mktemp("m")
    mesh = getattr(trimesh.creation, shape)(*((0.4, 0.2) if shape == "torus" else ()))
    mesh.apply_scale(size)
    whole = abs(mesh.volume) * abs(scale) ** 3
    mesh.faces = mesh.faces[:, ::-1] if inverted else mesh.faces
    (folder / "pad.obj").write_text(trimesh.exchange.obj.export_obj(mesh))
    text = PAD.replace("shape: BOX\n  geometry: {x: 0.06, y: 0.04, z: 0.01}", f"mesh: pad.obj\n  scale: {scale}", 1)
    (tissue,) = load(folder, text.replace(LINE, "")).tissues
    assert tissue.form.grid.sizes.prod(axis=1).sum() == pytest.approx(whole, rel=0.3)


def test_a_mesh_scaled_to_nothing_is_reported_as_that(tmp_path: Path) -> None:
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "pad.obj")
    text = PAD.replace("shape: BOX\n  geometry: {x: 0.06, y: 0.04, z: 0.01}", "mesh: pad.obj\n  scale: 0", 1)
    (error,) = [d for d in load(tmp_path, text).diagnostics if d.severity.name == "ERROR"]
    assert "has no extent" in error.message and "'scale'" in error.hint


def test_layers_that_all_have_a_material_need_none_of_the_body(tmp_path: Path) -> None:
    layers = "    layers: [{thickness: 0.004, material: fat}, {youngs modulus: 1.0e+4, density: 900}]\n"
    form = load(tmp_path, PAD.replace("    material: silicone pad\n", layers)).tissues[0].form
    assert [m.youngs for m in form.materials] == [MATERIALS["fat"].youngs, 1e4] and form.own_density


@pytest.mark.parametrize("shape", ["SPHERE", "CYLINDER", "CAPSULE", "CONE"])
def test_round_shapes_are_filled(tmp_path: Path, shape: str) -> None:
    text = PAD.replace("shape: BOX\n  geometry: {x: 0.06, y: 0.04, z: 0.01}",
                       f"shape: {shape}\n  geometry: {{radius: 0.02, height: 0.05}}", 1)  # fmt: skip
    form = load(tmp_path, text.replace("0.005\n", "0.0035\n", 1)).tissues[0].form
    ball, height = 4 / 3 * np.pi * 0.02**3, np.pi * 0.02**2 * 0.05
    volume = {"SPHERE": ball, "CYLINDER": height, "CAPSULE": np.pi * 0.02**2 * 0.01 + ball, "CONE": height / 3}[shape]
    assert form.grid.sizes.prod(axis=1).sum() == pytest.approx(volume, rel=0.08)


@settings(max_examples=8, deadline=None)
@given(
    least=st.floats(1.5, 3.0), damping=st.floats(0.9, 1.5), other=st.floats(0.05, 0.9), share=st.floats(1.01, 1.4),
    first=st.booleans(),
)  # fmt: skip
def test_free_tissue_is_refused_where_its_mass_is_lost_in_its_stiffness(
    tmp_path_factory: pytest.TempPathFactory, least: float, damping: float, other: float, share: float, first: bool
) -> None:
    """Of two layers the one counts that is stiffer for its density, wherever it lies."""

    def free(young: float, density: float) -> Scene:
        hard, soft = (
            f"      - {{thickness: 0.005, youngs modulus: {e!r}, density: {rho!r}, damping time: {damping!r}}}\n"
            for e, rho in ((young, density), (young * other, 2.0 * density / other))
        )
        layers = f"{LINE}    fixed: []\n    layers:\n{hard + soft if first else soft + hard}"
        return load(tmp_path_factory.mktemp("m"), PAD.replace("mass: 0.0", "mass: 1").replace(LINE, layers))

    (sound,) = free(1e5, 1e3).tissues
    cell = float(sound.form.grid.sizes.min())
    young = least * tissue.STIFF_OVER_HEAVY * (cell / tissue.SETTLING) ** 2 / (1.0 + damping / tissue.SETTLING)
    for density, refused in ((least / share, True), (least * share, False)):
        scene = free(young, density)
        reported = any("too little for a Young's modulus" in d.message for d in scene.diagnostics)
        assert reported == refused == (not scene.tissues), scene.diagnostics
