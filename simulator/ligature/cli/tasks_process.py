"""The process that judges a task of a run, and publishes scores on ROS through `ligature.ros`."""

from __future__ import annotations

import sys

from ligature.cli.process import Run, run_process
from ligature.process import report


def main() -> None:
    """Entry point; see `ligature.cli.process`."""
    run_process(_judge)


def _judge(run: Run) -> None:
    from ligature.ros.registrations import NameTaken
    from ligature.ros.tasks import TaskNode
    from ligature.tasks import MissingBodies

    try:
        node = TaskNode(run.scene, run.block, run.options.task, log)
    except (MissingBodies, NameTaken) as error:
        run.fail(error)
    report("ready", f"judging '{run.options.task}'")
    node.run(run.stop)


def log(line: str) -> None:
    """Print a line to the run's output."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()
