"""Time of a rod's tick by number of elements.

    python tests/bench/suture_rod.py

Prints microseconds a tick, median and 99th percentile of 2000 ticks, on one core.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "suture"))
from conftest import Bench, body, damped, line  # noqa: E402
from ligature.model.shapes import Plane
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


def main() -> None:
    for floor in (False, True):
        for elements in (40, 100, 200):
            median, late = _time(elements, floor)
            where = "on a floor" if floor else "hanging"
            sys.stdout.write(
                f"{elements:4d} elements {where:10s} {median:7.1f} us a tick, p99 {late:7.1f}, "
                f"{median / elements:.2f} us an element\n"
            )


if __name__ == "__main__":
    main()
