"""From ``servo_cp`` to the first ``measured_cp`` that moved, and how evenly feedback comes, over ROS on loopback.

``python -m tests.bench.arm_latency [PICTURE]``: PSM1 of the whole small scene is streamed poses at 200 Hz; now and then
the pose steps by a millimetre, and the time until the measured pose has moved is the latency. With a file name, both
distributions are drawn into it. Exit status 1 when the latency's 99th percentile is above 10 ms.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from ligature.cli.master import master_answers
from numpy.typing import NDArray

from tests.waiting import until

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
RATE = 200.0
STEPS = 600
UPDATES_PER_STEP = 20
STEP = 1e-3
MOVED = 2e-5
"""Metres from where the tip rested that count as motion; it rests to 1e-9."""

BOUND = 10.0
"""Milliseconds within which 99 of 100 commands must show."""


class Watcher:
    """Waits for the measured tip to leave a place along a direction (3,)."""

    def __init__(self, along: Sequence[float] = (1.0, 0.0, 0.0)) -> None:
        self.along = along
        self.arrivals: list[float] = []
        self.x = 0.0
        self._rest: float | None = None
        self._seen = 0.0
        self._moved = threading.Event()

    def take(self, message: object) -> None:
        """A new measured pose."""
        now = time.perf_counter()
        self.arrivals.append(now)
        p = message.pose.position  # type: ignore[attr-defined]
        self.x = p.x * self.along[0] + p.y * self.along[1] + p.z * self.along[2]
        if self._rest is not None and abs(self.x - self._rest) > MOVED:
            self._seen, self._rest = now, None
            self._moved.set()

    def expect(self) -> None:
        """From now on, wait for motion away from here."""
        self._moved.clear()
        self._rest = self.x

    def moved_at(self) -> float | None:
        """When motion was seen; None when none is seen for a second."""
        return self._seen if self._moved.wait(1.0) else None


def measure() -> tuple[Array, Array]:
    """Latencies and intervals between measured poses, both in milliseconds, of a running simulator."""
    import rospy
    from geometry_msgs.msg import PoseStamped

    from tests.ros import crtk

    rospy.init_node("arm_latency", anonymous=True, disable_signals=True)
    psm = crtk.Psm(rospy, "PSM1")
    psm.check_connections(20.0)
    assert psm.state.wait_for(lambda _: True, 20.0), "no operating state"
    assert psm.enable(10.0)
    assert psm.home(20.0)
    start = psm.setpoint_cp()
    psm.close()
    watcher = Watcher()
    rospy.Subscriber("/PSM1/measured_cp", PoseStamped, watcher.take, queue_size=10, tcp_nodelay=True)
    publisher = rospy.Publisher("/PSM1/servo_cp", PoseStamped, queue_size=10, tcp_nodelay=True)
    until(lambda: publisher.get_num_connections() and watcher.arrivals, "PSM1 listens and reports", 60.0)
    latencies = []
    for k in range(1, STEPS + 1):
        goal = PoseStamped(pose=crtk.pose_message(crtk.shifted(start, [STEP * (k % 2), 0.0, 0.0])))
        watcher.expect()
        begin = time.perf_counter()
        for n in range(UPDATES_PER_STEP + k % 7):  # steps come at all phases of the loop
            publisher.publish(goal)
            time.sleep(max(0.0, begin + (n + 1) / RATE - time.perf_counter()))
        seen = watcher.moved_at()
        if seen is not None:
            latencies.append(1e3 * (seen - begin))
    return np.array(latencies), 1e3 * np.diff(watcher.arrivals)


def draw(latencies: Array, intervals: Array, picture: Path) -> None:
    """Histograms of both."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    shown: Sequence[tuple[Array, str]] = (
        (latencies, "servo_cp to measured_cp that moved, ms"), (intervals, "between two measured_cp, ms"),
    )  # fmt: skip
    for axis, (values, label) in zip(axes, shown, strict=True):
        axis.hist(np.clip(values, 0.0, 15.0), bins=60, range=(0.0, 15.0), color="#3a6ea5")
        axis.axvline(np.percentile(values, 99), color="#c0392b", linewidth=1.0, label="99 %")
        axis.set_xlabel(label)
        axis.set_yscale("log")
        axis.legend(frameon=False)
    figure.savefig(picture, dpi=110)


def main() -> int:
    """Entry point."""
    port = 11900 + os.getpid() % 90
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1")
    scene = ROOT / "scenes" / "suturing_small" / "launch.yaml"
    command = (Path(sys.executable).parent / "ligature", "run", scene, "-p", "500", "--no-cameras")
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        until(lambda: master_answers(os.environ["ROS_MASTER_URI"]), "the ROS master answers", 60.0)
        latencies, intervals = measure()
    finally:
        run.terminate()
        run.wait()
    for values, what in ((latencies, "servo_cp to measured_cp"), (intervals, "between two measured_cp")):
        p50, p90, p99 = np.percentile(values, [50, 90, 99])
        sys.stdout.write(
            f"{what}, {len(values)} times: p50 {p50:.2f} ms, p90 {p90:.2f} ms, p99 {p99:.2f} ms, max {values.max():.2f} ms\n"
        )
    if len(sys.argv) > 1:
        draw(latencies, intervals, Path(sys.argv[1]))
    late = float(np.percentile(latencies, 99))
    return 1 if late > BOUND or len(latencies) < STEPS else 0


if __name__ == "__main__":
    sys.exit(main())
