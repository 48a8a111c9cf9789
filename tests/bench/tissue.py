"""What a tick of tissue costs, and what its accuracy is, as ratios to the reference of `tests.bench.scenes`.

``python -m tests.bench.tissue`` prints, for pads of about 500, 1000 and 1500 nodes with 12 passages of needles, thread
CPU times of a tick: of the three ticks in which the nodes rest, of the fourth in which they move, and of all.
"""

from __future__ import annotations

import statistics
import sys
import time

import numpy as np
from ligature.mesh.grid import Cut, build_grid
from ligature.model.material import TissueMaterial
from ligature.tissue.block import TissueBlock
from ligature.tissue.elastic import ElasticGrid

from tests.bench.scenes import chain_step_us
from tests.tissue.conftest import SprungNeedle

PADS = {"0.5k": (12, 9, 3), "1k": (17, 9, 4), "1.5k": (20, 12, 4)}
"""Cells of pads of 100 x 60 x 10 mm with a slit."""

PASSAGES = 12
TICKS = 800


def pad(cells: tuple[int, int, int], **options) -> TissueBlock:
    """A pad held at its bottom rim and its sides, with a slit through half of its depth."""
    axes = [np.linspace(0.0, size, n + 1) for size, n in zip((0.1, 0.06, 0.01), cells, strict=True)]
    mask = np.zeros((cells[0], cells[2]), dtype=bool)
    mask[3:-3, cells[2] // 2 :] = True
    grid = build_grid(axes, cuts=[Cut(1, cells[1] // 2, mask)])
    rim = (grid.site[:, :2] == 0) | (grid.site[:, :2] == np.array(cells[:2]))
    return TissueBlock(grid, [TissueMaterial(1e5)], rim.any(axis=1), **options)


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
