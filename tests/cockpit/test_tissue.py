"""Tissue on the page: sent when it moved, not more often than that, with a disc for each puncture."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import ligature
import numpy as np
import pytest
import trimesh
from ligature.cockpit.looks import LIT, body_looks
from ligature.cockpit.tissue import CORNERS, LIFT, TURNS, TissueStage, discs, fan
from ligature.cockpit.tone import displayed, linear, mapped
from ligature.model.state import MAX_PUNCTURES, new_state

PAD = (
    "bodies: [Pad, Floor]\nnamespace: /ambf/env/\n"
    "Floor: {name: Floor, mass: 0, shape: BOX, geometry: {x: 0.4, y: 0.4, z: 0.02}, "
    "location: {position: {x: 0, y: 0, z: -0.06}}}\n"
    "Pad: {name: Pad, mass: 0, shape: BOX, geometry: {x: 0.06, y: 0.04, z: 0.012}, "
    "color components: {ambient: {level: 0.5}, diffuse: {r: 0.5, g: 0.25, b: 1.0}, "
    "specular: {r: 0.1, g: 0.1, b: 0.1}, transparency: 1.0}, "
    "ligature tissue: {material: silicone pad, cell size: 0.005, fixed: [-z]}}\n"
)


class Page:
    """Takes what would be sent to browsers."""

    def __init__(self) -> None:
        self.meshes: dict[str, Any] = {}
        self.scene = self

    def add_mesh_simple(self, name: str, vertices: Any, faces: Any, **looks: Any) -> Any:
        self.meshes[name] = SimpleNamespace(vertices=vertices, faces=faces, **looks)
        return self.meshes[name]


@pytest.fixture
def stage(tmp_path: Path) -> tuple[Page, TissueStage, Any, np.ndarray]:
    (tmp_path / "m.yaml").write_text(PAD)
    scene = ligature.load(tmp_path / "m.yaml")
    page = Page()
    return page, TissueStage(page, scene), scene, new_state(scene)  # type: ignore[arg-type]


def test_a_pad_is_sent_as_a_closed_mesh_of_its_colour_and_not_as_a_rigid_one(stage: Any) -> None:
    page, _, scene, _ = stage
    mesh = page.meshes["/tissue/0"]
    light = mapped(linear(np.array(mesh.color) / 255.0) * LIT)  # as a browser shows it where it is lit
    red, green, blue = 255.0 * displayed(light)
    assert (red, green) == pytest.approx((128, 64), abs=8) and blue > 220, "a browser's whites are no brighter"
    solid = trimesh.Trimesh(np.round(mesh.vertices.astype(float), 6), mesh.faces)
    assert solid.volume == pytest.approx(0.06 * 0.04 * 0.012, rel=1e-4)
    assert set(body_looks(scene)) == {1}


def test_it_is_sent_anew_when_it_moved_and_at_most_every_other_time(stage: Any) -> None:
    page, tissue, scene, state = stage
    sent = [tissue.update(state) for _ in range(2 * TURNS)]
    assert sent == [0, 2, 0, 0]
    still = page.meshes["/tissue/0"].vertices
    state["tissue_node"] += 5e-6
    assert [tissue.update(state) for _ in range(TURNS)] == [0, 0]
    state["tissue_node"][0, -1, 2] += 0.003
    assert [tissue.update(state) for _ in range(TURNS)] == [0, 2]
    moved = page.meshes["/tissue/0"].vertices
    assert np.abs(moved - still).max() == pytest.approx(0.003, abs=1e-5)
    corner = scene.tissues[0].form.grid.nodes[-1]
    far = np.linalg.norm(still - corner, axis=1) > 0.01
    assert np.abs(moved - still)[far].max() < 1e-5


def test_punctures_are_discs_on_the_surface(stage: Any) -> None:
    page, tissue, _, state = stage
    rng = np.random.default_rng(2)
    normals = rng.standard_normal((3, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = 0.01 * rng.standard_normal((3, 3))
    state["puncture_count"][0, 0] = 3
    state["puncture_point"][0, 0, :3], state["puncture_normal"][0, 0, :3] = points, normals
    for _ in range(TURNS):
        tissue.update(state)
    shown = page.meshes["/punctures/0"]
    fans = shown.vertices.reshape(MAX_PUNCTURES, CORNERS + 1, 3)
    radius = tissue._marks[0].radius
    away = fans[:3] - points[:, None]
    np.testing.assert_allclose(np.einsum("ika,ia->ik", away, normals), LIFT, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(fans[:3, 1:] - fans[:3, :1], axis=2), radius, rtol=1e-4)
    assert np.ptp(fans[3:].reshape(-1, 3), axis=0).max() == 0.0
    area = trimesh.Trimesh(fans[:3].reshape(-1, 3), fan(3), process=False).area
    assert area == pytest.approx(3 * 0.5 * CORNERS * np.sin(2 * np.pi / CORNERS) * radius**2, rel=1e-3)
    assert discs(np.zeros((0, 8)), np.ones(3)).shape == (MAX_PUNCTURES * (CORNERS + 1), 3)
