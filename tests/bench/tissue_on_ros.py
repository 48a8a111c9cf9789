"""How fast `scenes/soft_suturing` runs on ROS while its needle, with the thread, is driven through both lips of the wound.

``python -m tests.bench.tissue_on_ros``: unthrottled, every State topic published at 100 Hz and taken by a subscriber. First
at 200 updates a second, for the real-time factor; then at 1000, where an update is a tick, for the 99th percentile and
the longest tick. Medians of once a second by /diagnostics, the longest of all seconds; on the clock, so that other work
on the machine counts.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import ligature
import numpy as np

from tests.bench.on_ros import ROOT, UNTHROTTLED, Listener, own_master, processor_seconds
from tests.waiting import until
from tests.wound import TURN, WayThroughWound

SCENE = ROOT / "scenes" / "soft_suturing" / "launch.yaml"
NEEDLE = "/ambf/env/phantom/Needle"
UPDATES = (200, 1000)
ABOVE, WITHIN = 0.03, 1e-3
"""Metres above the tissue where the needle comes from; distance from a place at which it counts as there."""

RESTS = 6
"""Seconds of the clock for which the run is looked at after the needle has come to stand in both lips."""

LIMIT = 180.0
"""Seconds of the clock in which the needle must have got there."""

STAND = 1.7
"""Radians of `TURN` after which it stands: in both lips, its thread not yet."""


class Driver:
    """Drives the needle by its Command topic, from its State."""

    def __init__(self, way: WayThroughWound) -> None:
        import rospy
        from ambf_msgs.msg import RigidBodyCmd, RigidBodyState

        self._way, self._pose, self._time = way, np.zeros(7), -1.0
        self._command = RigidBodyCmd
        self._publisher = rospy.Publisher(f"{NEEDLE}/Command", RigidBodyCmd, queue_size=1, tcp_nodelay=True)
        self._subscriber = rospy.Subscriber(
            f"{NEEDLE}/State", RigidBodyState, self._see, queue_size=1, tcp_nodelay=True
        )

    def _see(self, message: Any) -> None:
        p, q = message.pose.position, message.pose.orientation
        self._pose, self._time = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w]), message.sim_time

    def close(self) -> None:
        """Drive no more."""
        self._subscriber.unregister()
        self._publisher.unregister()

    def _send(self, kind: int, values: np.ndarray) -> None:
        command = self._command(cartesian_cmd_type=kind)
        if kind == self._command.TYPE_POSITION:
            place, turn = command.pose.position, command.pose.orientation
            place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w = values
        else:
            linear, angular = command.twist.linear, command.twist.angular
            linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = values
        self._publisher.publish(command)

    def _go(self, pose: np.ndarray, end: float) -> None:
        while np.abs(self._pose[:3] - pose[:3]).max() > WITHIN:
            if time.monotonic() > end:
                raise TimeoutError(f"the needle is at {self._pose[:3]}, not at {pose[:3]}")
            self._send(self._command.TYPE_POSITION, pose)
            time.sleep(0.01)

    def pass_through(self) -> None:
        """Bring the needle to the tissue and turn it in until it is in both lips."""
        way, end = self._way, time.monotonic() + LIMIT
        until(lambda: self._time >= 0.0, "the needle's State arrives", 60.0)
        start = way.pose(way.begin)
        self._go(start + np.array([0.0, 0.0, ABOVE, 0, 0, 0, 0]), end)
        self._go(start, end)
        begin = self._time
        turned = 0.0
        while turned < STAND:
            if time.monotonic() > end:
                raise TimeoutError(f"the needle has turned by {turned:.2f} of {STAND} rad")
            turned = (self._time - begin) * float(np.linalg.norm(way.spin))
            self._send(self._command.TYPE_VELOCITY, way.twist(way.begin + turned, self._pose))
            time.sleep(0.005)

    def stand(self, seconds: float) -> None:
        """Hold it where it is."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._send(self._command.TYPE_VELOCITY, np.zeros(6))
            time.sleep(0.02)


def measure(updates: int, way: WayThroughWound) -> str:
    """Run the scene, drive its needle, and report how it went."""
    import rospy

    command = [Path(sys.executable).parent / "ligature", "run", SCENE, "-p", str(updates), "-s", UNTHROTTLED]
    command += ["--min-hz", "100", "--max-hz", "100", "--no-cameras"]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        rospy.wait_for_message(f"{NEEDLE}/State", rospy.AnyMsg, 180.0)
        time.sleep(2.0)
        # A topic has the type of its first subscriber, and the listener takes any.
        driver, listener = Driver(way), Listener()
        driver.pass_through()
        standing = len(listener.seconds)
        before, begin = processor_seconds(run.pid), time.monotonic()
        driver.stand(RESTS)
        span = time.monotonic() - begin
        after = processor_seconds(run.pid)
        driver.close()
        listener.close()
    finally:
        run.terminate()
        run.wait()
    parts = []
    for name, seconds in (("driven in", listener.seconds[1:standing]), ("in both lips", listener.seconds[standing:])):
        if not seconds:
            continue
        factor, p50, p99, most = (
            np.array([float(row[key]) for row in seconds])
            for key in ("real-time factor", "update p50 (ms)", "update p99 (ms)", "update max (ms)")
        )
        parts.append(
            f"{name}: real-time factor {np.median(factor):.2f}, an update of {1000 // updates} ticks p50 "
            f"{np.median(p50):.3f} ms, p99 {np.median(p99):.3f} ms, most {most.max():.3f} ms"
        )
    shares = ", ".join(f"{name} {(after[name] - before[name]) / span:.0%}" for name in after if name in before)
    return "; ".join(parts) + f"; of a core: {shares}"


def main() -> int:
    """Entry point."""
    assert STAND < TURN
    way = WayThroughWound(ligature.load(SCENE))
    with own_master("tissue_on_ros"):
        sys.stdout.write(f"load of the machine at the start: {os.getloadavg()[0]:.1f}\n")
        for updates in UPDATES:
            sys.stdout.write(f"soft_suturing, {updates} updates/s: {measure(updates, way)}\n")
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
