"""From a device's message to the first ``measured_cp`` of the arm it drives that moved, over ROS on loopback.

``python -m tests.bench.teleop_latency``: a pen's driver publishes poses at 200 Hz to `ligature teleop`, which drives PSM1
of the small scene's arms; now and then the pen steps by two millimetres, and the time until the measured pose has moved
is the latency. Exit status 1 when its 99th percentile is above 15 ms.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from ligature.cli.master import master_answers
from numpy.typing import NDArray

from tests.bench.arm_latency import Watcher
from tests.waiting import until

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
MODELS = "1,3"
"""Both arms of the small scene; the view is a fixed one."""

RATE = 200.0
STEPS = 200
UPDATES_PER_STEP = 20
STEP = 2e-3
BOUND = 15.0
"""Milliseconds within which 99 of 100 steps must show."""

CONFIG = """
camera: {position: [0.0, 0.0, 1.0], rpy: [3.1415927, 0.0, 0.0]}
settings: {scale: 0.5, max velocity: 2.0, timeout: 0.5}
devices: {pen: {kind: touch, topic: /arm1/}}
pairs: {pen: [PSM1]}
"""


def direction(stream: Callable[[int], None], message: Any) -> Array:
    """Where the arm goes, (3,) in its base, when the pen goes to the right."""
    import rospy
    from geometry_msgs.msg import PoseStamped

    places = []
    for x in (0.0, STEP):
        message.pose.position.x = x
        stream(100)
        p = rospy.wait_for_message("/PSM1/measured_cp", PoseStamped).pose.position
        stream(20)
        places.append(np.array([p.x, p.y, p.z]))
    way = places[1] - places[0]
    assert np.linalg.norm(way) > STEP / 4, "the arm does not follow the pen"
    return np.asarray(way / np.linalg.norm(way))


def measure() -> Array:
    """Latencies in milliseconds, of a simulator and a teleoperation that run."""
    import rospy
    from geometry_msgs.msg import PoseStamped
    from std_msgs.msg import Bool

    rospy.init_node("teleop_latency", anonymous=True, disable_signals=True)
    watcher, follows = Watcher(), []
    rospy.Subscriber("/PSM1/measured_cp", PoseStamped, watcher.take, queue_size=10, tcp_nodelay=True)
    rospy.Subscriber("/pen_PSM1/following", Bool, lambda m: follows.append(m.data), queue_size=10)
    publisher = rospy.Publisher("/arm1/pose", PoseStamped, queue_size=10, tcp_nodelay=True)
    message = PoseStamped()
    message.pose.orientation.w = 1.0

    def stream(count: int) -> None:
        begin = time.perf_counter()
        for n in range(count):
            publisher.publish(message)
            time.sleep(max(0.0, begin + (n + 1) / RATE - time.perf_counter()))

    deadline = time.monotonic() + 60.0
    while not (follows and follows[-1]):
        assert time.monotonic() < deadline, "the pen does not drive within 60 s"
        stream(20)
    watcher.along = direction(stream, message)
    latencies = []
    for k in range(1, STEPS + 1):
        stream(UPDATES_PER_STEP + k % 7)  # steps come at all phases of the loop
        message.pose.position.x = STEP * ((k + 1) % 2)
        watcher.expect()
        begin = time.perf_counter()
        stream(UPDATES_PER_STEP)
        seen = watcher.moved_at()
        if seen is not None:
            latencies.append(1e3 * (seen - begin))
    return np.array(latencies)


def main() -> int:
    """Entry point."""
    port = 12000 + os.getpid() % 90
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1")
    command = Path(sys.executable).parent / "ligature"
    scene = ROOT / "scenes" / "suturing_small" / "launch.yaml"
    programs = [
        subprocess.Popen((command, "run", scene, "-l", MODELS, "-p", "500", "--no-cameras"), stdout=subprocess.DEVNULL)
    ]
    try:
        until(lambda: master_answers(os.environ["ROS_MASTER_URI"]), "the ROS master answers", 60.0)
        with tempfile.TemporaryDirectory() as folder:
            config = Path(folder) / "teleop.yaml"
            config.write_text(CONFIG)
            programs.append(subprocess.Popen((command, "teleop", config), stdout=subprocess.DEVNULL))
            latencies = measure()
    finally:
        for program in reversed(programs):
            program.terminate()
            program.wait()
    p50, p90, p99 = np.percentile(latencies, [50, 90, 99])
    sys.stdout.write(
        f"pen to measured_cp, {len(latencies)} steps: p50 {p50:.2f} ms, p90 {p90:.2f} ms, p99 {p99:.2f} ms,"
        f" max {latencies.max():.2f} ms\n"
    )
    return 1 if p99 > BOUND or len(latencies) < STEPS else 0


if __name__ == "__main__":
    sys.exit(main())
