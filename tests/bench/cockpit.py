"""What the cockpit costs physics: ``python -m tests.bench.cockpit [VIEWERS] [ROUNDS]``.

A simulation runs as fast as it can while an arm sways, so that every browser is sent poses and a bending thread; the
real-time factor is that of its physics process. Viewers are connections that speak viser's protocol and take whatever
the page sends, in one process at a low priority: browsers stand on other machines, and drawing here would measure them.
Rounds with and without viewers alternate; the median of the changes from one to the other is bounded. Beside it stands what
does not depend on what else the machine does: how far physics comes with a second of processor time, and how much of
a core the page takes. Exit status 1 when a change of the real-time factor is out of its bound. How soon an arm holds whose operator vanished is
measured in a real browser by the slow tests of ``tests/cockpit/test_vanished.py``.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import viser
from ligature.bus import Outbox, Pace
from ligature.robots.commands import ServoJp, StateCommand

from tests.cockpit.conftest import SMALL, Served
from tests.waiting import until

VIEWERS = Path(__file__).with_name("cockpit_viewers.py")
BOUND = 5.0
"""Percent by which viewers may change the real-time factor."""

SECONDS = 6.0
SETTLING = 2.0
SWAY = 0.2


@dataclass(frozen=True)
class Round:
    """Simulated over wall time, simulated seconds per second of physics on a processor, cores that the page takes."""

    factor: float
    reach: float
    page: float


def processor_seconds(served: Served) -> tuple[float, float]:
    """What physics has had, and all processes of the page."""
    listing = subprocess.run(["ps", "-wweo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout
    rows = [line.split(None, 2) for line in listing.splitlines()[1:]]
    physics = [pid for pid, ppid, words in rows if int(ppid) == served.process.pid and "ligature.cli.physics" in words]
    page = [pid for pid, ppid, words in rows if int(ppid) == served.process.pid and "cockpit_process" in words]
    page += [pid for pid, ppid, _ in rows if ppid in page]
    return sum(map(_spent, physics)), sum(map(_spent, page))


def _spent(pid: str) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def sway(served: Served, outbox: Outbox, seconds: float) -> Round:
    """Sway PSM1 for so long."""
    arm, begin = served.names.index("PSM1"), time.monotonic()
    home = served.arm("PSM1")["setpoint_js"][0, :6].copy()
    physics, page = processor_seconds(served)
    before, start = float(served.state["sim_time"]), time.monotonic()
    while (now := time.monotonic()) < begin + seconds:
        served.block.rings["spare"].beat()
        goal = [SWAY * np.sin(4.0 * now), SWAY * np.cos(4.0 * now) - SWAY, *home[2:]]
        outbox.push(ServoJp(arm, tuple(map(float, goal))))
        time.sleep(0.02)
    simulated, took = float(served.state["sim_time"]) - before, time.monotonic() - start
    had, paged = processor_seconds(served)
    return Round(simulated / took, simulated / (had - physics), (paged - page) / took)


def _ready(served: Served, word: str) -> bool:
    """Whether PSM1 is what ``word`` makes of it; the bench's ring is kept alive."""
    served.block.rings["spare"].beat()
    arm = served.arm("PSM1")
    return bool(arm["homed"] if word == "home" else arm["operating"] == 1)


def ready(served: Served, outbox: Outbox) -> None:
    """Enable and home PSM1."""
    arm = served.names.index("PSM1")
    for word in ("enable", "home"):
        outbox.push(StateCommand(arm, word))
        until(lambda word=word: _ready(served, word), f"PSM1 is ready after '{word}'", 60.0, every=0.05)


def compare(viewers: int, rounds: int, speed: float, scene: Path) -> list[tuple[Round, Round]]:
    """Rounds without and with viewers."""
    served = Served(scene=scene)
    outbox = Outbox(served.block.rings["spare"])
    try:
        ready(served, outbox)
        outbox.push(Pace(speed))
        found = []
        command = [sys.executable, str(VIEWERS), served.url, viser.__version__, str(viewers)]
        for _ in range(rounds):
            sway(served, outbox, SETTLING)
            alone = sway(served, outbox, SECONDS)
            with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as crowd:
                assert crowd.stdout is not None and crowd.stdin is not None
                for _ in range(viewers):
                    assert crowd.stdout.readline() == "connected\n"
                sway(served, outbox, SETTLING)
                found.append((alone, sway(served, outbox, SECONDS)))
                crowd.stdin.close()
        return found
    finally:
        served.end()


def median(values: Iterable[float]) -> float:
    return float(np.median(list(values)))


def main() -> int:
    """Print the figures."""
    status = 0
    viewers, rounds = (int(sys.argv[i]) if len(sys.argv) > i else default for i, default in ((1, 10), (2, 5)))
    for name, speed in (("paced at 1", 1.0), ("as fast as it can", 100.0)):
        found = compare(viewers, rounds, speed, SMALL)
        change = median(100.0 * (with_.factor / alone.factor - 1.0) for alone, with_ in found)
        reach = median(100.0 * (with_.reach / alone.reach - 1.0) for alone, with_ in found)
        page = median(100.0 * with_.page for _, with_ in found)
        sys.stdout.write(
            f"{name}: real-time factor {median(a.factor for a, _ in found):.3f} alone, "
            f"{median(w.factor for _, w in found):.3f} with {viewers} viewers, changes by {change:+.1f} %, at most {BOUND:g}; "
            f"simulated in a second of processor time {reach:+.1f} %; the page takes {page:.0f} % of a core; "
            f"load {os.getloadavg()[0]:.1f}\n"
        )
        status |= not abs(change) <= BOUND
    return status


if __name__ == "__main__":
    sys.exit(main())
