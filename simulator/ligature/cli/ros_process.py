"""The ROS process: hands the run's scene and shared memory to `ligature.ros`."""

from __future__ import annotations

from ligature.cli.process import Run, run_process
from ligature.process import report


def main() -> None:
    """Entry point: one argument, the run's options as text."""
    run_process(_serve)


def _serve(run: Run) -> None:
    from ligature.ros.master import NameTaken
    from ligature.ros.node import Node

    options = run.options
    try:
        node = Node(run.scene, run.block, options.min_hz, options.max_hz, options.names, options.src_crtk)
    except NameTaken as error:
        run.fail(error)
    report("ready", node.summary)
    node.run(run.stop, lambda: report("first-state"))


if __name__ == "__main__":
    main()
