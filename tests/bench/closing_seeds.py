"""Closes wounds in soft tissue by a stitch and a knot, from needle to knot in one run, and keeps how each went.

    python -m tests.bench.closing_seeds [N] [START] [--into FILE] [--table]

Each seed from START on draws how wide the wound gapes (2 to 6 mm), how stiff the tissue is (50 to 300 kPa) and where the
needle lies (turned by up to 8 degrees about the clip, up to 10 mm), besides what ``examples/close_wound.py`` draws of it:
the hands, the thread's friction, and some per cent of the stiffness; seed 0 is the scene's own. A line of JSON a seed goes
to FILE (default `build/closing_seeds.jsonl`); seeds that FILE has are passed over. Ends with the table of FILE in
Markdown; ``--table`` does only that.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import ligature
import numpy as np

from tests.bench.campaign import Row, arguments, authored, go_on
from tests.bench.tissue_seeds import drawn

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "examples"), str(ROOT / "scenes")]
import author_soft_closing  # noqa: E402
import close_wound  # noqa: E402
from soft_knot import scattered  # noqa: E402

TURNED = np.radians(8.0)
"""By which the needle lies turned at most."""


def scene_of(seed: int, folder: Path) -> ligature.Scene:
    """The scene with the wound, the tissue, the needle and the thread of a seed; its files go to ``folder``."""
    if seed == 0:
        return ligature.load(close_wound.SCENE)
    width, youngs = drawn(seed)
    heading = author_soft_closing.HEADING + float(np.random.default_rng([seed, 16]).uniform(-TURNED, TURNED))
    texts = author_soft_closing.texts(round(width, 5), round(youngs), round(heading, 4))
    return scattered(authored(texts, folder, close_wound.SCENE.parents[1]), seed)


def attempt(seed: int) -> Row:
    """One closure in a world of its own, and what came of it: millimetres, kilopascals, newtons, seconds."""
    with tempfile.TemporaryDirectory() as folder:
        scene = scene_of(seed, Path(folder))
        simulation = ligature.Simulation(scene)
    started = time.perf_counter()
    closed = close_wound.operate(simulation, seed)
    tissue = scene.bodies[scene.tissues[0].body].tissue
    assert tissue is not None
    knot, stitch = closed.knot, closed.stitch
    return {
        "seed": seed, "success": closed.success, "why": closed.stopped or (knot.stopped if knot else "no knot"),
        "wound": round(1e3 * stitch.open_gap, 2), "youngs": round(1e-3 * tissue.materials[0].youngs, 1),
        "friction": round(scene.bodies[scene.rods[0].bodies[0]].friction, 3),
        "made": [[round(1e3 * x, 2) for x in one.figures] for one in stitch.stitches],
        "kind": knot.kind if knot else [], "gaps": [round(1e3 * gap, 3) for gap in knot.gaps] if knot else [],
        "tear": round(1e3 * stitch.tear, 2), "force": round(stitch.force, 2), "tension": round(stitch.tension, 2),
        "simulated": round(simulation.time, 2), "took": round(time.perf_counter() - started, 1),
    }  # fmt: skip


def table(rows: list[Row]) -> Iterator[str]:
    """Markdown: a line a seed, and how many were closed and hold."""
    yield "| seed | wound, mm | tissue, kPa | friction | widths, mm | ends eased, mm | hands let go, mm | 10 s later, mm |"
    yield "|---|---|---|---|---|---|---|---|"
    for row in sorted(rows, key=lambda row: row["seed"]):
        widths = "; ".join(f"{m[0]:.1f}, {m[1]:.1f}" for m in row["made"])
        begin = f"| {row['seed']} | {row['wound']:.1f} | {row['youngs']:.0f} | {row['friction']:.2f} | {widths} "
        if row["why"]:
            yield f"{begin}| {row['why']} |"
            continue
        _, eased, free, last = row["gaps"]
        failed = "" if row["success"] else f" (open, or no square knot: {row['kind']})"
        yield f"{begin}| {eased:.2f} | {free:.2f} | {last:.2f}{failed} |"
    yield f"\n{sum(row['success'] for row in rows)} of {len(rows)} closed, and hold"


def main() -> int:
    """Entry point."""
    given = arguments("Stitches and knots over many wounds.").parse_args()
    return go_on(given, ROOT / "build" / "closing_seeds.jsonl", attempt, table)


if __name__ == "__main__":
    sys.exit(main())
