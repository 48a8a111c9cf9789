"""``ligature compile``: compiles kernels ahead, by running scenes for a moment, each in a process of its own."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

import ligature
from ligature.bundle import SCENES
from ligature.process import end_with_parent

COMPILED_SCENES = tuple(SCENES / name / "launch.yaml" for name in ("suturing", "peg_transfer"))
"""Bundled scenes that between them need nearly all kernels."""

TICKS = 300
"""Ticks that each scene runs, of which arms find their home for the last part."""


def compile_ahead(scenes: Sequence[Path], console: Console) -> int:
    """Compile what ``scenes`` need, or what most need; returns 1 when one of them cannot run."""
    scenes = scenes or COMPILED_SCENES
    begin = time.monotonic()
    console.print(f"compiling the kernels of {len(scenes)} scenes in parallel; this takes 1 to 2 minutes, once")
    running = {scene: _start(scene, console) for scene in scenes}
    status = 0
    for scene, (process, reader) in running.items():
        reader.join()
        if process.wait():
            console.print(f"{scene} cannot run (status {process.returncode})", style="red", markup=False)
            status = 1
    console.print(f"compiled after {time.monotonic() - begin:.0f} s")
    return status


def _start(scene: Path, console: Console) -> tuple[subprocess.Popen[str], threading.Thread]:
    """A process that runs ``scene``, and the thread that shows what it prints."""
    command = [sys.executable, "-m", "ligature.cli.compile", str(scene)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", preexec_fn=end_with_parent
    )

    def show() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            console.print(f"{scene.parent.name or scene}: {line.rstrip()}", style="dim", markup=False)

    reader = threading.Thread(target=show, daemon=True)
    reader.start()
    return process, reader


def run_for_a_moment(launch: Path) -> None:
    """Call what a run of the scene calls: ticks, arms that move, a picture; raises `ligature.SceneError`."""
    simulation = ligature.Simulation(ligature.load(launch))
    simulation.step(TICKS)
    for name in simulation.arms:
        simulation.arms[name].home()
    simulation.step(TICKS)
    _draw(simulation)


def _draw(simulation: ligature.Simulation) -> None:
    """A picture of the first camera, where there is one and OpenGL."""
    from ligature.render.context import RenderUnavailable

    for camera in list(simulation.cameras)[:1]:
        try:
            simulation.cameras[camera].capture()
        except RenderUnavailable:
            return


if __name__ == "__main__":
    try:
        run_for_a_moment(Path(sys.argv[1]))
    except (ligature.SceneError, OSError) as error:
        sys.exit(str(error))
