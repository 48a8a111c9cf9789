"""What stands still is drawn once, and pictures stay as they were to the last bit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.render import Frame, LightKind, Renderer, view_of
from ligature.render.context import create_context, draws_on_processor
from ligature.render.look import Look
from ligature.render.stirred import CELL, Readers, box_of, cells_of, far_at, stir, stirred_cells

from tests.opengl import opengl
from tests.render.stage import LAMP, TABLE, Stage, ball, checker, dimples

RED = "Ka 1 1 1\nKd 0.7 0.2 0.15\nKs 0.1 0.1 0.1\nNs 20\n"
WET = "Kd 0.75 0.3 0.28\nPr 0.7\nPc 1\nPcr 0.12\nmap_Bump dimples.png\n"
SECOND = LAMP.replace("x: 0.35", "x: -0.4").replace("x: -0.35", "x: 0.4") + ", shadow quality: 2"
SHADOWS = {
    "no shadows": {},
    "shadows of a spot": {"lamp": LAMP + ", shadow quality: 3"},
    "shadows of two": {
        "lamp": LAMP + ", shadow quality: 3",
        "more": f"M: {{{SECOND.replace('name: L', 'name: M')}}}\n",
    },
}
SUTURING = Path(__file__).parents[2] / "scenes" / "suturing" / "launch.yaml"
SIZE = 128
"""Texels of the shadow map."""


@pytest.fixture(params=SHADOWS)
def made(request: pytest.FixtureRequest, tmp_path):
    with opengl():
        if not draws_on_processor(create_context()):
            pytest.skip("GPUs keep nothing")
    props = [
        ball(RED, (-0.12, 0.05, 0.1)),
        ball(WET, (0.14, 0.1, 0.06), radius=0.06),
        ball(RED, (0, -0.1, 0.05), radius=0.04),
    ]
    table = TABLE + "map_Kd board.png\n"
    pictures = {"dimples.png": dimples(), "board.png": checker()}
    stage = Stage(tmp_path, props, table=table, pictures=pictures, **SHADOWS[request.param])
    path = stage.write()
    if "more" in SHADOWS[request.param]:
        path.write_text(path.read_text().replace("lights: [L]", "lights: [L, M]"))
    stage.write = lambda: path
    (kept, simulation), (plain, _) = stage.renderer(), stage.renderer()
    yield kept, plain, simulation
    simulation.close()


def differences(a: Frame, b: Frame) -> list[str]:
    """The passes in which two pictures differ."""
    names = ("rgb", "depth", "ids", "parts", "normals", "flow")
    return [name for name in names if not np.array_equal(getattr(a, name), getattr(b, name))]


def compared(kept, plain, state, view, passes=("rgb", "depth", "ids", "parts", "normals")) -> None:
    """Both renderers draw the same, of which ``plain`` begins anew each time."""
    plain.change_look(Look())
    assert differences(kept.render(state, view, passes), plain.render(state, view, passes)) == []
    assert plain.kept_pictures == 0


def test_pictures_with_moving_things_are_as_if_nothing_were_kept(made) -> None:
    kept, plain, simulation = made
    state, view = simulation.state.copy(), view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    aside = replace(view, view=view.view + np.array([[0, 0, 0, 0.03]] + 3 * [[0, 0, 0, 0]]))
    random = np.random.default_rng(1)
    for moment in range(12):
        state["body_pose"][0, 2, :3] = random.uniform((-0.25, -0.25, 0.02), (0.25, 0.25, 0.2))
        compared(kept, plain, state, view)
        compared(kept, plain, state, aside, ("rgb",))
        assert kept.kept_pictures == (0 if moment < 2 else 2 if moment < 7 else 4)
        if moment == 5:
            state["body_pose"][0, 1, 2] += 0.05  # what stood still no longer does
    state["light_world"][0, 0, 0] += 0.01
    for _ in range(3):
        compared(kept, plain, state, view)
    assert kept.kept_pictures == 5


def test_lights_and_looks_that_change_are_seen(made) -> None:
    kept, plain, simulation = made
    state, view = simulation.state, view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    stated = kept.lights.settings[0]
    for change in ({}, {"exponent": 2.0}, {"kind": LightKind.DIRECTIONAL}, {"shadow_quality": 0}):
        for _ in range(3):
            plain.change_look(Look())  # which takes back what was set of lights
            kept.lights.settings[0] = plain.lights.settings[0] = replace(stated, **change)
            assert differences(kept.render(state, view), plain.render(state, view)) == []
    kept.change_look(Look(brightness=(0.5,)))
    plain.change_look(Look(brightness=(0.5,)))
    assert differences(kept.render(state, view), plain.render(state, view)) == []


def test_pictures_with_optical_flow_keep_nothing(made) -> None:
    kept, _, simulation = made
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    for _ in range(3):
        assert np.abs(kept.render(simulation.state, view, ("rgb", "flow")).flow).max() < 1e-3
    assert kept.kept_pictures == 0


@pytest.mark.parametrize("seed", range(8))
def test_all_that_reads_what_a_triangle_covers_is_stirred(seed: int) -> None:
    """Points of triangles, also of those that begin behind the light, and texels about them."""
    random = np.random.default_rng(seed)
    size = 10.0 ** random.uniform(-2.0, 0.5)
    corners = random.uniform(-1.2, 1.2, (1, 2)) + random.uniform(-size, size, (3, 2))
    w = random.uniform(-0.5, 1.0, 3) if seed % 2 else random.uniform(0.1, 1.0, 3)
    clip = np.column_stack([corners * np.abs(w)[:, None], w])
    cells = stirred_cells(SIZE)
    stir(cells, np.eye(3, 4), clip, np.array([[0, 1, 2]], dtype=np.int32))
    points = random.dirichlet(np.ones(3), 4000) @ clip
    points = points[points[:, 2] > 1e-3]
    texels = (0.5 * points[:, :2] / points[:, 2:] + 0.5) * SIZE
    near = texels + random.uniform(-1.75, 1.75, texels.shape)
    near = near[((near >= 0) & (near < SIZE)).all(axis=1)]
    column, row = (near // CELL).astype(int).T
    assert (cells[row, column] == 255).all()


def test_what_is_far_from_a_triangle_is_not_stirred() -> None:
    cells = stirred_cells(SIZE)
    long = np.array([[-0.9, -0.9, 1.0], [0.9, 0.9, 1.0], [0.9, 0.88, 1.0]])
    stir(cells, np.eye(3, 4), long, np.array([[0, 1, 2]], dtype=np.int32))
    assert cells[0, -1] == cells[-1, 0] == 0 and 0.02 < (cells > 0).mean() < 0.25


def test_pixels_that_read_a_cell_are_chosen() -> None:
    places = np.array(
        [[[0.0, 0.0], [0.999, 0.0], [1.2, 0.5]], [[1.0, 1.0], [-1.0, -1.0], [np.nan, 0.5]]], dtype=np.float32
    )
    numbers = cells_of(places, 4 * CELL)
    assert numbers.tolist() == [[0, 3, -1], [15, -1, -1]]
    readers, cells = Readers(numbers, 4 * CELL), np.zeros((4, 4), dtype=np.uint8)
    facets = np.arange(6, dtype=np.int32).reshape(2, 3)
    depths, drawn = np.full((2, 3), 0.25, dtype=np.float32), np.zeros(6, dtype=bool)
    assert not len(readers.of(cells)) and box_of(readers.of(cells), facets, drawn)[2:] == (0, 0) and not drawn.any()
    cells[[0, 3], 3] = 255
    pixels = readers.of(cells)
    box = box_of(pixels, facets, drawn)
    assert pixels.tolist() == drawn.nonzero()[0].tolist() == [1, 3] and box == (0, 0, 2, 2)
    assert far_at(pixels, depths, box).tolist() == [[0.25, 1.0], [1.0, 0.25]]


@pytest.mark.parametrize("seed", range(4))
def test_a_scene_of_arms_moving_anyhow_is_as_if_nothing_were_kept(seed: int) -> None:
    """Two arms share their links' meshes, of which one may stand still and its twin move; a phantom of many faces."""
    with opengl():
        if not draws_on_processor(create_context()):
            pytest.skip("GPUs keep nothing")
        scene = ligature.load(SUTURING)
        kept, plain = Renderer(scene), Renderer(scene)
    simulation, random = ligature.Simulation(scene), np.random.default_rng(seed)
    state, movable = simulation.state.copy(), [k for k, body in enumerate(scene.bodies) if not body.static]
    views = [view_of(camera, state["camera_world"][0, camera.index], (200, 150)) for camera in scene.cameras[:2]]
    wound = state["body_pose"][0, scene.needles[0].body, :3]
    state["body_pose"][0, movable, :3] = wound + random.uniform(-0.05, 0.05, (len(movable), 3))
    moving = random.choice(movable, size=len(movable) // 2, replace=False)
    for _ in range(8):
        state["body_pose"][0, moving, :3] += random.normal(0.0, 0.005, (len(moving), 3))
        for view in views:
            compared(kept, plain, state, view, ("rgb", "depth", "ids"))
    assert kept.kept_pictures > 0
    simulation.close()
