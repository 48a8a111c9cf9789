"""Time of a rod's tick by number of elements, and the pictures of `docs/suture.md`.

    python tests/bench/suture_rod.py [--pictures docs/pictures]

Prints microseconds a tick, median and 99th percentile of 2000 ticks, on one core.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "suture"))
from conftest import Bench, body, damped, line  # noqa: E402
from ligature.model.scene import Plane  # noqa: E402
from ligature.suture.description import from_material  # noqa: E402


def _time(elements: int, floor: bool, ticks: int = 2000) -> tuple[float, float]:
    """Median and 99th percentile of a tick in microseconds, hanging free or lying on a floor."""
    bodies = [body(0, Plane(np.array([0.0, 0.0, 1.0]), 0.0))] if floor else []
    bench = Bench(bodies)
    length = 0.00244 * elements
    height = 0.0003 if floor else 1.0
    rod = bench.add(damped(from_material(line(elements, length, start=(0, 0, height)), 0.38e-3, 1e9, 1100.0)))
    if not floor:
        rod.hold_element(0)
    bench.step(200)
    spent = []
    for _ in range(ticks):
        begin = time.perf_counter()
        rod.step()
        spent.append(time.perf_counter() - begin)
    return 1e6 * float(np.median(spent)), 1e6 * float(np.quantile(spent, 0.99))


def _elastica(load: float) -> tuple[np.ndarray, float]:
    """Shape of a clamped rod under a tip load P L² / (E I), and its first-order error in the tip."""
    n, length, diameter, youngs = 60, 0.1, 1e-3, 2e9
    description = from_material(line(n, length), diameter, youngs, 1100.0)
    span = length * (1.0 - 1.0 / n)
    gravity = np.zeros((n, 3))
    gravity[-1, 2] = -load * youngs * np.pi * diameter**4 / 64 / span**2 / description.mass[-1]
    rod = Bench([]).add(damped(replace(description, gravity=gravity), 1 - 1e-15))
    rod.hold_element(0)
    for _ in range(1500):
        rod.step()
    return (rod.positions - rod.positions[0]) / span, span


def _draw(folder: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    published = {1.0: (0.30172, 0.05643), 5.0: (0.71379, 0.38763), 10.0: (0.81061, 0.55500)}
    figure, axes = plt.subplots(figsize=(5, 4))
    for load, (down, back) in published.items():
        shape, _ = _elastica(load)
        axes.plot(shape[:, 0], shape[:, 2], label=f"P L² / E I = {load:g}")
        axes.plot(1.0 - back, -down, "k+", markersize=12)
    axes.set_xlabel("x / L")
    axes.set_ylabel("z / L")
    axes.set_aspect("equal")
    axes.legend(frameon=False)
    figure.savefig(folder / "suture_elastica.png", dpi=110, bbox_inches="tight")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    for floor in (False, True):
        for elements in (40, 100, 200):
            median, late = _time(elements, floor)
            where = "on a floor" if floor else "hanging"
            sys.stdout.write(
                f"{elements:4d} elements {where:10s} {median:7.1f} us a tick, p99 {late:7.1f}, "
                f"{median / elements:.2f} us an element\n"
            )
    if arguments.pictures:
        _draw(arguments.pictures)


if __name__ == "__main__":
    main()
