"""Every scene of the repository and the corpus, drawn with the built-in shader and with one that sums over all lights.

``python -m tests.bench.contact_sheet`` writes ``build/contact_sheet.png``: the built-in shader, the summing one, and the
summing one under lights of the levels that CHAI3D gives those of AMBF. It prints which share of each picture is
saturated (white), the mean level, and that of the bodies in it. The exit status is 1 when 5 % of a picture or more is saturated beyond what is so
at AMBF's levels (a light floor under two lights is white there too), or nothing is seen.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import ligature
from ligature import Simulation
from ligature.adf import Resolver, read_any
from ligature.model.scene import Scene
from ligature.model.shapes import ShaderFiles
from ligature.render import CameraView, Renderer, view_of
from ligature.render.controls import Controls
from ligature.render.lights import LIGHT_AMBIENT
from ligature.render.target import saturated_share
from ligature.render.viewer import Figures, Viewer
from PIL import Image, ImageDraw

ROOT = Path(__file__).resolve().parents[2]
CORPUS = Path(os.environ.get("LIGATURE_CORPUS", ROOT.parent / "shared" / "corpus"))
SHADERS = ROOT / "tests" / "render" / "shaders"
SUMMING = ShaderFiles(SHADERS / "all_lights.vert", SHADERS / "all_lights.frag")
AMBF_LEVELS = {"ambient": 0.4 / LIGHT_AMBIENT, "diffuse": 0.7, "specular": 1.0}
"""By how much the products of light and material are larger in AMBF: ambient 0.4, diffuse 0.7, specular 1.0 are what
CHAI3D's lights have (``cGenericLight``), and AMBF leaves them."""

SIZE, CAPTION, COLUMNS = (240, 180), 14, 2
MOST_SATURATED = 0.05
LEAST_SEEN = 20
"""Mean level of bodies that are seen; around a small one the picture may be black."""


def scenes() -> Iterator[tuple[str, Scene]]:
    """Name and scene: launch files whole, of those that are collections each model alone, and all other model files."""
    for launch in sorted((ROOT / "scenes").glob("*/launch*.yaml")):
        yield f"{launch.parent.name}/{launch.stem}", ligature.load(launch)
    if (launch := CORPUS / "suturing_scene" / "launch.yaml").exists():
        yield "corpus: suturing_scene", ligature.load(launch, roots=[CORPUS])
    listed = set()
    if (launch := CORPUS / "multibodies" / "descriptions" / "launch.yaml").exists():
        document = read_any(launch, Resolver([CORPUS]))
        for index, model in enumerate(document.models):  # type: ignore[attr-defined]
            if model.path is not None:  # the corpus holds not all that its launch file lists
                listed.add(model.path)
                yield f"corpus: {index} {model.path.stem}", ligature.load(launch, (index,), roots=[CORPUS])
    for file in sorted(CORPUS.rglob("*.yaml")):
        if file not in listed and "bodies:" in file.read_text("utf-8", "replace"):
            try:
                scene = ligature.load(file, roots=[CORPUS])
            except ligature.SceneError as error:
                sys.stdout.write(f"{file.relative_to(CORPUS)}: no scene: {str(error).splitlines()[0]}\n")
                continue
            if any(b.visual.visible and (b.visual.mesh or b.visual.shapes) for b in scene.bodies):
                yield f"corpus: {file.parent.name}/{file.stem}", scene


def renderer_of(scene: Scene, files: ShaderFiles) -> Renderer:
    """Draws everything of ``scene`` with ``files``."""
    bodies = tuple(replace(body, visual=replace(body.visual, shaders=files)) for body in scene.bodies)
    return Renderer(replace(scene, bodies=bodies, roots=(*scene.roots, files.vertex.parent)))


def ambf_levels(folder: Path) -> ShaderFiles:
    """The summing shader under lights of AMBF's levels, written below ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    text = SUMMING.fragment.read_text()
    for word, level in AMBF_LEVELS.items():
        text = text.replace(f"gl_FrontLightProduct[i].{word}", f"{level} * gl_FrontLightProduct[i].{word}")
    (folder / "ambf.frag").write_text(text)
    (folder / "ambf.vert").write_text(SUMMING.vertex.read_text())
    return ShaderFiles(folder / "ambf.vert", folder / "ambf.frag")


def view_into(scene: Scene, simulation: Simulation, renderer: Renderer) -> CameraView:
    """What the first camera that sees a body sees; where none does, the window's view of all of it."""
    for camera in scene.cameras:
        view = view_of(camera, simulation.state["camera_world"][0, camera.index], SIZE)
        if (renderer.render(simulation.state, view, ("ids",)).ids > 0).mean() > 0.02:
            return view
    viewer = Viewer(Controls(replace(scene, cameras=()), lambda message: None), None)
    viewer.picture(simulation.state, SIZE, Figures())
    assert viewer._view is not None
    return viewer._view


def main() -> int:
    """Entry point."""
    reference = ambf_levels(ROOT / "build" / "contact_sheet")
    tiles: list[Image.Image] = []
    wrong = 0
    for name, scene in scenes():
        simulation = Simulation(scene)
        built_in = Renderer(scene)
        view = view_into(scene, simulation, built_in)
        tile = Image.new("RGB", (3 * SIZE[0], SIZE[1] + CAPTION), "black")
        shares: list[tuple[float, float, float]] = []
        for place, renderer in enumerate((built_in, renderer_of(scene, SUMMING), renderer_of(scene, reference))):
            picture = renderer.render(simulation.state, view, ("rgb", "ids"))
            rgb, bodies = picture.rgb, picture.rgb[picture.ids > 0]
            shares.append((saturated_share(rgb), float(rgb.mean()), float(bodies.mean()) if bodies.size else 0.0))
            tile.paste(Image.fromarray(rgb), (place * SIZE[0], CAPTION))
            renderer.release()
        simulation.close()
        allowed = shares[2][0] + MOST_SATURATED
        bad = any(white >= allowed or seen < LEAST_SEEN for white, _, seen in shares)
        wrong += bad
        words = zip(("built-in", "summing", "AMBF's levels"), shares, strict=True)
        text = f"{name}  " + " | ".join(
            f"{word} {white:.1%} white, mean {mean:.0f}, {seen:.0f}" for word, (white, mean, seen) in words
        )
        ImageDraw.Draw(tile).text((2, 1), text, fill="red" if bad else "white")
        sys.stdout.write(text + (" <-- wrong\n" if bad else "\n"))
        sys.stdout.flush()
        tiles.append(tile)
    width, height = tiles[0].size
    rows = -(-len(tiles) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * width, rows * height))
    for index, tile in enumerate(tiles):
        sheet.paste(tile, (index % COLUMNS * width, index // COLUMNS * height))
    path = ROOT / "build" / "contact_sheet.png"
    path.parent.mkdir(exist_ok=True)
    sheet.save(path)
    sys.stdout.write(f"{len(tiles)} scenes, {wrong} wrong: {path}\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
