"""How a process that serves ROS joins a run, or leaves it when it cannot."""

from __future__ import annotations

import sys
from typing import NoReturn

import ligature
from ligature.bus import Block, BusError
from ligature.bus.stop import Stop, stop_on_signal
from ligature.cli.options import RunOptions
from ligature.model.scene import Scene
from ligature.model.state import state_dtype
from ligature.process import end_with_parent, tell

SCENE_TIMEOUT = 10.0
"""Seconds to wait for the end of the run, for which the physics process gives the reasons."""


def join_run() -> tuple[RunOptions, Scene, Stop]:
    """Options, scene and stop signal of the run whose options are this process's one argument.

    Waits until physics runs. Where the scene does not load or the run ends, this process ends.
    """
    end_with_parent()
    stop = stop_on_signal()
    options = RunOptions.from_text(sys.argv[1])
    try:
        scene = options.load()
        Block.attach(options.bus, state_dtype(scene), cancelled=stop.is_set).close()
    except ligature.SceneError:
        stop.wait(SCENE_TIMEOUT)
        sys.exit(2)
    except BusError as error:
        tell("warning", str(error))
        sys.exit(0 if stop.is_set() else 1)
    return options, scene, stop


def give_up(stop: Stop, error: Exception) -> NoReturn:
    """End the run for a reason that its user has to put right."""
    tell("fatal", str(error))
    stop.wait(SCENE_TIMEOUT)
    sys.exit(2)
