"""One picture for each feature of materials and lights, and what of it can be stated in numbers."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.render import Frame, LightKind, LightSettings, view_of
from PIL import Image

from tests.render.stage import GOLDEN, LAMP, TABLE, Stage, assert_looks_like, ball, checker, difference, dimples

RED = "Ka 1 1 1\nKd 0.7 0.2 0.15\nKs 0.1 0.1 0.1\nNs 20\n"
FEATURES = {
    "plain": {"props": [ball(RED)]},
    "specular": {"props": [ball("Ka 1 1 1\nKd 0.2 0.25 0.6\nKs 0.9 0.9 0.9\nNs 60\n")]},
    "texture": {"props": [ball(RED + "map_Kd board.png\n")], "table": TABLE + "map_Kd board.png\n"},
    "normal map": {"props": [ball(RED + "map_Bump dimples.png\n")]},
    "emission": {"props": [ball(RED + "Ke 0.1 0.6 0.2\n")]},
    "transparency": {
        "props": [
            ball(RED + "d 0.5\n", (-0.07, 0.0, 0.1)),
            ball("Ka 1 1 1\nKd 0.1 0.3 0.9\nKs 0.8 0.8 0.8\nNs 80\nd 0.4\n", (0.05, -0.12, 0.1)),
            ball("Ka 1 1 1\nKd 0.9 0.8 0.1\n", (0.06, 0.16, 0.1)),
        ]
    },
    "adf colours": {
        "props": [
            ball(
                RED + "map_Kd board.png\n",
                keys=", color components: {diffuse: {r: 0.2, g: 0.8, b: 0.3}, specular: {r: 0.5, g: 0.5, b: 0}, "
                "ambient: {level: 0.3}, emission: {r: 0, g: 0, b: 0.2}, shininess: 30, transparency: 1.0}",
            )
        ]
    },
    "metal": {
        "props": [
            ball("Kd 0.75 0.75 0.77\nPm 1\nPr 0.15\n", (-0.16, 0, 0.1)),
            ball("Kd 0.95 0.65 0.25\nPm 1\nPr 0.45\n", (0.16, 0, 0.1)),
        ]
    },
    "metal of old files": {"props": [ball("Ka 1 1 1\nKd 0.8 0.8 0.8\nKs 0.5 0.5 0.5\nNs 360\n")]},
    "plastic": {"props": [ball("Kd 0.1 0.45 0.5\nPm 0\nPr 0.3\n")]},
    "wet tissue": {"props": [ball("Kd 0.75 0.3 0.28\nPr 0.7\nPc 1\nPcr 0.12\nmap_Bump dimples.png\n")]},
    "roughness and metal maps": {
        "props": [ball("Kd 0.8 0.6 0.5\nPm 1\nPr 0.8\nmap_Pm board.png\nmap_Pr board.png\n")],
    },
    "shadow of a spot": {"props": [ball(RED)], "lamp": LAMP + ", shadow quality: 3"},
    "attenuation and cone": {
        "props": [ball(RED)],
        "lamp": LAMP.replace("cutoff angle: 0.7", "cutoff angle: 0.3").replace("linear: 0", "linear: 1"),
    },
}


def stage(folder: Path, feature: str) -> Stage:
    return Stage(folder, pictures={"board.png": checker(), "dimples.png": dimples()}, **FEATURES[feature])


@pytest.mark.parametrize("feature", FEATURES)
def test_a_feature_looks_as_it_did(tmp_path: Path, feature: str) -> None:
    assert_looks_like(stage(tmp_path, feature).draw().rgb, GOLDEN / f"{feature.replace(' ', '_')}.png")


def test_no_two_features_pass_for_each_other() -> None:
    pictures = {f: np.asarray(Image.open(GOLDEN / f"{f.replace(' ', '_')}.png").convert("RGB")) for f in FEATURES}
    for (one, a), (other, b) in combinations(pictures.items(), 2):
        mean, worst = difference(a, b)
        assert mean >= 1.0 or worst >= 12.0, f"{one} would pass for {other}"


def test_a_directional_light_throws_its_shadow_along_its_direction(tmp_path: Path) -> None:
    scene = stage(tmp_path, "shadow of a spot")
    renderer, simulation = scene.renderer()
    renderer.lights.settings[0] = LightSettings(LightKind.DIRECTIONAL, shadow_quality=4)
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    frame = renderer.render(simulation.state, view)
    assert_looks_like(frame.rgb, GOLDEN / "shadow_of_a_directional_light.png")
    way = np.array([-0.35, 0.3, -0.65]) / 0.65
    centre = np.array([0.0, 0.0, 0.1]) + 0.1 * way  # of the ball's shadow on the table
    lit = np.array([0.15, -0.1, 0.0])
    assert brightness(frame, view, lit) > 2 * brightness(frame, view, centre + [-0.03, 0.03, 0])


def test_a_point_light_shines_around_itself(tmp_path: Path) -> None:
    renderer, simulation = stage(tmp_path, "attenuation and cone").renderer()
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    spot = renderer.render(simulation.state, view)
    renderer.lights.settings[0] = replace(renderer.lights.settings[0], kind=LightKind.POINT)
    point = renderer.render(simulation.state, view)
    beside = np.array([0.28, 0.12, 0.0])
    assert brightness(point, view, beside) > 1.5 * brightness(spot, view, beside)


def test_light_falls_off_as_the_specification_states(tmp_path: Path) -> None:
    lamp = (
        "name: L, location: {x: 0, y: 0, z: 0.5}, direction: {x: 0, y: 0, z: -1}, cutoff angle: 1.2, spot exponent: 2, "
        "attenuation: {constant: 0.5, linear: 1.0, quadratic: 2.0}"
    )
    scene = Stage(tmp_path, [], lamp, "Ka 0 0 0\nKd 0.8 0.8 0.8\nKs 0 0 0\nNs 1\n")
    renderer, simulation = scene.renderer()
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    frame = renderer.render(simulation.state, view)
    for x in (0.0, 0.1, 0.2):
        d = np.hypot(0.5, x)
        cosine = 0.5 / d
        expected = 0.8 * cosine * cosine**2 / (0.5 + d + 2 * d * d)
        assert brightness(frame, view, np.array([x, 0, 0])) == pytest.approx(255 * expected, abs=2)


def test_a_transparent_body_mixes_with_what_is_behind_and_is_seen_in_depth_and_ids(tmp_path: Path) -> None:
    frame = stage(tmp_path, "transparency").draw()
    solid = stage(tmp_path, "transparency")
    solid.props = [replace(p, material=p.material.replace("d 0.5\n", "").replace("d 0.4\n", "")) for p in solid.props]
    opaque = solid.draw()
    assert (frame.ids == opaque.ids).all() and (frame.depth == opaque.depth).all()
    assert difference(frame.rgb, opaque.rgb)[0] > 5


def test_edges_are_smooth_and_ids_are_not(tmp_path: Path) -> None:
    scene = stage(tmp_path, "plain")
    smooth, hard = scene.draw(4), scene.draw(0)
    assert (smooth.ids == hard.ids).all() and (smooth.depth == hard.depth).all()
    assert (smooth.normals == hard.normals).all()
    edge = (smooth.ids[:, 1:] != smooth.ids[:, :-1]).any(axis=0)
    assert edge.any()
    between = np.abs(smooth.rgb.astype(int) - hard.rgb).max(axis=2) > 16
    assert 50 < between.sum() < 0.05 * between.size


def test_the_low_resolution_mesh_is_drawn_where_the_object_is_small(tmp_path: Path) -> None:
    from ligature.model.shapes import Sphere
    from ligature.render import geometry

    from tests.render.stage import write_obj

    scene = Stage(tmp_path, [ball(RED, (0.35, 1.2, -0.4), radius=0.05), ball(RED)], table=None)
    renderer, simulation = scene.renderer()
    full = renderer.triangles
    (tmp_path / "low").mkdir()
    fine, geometry.SEGMENTS = geometry.SEGMENTS, 8
    try:
        for index, radius in enumerate((0.05, 0.1)):
            write_obj(tmp_path / "low" / f"b{index}.obj", geometry.of_shape(Sphere(radius)), RED)
    finally:
        geometry.SEGMENTS = fine
    renderer, simulation = scene.renderer()
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    frame = renderer.render(simulation.state, view)
    assert renderer.drawn_triangles < 0.7 * full
    assert set(np.unique(frame.ids)) == {0, 1, 2}


def test_what_is_outside_the_picture_is_not_drawn(tmp_path: Path) -> None:
    scene = Stage(tmp_path, [ball(RED), ball(RED, (0, -3.0, 0.1)), ball(RED, (4.0, 0, 0.1))], table=None)
    renderer, simulation = scene.renderer(0)
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    renderer.render(simulation.state, view)
    assert renderer.drawn_triangles * 3 == renderer.triangles


def test_a_scene_without_lights_is_lit_from_the_eye(tmp_path: Path) -> None:
    scene = stage(tmp_path, "plain")
    path = scene.write()
    text = path.read_text()
    lit = scene.draw().rgb
    path.write_text(text.replace("lights: [L]", "lights: []"))
    from ligature.render import Renderer

    simulation = Simulation(ligature.load(path))
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    unlit = Renderer(simulation.scene).render(simulation.state, view).rgb
    assert unlit.max() > 100 and difference(lit, unlit)[0] > 2


def test_a_sky_box_fills_what_is_empty_with_the_right_face(tmp_path: Path) -> None:
    colours = {"right": (200, 0, 0), "left": (0, 200, 0), "bottom": (0, 0, 200), "top": (200, 200, 0),
               "front": (0, 200, 200), "back": (200, 0, 200)}  # fmt: skip
    for name, colour in colours.items():
        Image.new("RGB", (8, 8), colour).save(tmp_path / f"{name}.png")
    faces = ", ".join(f"{name}: {name}.png" for name in colours)
    looks = {"A": ("1, y: 0, z: 0", "right"), "B": ("0, y: -1, z: 0", "top"), "D": ("0, y: 0.01, z: 1", "front")}
    cameras = "".join(
        f"{name}: {{name: {name}, location: {{x: 0, y: 0, z: 0}}, look at: {{x: {at}}}, up: {{x: 0, y: 0.1, z: 1}}, "
        "field view angle: 0.5, publish image resolution: {width: 40, height: 30}}\n"
        for name, (at, _) in looks.items()
    )
    (tmp_path / "world.yaml").write_text(f"cameras: [{', '.join(looks)}]\nskybox: {{path: ./, {faces}}}\n" + cameras)
    (tmp_path / "model.yaml").write_text(
        "bodies: [A]\nA: {name: A, mass: 0, shape: SPHERE, geometry: {radius: 0.01}, location: {position: {x: -3, y: 3, z: -3}}}\n"
    )
    (tmp_path / "colors.yaml").write_text("white: {r: 255, g: 255, b: 255, a: 255}\n")
    (tmp_path / "devices.yaml").write_text("input devices: []\n")
    (tmp_path / "launch.yaml").write_text(
        "world config: world.yaml\ncolor config: colors.yaml\ninput devices config: devices.yaml\n"
        "multibody configs: [model.yaml]\n"
    )
    simulation = Simulation(ligature.load(tmp_path / "launch.yaml"))
    for name, (_, face) in looks.items():
        frame = simulation.cameras[name].capture()
        assert tuple(frame.rgb[15, 20]) == colours[face]
        assert (frame.ids == 0).all()


def test_optical_flow_is_how_far_pixels_move(tmp_path: Path) -> None:
    scene = Stage(tmp_path, [ball(RED)], table=None)
    renderer, simulation = scene.renderer()
    camera = simulation.scene.cameras[0]
    view = view_of(camera, simulation.state["camera_world"][0, 0])
    passes = ("depth", "ids", "flow")
    assert np.abs(renderer.render(simulation.state, view, passes).flow).max() < 1e-3
    simulation.bodies["B0"].set_pose([0.01, 0.0, 0.1, 0, 0, 0, 1])
    simulation.step(1)
    frame = renderer.render(simulation.state, view, passes)
    seen = frame.ids == 1
    expected = view.intrinsics[0, 0] * 0.01 / frame.depth[seen]
    assert np.abs(frame.flow[seen][:, 0] - expected).max() < 0.02
    assert np.abs(frame.flow[seen][:, 1]).max() < 0.02


def test_parts_report_materials_of_one_body_apart(tmp_path: Path) -> None:
    renderer, simulation = Stage(tmp_path, [ball(RED), ball(RED, (0.2, 0, 0.1))]).renderer()
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    frame = renderer.render(simulation.state, view, ("ids", "parts"))
    pairs = set(zip(frame.ids.ravel().tolist(), frame.parts.ravel().tolist(), strict=True))
    assert len(pairs) == 4 and (0, 0) in pairs and len({part for _, part in pairs}) == 4


def brightness(frame: Frame, view, point: np.ndarray) -> float:
    """Mean of the colour around a point of the world."""
    eye = view.view @ [*point, 1.0]
    clip = view.projection @ eye
    column = int((clip[0] / clip[3] * 0.5 + 0.5) * view.width)
    row = int((0.5 - clip[1] / clip[3] * 0.5) * view.height)
    return float(frame.rgb[row - 1 : row + 2, column - 1 : column + 2].mean())
