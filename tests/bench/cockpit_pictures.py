"""Pictures a second on the page, and their cost: ``python -m tests.bench.cockpit_pictures [SCENE [SECONDS [ROUNDS]]]``.

A scene is simulated at real time while 1 and 10 viewers look at the endoscope's large picture (480 pixels high); each
round is paired with one without a viewer just before it. Medians over the rounds are printed. Viewers speak the page's own protocol and confirm each picture, as a browser that draws at
once. Printed are pictures a second that come to a viewer, processor milliseconds of the drawing process and of the
page for each picture drawn, how high the pictures are, and the real-time factor of physics. Processor time does not
depend on what else the machine does; pictures a second and the real-time factor do, so the load stands beside them,
and the change of the factor from the round without viewers to the one after it.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from statistics import median

from PIL import Image

from tests.bench.cockpit import _spent
from tests.cockpit.conftest import ROOT, Served
from tests.cockpit.wired import Wired
from tests.waiting import until

HIGH = 480
CROWDS = (1, 10)


def processes(served: Served) -> dict[str, str]:
    """Process ids of physics, the page, and the drawing of its pictures."""
    listing = subprocess.run(["ps", "-wweo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout
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


def paired(served: Served, crowd: int, seconds: float) -> tuple[Round, Round]:
    """A round without viewers, and one with a ``crowd``."""
    alone = look(served, [], seconds)
    viewers = [Wired(served.url) for _ in range(crowd)]
    try:
        for viewer in viewers:
            viewer.orders("view", [True, HIGH, False])
        for viewer in viewers:
            until(lambda viewer=viewer: viewer.pictures > 10, "pictures come", 120.0)
        return alone, look(served, viewers, seconds)
    finally:
        for viewer in viewers:
            viewer.goes()


def main() -> None:
    """Print a row for each crowd."""
    scene = sys.argv[1] if len(sys.argv) > 1 else "suturing_small"
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 3
    served = Served(scene=ROOT / "scenes" / scene / "launch.yaml")
    try:
        pairs = {crowd: [paired(served, crowd, seconds) for _ in range(rounds)] for crowd in CROWDS}
    finally:
        served.end()
    for crowd, found in pairs.items():
        rate = median(looked.rate for _, looked in found)
        cores = {name: median(looked.spent[name] for _, looked in found) for name in found[0][1].spent}
        change = median(looked.factor - alone.factor for alone, looked in found)
        sys.stdout.write(
            f"{scene}, {crowd} viewers: {rate:.1f} pictures/s of {median(r.height for _, r in found):.0f} rows; "
            f"{1e3 * cores['drawing'] / rate:.1f} ms of processor a picture to draw, "
            f"{1e3 * cores['page'] / rate:.1f} ms for the page; cores: "
            + ", ".join(f"{name} {share:.2f}" for name, share in cores.items())
            + f"; real-time factor {median(r.factor for _, r in found):.2f}, {change:+.3f} from none to {crowd}; "
            f"load {os.getloadavg()[0]:.1f}\n"
        )


if __name__ == "__main__":
    main()
