"""The window process: shows the newest state of the bus to people, and sends their commands."""

from __future__ import annotations

import sys
import time

import ligature
from ligature.bus import Block, BusError, Outbox
from ligature.bus.stop import stop_on_signal
from ligature.cli.options import RunOptions
from ligature.model.state import new_state, state_dtype
from ligature.process import end_with_parent, tell
from ligature.render import RenderUnavailable
from ligature.render.viewer import Figures, Viewer
from ligature.render.window import Window

PHYSICS_SILENCE = 5.0
"""Seconds without a sign of life of the physics process after which this one ends."""

MIN_FRAME_PERIOD = 1.0 / 60.0
"""Seconds that a picture is shown at least."""

SMOOTHING = 0.1
"""Part of the newest frame time in the frame rate on the screen."""


def main() -> None:
    """Entry point: one argument, the run's options as text."""
    end_with_parent()
    stop = stop_on_signal()
    options = RunOptions.from_text(sys.argv[1])
    try:
        scene = options.load()
        block = Block.attach(options.bus, state_dtype(scene), cancelled=stop.is_set)
        window = Window(f"Ligature: {scene.name}")
    except (RenderUnavailable, ligature.SceneError, BusError) as error:
        if isinstance(error, RenderUnavailable):
            tell("warning", str(error))
        sys.exit(0)
    outbox, ring, state = Outbox(block.rings["window"]), block.rings["window"], new_state(scene)
    viewer = Viewer(scene, outbox.push, window.context)
    window.listen(viewer)
    tell("ready", "H in the window shows its keys")
    period = MIN_FRAME_PERIOD
    while not (stop.is_set() or window.closed) and block.age < PHYSICS_SILENCE:
        begin = time.monotonic()
        ring.beat()
        block.read(state)
        figures = Figures(1.0 / period, float(block.figures["real_time_factor"][0]))
        window.show(viewer.picture(state, window.size, figures))
        viewer.pull()
        outbox.flush()
        time.sleep(max(MIN_FRAME_PERIOD - (time.monotonic() - begin), 0.0))
        period += SMOOTHING * (time.monotonic() - begin - period)
    window.close()


if __name__ == "__main__":
    main()
