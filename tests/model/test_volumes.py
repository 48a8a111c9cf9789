"""Volumes of AMBF: stacks of pictures that are drawn and collide as their iso-surface."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.model.shapes import TriMesh
from ligature.model.slices import slice_files
from PIL import Image

N, SIZE, RADIUS = 40, 0.2, 0.08

SCENE = """\
namespace: /ambf/env/
gravity: {x: 0, y: 0, z: -9.8}
volumes: [VOLUME Bone]
bodies: [BODY Carrier, BODY Ball]
cameras: [eye]
VOLUME Bone:
  name: Bone
  images: {path: ./slices, prefix: plane0, format: png, count: 99}
  dimensions: {x: 0.2, y: 0.2, z: 0.2}
  color rgba: {r: 0.9, g: 0.8, b: 0.6, a: 1}
  location: {position: {x: 0.5, y: 0, z: 0.1}}
BODY Carrier: {name: Carrier, mass: 0, location: {position: {x: 0, y: 0, z: 0}}}
BODY Ball: {name: Ball, mass: 0.1, collision shape: SPHERE, collision geometry: {radius: 0.02}, collision margin: 0.0005,
  shape: SPHERE, geometry: {radius: 0.02}, location: {position: {x: 0.5, y: 0, z: 0.22}}}
eye: {name: eye, location: {x: 0.5, y: -1, z: 0.1}, look at: {x: 0.5, y: 0, z: 0.1}, up: {x: 0, y: 0, z: 1}, field view angle: 0.4}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A ball of voxels with a notch at +x, as slices of AMBF's ear: unpadded numbers, fewer than 'count'."""
    slices = tmp_path / "slices"
    slices.mkdir()
    axis = (np.arange(N) + 0.5) / N * SIZE - SIZE / 2
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    field = np.clip(0.5 + (RADIUS - np.sqrt(x * x + y * y + z * z)) / 0.01, 0, 1)
    field[(x > 0.05) & (np.abs(y) < 0.02)] = 0.0
    for k in range(N):
        grey = np.round(255 * field[:, :, k]).astype(np.uint8).T[::-1]
        Image.fromarray(grey).save(slices / f"plane0{k}.png")
    (tmp_path / "m.yaml").write_text(SCENE)
    return tmp_path


def test_a_volume_becomes_a_static_body_in_the_shape_of_its_surface(folder: Path) -> None:
    scene = ligature.load(folder / "m.yaml")
    assert not [d for d in scene.diagnostics if d.severity.name in ("ERROR", "WARNING")]
    body = next(b for b in scene.bodies if b.identity.name == "Bone")
    assert body.static and body.identity.passive
    shape = body.colliders[0].shape
    assert isinstance(shape, TriMesh)
    away = np.linalg.norm(shape.vertices, axis=1)
    notch = (shape.vertices[:, 0] > 0.045) & (np.abs(shape.vertices[:, 1]) < 0.025)
    assert away[~notch] == pytest.approx(RADIUS, abs=0.002)
    assert shape.vertices[notch, 0].min() == pytest.approx(0.05, abs=SIZE / N)
    assert notch.any() and not (shape.vertices[:, 0] < -RADIUS - 0.002).any()


def test_what_falls_on_a_volume_rests_on_its_surface(folder: Path) -> None:
    sim = Simulation(ligature.load(folder / "m.yaml"))
    ball = sim.bodies["Ball"]
    sim.step(300)
    assert ball.pose[2] == pytest.approx(0.1 + RADIUS + 0.02, abs=0.004)
    assert sim._world.queries.contacts(ball.body.index, 0.001)[0].body == sim.bodies["Bone"].body.index


def test_a_volume_is_drawn_with_depth_and_number(folder: Path) -> None:
    pytest.importorskip("moderngl")
    sim = Simulation(ligature.load(folder / "m.yaml"))
    frame = sim.cameras["eye"].capture((64, 64))
    number = {name: n for n, name in sim.scene.drawn_names.items()}[sim.bodies["Bone"].body.identity.identifier]
    assert frame.ids[32, 32] == number
    assert frame.depth[32, 32] == pytest.approx(1.0 - RADIUS, abs=0.003)
    share = float((frame.ids == number).mean())
    wide = 2 * 1.0 * np.tan(0.2)
    assert share == pytest.approx(np.pi * RADIUS**2 / wide**2, rel=0.12)
    sim.close()


def test_a_volume_on_a_moving_body_goes_along(folder: Path) -> None:
    text = SCENE.replace(
        "BODY Carrier: {name: Carrier, mass: 0",
        "BODY Carrier: {name: Carrier, mass: 1.0, inertia: {ix: 1, iy: 1, iz: 1}",
    )
    (folder / "m.yaml").write_text(text.replace("  name: Bone\n", "  name: Bone\n  parent: BODY Carrier\n"))
    sim = Simulation(ligature.load(folder / "m.yaml"))
    carrier, bone = sim.bodies["Carrier"], sim.bodies["Bone"]
    assert bone.pose[:3] == pytest.approx([0.5, 0, 0.1], abs=1e-6)
    for k in range(200):
        carrier.command_pose([0, 0.001 * k, 0, 0, 0, 0, 1])
        sim.step(2)
    assert bone.pose[:3] - carrier.pose[:3] == pytest.approx([0.5, 0, 0.1], abs=1e-3)
    assert carrier.pose[1] > 0.15


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("path: ./slices", "path: ./nowhere"), "has no file plane00.png"),
        (("path: ./slices", "path: ../../.."), "lies outside|has no file"),
        (("color rgba", "iso-surface value: 0\n  color rgba"), "'iso-surface value' is 0"),
        (("count: 99", "count: 99999999"), "the maximum is 4096 slices"),
        (("x: 0.2, y: 0.2, z: 0.2", "x: 0.2, y: -0.2, z: 0.2"), "must be above 0"),
    ],
)
def test_what_is_wrong_with_a_volume_is_named_and_the_rest_runs(
    folder: Path, change: tuple[str, str], reason: str
) -> None:
    import re

    (folder / "m.yaml").write_text(SCENE.replace(*change))
    scene = ligature.load(folder / "m.yaml")
    assert not any(b.identity.name == "Bone" for b in scene.bodies)
    found = [d for d in scene.diagnostics if re.search(reason, str(d))]
    assert found and found[0].mark is not None
    assert any(b.identity.name == "Ball" for b in scene.bodies)


def test_slices_of_different_sizes_and_damaged_ones_are_named(folder: Path) -> None:
    Image.new("L", (7, 7)).save(folder / "slices" / "plane03.png")
    assert "'plane03.png' has 7 × 7 pixels" in "\n".join(map(str, ligature.load(folder / "m.yaml").diagnostics))
    (folder / "slices" / "plane03.png").write_bytes(b"no picture")
    assert "'plane03.png'" in "\n".join(map(str, ligature.load(folder / "m.yaml").diagnostics))


def test_numbers_of_slices_may_have_zeros_before_them(tmp_path: Path) -> None:
    from ligature.adf import Resolver

    names = ["s0.png", "s01.png", "s002.png", "s10.png", "s100.png", "s7.jpg"]
    for name in names:
        (tmp_path / name).touch()
    found = slice_files(tmp_path, "s", "png", 100, Resolver([tmp_path]))
    assert [path.name for path in found] == ["s0.png", "s01.png", "s002.png", "s10.png", "s100.png"]
