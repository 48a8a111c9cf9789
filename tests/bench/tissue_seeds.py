"""Sutures soft tissue by the demonstration, over wounds, stiffnesses and places of the needle, and keeps how each went.

    python -m tests.bench.tissue_seeds [N] [START] [--stitches K] [--into FILE] [--table]

Each seed from START on draws where the needle lies, how wide the wound gapes (2 to 6 mm) and how stiff the pad is (50 to
300 kPa); seed 0 is the scene's own. A line of JSON a seed goes to FILE (default `build/tissue_seeds_K.jsonl`, with K stitches
of one thread); seeds that FILE has are passed over. Ends with the table of FILE in Markdown; ``--table`` does only that.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import ligature
import numpy as np

from tests.bench.campaign import Row, arguments, go_on

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples"))
import suture_tissue  # noqa: E402
from suture import scatter  # noqa: E402


def drawn(seed: int) -> tuple[float, float]:
    """Width of the wound, m, and Young's modulus of the pad, Pa, of a seed."""
    if seed == 0:
        return 0.004, 69e3
    rng = np.random.default_rng([seed, 15])
    return float(rng.uniform(0.002, 0.006)), float(50e3 * 6.0 ** rng.uniform())


def scene_of(gap: float, youngs: float, folder: Path) -> ligature.Scene:
    """The scene with another wound and pad; its files go to ``folder``."""
    scenes = suture_tissue.SCENE.parents[1]
    launch = suture_tissue.SCENE.read_text(encoding="utf-8").replace("../", f"{scenes}/")
    task = suture_tissue.SCENE.with_name("task.yaml").read_text(encoding="utf-8")
    for before, after in (
        ("high resolution path: ../", f"high resolution path: {scenes}/"),
        ("material: silicone pad", f"material: silicone pad\n    youngs modulus: {youngs:.6g}"),
        ("from: {x: -0.002,", f"from: {{x: {-gap / 2:.6f},"),
        ("to: {x: 0.002,", f"to: {{x: {gap / 2:.6f},"),
    ):
        if before not in task:
            raise ValueError(f"the scene has no '{before}' any more")
        task = task.replace(before, after)
    (folder / "task.yaml").write_text(task, encoding="utf-8")
    (folder / "launch.yaml").write_text(launch, encoding="utf-8")
    return ligature.load(folder / "launch.yaml", roots=[scenes])


def attempt(seed: int, stitches: int = 1) -> Row:
    """One suture in a world of its own, and what came of it: millimetres, kilopascals, newtons, seconds."""
    gap, youngs = drawn(seed)
    with tempfile.TemporaryDirectory() as folder:
        simulation = ligature.Simulation(scene_of(gap, youngs, Path(folder)))
    scatter(simulation, seed)
    started = time.perf_counter()
    score, measures, stopped = suture_tissue.operate(simulation, suture_tissue.Plan(stitches))
    report = score.report()
    return {
        "seed": seed, "wound": round(1e3 * gap, 2), "youngs": round(1e-3 * youngs, 1),
        "success": score.success and not stopped, "why": stopped,
        "made": [[round(1e3 * x, 2) for x in stitch.figures] for stitch in score.stitches],
        **{name: round(1e3 * report[name], 3) for name in ("gap", "asymmetry", "step", "tear")},
        "force": round(score.force, 2), "tension": round(measures.thread_tension, 2), "drops": measures.drops,
        "simulated": round(simulation.time, 2), "took": round(time.perf_counter() - started, 1),
        "load": round(os.getloadavg()[0], 1),
    }  # fmt: skip


def table(rows: list[Row]) -> Iterator[str]:
    """Markdown: a line a seed, and how many were closed."""
    yield "| seed | wound, mm | pad, kPa | gap after, mm | widths, mm | depths, mm | tear, mm | thread, N |"
    yield "|---|---|---|---|---|---|---|---|"
    for row in sorted(rows, key=lambda row: row["seed"]):
        widths = "; ".join(f"{m[0]:.1f}, {m[1]:.1f}" for m in row["made"])
        depths = "; ".join(f"{m[2]:.1f}, {m[3]:.1f}" for m in row["made"])
        gap = f"{row['gap']:.2f}" if row["success"] else f"{row['gap']:.2f} ({row['why'] or 'open'})"
        yield (
            f"| {row['seed']} | {row['wound']:.1f} | {row['youngs']:.0f} | {gap} | {widths} | {depths} "
            f"| {row['tear']:.1f} | {row['tension']:.1f} |"
        )
    yield f"\n{sum(row['success'] for row in rows)} of {len(rows)} closed"


def main() -> int:
    """Entry point."""
    options = arguments("Sutures soft tissue over many wounds.")
    options.add_argument("--stitches", type=int, default=1)
    given = options.parse_args()
    into = ROOT / "build" / f"tissue_seeds_{given.stitches}.jsonl"
    return go_on(given, into, lambda seed: attempt(seed, given.stitches), table)


if __name__ == "__main__":
    sys.exit(main())
