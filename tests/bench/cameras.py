"""Cameras on ROS beside real-time physics: frames a second, time from state to topic, real-time factor.

``python -m tests.bench.cameras [LAUNCH] [-l …]``: a simulator at 1 kHz, and a client of colour, depth and ids of one
camera, then of two.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from ligature.cli.master import master_answers

from tests.waiting import until

ROOT = Path(__file__).resolve().parents[2]
CORPUS = Path(os.environ.get("LIGATURE_CORPUS", ROOT.parent / "shared" / "corpus")) / "suturing_scene" / "launch.yaml"
SECONDS = 10.0
TIMEOUT = 120.0
"""Seconds to wait for the first picture."""

TOPICS = ("ImageData", "DepthImage", "IdImage")


def listen(cameras: tuple[str, ...], seconds: float) -> None:
    """Print rates and latencies of ``cameras``, and what the simulator states of itself meanwhile."""
    import rospy
    from diagnostic_msgs.msg import DiagnosticArray
    from sensor_msgs.msg import Image

    ages: dict[str, list[float]] = {}
    factors: list[float] = []

    def take(message: Image, topic: str) -> None:
        ages.setdefault(topic, []).append(time.time() - message.header.stamp.to_sec())

    def note(message: DiagnosticArray) -> None:
        factors.append(float({v.key: v.value for v in message.status[0].values}["real-time factor"]))

    names = [f"/ambf/env/cameras/{camera}/{topic}" for camera in cameras for topic in TOPICS]
    subscribers = [
        rospy.Subscriber(name, Image, take, name, queue_size=1, tcp_nodelay=True, buff_size=1 << 24) for name in names
    ]
    subscribers.append(rospy.Subscriber("/diagnostics", DiagnosticArray, note, queue_size=5))
    time.sleep(2.0)
    ages.clear()
    factors.clear()
    time.sleep(seconds)
    for subscriber in subscribers:
        subscriber.unregister()
    found = np.concatenate([1e3 * np.array(ages[name]) for name in names])
    rate = min(len(ages[name]) for name in names) / seconds
    p50, p99 = np.percentile(found, [50, 99])
    sys.stdout.write(
        f"{' and '.join(cameras)}, colour, depth and ids of 640 x 480: {rate:.1f} frames/s, state to topic p50 {p50:.0f} ms, "
        f"p99 {p99:.0f} ms, real-time factor {statistics.median(factors):.3f}\n"
    )


def main() -> int:
    """Entry point."""
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{11900 + os.getpid() % 90}", ROS_IP="127.0.0.1")
    scene = sys.argv[1:] or ([str(CORPUS), "-l", "10,11,6,7,8,9"] if CORPUS.exists() else [])
    scene = scene or [str(ROOT / "scenes" / "suturing_small" / "launch.yaml")]
    command = [Path(sys.executable).parent / "ligature", "run", *scene, "-p", "1000", "--cameras"]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        until(lambda: master_answers(os.environ["ROS_MASTER_URI"]), "the ROS master answers", 60.0)
        import rospy
        from sensor_msgs.msg import Image

        rospy.init_node("cameras_bench", anonymous=True, disable_signals=True)
        rospy.wait_for_message("/ambf/env/cameras/cameraR/ImageData", Image, TIMEOUT)
        load = os.getloadavg()[0]
        listen(("cameraL",), SECONDS)
        listen(("cameraL", "cameraR"), SECONDS)
        sys.stdout.write(f"load of the machine at the start: {load:.1f}\n")
    finally:
        run.terminate()
        run.wait()
    return 0


if __name__ == "__main__":
    sys.exit(main())
