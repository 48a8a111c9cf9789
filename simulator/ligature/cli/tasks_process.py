"""The process that judges a task of a run, and hands it to `ligature.ros`."""

from __future__ import annotations

import sys

from ligature.cli.joining import give_up, join_run
from ligature.process import tell


def main() -> None:
    """Entry point: one argument, the run's options as text."""
    options, scene, stop = join_run()
    from ligature.ros.master import NameTaken
    from ligature.ros.tasks import TaskNode
    from ligature.tasks import MissingBodies

    try:
        node = TaskNode(scene, options.bus, options.task, say)
    except (MissingBodies, NameTaken) as error:
        give_up(stop, error)
    tell("ready", f"judging '{options.task}'")
    node.run(stop)


def say(line: str) -> None:
    """A line for whoever reads the run's output."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
