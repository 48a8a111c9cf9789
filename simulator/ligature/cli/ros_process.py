"""The ROS process: hands the run's scene and shared memory to `ligature.ros`.

It imports ROS and advertises all topics while the physics process still builds its world, and a master still starts.
"""

from __future__ import annotations

import os
import sys

from ligature.cli.master import DEFAULT_MASTER, master_answers
from ligature.cli.options import RunOptions
from ligature.cli.process import Run, run_process
from ligature.process import report, run_in_real_time
from ligature.ros.node import Node
from ligature.ros.registrations import NameTaken

MASTER_NAP = 0.02
HAPTIC_RATE = 1000.0
"""Forces per second that AMBF reckons with where ``-d`` gives none."""

"""Seconds between two questions to a master that does not answer yet."""


def main() -> None:
    """Entry point; see `ligature.cli.process`."""
    run_process(_serve, early=True)


def _serve(run: Run) -> None:
    options, uri = run.options, os.environ.get("ROS_MASTER_URI") or DEFAULT_MASTER
    while not master_answers(uri):  # the supervisor ends the run when none ever does
        if run.stop.wait(MASTER_NAP):
            sys.exit(0)
    try:
        node = Node(
            run.scene, run.block, options.min_hz, options.max_hz, options.names, options.src_crtk, options.base_frames,
            _haptics(options), len(options.devices),
        )  # fmt: skip
    except NameTaken as error:
        run.fail(error)
    run.await_state()
    real_time = run_in_real_time()
    report("ready", f"{node.summary}{'; readings in real time' if real_time else ''}")
    node.run(run.stop, lambda: report("first-state"))


def _haptics(options: RunOptions) -> dict[str, object]:
    """Settings of force feedback for teleoperation."""
    found: dict[str, object] = {"rate": options.haptic_rate} if options.haptic_rate else {}
    if options.haptic_fixed:
        found["step"] = options.speed / (options.haptic_rate or HAPTIC_RATE)
    return found if options.haptic_forces is None else {**found, "forces": options.haptic_forces}
