"""Rays through volumes, against closed forms and against a marcher in NumPy and SciPy with steps of a hundredth voxel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.adf import AdfError
from ligature.model.shapes import ShaderFiles
from ligature.model.voxels import VolumeForm
from ligature.render import CameraView, Frame, Renderer, view_of
from ligature.render.rays import volume_rays
from ligature.render.visuals import VisualLoader
from PIL import Image
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial.transform import Rotation

from tests.opengl import opengl

N, EDGE, RADIUS = 40, 0.08, 0.03
"""Voxels along an edge, and metres, of the box; radius of the ball in it."""

SCENE = """\
namespace: /ambf/env/
plugins: [{{name: nothing, filename: nothing.py}}]
volumes: [Cloud]
bodies: [Plate]
lights: [lamp]
cameras: [eye]
Cloud:
  name: Cloud
  images: {{path: ./, prefix: s, format: png, count: {count}}}
  dimensions: {{x: {x}, y: {y}, z: {z}}}
  color components: {colour}
  {keys}
Plate: {{name: Plate, mass: 0, shape: BOX, geometry: {{x: 0.4, y: 0.4, z: 0.004}}, location: {{position: {{x: 0, y: 0, z: {plate}}}}},
  color components: {{diffuse: {{r: 0, g: 0, b: 0}}, emission: {{r: 0.8, g: 0.8, b: 0.8}}, ambient: {{level: 0}}, specular: {{r: 0, g: 0, b: 0}}, transparency: 1}}}}
lamp: {{name: lamp, {lamp}, cutoff angle: 0.8, attenuation: {{constant: 1, linear: 0, quadratic: 0}}}}
eye: {{name: eye, location: {{x: 0, y: 0, z: 0.3}}, look at: {{x: 0, y: 0, z: 0}}, up: {{x: 0, y: 1, z: 0}}, field view angle: 0.35,
  clipping plane: {{near: 0.001, far: 2}}, publish image resolution: {{width: 64, height: 48}}}}
