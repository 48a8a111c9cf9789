"""The environment cube, ambient occlusion and matcaps, as shaders of scene files and the built-in one see them."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.render import Renderer, view_of
from PIL import Image

from tests.opengl import opengl
from tests.render.test_shaders import well_inside

FACES = {"right": (200, 0, 0), "left": (0, 200, 0), "bottom": (0, 0, 200), "top": (200, 200, 0),
         "front": (0, 200, 200), "back": (200, 0, 200)}  # fmt: skip
ORDER = ("right", "left", "bottom", "top", "front", "back")
"""Which picture is +X, -X, +Y, -Y, +Z, -Z."""

MIRROR = """\
#version 120
varying vec3 vWay;
uniform mat4 viewMat;
void main() {
    vec3 eye = vec3(gl_ModelViewMatrix * gl_Vertex), n = normalize(gl_NormalMatrix * gl_Normal);
    vWay = transpose(mat3(viewMat)) * %s;
    gl_Position = ftransform();
}
"""
SHOWS_SKY = "#version 120\nuniform samplerCube skybox;\nvarying vec3 vWay;\nvoid main() { gl_FragColor = vec4(textureCube(skybox, vWay).rgb, 1.0); }\n"
QUAD = """\
mtllib quad.mtl
usemtl own
v -1 0 -1
v 1 0 -1
v 1 0 1
v -1 0 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 -1 0
f 1/1/1 2/2/1 3/3/1 4/4/1
"""
CAMERA = (
    "C: {name: C, location: {x: 0, y: -3, z: 0}, look at: {x: 0, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}, "
    "field view angle: 0.8, clipping plane: {near: 0.05, far: 10}, publish image resolution: {width: 80, height: 60}}\n"
)


def drawn(folder: Path, body: str, shaders: tuple[str, str] | None = None, sky: bool = False) -> tuple:
    """A picture of one body, with the renderer that drew it and the camera's view."""
    text = f"bodies: [Thing]\nnamespace: /ambf/env/\nThing: {{name: Thing, mass: 0, {body}}}\n"
    if shaders is not None:
        for ending, source in zip(("vert", "frag"), shaders, strict=True):
            (folder / f"own.{ending}").write_text(source)
        text += "shaders: {path: ./, vertex: own.vert, fragment: own.frag}\n"
    (folder / "model.yaml").write_text(text)
    for name, colour in FACES.items():
        Image.new("RGB", (8, 8), colour).save(folder / f"{name}.png")
    faces = ", ".join(f"{name}: {name}.png" for name in FACES)
    (folder / "world.yaml").write_text("cameras: [C]\n" + (f"skybox: {{path: ./, {faces}}}\n" if sky else "") + CAMERA)
    (folder / "colors.yaml").write_text("white: {r: 255, g: 255, b: 255, a: 255}\n")
    (folder / "devices.yaml").write_text("input devices: []\n")
    (folder / "launch.yaml").write_text(
        "world config: world.yaml\ncolor config: colors.yaml\ninput devices config: devices.yaml\nmultibody configs: [model.yaml]\n"
    )
    simulation = Simulation(ligature.load(folder / "launch.yaml"))
    with opengl():
        renderer = Renderer(simulation.scene, samples=0)
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
    frame = renderer.render(simulation.state, view)
    assert renderer.problems == []
    return frame, renderer, view


def looked_up(ways: np.ndarray) -> np.ndarray:
    """Colours of directions (n, 3): the face of the largest coordinate (OpenGL 3.3, table 3.19)."""
    axis = np.abs(ways).argmax(axis=1)
    face = 2 * axis + (ways[np.arange(len(ways)), axis] < 0)
    return np.array([FACES[name] for name in ORDER])[face]


@pytest.mark.parametrize("way", ["n", "reflect(normalize(eye), n)"])
def test_a_shader_of_a_scene_file_sees_the_sky_box_around_it(tmp_path: Path, way: str) -> None:
    sphere = "shape: SPHERE, geometry: {radius: 1.0}"
    frame, _, view = drawn(tmp_path, sphere, (MIRROR % way, SHOWS_SKY), sky=True)
    rows, columns = np.nonzero(well_inside(frame, 1))
    p = view.projection
    depth = frame.depth[rows, columns]
    x = ((columns + 0.5) / view.width * 2 - 1) / p[0, 0] * depth
    y = (1 - (rows + 0.5) / view.height * 2) / p[1, 1] * depth
    eye = np.column_stack([x, y, -depth])
    world = (eye - view.view[:3, 3]) @ view.view[:3, :3]
    normals = world / np.linalg.norm(world, axis=1, keepdims=True)  # of a sphere about the origin
    if way != "n":
        towards = (world - [0, -3, 0]) / np.linalg.norm(world - [0, -3, 0], axis=1, keepdims=True)
        normals = towards - 2 * np.einsum("ij,ij->i", towards, normals)[:, None] * normals
    agree = np.abs(frame.rgb[rows, columns].astype(int) - looked_up(normals)).max(axis=1) <= 2
    second, first = np.sort(np.abs(normals), axis=1)[:, 1:].T
    sure = second < 0.85 * first  # facets differ from the sphere along the edges of the cube
    assert sure.sum() > 500
    assert len({tuple(colour) for colour in looked_up(normals[sure])}) >= 4
    assert agree[sure].mean() > 0.95


