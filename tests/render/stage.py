"""A table, a ball and a light to try materials on, written as ADF, OBJ and MTL files; and pictures to compare with.

Set ``LIGATURE_UPDATE_PICTURES=1`` to draw the pictures anew, and look at them before committing.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import ligature
import numpy as np
from ligature import Simulation
from ligature.model.shapes import Box, Sphere
from ligature.render import Frame, Renderer, view_of
from ligature.render.context import create_context, draws_on_processor
from ligature.render.geometry import Triangles, box, of_shape
from PIL import Image

from tests.opengl import opengl

GOLDEN = Path(__file__).parent / "golden"
CAMERA = (
    "C: {name: C, location: {x: 0.0, y: -0.62, z: 0.42}, look at: {x: 0, y: 0, z: 0.06}, up: {x: 0, y: 0, z: 1}, "
    "field view angle: 0.62, clipping plane: {near: 0.01, far: 10}, publish image resolution: {width: 240, height: 180}}\n"
)
LAMP = (
    "name: L, location: {x: 0.35, y: -0.3, z: 0.7}, direction: {x: -0.35, y: 0.3, z: -0.65}, cutoff angle: 0.7, "
    "spot exponent: 0.5, attenuation: {constant: 1, linear: 0, quadratic: 0}"
)
TABLE = "Ka 1 1 1\nKd 0.45 0.5 0.48\nKs 0.05 0.05 0.05\nNs 10\n"


@dataclass(frozen=True)
class Prop:
    """A body: its mesh, the text of its material, where it stands, and more ADF keys."""

    shape: Box | Sphere
    material: str
    at: tuple[float, float, float]
    keys: str = ""


def ball(material: str, at: tuple[float, float, float] = (0.0, 0.0, 0.1), keys: str = "", radius: float = 0.1) -> Prop:
    return Prop(Sphere(radius), material, at, keys)


@dataclass
class Stage:
    """Files of one scene in ``folder``; `draw` takes its picture."""

    folder: Path
    props: list[Prop]
    lamp: str = LAMP
    table: str | None = TABLE
    pictures: dict[str, np.ndarray] = field(default_factory=dict)
    more: str = ""

    def write(self) -> Path:
        """Write everything; returns the ADF file."""
        props = list(self.props)
        if self.table is not None:
            props.append(Prop(Box(np.array([1.2, 1.2, 0.02])), self.table, (0, 0, -0.01)))
        for name, pixels in self.pictures.items():
            Image.fromarray(pixels).save(self.folder / name)
        lines = []
        for index, prop in enumerate(props):
            triangles = box(prop.shape.size) if isinstance(prop.shape, Box) else of_shape(prop.shape)
            write_obj(self.folder / f"b{index}.obj", triangles, prop.material)
            x, y, z = prop.at
            lines.append(
                f"B{index}: {{name: B{index}, mass: 0, mesh: b{index}.obj, collision shape: SPHERE, collision geometry: "
                f"{{radius: 0.001}}, location: {{position: {{x: {x}, y: {y}, z: {z}}}}}{prop.keys}}}\n"
            )
        names = ", ".join(f"B{index}" for index in range(len(props)))
        head = f"bodies: [{names}]\ncameras: [C]\nlights: [L]\nnamespace: /ambf/env/\n"
        path = self.folder / "m.yaml"
        folders = "high resolution path: ./\nlow resolution path: ./low/\n"
        path.write_text(head + folders + "".join(lines) + CAMERA + f"L: {{{self.lamp}}}\n" + self.more)
        return path

    def renderer(self, samples: int | None = None) -> tuple[Renderer, Simulation]:
        """The scene, loaded, and what draws it; skips where there is no OpenGL."""
        simulation = Simulation(ligature.load(self.write()))
        with opengl():
            return Renderer(simulation.scene, samples), simulation

    def draw(self, samples: int | None = None) -> Frame:
        """Its picture."""
        renderer, simulation = self.renderer(samples)
        assert renderer.problems == []
        view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
        frame = renderer.render(simulation.state, view)
        renderer.release()
        return frame


def write_obj(path: Path, triangles: Triangles, material: str) -> None:
    """An OBJ file of ``triangles`` with one material."""
    path.with_suffix(".mtl").write_text(f"newmtl m\n{material}")
    lines = [f"mtllib {path.stem}.mtl", "usemtl m"]
    lines += ["v {:.6f} {:.6f} {:.6f}".format(*p) for p in triangles.positions]
    lines += ["vt {:.5f} {:.5f}".format(*p) for p in triangles.uvs]
    lines += ["vn {:.5f} {:.5f} {:.5f}".format(*p) for p in triangles.normals]
    lines += ["f " + " ".join(f"{i}/{i}/{i}" for i in face + 1) for face in triangles.faces]
    path.write_text("\n".join(lines) + "\n")


def checker(cells: int = 16, edge: int = 16) -> np.ndarray:
    """A black and white board."""
    board = np.indices((cells, cells)).sum(axis=0) % 2
    return np.repeat(np.repeat(40 + 190 * board, edge, 0), edge, 1).astype(np.uint8)[..., None].repeat(3, 2)


def dimples(size: int = 128, waves: int = 6) -> np.ndarray:
    """A normal map of round waves."""
    u, v = np.meshgrid(*[np.linspace(0, 2 * np.pi * waves, size, endpoint=False)] * 2)
    n = np.stack([0.5 * np.sin(u), 0.5 * np.sin(v), np.ones_like(u)], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return (127.5 + 127.5 * n).astype(np.uint8)


def difference(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """How different two pictures look: mean, and 99.5th percentile, over the cells of two by two pixels, of 255.

    Cells, since half a pixel of an edge more or less is not seen; the percentile, since a missing detail is.
    """
    gap = _gap(a, b)
    return float(gap.mean()), float(np.percentile(gap, 99.5))


@cache
def _draws_on_processor() -> bool:
    return draws_on_processor(create_context())


def _gap(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    h, w = a.shape[0] // 2 * 2, a.shape[1] // 2 * 2
    cells = [p[:h, :w].astype(float).reshape(h // 2, 2, w // 2, 2, 3).mean(axis=(1, 3)) for p in (a, b)]
    return np.abs(cells[0] - cells[1]).max(axis=2)


def assert_looks_like(rgb: np.ndarray, path: Path, moved: float = 0.005) -> None:
    """Compare with the picture at ``path``, of which a share may have ``moved``; or draw it anew when asked to.

    The pictures were drawn by Mesa's rasteriser with smoothed edges. A GPU draws four samples a pixel instead.
    """
    if os.environ.get("LIGATURE_UPDATE_PICTURES"):
        path.parent.mkdir(exist_ok=True, parents=True)
        Image.fromarray(rgb).save(path, optimize=True)
    with Image.open(path) as image:
        expected = np.asarray(image.convert("RGB"))
    assert rgb.shape == expected.shape
    gap, most = _gap(rgb, expected), 12.0 if _draws_on_processor() else 24.0
    still = np.sort(gap, axis=None)[: int(gap.size * (1 - moved))]
    assert still.mean() < 1.0 and still.max() < most, (
        f"{path.name} looks different: mean {still.mean():.2f}, {1 - moved:.1%} within {still.max():.1f} of 255"
    )
