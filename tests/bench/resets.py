"""How long a snapshot takes to restore, and a scene to reset: ``python -m tests.bench.resets``."""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable

import ligature

from tests.bench import ledger
from tests.bench.reference import chain_step_us

ROUNDS = 15


def median_ms(act: Callable[[], object], between: Callable[[], object]) -> float:
    """Milliseconds of processor time of a median call; ``between`` calls the world moves on."""
    times = []
    for _ in range(ROUNDS):
        between()
        begin = time.process_time()
        act()
        times.append(1e3 * (time.process_time() - begin))
    return statistics.median(times)


def main() -> int:
    """Entry point."""
    found = {}
    for name in ("needle_pick", "suturing_small", "suturing"):
        simulation = ligature.Simulation(ligature.load(ledger.ROOT / "scenes" / name / "launch.yaml"))
        simulation.step(50)
        taken, reference = simulation.snapshot(), chain_step_us()
        restore = median_ms(lambda s=simulation, t=taken: s.restore(t), lambda s=simulation: s.step(20))
        reset = median_ms(simulation.reset, lambda s=simulation: s.step(20))
        found[name] = {
            "restore": {"ms": restore, "ratio": 1e3 * restore / reference},
            "reset": {"ms": reset, "ratio": 1e3 * reset / reference},
        }
        sys.stdout.write(f"{name}: restore {restore:.2f} ms, reset {reset:.2f} ms; reference {reference:.0f} us\n")
        simulation.close()
    ledger.note("resets", found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