"""

BONE = "{diffuse: {r: 0.5, g: 0.4, b: 0.3}, ambient: {level: 0.5}, specular: {r: 0, g: 0, b: 0}, transparency: 1}"
BLACK = "{diffuse: {r: 0, g: 0, b: 0}, ambient: {level: 0}, specular: {r: 0, g: 0, b: 0}, transparency: 1}"
ABOVE = "location: {x: 0, y: 0, z: 0.5}, direction: {x: 0, y: 0, z: -1}"
BESIDE = "location: {x: 0.3, y: 0.1, z: 0.4}, direction: {x: -0.6, y: -0.2, z: -0.8}, shadow quality: 4"
RAMP = "ligature rendering: transfer function\n  ligature transfer function: [{value: 0, opacity: 0}, {value: 1, opacity: 1}]"


class Stage:
    """A volume of given voxels, a shining plate, and an eye above both."""

    def __init__(
        self,
        folder: Path,
        values: np.ndarray,
        keys: str = "",
        plate: float = -0.2,
        edges: tuple[float, ...] = (EDGE,) * 3,
        colour: str = BONE,
        lamp: str = ABOVE,
    ) -> None:
        for k in range(values.shape[2]):
            Image.fromarray(np.ascontiguousarray(values[:, ::-1, k].T)).save(folder / f"s{k}.png")
        x, y, z = edges
        text = SCENE.format(count=values.shape[2] - 1, keys=keys, plate=plate, x=x, y=y, z=z, colour=colour, lamp=lamp)
        (folder / "m.yaml").write_text(text)
        (folder / "nothing.py").write_text("class Plugin:\n    def __init__(self, host):\n        pass\n")
        loaded = ligature.load(folder / "m.yaml")
        assert not [d for d in loaded.diagnostics if d.severity.name in ("ERROR", "WARNING")]
        self.sim = Simulation(loaded, allow_plugins=True)  # so that voxels are of the state
        self.scene = self.sim.scene
        with opengl():
            self.renderer = Renderer(self.scene)
        self.state = self.sim.state.copy()
        found = {body.identity.name: body for body in self.scene.bodies}
        self.cloud, self.plate = found["Cloud"].index + 1, found["Plate"].index + 1
        form = found["Cloud"].volume
        assert form is not None
        self.form: VolumeForm = form
        self.view = view_of(self.scene.cameras[0], self.state["camera_world"][0, 0])

    def draw(
        self, view: CameraView | None = None, passes: tuple[str, ...] = ("rgb", "depth", "ids", "normals")
    ) -> Frame:
        frame = self.renderer.render(self.state, view or self.view, passes)
        assert self.renderer.problems == []
        return frame

    def close(self) -> None:
        self.renderer.release()
        self.sim.close()


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[type]:
    made: list[Stage] = []

    def make(*args: object, **kwargs: object) -> Stage:
        folder = tmp_path / str(len(made))
        folder.mkdir()
        made.append(Stage(folder, *args, **kwargs))  # type: ignore[arg-type]
        return made[-1]

    yield make  # type: ignore[misc]
    for each in made:
        each.close()


def ball() -> np.ndarray:
    """A ball whose values fall by half a level a millimetre about its surface."""
    axis = ((np.arange(N) + 0.5) / N - 0.5) * EDGE
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    return np.rint(255 * np.clip(0.5 + (RADIUS - np.sqrt(x * x + y * y + z * z)) / 0.012, 0, 1)).astype(np.uint8)


def rays(view: CameraView) -> tuple[np.ndarray, np.ndarray]:
    """Start (3,) and unit ways (h, w, 3) of the rays of a perspective view, in the world."""
    inverse = np.linalg.inv(view.projection @ view.view)
    x = (np.arange(view.width) + 0.5) / view.width * 2 - 1
    y = 1 - (np.arange(view.height) + 0.5) / view.height * 2
    at = np.stack([*np.meshgrid(x, y), np.ones((view.height, view.width)), np.ones((view.height, view.width))], axis=-1)
    far = at @ inverse.T
    start = np.linalg.inv(view.view)[:3, 3]
    ways = far[..., :3] / far[..., 3:] - start
    return start, ways / np.linalg.norm(ways, axis=-1, keepdims=True)


def sampled(
    form: VolumeForm, values: np.ndarray, T_world_volume: np.ndarray, view: CameraView
) -> tuple[np.ndarray, ...]:
    """Values (0 to 1) of a volume along the rays of a view, (n, h, w), and their distances (n,): SciPy's interpolation."""
    padded = np.pad(values.astype(float) / 255, 1)
    axes = [np.arange(-1, n + 1) for n in values.shape]
    field = RegularGridInterpolator(axes, padded, bounds_error=False, fill_value=0.0)
    start, ways = rays(view)
    inverse = np.linalg.inv(T_world_volume)
    start, ways = inverse[:3, :3] @ start + inverse[:3, 3], ways @ inverse[:3, :3].T
    reach = float(np.linalg.norm(form.size))
    near = max(float(np.linalg.norm(start)) - reach, 1e-3)
    distance = np.arange(near, float(np.linalg.norm(start)) + reach, float(form.spacing.min()) / 25)
    points = start + distance[:, None, None, None] * ways
    return field(points / form.spacing + (np.array(values.shape) - 1) / 2), distance, ways


