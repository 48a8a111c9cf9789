"""A recorded run, simulated again bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import ligature
from ligature.bus.record import Record
from ligature.cli.options import RunOptions

TICK = 1e-3

CHECK_INTERVAL = 0.005
"""Simulated seconds between two evaluations of a task."""


class Differs(ValueError):
    """A scene that is not the one that a record was made with."""


def resimulate(
    record: Record,
    scene: Path | None,
    watch: Callable[[ligature.Simulation], None] = lambda _: None,
    allow_plugins: bool = False,
) -> ligature.Simulation:
    """Simulate a recorded run again; ``scene`` replaces the launch file that the record names.

    The user alone allows plug-ins, never a record. ``watch`` sees the simulation where what was asked to be recorded
    begins, and after each update from there on. Raises `ligature.SceneError`, and `Differs` when the scene does not
    begin as the recorded one did, or goes on otherwise.
    """
    options = RunOptions.from_text(record.header.options)
    if options.allow_plugins and not allow_plugins:
        raise Differs("the run was recorded with --allow-plugins; replay it with 'ligature replay --allow-plugins'")
    options = replace(options, allow_plugins=allow_plugins, scene=options.scene if scene is None else str(scene))
    simulation = ligature.Simulation(options.load(), TICK, 1.0 / options.rate, allow_plugins)
    ticks = simulation.ticks_per_update
    simulation.step(ticks)
    if simulation.state_hash() != record.header.begin:
        simulation.close()
        raise Differs(
            f"'{options.scene}' starts in another state than the recorded run: the scene or the version changed; "
            "replay it with both as they were"
        )

    watched = False

    def update() -> None:
        simulation.step(ticks)
        if watched:
            watch(simulation)

    def started() -> None:
        nonlocal watched
        watched = True
        if record.begun not in ("", simulation.state_hash()):
            simulation.close()
            raise Differs("the run diverges before the recording begins: replay it with the version that recorded it")
        watch(simulation)

    record.replay(update, simulation.apply, started)
    return simulation


def looks(simulation: ligature.Simulation) -> bool:
    """Whether a task looks at the simulation after this update."""
    return round(simulation.time / simulation.dt) % round(CHECK_INTERVAL / simulation.dt) < simulation.ticks_per_update
