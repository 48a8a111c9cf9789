"""What it costs that a tick steps a list of subsystems: ``python -m tests.bench.stepping``.

Beside `Subsystems.step`, which walks the list, stands a function with the same calls and stopwatches written out, one
line for each subsystem. One simulation takes blocks of ticks by the one and by the other in turns.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from types import MethodType
from typing import Any

import ligature
from ligature.bundle import SCENES
from ligature.simulation.subsystems import Phases, Subsystems

PAIRS, TICKS = 800, 20


def written_out(phases: Phases, subsystems: Any) -> Callable[[], None]:
    """The calls of `Subsystems.step`, one line for each."""
    names: dict[str, Any] = {"perf_counter": time.perf_counter, "clock": subsystems._clock}
    lines = ["def step():", "tick, now = clock.since_reset, perf_counter()"]
    for p, (stopwatch, stepping) in enumerate(phases):
        names[f"stopwatch_{p}"] = stopwatch
        for s, subsystem in enumerate(stepping):
            names[f"step_{p}_{s}"] = subsystem.step
            lines.append(f"step_{p}_{s}(tick)")
        lines += ["begin, now = now, perf_counter()", f"stopwatch_{p}.seconds += now - begin"]
    exec("\n    ".join(lines), names)
    function: Callable[[], None] = names["step"]
    return function


def measure(name: str, busy: bool) -> tuple[float, float]:
    """Time of a block by the list over that by calls written out, median of pairs; microseconds of a tick.

    Either arms find their home and then stand, or a needle follows poses, and no tick is coasted.
    """
    simulation = ligature.Simulation(ligature.load(SCENES / name / "launch.yaml"), update=5e-3)
    needle = simulation.bodies["BODY Needle"] if busy else None
    for arm in () if busy else simulation.arms:
        simulation.arms[arm].home()
    simulation.step(400)
    subsystems: Any = simulation._subsystems
    functions: dict[int, Callable[[], None]] = {}

    def step(self: Subsystems, phases: Phases) -> None:
        if id(phases) not in functions:
            functions[id(phases)] = written_out(phases, subsystems)
        functions[id(phases)]()

    ways = MethodType(Subsystems.step, subsystems), MethodType(step, subsystems)
    start = needle.pose.copy() if needle else None
    seconds: list[dict[int, float]] = []
    for pair in range(PAIRS):
        found = {}
        for way in (0, 1) if pair % 2 else (1, 0):
            if needle is not None and start is not None:
                goal = start.copy()
                goal[:3] += 0.02 * (pair % 300) / 300, 0.0, 0.01 * (pair % 50) / 50
                needle.command_pose(goal.tolist())
            subsystems.step = ways[way]
            begin = time.perf_counter()
            simulation.step(TICKS)
            found[way] = time.perf_counter() - begin
        seconds.append(found)
    ratio = statistics.median(found[0] / found[1] for found in seconds)
    return ratio, 1e6 * statistics.median(found[0] for found in seconds) / TICKS


def main() -> int:
    """Entry point."""
    for name, busy in (("suturing_small", True), ("suturing", False), ("needle_pick", False)):
        ratio, microseconds = measure(name, busy)
        what = "a needle on poses" if busy else "arms that find their home"
        sys.stdout.write(f"{name}, {what}: list over calls written out {ratio:.3f}, {microseconds:.0f} µs a tick\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
