"""From a command on ROS to the first state that shows it, on loopback, at 1 kHz physics.

``python -m tests.bench.latency``: the camera body, which a position command moves at once, is sent
back and forth; the time until its State has the new position is the latency.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
from ligature.cli.master import master_answers

from tests.waiting import until

ROOT = Path(__file__).resolve().parents[2]
BODY = "/ambf/env/phantom/CameraFrame"
COMMANDS = 1000


def samples(count: int) -> list[float]:
    """Latencies in seconds of ``count`` commands to a running simulator."""
    import rospy
    from ambf_msgs.msg import RigidBodyCmd, RigidBodyState

    rospy.init_node("latency", anonymous=True, disable_signals=True)
    seen, wanted, latencies = threading.Event(), [0.0], []

    def take(message: RigidBodyState) -> None:
        if abs(message.pose.position.x - wanted[0]) < 1e-9:
            seen.set()

    rospy.Subscriber(f"{BODY}/State", RigidBodyState, take, queue_size=1, tcp_nodelay=True)
    publisher = rospy.Publisher(f"{BODY}/Command", RigidBodyCmd, queue_size=1, tcp_nodelay=True)
    until(publisher.get_num_connections, "the simulator listens", 60.0)
    command = RigidBodyCmd(cartesian_cmd_type=1)
    command.pose.orientation.w = 1.0
    rng = np.random.default_rng(1)
    for i in range(count + 100):
        wanted[0] = command.pose.position.x = 0.01 * (i % 2) + 1e-4 * (i % 17)
        seen.clear()
        begin = time.perf_counter()
        publisher.publish(command)
        if seen.wait(1.0) and i >= 100:
            latencies.append(time.perf_counter() - begin)
        time.sleep(0.005 + 0.003 * rng.random())
    return latencies


def main() -> int:
    """Entry point."""
    port = 11700 + os.getpid() % 200
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1")
    scene = ROOT / "scenes" / "suturing_small" / "launch.yaml"
    run = subprocess.Popen(
        [Path(sys.executable).parent / "ligature", "run", scene, "-p", "1000"], stdout=subprocess.DEVNULL
    )
    try:
        until(lambda: master_answers(os.environ["ROS_MASTER_URI"]), "the ROS master answers", 60.0)
        time.sleep(4.0)
        values = 1e3 * np.array(samples(COMMANDS))
    finally:
        run.terminate()
        run.wait()
    p50, p90, p99 = np.percentile(values, [50, 90, 99])
    sys.stdout.write(
        f"command to state over ROS, {len(values)} commands: p50 {p50:.2f} ms, p90 {p90:.2f} ms, p99 {p99:.2f} ms, "
        f"max {values.max():.2f} ms\n"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