def first_entry(values: np.ndarray, distance: np.ndarray, level: float) -> np.ndarray:
    """Distance at which rays first come from below the level to it; inf where they never do."""
    enters = (values[:-1] < level) & (values[1:] >= level)
    k = np.argmax(enters, axis=0)
    a, b = (np.take_along_axis(values, (k + j)[None], axis=0)[0] for j in (0, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        at = distance[k] + (level - a) / (b - a) * (distance[1] - distance[0])
    return np.where(enters.any(axis=0), at, np.inf)


def test_a_ball_has_the_depth_and_normals_of_a_sphere(stage: type) -> None:
    """To a tenth of a voxel, 2 degrees and half a pixel of outline."""
    made = stage(ball())
    frame = made.draw()
    start, ways = rays(made.view)
    along = -(ways @ start)
    square = RADIUS**2 - (start @ start - along**2)
    depth = (along - np.sqrt(np.maximum(square, 0))) * -(ways @ made.view.view[2, :3])
    sure = square > (2 * RADIUS * 0.3e-3)  # but for half a pixel of the outline
    assert (frame.ids[sure] == made.cloud).all() and (frame.ids[square < -2 * RADIUS * 0.3e-3] != made.cloud).all()
    inner = square > (0.3 * RADIUS) ** 2
    assert np.abs(frame.depth - depth)[inner].max() < 0.1 * EDGE / N
    points = start + (along - np.sqrt(np.maximum(square, 0)))[..., None] * ways
    normals = points / RADIUS @ made.view.view[:3, :3].T
    assert (frame.normals * normals).sum(axis=-1)[inner].min() > np.cos(np.radians(2))
    assert np.linalg.norm(frame.normals[inner], axis=-1) == pytest.approx(1.0, abs=1e-5)


def test_a_surface_by_rays_is_lit_as_its_mesh_is(stage: type) -> None:
    rgb = [stage(ball(), f"ligature rendering: {how}").draw() for how in ("rays", "mesh")]
    inner = np.isfinite(rgb[0].depth) & (rgb[0].depth < 0.3 - 0.5 * RADIUS)
    assert np.abs(rgb[0].rgb.astype(int) - rgb[1].rgb)[inner].max() <= 6
    assert (rgb[0].ids != rgb[1].ids).mean() < 0.01


def test_rays_throw_the_shadow_that_the_mesh_throws(stage: type) -> None:
    """On a lit plate below."""
    frames = []
    for how in ("rays", "mesh"):
        made = stage(ball(), f"ligature rendering: {how}", -0.05, lamp=BESIDE)
        surface = next(b for b in made.renderer._batches if b.pieces[0].owner == made.plate - 1)
        colour = replace(surface.surface.colour, diffuse=(0.6,) * 3, emission=(0.0,) * 3)
        surface.surface = replace(surface.surface, colour=colour)
        frames.append(made.draw())
    plate = frames[0].ids == frames[1].ids
    plate &= frames[0].ids == made.plate
    dark = [frame.rgb[..., 0] < 40 for frame in frames]
    assert (dark[1] & plate).sum() > 30
    assert (dark[0] != dark[1])[plate].mean() < 0.01


def test_flow_and_parts_by_rays_are_those_of_the_mesh(stage: type) -> None:
    """While the eye moves and turns."""
    frames = []
    for how in ("rays", "mesh"):
        made = stage(ball(), f"ligature rendering: {how}")
        first = looking(made.view, np.array([0.05, 0.02, 0.3]), np.zeros(3))
        made.draw(first, ("flow",))
        frames.append(
            made.draw(
                looking(made.view, np.array([0.06, 0.0, 0.28]), np.array([0.003, 0, 0])), ("flow", "parts", "ids")
            )
        )
    both = (frames[0].ids == made.cloud) & (frames[1].ids == made.cloud)
    assert np.linalg.norm(frames[1].flow[both], axis=-1).max() > 1.0
    gap = np.linalg.norm(frames[0].flow - frames[1].flow, axis=-1)[both]
    assert np.quantile(gap, 0.9) < 0.02 and gap.max() < 0.3
    assert len(np.unique(frames[0].parts[both])) == 1


@pytest.mark.parametrize("density", [0.02, 0.1])
def test_a_slab_lets_light_through_as_beer_and_lambert_say(stage: type, density: float) -> None:
    """Values of 0.6 all over: opacity 0.6, and exp(-0.6 density 80 mm) of the plate's light comes through."""
    keys = f"{RAMP}\n  optical density: {density}"
    frame = stage(np.full((N, N, N), 153, np.uint8), keys, -0.05, colour=BLACK).draw()
    expected = 255 * 0.8 * np.exp(-0.6 * density * 1e3 * EDGE)
    assert frame.rgb[24, 32].astype(float) == pytest.approx(expected, abs=2.0)


@pytest.mark.parametrize("how", ["rays", "transfer function"])
@pytest.mark.parametrize(("plate", "seen"), [(0.05, "Plate"), (0.0, "both"), (-0.05, "Cloud")])
def test_a_plate_hides_a_volume_from_its_place_on(stage: type, how: str, plate: float, seen: str) -> None:
    """A plate above the ball, through its middle and below it; the eye is above."""
    made = stage(ball(), f"ligature rendering: {how}", plate)
    frame = made.draw()
    assert frame.ids[24, 32] == (made.plate if seen == "Plate" else made.cloud)
    assert frame.ids[0, 0] == made.plate
    top = plate + 0.002 if seen == "Plate" else RADIUS
    assert frame.depth[24, 32] == pytest.approx(0.3 - top, abs=2e-3)
    alone = stage(ball(), f"ligature rendering: {how}", -0.2).draw()
    if seen != "Plate":
        same = (alone.ids == made.cloud) & (alone.depth < 0.3 - 0.006)
        assert np.abs(frame.depth - alone.depth)[same].max() < 1e-6


def test_what_shines_through_ends_at_what_is_opaque(stage: type) -> None:
    """A plate in the middle of a slab: half of the way absorbs."""
    keys = f"{RAMP}\n  optical density: 0.02"
    frame = stage(np.full((N, N, N), 255, np.uint8), keys, 0.0, colour=BLACK).draw()
    assert frame.rgb[24, 32, 0] == pytest.approx(255 * 0.8 * np.exp(-20 * (0.04 - 0.002)), abs=2.0)


def test_half_of_the_light_is_gone_where_the_depth_of_a_transfer_function_is(stage: type) -> None:
    made = stage(np.full((N, N, N), 255, np.uint8), f"{RAMP}\n  optical density: 0.05")
    depth = made.draw().depth[24, 32]
    assert depth == pytest.approx(0.3 - 0.04 + np.log(2) / 50, abs=0.1 * EDGE / N)
    thin = stage(np.full((N, N, N), 255, np.uint8), f"{RAMP}\n  optical density: 0.005")  # 33 % in all
    assert thin.draw().ids[24, 32] == thin.plate


def test_a_cut_changes_the_picture_only_there_and_a_reset_brings_all_back(stage: type) -> None:
    made = stage(ball())
    before = made.draw()
    voxels = made.state["volume_value"][0].reshape(N, N, N)
    kept = voxels.copy()
    voxels[18:22, 18:22, 30:36] = 0
    after = made.draw()
    changed = np.abs(after.depth - before.depth) > 1e-7
    rows, columns = np.nonzero(changed)
    assert changed.any() and (after.depth >= before.depth - 1e-7).all()
    pixel = 0.35 / 48 * (0.3 - RADIUS)
    reach = (2 + 1) * EDGE / N / pixel + 1  # the voxels and the cells around them
    assert np.abs(rows - 23.5).max() <= reach and np.abs(columns - 31.5).max() <= reach
    fresh = stage(ball())
    fresh.state["volume_value"][...] = made.state["volume_value"]
    assert (fresh.draw().depth == after.depth).all(), "in part as at once"
    voxels[...] = kept
    again = made.draw()
    assert (again.depth == before.depth).all() and (again.rgb == before.rgb).all()


def test_a_volume_that_grows_is_seen_where_nothing_was(stage: type) -> None:
    """Its distances are measured anew."""
    values = np.zeros((N, N, N), np.uint8)
    values[0, 0, 0] = 255
    made = stage(values)
    assert made.draw().ids[24, 32] == made.plate
    made.state["volume_value"][0] = ball().ravel()
    assert made.draw().depth[24, 32] == pytest.approx(0.3 - RADIUS, abs=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_any_volume_seen_from_anywhere_has_the_depth_of_a_fine_march(stage: type, seed: int) -> None:
    """Random lattices, edges, levels, poses and eyes, one in three of them in the box; some rays graze, and may differ."""
    rng = np.random.default_rng(seed)
    shape = rng.integers(5, 14, 3)
    coarse = RegularGridInterpolator([np.linspace(0, 1, 4)] * 3, rng.random((4, 4, 4)))
    lattice = np.stack(np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij"), axis=-1)
    values = np.rint(255 * coarse(lattice)).astype(np.uint8)
    turn = Rotation.random(random_state=int(seed)).as_euler("xyz")
    place = "location: {{position: {{x: 0.02, y: 0.01, z: 0}}, orientation: {{r: {}, p: {}, y: {}}}}}".format(*turn)
    how = ("rays", "transfer function")[seed % 2]
    level = float(rng.uniform(0.35, 0.65))
    points = f"ligature transfer function: [{{value: 0.2, opacity: 0}}, {{value: {level + 0.2:.3f}, opacity: 1}}]"
    keys = f"ligature rendering: {how}\n  iso-surface value: {level:.4f}\n  {place}\n  {points}\n  quality: 1\n  optical density: 0.1"
    edges = tuple(rng.uniform(0.05, 0.1, 3))
    made = stage(values, keys, -2.0, edges)
    T = made.scene.bodies[made.cloud - 1].T_world_body
    away = 0.01 if seed % 3 == 2 else 0.25
    camera = made.scene.cameras[0]
    position = T[:3, 3] + away * Rotation.random(random_state=int(200 + seed)).as_matrix()[:, 2]
    view = looking(view_of(camera, made.state["camera_world"][0, 0]), position, T[:3, 3])
    frame = made.draw(view, ("depth", "ids"))
    found, distance, ways = sampled(made.form, values, T, view)
    if how == "rays":
        at = first_entry(found, distance, made.form.level / 255)
    else:
        opacity = np.clip((found - 0.2) / (level + 0.2 - 0.2), 0, 1)
        gone = np.cumsum(100.0 * opacity * (distance[1] - distance[0]), axis=0)
        at = np.where(gone[-1] >= np.log(2), distance[np.argmax(gone >= np.log(2), axis=0)], np.inf)
    _, world = rays(view)
    expected = at * -(world @ view.view[2, :3])
    hit = frame.ids == made.cloud
    assert (hit != np.isfinite(at)).mean() < 0.02
    both = hit & np.isfinite(at)
    assert both.any() or away < 0.1, "only an eye in the volume may see nothing of it"
    if both.any():
        error = np.abs(frame.depth[both] - expected[both]) / made.form.spacing.min()
        assert np.median(error) < 0.05 and np.quantile(error, 0.97) < 0.25


def looking(view: CameraView, position: np.ndarray, target: np.ndarray) -> CameraView:
    """``view`` from ``position`` at ``target``."""
    z = (position - target) / np.linalg.norm(position - target)
    x = np.cross([0.3, 0.5, 0.8], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = [x, np.cross(z, x), z]
    matrix[:3, 3] = -matrix[:3, :3] @ position
    return replace(view, view=matrix)


def test_shaders_of_a_camera_see_the_surface_and_not_the_box(stage: type, tmp_path: Path) -> None:
    (tmp_path / "a.vs").write_text("void main() { gl_Position = ftransform(); }")
    (tmp_path / "a.fs").write_text("void main() { gl_FragColor = vec4(0.0, 1.0, 0.0, 1.0); }")
    made = stage(ball(), plate=-2.0)
    shaders = ShaderFiles(tmp_path / "a.vs", tmp_path / "a.fs")
    frame = made.renderer.render(made.state, made.view, ("rgb", "ids"), shaders)
    assert made.renderer.problems == []
    green = frame.rgb[..., 1] == 255
    assert (green != (frame.ids != 0)).mean() < 0.02 and 0.1 < green.mean() < 0.5


def test_a_volume_too_long_for_a_texture_is_reported_and_left_to_the_mesh(stage: type) -> None:
    made = stage(ball())
    problems: list[AdfError] = []
    small = SimpleNamespace(info={"GL_MAX_3D_TEXTURE_SIZE": N + 1})
    assert volume_rays(small, made.scene, VisualLoader().of_scene(made.scene), problems) == []  # type: ignore[arg-type]
    assert [str(p.diagnostics[0]) for p in problems] == [
        "warning: volume '/ambf/env/Cloud' has 40 voxels along an edge, rays take up to 39: drawn as a mesh"
    ]


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("ligature rendering: fog", "ligature rendering"),
        ("optical density: -1", "optical density"),
        ("ligature transfer function: [{value: 0.5, opacity: 0}, {value: 0.5, opacity: 1}]", "value 0.5 of its transfer function follows 0.5"),
        ("ligature transfer function: [{value: 0.5, opacity: 2}]", "opacity"),
        ("ligature transfer function: [{value: 0.5}]", "opacity"),
    ],
)  # fmt: skip
def test_bad_keys_of_a_volume_are_named_with_their_place(tmp_path: Path, keys: str, words: str) -> None:
    for k in range(4):
        Image.fromarray(np.full((4, 4), 255, np.uint8)).save(tmp_path / f"s{k}.png")
    (tmp_path / "m.yaml").write_text(
        SCENE.format(count=3, keys=keys, plate=-0.2, x=0.1, y=0.1, z=0.1, colour=BONE, lamp=ABOVE)
    )
    try:
        found = ligature.load(tmp_path / "m.yaml").diagnostics
    except ligature.SceneError as error:
        found = tuple(error.diagnostics)
    wrong = [str(d) for d in found if d.severity.name == "ERROR"]
    assert any(words in text and "m.yaml:12:" in text for text in wrong), wrong
