"""Starts the ROS process: loads the run's scene and hands it to `ligature.ros`."""

from __future__ import annotations

import sys

import ligature
from ligature.bus.process import end_with_parent, stop_on_signal, tell
from ligature.cli.options import RunOptions


def main() -> None:
    """Entry point: one argument, the run's options as text."""
    end_with_parent()
    stop = stop_on_signal()
    options = RunOptions.from_text(sys.argv[1])
    try:
        scene = options.load()
    except ligature.SceneError:
        sys.exit(2)
    from ligature.ros.node import Node

    node = Node(scene, options.bus, options.min_hz, options.max_hz, options.names)
    tell("ready", f"{node.topics} topics")
    node.run(stop, lambda: tell("first-state"))


if __name__ == "__main__":
    main()
