"""What one change cost: two revisions run the same work in turns, each in a process and with kernels of its own.

    python -m tests.bench.revisions BEFORE [AFTER] [--rounds 7]

A revision is what git knows by that name; ``.`` is the working tree. The work is the bundled scene with its thread,
whose needle follows commanded poses, and one throw of the demonstration. Printed are whether every body ended on the same bits,
and the median ratio of the processor's times, first against second of each pair.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import runpy
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.bench.walks import unpack

HERE = Path(__file__).resolve()
PROJECT = HERE.parents[2]
SCENE = "scenes/suturing_small/launch.yaml"
TICKS, TICKS_PER_STEP = 6000, 20
ROUNDS = 7


def poses(simulation: Any) -> bytes:
    """The bits of the poses of all bodies."""
    return b"".join(simulation.bodies[name].pose.tobytes() for name in simulation.bodies)


def scene(root: Path) -> dict[str, Any]:
    """Command poses of the bundled scene's needle for six simulated seconds."""
    import ligature

    simulation = ligature.Simulation(ligature.load(root / SCENE), update=5e-3)
    needle = simulation.bodies["BODY Needle"]
    start, digest = needle.pose.copy(), hashlib.sha256()
    simulation.step(200)  # what is compiled or built at first is not counted
    begin = time.process_time()
    for k in range(TICKS // TICKS_PER_STEP):
        goal = start.copy()
        goal[:3] += 0.02 * k / (TICKS // TICKS_PER_STEP), 0.0, 0.01 * (k % 50) / 50
        needle.command_pose(goal.tolist())
        simulation.step(TICKS_PER_STEP)
    seconds = time.process_time() - begin
    digest.update(poses(simulation))
    return {"seconds": seconds, "hash": digest.hexdigest()}


def demonstration(root: Path) -> dict[str, Any]:
    """One throw by the example of the revision; its simulation is read after every hundredth step."""
    from ligature.simulation import Simulation

    digest, calls, step = hashlib.sha256(), 0, Simulation.step

    def watched(simulation: Any, ticks: int = 1) -> None:
        nonlocal calls
        step(simulation, ticks)
        calls += 1
        if calls % 100 == 0:
            digest.update(poses(simulation))

    Simulation.step = watched
    sys.argv = ["suture.py", "--throws", "1", "--seed", "0", "--out", tempfile.mkdtemp()]
    sys.path.insert(0, str(root / "examples"))
    begin = time.process_time()
    try:
        runpy.run_path(str(root / "examples" / "suture.py"), run_name="__main__")
    except SystemExit as end:
        if end.code:
            raise
    return {"seconds": time.process_time() - begin, "hash": digest.hexdigest()}


WORK = {"scene": scene, "demonstration": demonstration}


def run(name: str, root: Path) -> dict[str, Any]:
    """Do one work at a revision, in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": f"{root / 'simulator'}:{PROJECT}"}
    words = [sys.executable, str(HERE), "--child", name, str(root)]
    done = subprocess.run(words, cwd=root, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def compare(name: str, before: Path, after: Path, rounds: int) -> None:
    """Print what one work says of both."""
    for root in (before, after):
        run(name, root)  # compiles
    pairs = [(run(name, before), run(name, after)) for _ in range(rounds)]
    ratios = sorted(second["seconds"] / first["seconds"] for first, second in pairs)
    hashes = {first["hash"] for first, _ in pairs}, {second["hash"] for _, second in pairs}
    same = "the same bits" if hashes[0] == hashes[1] and len(hashes[0]) == 1 else "OTHER BITS"
    sys.stdout.write(
        f"{name}: {same}; time after/before {statistics.median(ratios):.3f} ({ratios[0]:.3f} to {ratios[-1]:.3f} "
        f"in {rounds} pairs)\n"
    )
    sys.stdout.flush()


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("revisions", nargs="*")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--work", choices=sorted(WORK), action="append")
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.child:
        sys.stdout.write("\n" + json.dumps(WORK[asked.child[0]](Path(asked.child[1]))) + "\n")
        return 0
    before, after = [*asked.revisions, "."][:2]
    with tempfile.TemporaryDirectory() as folder:
        trees = Path(folder) / "before", Path(folder) / "after"
        for root, revision in zip(trees, (before, after), strict=True):
            root.mkdir()
            unpack(revision, root)
        for name in asked.work or WORK:
            compare(name, trees[0], trees[1], asked.rounds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
