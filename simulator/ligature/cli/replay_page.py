"""``ligature replay --page``: recorded runs on a page, to go through their time and to compare two of them."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from rich.console import Console

import ligature
from ligature.bus.record import Record, is_record
from ligature.bus.stop import stop_on_signal
from ligature.cli.resimulation import resimulate
from ligature.cockpit.address import TOKEN_VARIABLE, read_address
from ligature.cockpit.replay_page import Reel, ReplayPage
from ligature.paths import printable, reason


def show(files: list[Path], scene: Path | None, at: str, console: Console) -> int:
    """Simulate records again, serve them, and wait for the end; the exit status is 1 where that is not possible."""
    try:
        reels = _reels(files, scene, console)
        token, address = os.environ.get(TOKEN_VARIABLE, ""), read_address(at)
        page = ReplayPage(reels, address, token, lambda text: console.print(text, markup=False))
    except ligature.SceneError as error:
        for diagnostic in error.diagnostics:
            console.print(str(diagnostic), style="red", markup=False)
        return 1
    except (ValueError, RuntimeError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    except OSError as error:
        if error.filename is not None:
            raise
        console.print(reason(error), style="red", markup=False)
        return 1
    console.print(f"replay ready: {page.url}", markup=False)
    stop = stop_on_signal((signal.SIGINT, signal.SIGTERM), 10.0)
    while not stop.is_set():
        page.turn()
    page.close()
    return 0


def _reels(files: list[Path], scene: Path | None, console: Console) -> list[Reel]:
    found = []
    names = [printable(file.stem) for file in files]
    for number, file in enumerate(files):
        if not is_record(file):
            raise ValueError(f"{file}: not a record of a run; a page needs one")
        name = names[number] if names.count(names[number]) == 1 else f"{names[number]} ({number + 1})"
        reel: Reel | None = None

        def take(simulation: ligature.Simulation, name: str = name) -> None:
            nonlocal reel
            reel = reel or Reel(name, simulation.scene)
            reel.take(simulation.state)

        console.print(f"simulating '{file}' again", markup=False)
        resimulate(Record.read(file), scene, take).close()
        if reel is None:
            raise ValueError(f"{file}: the recording is empty; record at least one update")
        found.append(reel)
    return found
