"""Runs every benchmark one after the other: ``python -m tests.bench.run``."""

from __future__ import annotations

import subprocess
import sys

BENCHMARKS = (
    "scenes", "on_ros", "latency", "arm_latency", "teleop_latency", "teleop_suture", "kinematics", "cameras", "render",
    "environments", "suturing_on_ros",
)  # fmt: skip


def main() -> int:
    """Entry point."""
    return max(subprocess.run([sys.executable, "-m", f"tests.bench.{name}"]).returncode for name in BENCHMARKS)


if __name__ == "__main__":
    sys.exit(main())
