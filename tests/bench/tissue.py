"""What a tick of tissue costs, as ratios to the reference of `tests.bench.scenes` in the same run.

``python -m tests.bench.tissue`` prints thread CPU times. First for scenes, a pad of about 500, 1000 and 1500 nodes that
two tools press, with and without a needle in 12 nodes of its path, and with its thread in them instead: all that
tissue adds to a tick. Then for the numerics alone: of the three ticks in which the nodes rest, of the fourth in which
they move, and of all.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from ligature import Simulation
from ligature.mesh.grid import Cut, build_grid
from ligature.model.material import TissueMaterial
from ligature.tissue.block import TissueBlock
from ligature.tissue.elastic import ElasticGrid

from tests.bench import ledger
from tests.bench.reference import chain_step_us
from tests.soft import conftest as kit
from tests.tissue.conftest import SprungNeedle

PADS = {"0.5k": (12, 9, 3), "1k": (17, 9, 4), "1.5k": (20, 12, 4)}
"""Cells of pads of 100 x 60 x 10 mm with a slit."""

PASSAGES = 12
TICKS = 800

SCENES = {"0.5k": 0.06, "1k": 0.12, "1.5k": 0.19}
"""Lengths in metres of pads of 60 x 10 mm across, with cells of 5 mm."""

INSIDE = {"no needle": 0, "needle": 800, "thread": 1500}
"""What is in the tissue, and ticks that it takes to get there."""


def pad(cells: tuple[int, int, int], **options) -> TissueBlock:
    """A pad held at its bottom rim and its sides, with a slit through half of its depth."""
    axes = [np.linspace(0.0, size, n + 1) for size, n in zip((0.1, 0.06, 0.01), cells, strict=True)]
    mask = np.zeros((cells[0], cells[2]), dtype=bool)
    mask[3:-3, cells[2] // 2 :] = True
    grid = build_grid(axes, cuts=[Cut(1, cells[1] // 2, mask)])
    rim = (grid.site[:, :2] == 0) | (grid.site[:, :2] == np.array(cells[:2]))
    return TissueBlock(grid, [TissueMaterial(1e5)], rim.any(axis=1), **options)


def scene_us(length: float, inside: str, folder: Path) -> dict[str, Any]:
    """Thread CPU time in microseconds that tissue adds to a tick of a scene, beside two tools that press it."""
    tools = [
        kit.body(name, "shape: CAPSULE, geometry: {radius: 0.003, height: 0.03, axis: Z}", (x, 0.015, 0.1205), 0.1)
        for name, x in (("Left", -0.022), ("Right", 0.022))
    ]
    pad_ = kit.pad("    fixed: [-z]\n", size=(length, 0.06, 0.01), cell=0.005)
    blocks = [pad_, *tools, *([kit.needle()] if inside != "no needle" else [])]
    simulation = Simulation(kit.load(folder, *blocks, *([kit.THREAD] if inside == "thread" else [])))
    (piece,) = simulation.tissues.pieces
    for name in ("Left", "Right"):
        simulation.bodies[f"BODY {name}"].command_twist([0] * 6)
    bite = kit.Bite(simulation, depth=0.0048) if inside != "no needle" else None
    simulation.step(INSIDE[inside])
    if bite is not None:
        bite.turn(2e-3)
    for name in ("Left", "Right"):
        simulation.bodies[f"BODY {name}"].command_twist([0, 0, -0.02, 0, 0, 0])
    simulation.step(100)
    for name in ("Left", "Right"):
        simulation.bodies[f"BODY {name}"].command_twist([1e-3, 0, 0, 0, 0, 0])
    times = []
    for part in (piece.begin, piece.end):
        setattr(piece, part.__name__, _timed(part, times))
    simulation.step(TICKS)
    ticks = np.array(times).reshape(-1, 2).sum(axis=1) / 1e3
    passages = int(bite.inside.passages) if bite else 0
    return {
        "nodes": len(piece.block.elastic.x), "passages": passages,
        "thread": int(sum(thread.inside.engaged.sum() for thread in piece.threads)),
        "points": len(piece.contacts.forces) and int(piece.contacts._touching.used.sum()),
        "median": float(np.median(ticks)), "mean": float(ticks.mean()), "p99": float(np.quantile(ticks, 0.99)),
        "max": float(ticks.max()),
    }  # fmt: skip


def _timed(work, times: list[int]):
    """``work``, which appends its nanoseconds of thread CPU time to ``times``."""

    def measured() -> None:
        begin = time.thread_time_ns()
        work()
        times.append(time.thread_time_ns() - begin)

    return measured


def tick_us(cells: tuple[int, int, int]) -> dict[str, float]:
    """Medians in microseconds of thread CPU time, with a needle in ``PASSAGES`` nodes of its path."""
    begin = time.thread_time_ns()
    block = pad(cells)
    setup = (time.thread_time_ns() - begin) / 1e9
    needle = SprungNeedle(block, (0.02, 0.0405, 0.0105), (1.0, 0.0, -0.35), length=0.04)
    for _ in range(1000):
        if needle.needle.passages >= PASSAGES:
            break
        needle.advance(1e-4, 0.1)
    couple, step = [], []
    for _ in range(TICKS):
        needle.goal = needle.goal + 1e-6 * needle.axes[:, 0]
        H, g = needle.equations()
        begin = time.thread_time_ns()
        delta, _ = needle.needle.couple(needle.tip, needle.R[:, 0], needle.R[:, 1], needle.centre, H, g)
        middle = time.thread_time_ns()
        block.step()
        step.append((time.thread_time_ns() - middle) / 1e3)
        couple.append((middle - begin) / 1e3)
        needle.move(delta)
    moving = int(np.argmax([statistics.median(step[k::4]) for k in range(4)]))
    resting = [t for k, t in enumerate(step) if k % 4 != moving]
    return {
        "nodes": len(block.elastic.x), "free": len(block.elastic.free), "passages": needle.needle.passages,
        "setup_s": setup, "couple": statistics.median(couple), "rest": statistics.median(resting),
        "move": statistics.median(step[moving::4]), "tick": float(np.mean(couple) + np.mean(step)),
    }  # fmt: skip


def solver_us(cells: tuple[int, int, int]) -> dict[str, float]:
    """Medians in microseconds of a solve, of the elastic forces and of both with what is around them."""
    elastic: ElasticGrid = pad(cells).elastic
    rng = np.random.default_rng(0)
    elastic.x[elastic.free] += 1e-4 * rng.normal(size=(len(elastic.free), 3))
    b = rng.normal(size=3 * len(elastic.free))

    def median(work) -> float:
        times = []
        for _ in range(300):
            begin = time.thread_time_ns()
            work()
            times.append((time.thread_time_ns() - begin) / 1e3)
        return statistics.median(times)

    return {
        "solve": median(lambda: elastic._factor.solve(b)),
        "forces": median(elastic.elastic_forces),
        "predict": median(elastic.predict),
        "nonzeros": elastic._factor.nonzeros,
    }


def main() -> int:
    """Entry point."""
    reference = statistics.median(chain_step_us() for _ in range(3))
    sys.stdout.write(f"reference, 40 Bullet bodies with point joints: {reference:.0f} us a step\n")
    found: dict[str, dict[str, Any]] = {}
    for name, length in SCENES.items():
        for inside in INSIDE:
            with tempfile.TemporaryDirectory() as folder:
                figures = scene_us(length, inside, Path(folder))
            found[f"{name}, {inside}"] = {**figures, "reference_us": reference, "ratio": figures["median"] / reference}
            sys.stdout.write(
                f"{name}, {inside}: {figures['nodes']} nodes, {figures['points']} points of contact with two tools, "
                f"needle in {figures['passages']} nodes, thread in {figures['thread']}: tissue adds a median of "
                f"{figures['median']:.0f} us to a tick, {figures['median'] / reference:.2f} of the reference (mean "
                f"{figures['mean']:.0f}, p99 {figures['p99']:.0f}, most {figures['max']:.0f})\n"
            )
            sys.stdout.flush()
    ledger.note("tissue", found)
    for name, cells in PADS.items():
        figures, solver = tick_us(cells), solver_us(cells)
        sys.stdout.write(
            f"{name}: {figures['nodes']} nodes ({figures['free']} free), {figures['passages']} passages, set up in "
            f"{figures['setup_s']:.2f} s: a tick {figures['tick']:.0f} us, {figures['tick'] / reference:.2f} of the "
            f"reference (needle {figures['couple']:.0f}, nodes at rest {figures['rest']:.0f}, nodes moving "
            f"{figures['move']:.0f}); solve {solver['solve']:.0f}, forces {solver['forces']:.0f}, prediction "
            f"{solver['predict']:.0f} us, {solver['nonzeros']} values in the factor\n"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
