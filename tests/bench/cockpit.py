"""What the cockpit costs physics: ``python -m tests.bench.cockpit [VIEWERS] [ROUNDS]``.

A simulation runs as fast as it can while an arm sways, so that every browser is sent poses and a bending thread; the
real-time factor is that of its physics process. Viewers are connections that speak viser's protocol and take whatever
the page sends, in one process at a low priority: browsers stand on other machines, and drawing here would measure them.
Rounds with and without viewers alternate; medians are compared. How soon an arm holds whose operator vanished is
measured in a real browser by the slow tests of ``tests/cockpit/test_vanished.py``.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import viser
from ligature.bus import Outbox, Pace
from ligature.model.commands import ArmCommand

from tests.cockpit.conftest import SMALL, Served

VIEWERS = Path(__file__).with_name("cockpit_viewers.py")
SECONDS = 6.0
SETTLING = 2.0
SWAY = 0.2


def sway(served: Served, outbox: Outbox, seconds: float) -> float:
    """Sway PSM1 for so long; returns the real-time factor: simulated over wall time."""
    arm, begin = served.names.index("PSM1"), time.monotonic()
    home = served.arm("PSM1")["setpoint_js"][0, :6].copy()
    before, start = float(served.state["sim_time"]), time.monotonic()
    while (now := time.monotonic()) < begin + seconds:
        served.block.rings["spare"].beat()
        goal = [SWAY * np.sin(4.0 * now), SWAY * np.cos(4.0 * now) - SWAY, *home[2:]]
        outbox.push(ArmCommand(arm, "servo_jp", tuple(map(float, goal))))
        time.sleep(0.02)
    return (float(served.state["sim_time"]) - before) / (time.monotonic() - start)


def ready(served: Served, outbox: Outbox) -> None:
    """Enable and home PSM1."""
    arm = served.names.index("PSM1")
    for word in ("enable", "home"):
        outbox.push(ArmCommand(arm, "state_command", (), word))
        deadline = time.monotonic() + 60.0
        while not (served.arm("PSM1")["homed"] if word == "home" else served.arm("PSM1")["operating"] == 1):
            assert time.monotonic() < deadline, f"PSM1 does not {word}"
            served.block.rings["spare"].beat()
            time.sleep(0.05)


def compare(viewers: int, rounds: int, speed: float, scene: Path) -> tuple[float, float]:
    """Median real-time factors without and with viewers."""
    served = Served(scene=scene)
    outbox = Outbox(served.block.rings["spare"])
    try:
        ready(served, outbox)
        outbox.push(Pace(speed))
        alone, watched = [], []
        command = [sys.executable, str(VIEWERS), served.url, viser.__version__, str(viewers)]
        for _ in range(rounds):
            sway(served, outbox, SETTLING)
            alone.append(sway(served, outbox, SECONDS))
            with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as crowd:
                assert crowd.stdout is not None and crowd.stdin is not None
                for _ in range(viewers):
                    assert crowd.stdout.readline() == "connected\n"
                sway(served, outbox, SETTLING)
                watched.append(sway(served, outbox, SECONDS))
                crowd.stdin.close()
        return float(np.median(alone)), float(np.median(watched))
    finally:
        served.end()


def main() -> None:
    """Print the figures."""
    viewers, rounds = (int(sys.argv[i]) if len(sys.argv) > i else default for i, default in ((1, 10), (2, 5)))
    for name, speed in (("paced at 1", 1.0), ("as fast as it can", 100.0)):
        alone, watched = compare(viewers, rounds, speed, SMALL)
        change = 100.0 * (watched / alone - 1.0)
        sys.stdout.write(
            f"{name}: real-time factor {alone:.3f} alone, {watched:.3f} with {viewers} viewers ({change:+.1f} %); "
            f"load {os.getloadavg()[0]:.1f}\n"
        )


if __name__ == "__main__":
    main()
