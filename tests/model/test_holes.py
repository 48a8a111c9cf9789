"""Tissue holes: a ghost in a ring of shapes on its parent, around the opening on all sides and clear of it."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.frames import rpy_matrix
from ligature.model.scene import Scene

HALF, THIN = 0.003, 0.0005
TURNED = (0.3, -0.5, 0.8)
SHAPES = {
    "x": f"collision shape: BOX, collision geometry: {{x: {THIN}, y: {2 * HALF}, z: {4 * HALF}}}",
    "y": f"collision shape: BOX, collision geometry: {{x: {4 * HALF}, y: {THIN}, z: {2 * HALF}}}",
    "z": f"collision shape: BOX, collision geometry: {{x: {2 * HALF}, y: {4 * HALF}, z: {THIN}}}",
    "round": f"collision shape: CYLINDER, collision geometry: {{radius: {HALF}, height: {THIN}, axis: Z}}",
    "mesh": "collision mesh: ghost.obj",
}
"""Ghosts with the same opening, thin along each axis; the round one is as wide as it is high."""

FACES = "".join(
    f"f {a} {b} {c} {d}\n"
    for a, b, c, d in ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
)
"""Of the box of the mesh, whose corners come z first."""

ACROSS = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2), "round": (0, 1, 2), "mesh": (0, 1, 2)}


def scene(
    folder: Path, angles: list[float], radius: float = 2 * HALF, shape: str = "z", above: float = 0.0, keys: str = ""
) -> Scene:
    """A body with balls at ``angles`` around a ghost that stands somewhere on it, ``above`` its plane."""
    at, R = np.array([0.01, 0.02, 0.03]), rpy_matrix(*TURNED)
    balls = []
    for angle in angles:
        local = np.zeros(3)
        local[list(ACROSS[shape])] = radius * math.cos(angle), radius * math.sin(angle), above
        x, y, z = at + R @ local
        balls.append(
            f"{{shape: SPHERE, geometry: {{radius: 0.0005}}, offset: {{position: {{x: {x:.9f}, y: {y:.9f}, z: {z:.9f}}}}}}}"
        )
    corners = itertools.product((-HALF, HALF), (-2 * HALF, 2 * HALF), (-THIN / 2, THIN / 2))
    (folder / "ghost.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + FACES)
    (folder / "m.yaml").write_text(
        f"bodies: [B]\nghost objects: [G]\nB: {{name: b, mass: 1, inertial offset: {{}}, compound collision shape: [{', '.join(balls)}]}}\n"
        f"G: {{name: g, parent: B, {keys} {SHAPES[shape]}, location: {{position: {{x: 0.01, y: 0.02, z: 0.03}}, "
        f"orientation: {{r: {TURNED[0]}, p: {TURNED[1]}, y: {TURNED[2]}}}}}}}\n"
    )
    return ligature.load(folder / "m.yaml")


def found(folder: Path, angles: list[float], *how: float | str) -> bool:
    return bool(scene(folder, angles, *how).holes)  # type: ignore[arg-type]


def ring(count: int, turn: float = 2.0 * math.pi) -> list[float]:
    """Angles of ``count`` shapes, which leave a gap of 2 pi - turn + turn / count."""
    return [0.4 + turn * k / count for k in range(count)]


@pytest.mark.parametrize("shape", SHAPES)
def test_a_hole_is_where_its_ghost_is_and_as_wide(tmp_path: Path, shape: str) -> None:
    ringed = scene(tmp_path, ring(4), shape=shape)
    (hole,) = ringed.holes
    assert (hole.index, hole.name, hole.ghost, hole.body) == (0, "G", 0, 0)
    np.testing.assert_allclose(sorted(hole.half), [HALF, HALF if shape == "round" else 2 * HALF], atol=1e-9)
    np.testing.assert_allclose(hole.T_body_hole[:3, 3], [0.01, 0.02, 0.03], atol=1e-9)
    R = hole.T_body_hole[:3, :3]
    np.testing.assert_allclose(R[:, 2], rpy_matrix(*TURNED)[:, ACROSS[shape][2]], atol=1e-6)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1.0)
    (reported,) = [d for d in ringed.diagnostics if d.code == "hole"]
    assert "'G' is a tissue hole" in reported.message
    if shape in "xyz":  # each half size lies along its own axis of the ghost
        size = dict(zip("xyz", np.full(3, THIN), strict=True))
        size |= {"xyz"[ACROSS[shape][0]]: 2 * hole.half[0], "xyz"[ACROSS[shape][1]]: 2 * hole.half[1]}
        assert ", ".join(f"{axis}: {length}" for axis, length in size.items()) in SHAPES[shape]


@pytest.mark.parametrize("share", [0.97, 1.03])
@pytest.mark.parametrize("shape", ["z", "round"])
def test_a_ring_is_closed_and_near_the_opening_and_in_its_plane(tmp_path: Path, share: float, shape: str) -> None:
    widest = HALF if shape == "round" else 2 * HALF
    assert found(tmp_path, ring(4), share * 3.0 * widest, shape) is (share < 1.0)
    assert found(tmp_path, ring(4), share * 0.3 * HALF, shape) is (share > 1.0)
    assert found(tmp_path, ring(4), 2 * HALF, shape, share * widest) is (share < 1.0)
    gap = share * math.pi
    angles = list(np.linspace(0.4, 0.4 + 2.0 * math.pi - gap, 5))
    assert found(tmp_path, angles, 2 * HALF, shape) is (share < 1.0)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_ring_has_at_least_three_shapes(tmp_path: Path, count: int) -> None:
    assert found(tmp_path, ring(count)) is (count >= 3)


@pytest.mark.parametrize(
    ("keys", "count", "hole"),
    [("", 4, True), ("ligature hole: false,", 4, False), ("ligature hole: true,", 1, True), ("", 1, False)],
)
def test_a_ghost_can_state_what_it_is(tmp_path: Path, keys: str, count: int, hole: bool) -> None:
    assert bool(scene(tmp_path, ring(count), keys=keys).holes) is hole


def test_a_ghost_without_a_parent_is_no_hole(tmp_path: Path) -> None:
    text = (scene(tmp_path, ring(4)) and (tmp_path / "m.yaml").read_text()).replace(
        "parent: B, ", "ligature hole: true, "
    )
    (tmp_path / "m.yaml").write_text(text)
    assert ligature.load(tmp_path / "m.yaml").holes == ()
