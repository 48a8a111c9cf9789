"""``ligature bench``: how fast the physics of a scene runs here."""

from __future__ import annotations

import json as json_module
import resource
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

import ligature
from ligature.model.scene import Scene
from ligature.simulation import PHASES

WARM_UP = 200


def bench(
    launch: Path,
    models: tuple[int, ...] | None,
    roots: Sequence[Path],
    seconds: float,
    rate: float,
    json: bool,
    console: Console,
) -> int:
    """Measure for ``seconds`` and print; returns the exit status."""
    try:
        begin = time.perf_counter()
        scene = ligature.load(launch, models, roots=roots)
        figures = measure(scene, seconds, rate, time.perf_counter() - begin)
    except ligature.SceneError as error:
        for diagnostic in error.diagnostics:
            console.print(str(diagnostic), style="red", markup=False)
        return 2
    if json:
        console.print_json(json_module.dumps(figures))
        return 0
    table = Table(title=Text(f"{launch} at {figures['dt_ms']:g} ms, updates of {figures['update_ms']:g} ms"))
    table.add_column("figure")
    table.add_column("value", justify="right")
    for name in (
        "ticks_per_second",
        "real_time_factor",
        "tick_p50_us",
        "tick_p99_us",
        "tick_max_us",
        "start_s",
        "memory_mb",
    ):
        table.add_row(name.replace("_", " "), f"{figures[name]:,.2f}")
    for phase in PHASES:
        table.add_row(f"{phase} per tick, us", f"{figures['phases_us'][phase]:,.1f}")
    console.print(table)
    for problem in figures["problems"]:
        console.print(problem, style="yellow", markup=False)
    return 0


def measure(scene: Scene, seconds: float, rate: float, loading: float = 0.0) -> dict[str, Any]:
    """Figures of an unthrottled run in this process; a tick's time includes its share of an update.

    ``loading`` are the seconds that the scene took to load; they are part of the start.
    """
    run = Run(scene, rate)
    run.go_on(seconds)
    figures = run.figures()
    figures["start_s"] += loading
    return figures


class Run:
    """An unthrottled run of a scene in this process, in as many spans as its caller wants.

    Parameters
    ----------
    scene
        What is simulated.
    rate
        Updates a second of simulated time.
    """

    def __init__(self, scene: Scene, rate: float) -> None:
        begin = time.perf_counter()
        self._simulation = ligature.Simulation(scene, update=1.0 / rate)
        self._batch = self._simulation.ticks_per_update
        self._simulation.step(self._batch)
        self._start = time.perf_counter() - begin
        for _ in range(max(1, WARM_UP // self._batch)):
            self._simulation.step(self._batch)
        for phase in self._simulation.phases.values():
            phase.seconds = 0.0
        self._times: list[float] = []

    def go_on(self, seconds: float) -> list[float]:
        """Go on for ``seconds`` on the clock; returns the seconds of a tick in each update."""
        times = []
        end = time.perf_counter() + seconds
        while time.perf_counter() < end:
            before = time.perf_counter()
            self._simulation.step(self._batch)
            times.append((time.perf_counter() - before) / self._batch)
        self._times += times
        return times

    def figures(self) -> dict[str, Any]:
        """Figures of all spans together."""
        simulation, batch = self._simulation, self._batch
        total, ticks = float(np.sum(self._times)) * batch, len(self._times) * batch
        p50, p99 = np.percentile(self._times, [50, 99])
        return {
            "dt_ms": simulation.dt * 1e3,
            "update_ms": simulation.dt * batch * 1e3,
            "ticks_per_second": ticks / total,
            "real_time_factor": ticks * simulation.dt / total,
            "tick_p50_us": p50 * 1e6,
            "tick_p99_us": p99 * 1e6,
            "tick_max_us": max(self._times) * 1e6,
            "start_s": self._start,
            "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            "problems": [str(problem) for problem in simulation.problems],
            "phases_us": {name: phase.seconds / ticks * 1e6 for name, phase in simulation.phases.items()},
        }
