"""Pictures a second on the page, and what they cost: ``python -m tests.bench.cockpit_pictures [SCENE] [SECONDS]``.

A scene is simulated at real time while 1 and 10 viewers look at the endoscope's large picture (480 pixels high), beside
rounds without a viewer. Viewers speak the page's own protocol and confirm each picture, as a browser that draws at
once. Printed are pictures a second that come to a viewer, processor milliseconds of the drawing process and of the
page for each picture drawn, how high the pictures are, and the real-time factor of physics. Processor time does not
depend on what else the machine does; pictures a second and the real-time factor do, so the load stands beside them.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
import time
from dataclasses import dataclass

from PIL import Image

from tests.bench.cockpit import _spent
from tests.cockpit.conftest import ROOT, Served
from tests.cockpit.wired import Wired
from tests.waiting import until

HIGH = 480
CROWDS = (0, 1, 10)


def processes(served: Served) -> dict[str, str]:
    """Process ids of physics, the page, and the drawing of its pictures."""
    listing = subprocess.run(["ps", "-eo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout
    rows = [line.split(None, 2) for line in listing.splitlines()[1:]]
    ours = {words: pid for pid, parent, words in rows if int(parent) == served.process.pid}
    page = next(pid for words, pid in ours.items() if "cockpit_process" in words)
    return {
        "physics": next(pid for words, pid in ours.items() if "ligature.cli.physics" in words),
        "page": page, "drawing": next(pid for pid, parent, _ in rows if parent == page),
    }  # fmt: skip


@dataclass(frozen=True)
class Round:
    """Pictures a second of a viewer, processor seconds of each process, real-time factor, pixels from top to bottom."""

    rate: float
    spent: dict[str, float]
    factor: float
    height: int


def look(served: Served, viewers: list[Wired], seconds: float) -> Round:
    """Look on for so long."""
    pids = processes(served)
    before = {name: _spent(pid) for name, pid in pids.items()}
    count = [viewer.pictures for viewer in viewers]
    begin, start = time.monotonic(), float(served.state["sim_time"])
    time.sleep(seconds)
    took = time.monotonic() - begin
    shown = sum(v.pictures - c for v, c in zip(viewers, count, strict=True)) / max(len(viewers), 1)
    height = Image.open(io.BytesIO(viewers[0].picture)).height if viewers else 0
    spent = {name: (_spent(pid) - before[name]) / took for name, pid in pids.items()}
    return Round(shown / took, spent, (float(served.state["sim_time"]) - start) / took, height)


def main() -> None:
    """Print a row for each crowd."""
    scene = sys.argv[1] if len(sys.argv) > 1 else "suturing_small"
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
    served = Served(scene=ROOT / "scenes" / scene / "launch.yaml")
    try:
        for crowd in CROWDS:
            viewers = [Wired(served.url) for _ in range(crowd)]
            for viewer in viewers:
                viewer.orders("view", [True, HIGH, False])
            for viewer in viewers:
                until(lambda viewer=viewer: viewer.pictures > 10, "pictures come", 120.0)
            found = look(served, viewers, seconds)
            each = {name: 1e3 * cores / found.rate if found.rate else 0.0 for name, cores in found.spent.items()}
            sys.stdout.write(
                f"{scene}, {crowd} viewers: {found.rate:.1f} pictures/s of {found.height} rows; "
                f"{each['drawing']:.1f} ms of processor a picture to draw, {each['page']:.1f} ms for the page; cores: "
                + ", ".join(f"{name} {cores:.2f}" for name, cores in found.spent.items())
                + f"; real-time factor {found.factor:.2f}; load {os.getloadavg()[0]:.1f}\n"
            )
            sys.stdout.flush()
            for viewer in viewers:
                viewer.goes()
    finally:
        served.end()


if __name__ == "__main__":
    main()
