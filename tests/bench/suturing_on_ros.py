"""How fast our suturing scene runs on ROS, without cameras and with a stereo pair at 10 Hz.

``python -m tests.bench.suturing_on_ros [SECONDS]``: unthrottled, then with cameras as fast as time passes too; every State
topic published at 100 Hz and taken by a subscriber, colour of both cameras too; medians of once a second by /diagnostics.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.bench.on_ros import ROOT, SETTLING, UNTHROTTLED, UPDATES, Listener, own_master, processor_seconds

SECONDS = 10.0
CLOCK = 120
"""Frames a second of the clock that a camera's interval counts."""

HZ = 10
RUNS = (("no cameras", False, UNTHROTTLED), ("stereo cameras", True, UNTHROTTLED), ("the same in real time", True, "1"))
"""What is informed of a run, whether it has cameras, and its limit of the real-time factor."""

PICTURES = [f"/ambf/env/cameras/camera{side}/ImageData" for side in "LR"]


def scene_at(hz: int, folder: Path) -> Path:
    """Our suturing scene, copied to ``folder``, with pictures at ``hz``."""
    scenes = folder / "scenes"
    shutil.copytree(ROOT / "scenes", scenes)
    world = scenes / "theatre" / "world.yaml"
    lines = [
        f"  publish image interval: {CLOCK // hz}" if "publish image interval" in line else line
        for line in world.read_text().splitlines()
    ]
    world.write_text("\n".join(lines) + "\n")
    return scenes / "suturing" / "launch.yaml"


def measure(launch: Path, cameras: bool, limit: str, seconds: float) -> str:
    """Run the scene, listen, and report how it went."""
    import rospy
    from sensor_msgs.msg import Image

    command = [Path(sys.executable).parent / "ligature", "run", launch, "-p", str(UPDATES), "-s", limit]
    command += ["--min-hz", "100", "--max-hz", "100", "--cameras" if cameras else "--no-cameras"]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    frames: list[Image] = []
    try:
        rospy.wait_for_message("/ambf/env/World/State", rospy.AnyMsg, 120.0)
        listener = Listener()
        pictures = [
            rospy.Subscriber(name, Image, frames.append, queue_size=1, tcp_nodelay=True, buff_size=1 << 24)
            for name in PICTURES
            if cameras
        ]
        if cameras:
            rospy.wait_for_message(PICTURES[1], Image, 120.0)
        time.sleep(SETTLING + 2)
        before, taken, begin = processor_seconds(run.pid), len(frames), time.monotonic()
        time.sleep(seconds)
        span = time.monotonic() - begin
        after, taken = processor_seconds(run.pid), len(frames) - taken
        for subscriber in pictures:
            subscriber.unregister()
        listener.close()
    finally:
        run.terminate()
        run.wait()
    shares = ", ".join(f"{name} {(after[name] - before[name]) / span:.0%}" for name in after if name in before)
    seen = f", {taken / 2 / span:.1f} pictures a second and camera" if cameras else ""
    return f"real-time factor {listener.median('real-time factor'):.2f}{seen}; of a core: {shares}"


def main() -> int:
    """Entry point."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    with own_master("suturing_on_ros"):
        load = os.getloadavg()[0]
        with tempfile.TemporaryDirectory() as folder:
            launch = scene_at(HZ, Path(folder))
            for name, cameras, limit in RUNS:
                found = measure(launch, cameras, limit, seconds)
                sys.stdout.write(f"suturing, {name}: {found}\n")
                sys.stdout.flush()
        sys.stdout.write(f"load of the machine at the start: {load:.1f}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
