"""Exposure: a cavity lit by the endoscope alone is neither white nor black, with and without shaders of the scene."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.render import Renderer, view_of
from ligature.render.target import saturated_share

from tests.opengl import opengl

SHADERS = Path(__file__).parent / "shaders"
WALLS = (("x", 0, 1), ("x", 0, -1), ("y", 1, 1), ("y", 1, -1))


def cavity(random: np.random.Generator, shaders: str) -> str:
    """A shaft of random depth and width, its floor and something on it, and a scope that looks and shines into it."""
    depth, half = random.uniform(0.03, 0.15), random.uniform(0.01, 0.05)
    colour = random.uniform(0.2, 0.85, 3)
    look = (
        "color components: {" + ", ".join(
            f"{word}: {{{', '.join(f'{c}: {v:.3f}' for c, v in zip('rgb', values, strict=True))}}}"
            for word, values in {"diffuse": colour, "ambient": 0.5 * colour, "specular": [0.3] * 3}.items()
        ) + ", shininess: 64, transparency: 1}"
    )  # fmt: skip
    lines = []
    boxes = {
        "Floor": ((2 * half, 2 * half, 0.002), (0, 0, -depth)),
        "Lump": ((0.006, 0.009, 0.008), (0.002, 0, -depth)),
    }
    for axis, k, sign in WALLS:
        size, place = [2 * half, 2 * half, depth], [0.0, 0.0, -depth / 2]
        size[k], place[k] = 0.002, sign * half
        boxes[f"Wall{axis}{'pm'[sign < 0]}"] = tuple(size), tuple(place)
    for name, (size, place) in boxes.items():
        geometry = ", ".join(f"{c}: {v:.5f}" for c, v in zip("xyz", size, strict=True))
        position = ", ".join(f"{c}: {v:.5f}" for c, v in zip("xyz", place, strict=True))
        lines.append(
            f"{name}: {{name: {name}, mass: 0, shape: BOX, geometry: {{{geometry}}}, "
            f"location: {{position: {{{position}}}}}, {look}}}"
        )
    scope = "location: {x: 0.001, y: 0, z: 0.005}"
    lines.append(
        f"C: {{name: C, {scope}, look at: {{x: 0.001, y: 0, z: -1}}, up: {{x: 0, y: 1, z: 0}}, "
        f"field view angle: {random.uniform(0.6, 1.3):.3f}, clipping plane: {{near: 0.001, far: 1}}, "
        "publish image resolution: {width: 96, height: 72}}"
    )
    lines.append(
        f"L: {{name: L, {scope}, direction: {{x: 0, y: 0, z: -1}}, cutoff angle: {random.uniform(0.7, 1.5):.3f}, "
        f"spot exponent: {random.uniform(0.0, 2.0):.3f}, shadow quality: {random.integers(0, 4)}}}"
    )
    head = f"bodies: [{', '.join(boxes)}]\ncameras: [C]\nlights: [L]\n"
    own = f"shaders: {{path: ./, vertex: {shaders}.vert, fragment: {shaders}.frag}}\n" if shaders else ""
    return head + own + "\n".join(lines) + "\n"


@pytest.mark.parametrize("shaders", ["", "all_lights", "phong"])
def test_a_cavity_lit_by_the_endoscope_alone_is_neither_white_nor_black(tmp_path: Path, shaders: str) -> None:
    for ending in ("vert", "frag") if shaders else ():
        (tmp_path / f"{shaders}.{ending}").write_text((SHADERS / f"{shaders}.{ending}").read_text())
    for seed in range(12):
        path = tmp_path / f"m{seed}.yaml"
        path.write_text(cavity(np.random.default_rng(seed), shaders))
        simulation = Simulation(ligature.load(path))
        with opengl():
            renderer = Renderer(simulation.scene)
        view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])
        frame = renderer.render(simulation.state, view, ("rgb", "ids"))
        assert renderer.problems == []
        level = frame.rgb[frame.ids > 0].mean(axis=1)
        assert saturated_share(frame.rgb) < 0.05, seed
        assert 25 < level.mean() < 235 and (level < 8).mean() < 0.2, (seed, level.mean(), (level < 8).mean())
        renderer.release()
        simulation.close()
