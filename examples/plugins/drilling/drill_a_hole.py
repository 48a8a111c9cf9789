"""Drills a slot into the bone, and writes pictures before and after, the force, and how fast pictures are drawn.

``python examples/plugins/drilling/drill_a_hole.py FOLDER`` writes before.png, after.png, force.csv and force.png.
"""

from __future__ import annotations

import csv
import sys
import time
from pathlib import Path

import ligature
import numpy as np
from ligature.model.commands import PluginCommand
from numpy.typing import NDArray
from PIL import Image

SCENE = Path(__file__).resolve().parent / "drilling.yaml"
WAY = [(0.0, -0.006, 0.0, 0.019), (1.0, -0.006, 0.0, 0.0135), (3.0, 0.006, 0.0, 0.0135), (3.6, 0.006, 0.0, 0.03)]
"""Where the burr is to be: seconds, then metres."""

EVERY = 5
"""Ticks between two samples."""


def main(folder: Path) -> None:
    """Drill, and write all files to ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    sim = ligature.Simulation(ligature.load(SCENE), allow_plugins=True)
    camera, drill, way = sim.cameras["main"], sim.bodies["Drill"], np.array(WAY)
    drill.set_pose([*WAY[0][1:], 0, 0, 0, 1])
    Image.fromarray(camera.capture((640, 480)).rgb).save(folder / "before.png")
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
    Image.fromarray(camera.capture((640, 480)).rgb).save(folder / "after.png")
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
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
