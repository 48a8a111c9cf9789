"""The process that judges a task of a run, and hands it to `ligature.ros`."""

from __future__ import annotations

import sys

import ligature
from ligature.bus import Block, BusError
from ligature.bus.process import end_with_parent, stop_on_signal, tell
from ligature.cli.options import RunOptions
from ligature.model.state import state_dtype

SCENE_PATIENCE = 10.0
"""Seconds to wait for the end of the run, for which the physics process gives the reasons."""


def main() -> None:
    """Entry point: one argument, the run's options as text."""
    end_with_parent()
    stop = stop_on_signal()
    options = RunOptions.from_text(sys.argv[1])
    try:
        scene = options.load()
        Block.attach(options.bus, state_dtype(scene), cancelled=stop.is_set).close()
    except ligature.SceneError:
        stop.wait(SCENE_PATIENCE)
        sys.exit(2)
    except BusError as error:
        tell("warning", str(error))
        sys.exit(0 if stop.is_set() else 1)
    from ligature.ros.master import NameTaken
    from ligature.ros.tasks import TaskNode
    from ligature.tasks import MissingBodies

    try:
        node = TaskNode(scene, options.bus, options.task, say)
    except (MissingBodies, NameTaken) as error:
        tell("fatal", str(error))
        stop.wait(SCENE_PATIENCE)
        sys.exit(2)
    tell("ready", f"judging '{options.task}'")
    node.run(stop)


def say(line: str) -> None:
    """A line for whoever reads the run's output."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
