"""A trefoil tied by two hands, drawn tight, then under 1 N for 5 s: how it holds, and what its ticks cost.

    python tests/bench/knot.py [FOLDER]

Writes `knot.png` into FOLDER, default `docs/pictures`; prints the way that the ends part while it is under load, and
processor time of the rod's ticks after the first, which loads the kernels. Some ten seconds once the kernels are compiled.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from types import SimpleNamespace

import matplotlib
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from tests.suture.conftest import DT, Bench, body, damped, from_material  # noqa: E402
from tests.suture.test_knots import RIGHT, TwoArms  # noqa: E402

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402

LOAD, SECONDS = 1.0, 5.0


class Timed(TwoArms):
    """Two arms that remember tension and length after every tick, and its cost in seconds."""

    def __init__(self) -> None:
        super().__init__(SimpleNamespace(Bench=Bench, body=body, damped=damped, from_material=from_material))
        self.cost: list[float] = []
        self.seen: list[tuple[float, float]] = []
        step = self.rod.step

        def timed() -> None:
            begin = time.thread_time()
            step()
            self.cost.append(time.thread_time() - begin)
            self.seen.append((self.tension, 1e3 * self.span * self.length))

        self.rod.step = timed  # type: ignore[method-assign]


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/pictures")
    arms = Timed()
    arms.attachment()
    shapes = [("tied", arms.rod.positions.copy())]
    arms.move(RIGHT, (0.10, 0.0, 0.02))
    shapes.append(("drawn", arms.rod.positions.copy()))
    while arms.tension < LOAD:
        arms.move(RIGHT, arms.bench.pose[RIGHT][:3] + [0.001, 0.0, 0.0], 0.05)
    tight = len(arms.cost)
    arms.pull(LOAD, 500)
    start = len(arms.cost)
    arms.pull(LOAD, round(SECONDS / DT))
    shapes.append(("after 5 s under 1 N", arms.rod.positions.copy()))
    cost, seen = 1e6 * np.array(arms.cost), np.array(arms.seen)
    held = seen[start:]
    sys.stdout.write(
        f"under {LOAD:g} N for {SECONDS:g} s: tension {held[:, 0].min():.3f} to {held[:, 0].max():.3f} N, "
        f"the ends part by {1e3 * (held[-1, 1] - held[0, 1]):.0f} um\n"
    )
    for name, part in (("tying and drawing", cost[1:tight]), ("under load", cost[start:])):
        sys.stdout.write(
            f"{name}: {np.median(part):.0f} us a tick (median), p99 {np.percentile(part, 99):.0f}, most {part.max():.0f}\n"
        )
    _draw(folder, shapes, held)


def _draw(folder: Path, shapes: list[tuple[str, np.ndarray]], held: np.ndarray) -> None:
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.6), constrained_layout=True)
    for k, (name, points) in enumerate(shapes):
        left.plot(1e3 * points[:, 0], 1e3 * points[:, 1] - 25 * k, lw=2, label=name)
    left.set(title="a trefoil tied by two hands", xlabel="x, mm", yticks=[], aspect="equal")
    left.legend(frameon=False, fontsize=8)
    t = DT * np.arange(len(held))
    right.plot(t, held[:, 0], label="tension, N")
    right.plot(t, 1e3 * (held[:, 1] - held[0, 1]) / 100, label="ends parted, 0.1 mm")
    right.set(title="held", xlabel="t, s", ylim=(0.0, 1.2))
    right.legend(frameon=False, fontsize=8)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "knot.png", dpi=80)


if __name__ == "__main__":
    main()
