"""``ligature poses``: where the bodies of a scene are over time, for editors that play them back."""

from __future__ import annotations

import io
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

import ligature
from ligature.adf import AdfError
from ligature.authoring.save import SaveError, refuse_input, save_all
from ligature.cli.numbers import counted
from ligature.process import signals_held

PROGRESS_SECONDS = 0.5
"""Seconds between two lines ``N of M frames``, which editors show as progress."""


def poses(
    file: Path,
    models: Sequence[int] | None,
    roots: Sequence[Path],
    seconds: float,
    rate: float,
    out: Path,
    console: Console,
) -> int:
    """Simulate and write an npz file; returns the exit status.

    It holds ``identifiers`` (n,), ``times`` (t,) in seconds, and ``poses`` (t, n, 7): x y z qx qy qz
    qw in the world.
    """
    try:
        refuse_input(out, file)
        scene = ligature.load(file, models=models, roots=roots)
    except SaveError as error:
        console.print(str(error), style="red", markup=False)
        return 1
    except AdfError as error:
        for diagnostic in error.diagnostics:
            console.print(str(diagnostic), style="red", markup=False)
        return 1
    simulation = ligature.Simulation(scene, dt=1e-3)
    names = [body.identity.identifier for body in scene.bodies]
    ticks = np.rint(np.arange(int(seconds * rate + 1e-9) + 1) * 1000.0 / rate).astype(int)
    frames: list[np.ndarray] = []
    reported = time.monotonic()
    for wait in np.diff(ticks, prepend=0):
        simulation.step(int(wait))
        frames.append(np.array([simulation.bodies[name].pose for name in names]))
        if time.monotonic() - reported > PROGRESS_SECONDS:
            console.print(f"{len(frames)} of {len(ticks)} frames", markup=False)
            reported = time.monotonic()
    times = ticks * 1e-3
    data = io.BytesIO()
    np.savez(data, identifiers=np.array(names), times=times, poses=np.array(frames))
    try:
        with signals_held():
            save_all({out: data.getvalue()})
    except SaveError as error:
        console.print(str(error), style="red", markup=False)
        return 1
    console.print(f"{out}: {counted(len(names), 'body', 'bodies')}, {counted(len(frames), 'frame')}", markup=False)
    return 0