def test_without_a_sky_box_all_around_is_white(tmp_path: Path) -> None:
    frame, *_ = drawn(tmp_path, "shape: SPHERE, geometry: {radius: 1.0}", (MIRROR % "n", SHOWS_SKY))
    inside = well_inside(frame, 1)
    assert inside.any() and (frame.rgb[inside] == 255).all()


def test_the_sky_shines_through_what_is_transparent(tmp_path: Path) -> None:
    black = "shape: SPHERE, geometry: {radius: 0.5}, color components: {transparency: 0.5, diffuse: {r: 0, g: 0, b: 0}"
    frame, *_ = drawn(tmp_path, black + ", ambient: {level: 0}, specular: {r: 0, g: 0, b: 0}}", sky=True)
    sky, through = frame.rgb[30, 4].astype(int), frame.rgb[30, 40].astype(int)
    assert sky.max() > 100
    assert np.abs(through - sky / 2).max() <= 2


def quad(folder: Path, material: str) -> str:
    (folder / "quad.obj").write_text(QUAD)
    (folder / "quad.mtl").write_text(f"newmtl own\n{material}")
    rng = np.random.default_rng(3)
    for name in ("ao", "ball"):
        Image.fromarray(rng.integers(0, 256, (4, 4, 3), dtype=np.uint8)).resize((64, 64), 0).save(
            folder / f"{name}.png"
        )
    for name, level in (("dark", 0), ("half", 128), ("light", 255)):
        Image.new("RGB", (4, 4), (level,) * 3).save(folder / f"{name}.png")
    return "mesh: quad.obj"


@pytest.mark.parametrize(
    ("sampler", "line", "picture"),
    [("aoMap", "map_ao ao.png", "ao"), ("uMatcapMap", "refl -type sphere ball.png", "ball")],
)
def test_maps_of_a_material_reach_shaders_of_scene_files(tmp_path: Path, sampler: str, line: str, picture: str) -> None:
    vertex = (
        "#version 120\nvarying vec2 vAt;\nvoid main() { vAt = gl_MultiTexCoord0.xy; gl_Position = ftransform(); }\n"
    )
    fragment = f"#version 120\nuniform sampler2D {sampler};\nvarying vec2 vAt;\nvoid main() {{ gl_FragColor = vec4(texture2D({sampler}, vAt).rgb, 1.0); }}\n"
    frame, *_ = drawn(tmp_path, quad(tmp_path, f"Kd 1 1 1\n{line}\n"), (vertex, fragment))
    rows, columns = np.nonzero(frame.ids == 1)
    box = rows.min(), rows.max() + 1, columns.min(), columns.max() + 1
    seen = Image.fromarray(frame.rgb[box[0] : box[1], box[2] : box[3]])
    wanted = np.asarray(Image.open(tmp_path / f"{picture}.png").resize((4, 4), Image.Resampling.BOX), dtype=int)
    # the middle of each of its 16 squares
    found = np.asarray(seen.resize((64, 64), Image.Resampling.NEAREST), dtype=int)[8::16, 8::16]
    assert np.abs(found - wanted).max() <= 4
    plain, *_ = drawn(tmp_path, quad(tmp_path, "Kd 1 1 1\n"), (vertex, fragment))
    assert (plain.rgb[plain.ids == 1] == 255).all()


@pytest.mark.parametrize("look", ["", "Pm 0\nPr 0.6\n"])
def test_occlusion_dims_what_arrives_from_all_around_and_nothing_else(tmp_path: Path, look: str) -> None:
    """With an own oracle for plain materials: black occlusion is no ambient light, half of it half of that light."""
    base = "Ka {0} {0} {0}\nKd 0.4 0.3 0.2\nKs 0 0 0\n" + look

    def colour(ambient: float, picture: str) -> np.ndarray:
        line = f"map_ao {picture}.png\n" if picture else ""
        frame, *_ = drawn(tmp_path, quad(tmp_path, base.format(ambient) + line))
        return frame.rgb[frame.ids == 1].astype(int).mean(axis=0)

    plain, light, half, dark = (colour(1.0, name) for name in ("", "light", "half", "dark"))
    assert np.abs(plain - light).max() <= 1
    assert (dark < half).all() and (half < light).all()
    if not look:
        assert np.abs(dark - colour(0.0, "")).max() <= 1
        assert half == pytest.approx(dark + 128 / 255 * (light - dark), abs=2)
