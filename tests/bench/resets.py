"""How long a snapshot takes to restore, and a scene to reset: ``python -m tests.bench.resets``."""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from typing import NamedTuple

import ligature

from tests.bench import ledger
from tests.bench.reference import Reference

ROUNDS = 15


class Median(NamedTuple):
    """What a call takes of the processor: medians over the rounds."""

    ms: float
    """Milliseconds."""
    ratio: float
    """Over a step of the reference, which is timed in turn with the calls."""


def median(act: Callable[[], object], between: Callable[[], object], reference: Reference) -> Median:
    """What ``act`` takes; ``between`` calls the world moves on."""
    taken = []
    for _ in range(ROUNDS):
        between()
        begin = time.process_time()
        act()
        spent = time.process_time() - begin
        taken.append((1e3 * spent, 1e6 * spent / reference.time().processor))
    return Median(*(statistics.median(column) for column in zip(*taken, strict=True)))


def main() -> int:
    """Entry point."""
    found = {}
    with Reference() as reference:
        for name in ("needle_pick", "suturing_small", "suturing"):
            simulation = ligature.Simulation(ligature.load(ledger.ROOT / "scenes" / name / "launch.yaml"))
            simulation.step(50)
            taken = simulation.snapshot()
            calls = {"restore": lambda s=simulation, t=taken: s.restore(t), "reset": simulation.reset}
            medians = {what: median(act, lambda s=simulation: s.step(20), reference) for what, act in calls.items()}
            found[name] = {what: one._asdict() for what, one in medians.items()}
            parts = [f"{what} {one.ms:.2f} ms, {one.ratio:.1f} of the reference" for what, one in medians.items()]
            sys.stdout.write(f"{name}: {'; '.join(parts)}\n")
            simulation.close()
    ledger.note("resets", found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
