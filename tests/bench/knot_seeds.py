"""Closes wounds in soft tissue by a square knot, over widths, stiffnesses, hands and threads, and keeps how each went.

    python -m tests.bench.knot_seeds [N] [START] [--into FILE] [--table]

Each seed from START on draws how wide the wound gapes (2 to 6 mm) and how stiff the tissue is (50 to 300 kPa), besides
what ``examples/soft_knot.py`` draws of it: the hands, the thread's friction, and some per cent of the stiffness; seed 0
is the scene's own. A line of JSON a seed goes to FILE (default `build/knot_seeds.jsonl`); seeds that FILE has are passed
over. Ends with the table of FILE in Markdown; ``--table`` does only that.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import ligature

from tests.bench.campaign import Row, arguments, authored, go_on
from tests.bench.tissue_seeds import drawn

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "examples"), str(ROOT / "scenes")]
import author_soft_knot  # noqa: E402
import soft_knot  # noqa: E402


def scene_of(seed: int, folder: Path) -> ligature.Scene:
    """The scene with the wound, the tissue and the thread of a seed; its files go to ``folder``."""
    if seed == 0:
        return ligature.load(soft_knot.SCENE)
    width, youngs = drawn(seed)
    texts = author_soft_knot.texts(round(width, 5), round(youngs))
    return soft_knot.scattered(authored(texts, folder, soft_knot.SCENE.parents[1]), seed)


def attempt(seed: int) -> Row:
    """One knot in a world of its own, and what came of it: millimetres, kilopascals, seconds."""
    with tempfile.TemporaryDirectory() as folder:
        scene = scene_of(seed, Path(folder))
        simulation = ligature.Simulation(scene)
    started = time.perf_counter()
    try:
        found = soft_knot.operate(simulation, seed)
    except soft_knot.Failure as failure:
        return {"seed": seed, "success": False, "why": str(failure), "gaps": [], "kind": []}
    tissue = scene.bodies[scene.tissues[0].body].tissue
    assert tissue is not None
    return {
        "seed": seed, "success": found.success, "why": found.stopped, "kind": found.kind,
        "youngs": round(1e-3 * tissue.materials[0].youngs, 1),
        "friction": round(scene.bodies[scene.rods[0].bodies[0]].friction, 3),
        "gaps": [round(1e3 * gap, 3) for gap in found.gaps], "simulated": round(found.time, 2),
        "took": round(time.perf_counter() - started, 1),
    }  # fmt: skip


def table(rows: list[Row]) -> Iterator[str]:
    """Markdown: a line a seed, and how many hold."""
    yield "| seed | wound, mm | tissue, kPa | friction | ends eased, in the hands, mm | hands let go, mm | 10 s later, mm |"
    yield "|---|---|---|---|---|---|---|"
    for row in sorted(rows, key=lambda row: row["seed"]):
        if row["why"]:
            yield f"| {row['seed']} | {row['why']} |"
            continue
        first, eased, free, last = row["gaps"]
        failed = "" if row["success"] else f" (open, or no square knot: {row['kind']})"
        yield (
            f"| {row['seed']} | {first:.1f} | {row['youngs']:.0f} | {row['friction']:.2f} | {eased:.2f} | {free:.2f} "
            f"| {last:.2f}{failed} |"
        )
    yield f"\n{sum(row['success'] for row in rows)} of {len(rows)} hold"


def main() -> int:
    """Entry point."""
    given = arguments("Square knots over many wounds.").parse_args()
    return go_on(given, ROOT / "build" / "knot_seeds.jsonl", attempt, table)


if __name__ == "__main__":
    sys.exit(main())
