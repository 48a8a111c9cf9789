"""The window process: shows the newest state of the bus to people, and sends their commands."""

from __future__ import annotations

import time

from ligature.bus import Outbox
from ligature.cli.process import Run, run_process
from ligature.model.state import new_state
from ligature.process import report
from ligature.render import RenderUnavailable
from ligature.render.viewer import Figures
from ligature.render.windows import Windows

MIN_FRAME_PERIOD = 1.0 / 60.0
"""Shortest time in seconds that a picture is shown."""

SMOOTHING = 0.1
"""Weight of the newest frame time in the displayed frame rate."""


def main() -> None:
    """Entry point; see `ligature.cli.process`."""
    run_process(_show)


def _show(run: Run) -> None:
    scene, block = run.scene, run.block
    outbox, ring, state = Outbox(block.rings["window"]), block.rings["window"], new_state(scene)
    try:
        windows = Windows(scene, outbox.push, run.options.camera_windows)
    except RenderUnavailable as error:
        run.decline("window", error)
    report("ready", "H in the window shows its keys")
    period = MIN_FRAME_PERIOD
    while run.active and windows.open:
        begin = time.monotonic()
        ring.beat()
        block.read(state)
        windows.show(state, Figures(1.0 / period, float(block.figures["real_time_factor"][0])))
        outbox.flush()
        time.sleep(max(MIN_FRAME_PERIOD - (time.monotonic() - begin), 0.0))
        period += SMOOTHING * (time.monotonic() - begin - period)
    windows.close()
