"""Starts the ROS process: loads the run's scene and hands it to `ligature.ros`."""

from __future__ import annotations

from ligature.cli.joining import give_up, join_run
from ligature.process import tell


def main() -> None:
    """Entry point: one argument, the run's options as text."""
    options, scene, stop = join_run()
    from ligature.ros.master import NameTaken
    from ligature.ros.node import Node

    try:
        node = Node(scene, options.bus, options.min_hz, options.max_hz, options.names, options.src_crtk)
    except NameTaken as error:
        give_up(stop, error)
    tell("ready", node.told)
    node.run(stop, lambda: tell("first-state"))


if __name__ == "__main__":
    main()
