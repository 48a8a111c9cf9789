"""Runs every benchmark one after the other, then states what got slower: ``python -m tests.bench.run``."""

from __future__ import annotations

import subprocess
import sys

BENCHMARKS = (
    "scenes", "resets", "start", "growth", "environments", "datasets", "on_ros", "latency", "arm_latency", "teleop_latency",
    "teleop_suture", "kinematics", "cameras", "render", "suturing_on_ros", "flame",
    "ledger",
)  # fmt: skip


def main() -> int:
    """Entry point."""
    return max(subprocess.run([sys.executable, "-m", f"tests.bench.{name}"]).returncode for name in BENCHMARKS)


if __name__ == "__main__":
    sys.exit(main())
