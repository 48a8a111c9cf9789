"""Drills a slot into the bone, and writes pictures before and after, the force, and how fast pictures are drawn.

``python examples/plugins/drilling/drill_a_hole.py FOLDER`` writes drilling.webp, before and after, glass.webp, the same
by a transfer function, force.csv and force.png. The bone is drawn as the scene states; a second argument, mesh, rays or
"transfer function", draws it otherwise.
"""

from __future__ import annotations

import csv
import sys
import time
from dataclasses import replace
from pathlib import Path

import ligature
import numpy as np
from ligature.model.commands import PluginCommand
from ligature.model.scene import Scene
from ligature.model.voxels import Rendering, VolumeLook
from ligature.render import Renderer, view_of
from numpy.typing import NDArray
from PIL import Image

SCENE = Path(__file__).resolve().parent / "drilling.yaml"
WAY = [(0.0, -0.006, 0.0, 0.019), (1.0, -0.006, 0.0, 0.0135), (3.0, 0.006, 0.0, 0.0135), (3.6, 0.006, 0.0, 0.03)]
"""Where the burr is to be: seconds, then metres."""

EVERY = 5
"""Ticks between two samples."""

GLASS = VolumeLook(
    Rendering.TRANSFER_FUNCTION,
    extinction=120.0,
    transfer=np.array([[0.2, 1.0, 1.0, 1.0, 0.0], [0.5, 1.0, 0.8, 0.7, 1.0], [1.0, 0.9, 0.9, 1.0, 0.4]]),
)
"""A bone that light shines through."""


def main(folder: Path, rendering: str | None = None) -> None:
    """Drill, and write all files to ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = ligature.load(SCENE)
    if rendering is not None:
        scene = looking(scene, VolumeLook(Rendering(rendering.upper())))
    sim = ligature.Simulation(scene, allow_plugins=True)
    glass = Renderer(looking(sim.scene, GLASS))
    camera, drill, way = sim.cameras["main"], sim.bodies["Drill"], np.array(WAY)
    drill.set_pose([*WAY[0][1:], 0, 0, 0, 1])
    before = [camera.capture((640, 480)).rgb, seen_by(glass, sim)]
    sim.apply(PluginCommand(0, 0, (1.0,)))
    rows, drawn = [], []
    for tick in range(0, round(1000 * WAY[-1][0]), EVERY):
        drill.command_pose([*(float(np.interp(1e-3 * tick, way[:, 0], way[:, k])) for k in (1, 2, 3)), 0, 0, 0, 1])
        sim.step(EVERY)
        x, y, z, removed, depth = sim.state["plugin_value"][0].tolist()
        rows.append((sim.time, x, y, z, int(removed), depth))
        if tick % 100 == 0:
            begin = time.perf_counter(), time.process_time()
            camera.capture((640, 480))
            drawn.append((time.perf_counter() - begin[0], time.process_time() - begin[1]))
    after = [camera.capture((640, 480)).rgb, seen_by(glass, sim)]
    for name, pair in zip(("drilling", "glass"), zip(before, after, strict=True), strict=True):
        Image.fromarray(np.hstack(pair)).save(folder / f"{name}.webp", quality=85)
    with (folder / "force.csv").open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(["time s", "force x N", "force y N", "force z N", "voxels removed", "depth m"])
        writer.writerows(rows)
    plot(np.array(rows), folder / "force.png")
    wall, processor = 1e3 * np.median(drawn, axis=0)
    print(f"{rows[-1][4]} voxels removed, largest force {np.linalg.norm(np.array(rows)[:, 1:4], axis=1).max():.2f} N")
    print(f"a picture of 640 x 480 took {wall:.0f} ms, of the processor {processor:.0f} ms (medians while drilling)")
    for problem in sim.problems:
        print(problem)
    sim.close()


def looking(scene: Scene, look: VolumeLook) -> Scene:
    """``scene`` with its volumes drawn otherwise."""
    bodies = (
        body if body.volume is None else replace(body, volume=replace(body.volume, look=look)) for body in scene.bodies
    )
    return replace(scene, bodies=tuple(bodies))


def seen_by(renderer: Renderer, sim: ligature.Simulation) -> NDArray[np.uint8]:
    """The picture of the scene's camera, 640 x 480."""
    view = view_of(sim.scene.cameras[0], sim.state["camera_world"][0, 0], (640, 480))
    return renderer.render(sim.state, view, ("rgb",)).rgb


def plot(rows: NDArray[np.float64], file: Path) -> None:
    """Draw force and removed voxels over time, if Matplotlib is installed."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("force.png needs Matplotlib: pip install matplotlib")
        return
    figure = Figure(figsize=(8, 3.5), layout="constrained")
    axes = figure.add_subplot()
    for column, name in ((1, "along x"), (3, "along z")):
        axes.plot(rows[:, 0], rows[:, column], label=f"force {name}")
    axes.set(xlabel="time in s", ylabel="force on the hand in N")
    voxels = axes.twinx()
    voxels.plot(rows[:, 0], rows[:, 4], color="grey", linestyle="--", label="voxels removed")
    voxels.set(ylabel="voxels removed")
    figure.legend(loc="upper left", bbox_to_anchor=(0.1, 0.45))
    figure.savefig(file, dpi=100)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."), *sys.argv[2:3])
