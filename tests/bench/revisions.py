"""What one change cost: two revisions do the same work in turns, span by span, each with kernels of its own.

    python -m tests.bench.revisions BEFORE [AFTER] [--rounds 3]

A revision is what git knows by that name; ``.`` is the working tree. The work is the bundled scene with its thread,
whose needle follows commanded poses, and one throw of the demonstration. Each revision has a process, and only one of
them runs at a time: for a span of some milliseconds, in which the machine is the same for both. Printed are whether
every body ended on the same bits, and the median ratio of the processor's times of two spans.
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
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from tests.bench.walks import unpack

HERE = Path(__file__).resolve()
PROJECT = HERE.parents[2]
SCENE = "scenes/suturing_small/launch.yaml"
TICKS, TICKS_PER_STEP = 6000, 20
STEPS_PER_SPAN = 100
ROUNDS = 3

Turn = Callable[[], None]
"""Ends a span of work, and waits until the next may begin."""


def poses(simulation: Any) -> bytes:
    """The bits of the poses of all bodies."""
    return b"".join(simulation.bodies[name].pose.tobytes() for name in simulation.bodies)


def scene(root: Path, turn: Turn) -> str:
    """Command poses of the bundled scene's needle for six simulated seconds; returns the digest of where it ends."""
    import ligature

    simulation = ligature.Simulation(ligature.load(root / SCENE), update=5e-3)
    needle = simulation.bodies["BODY Needle"]
    start = needle.pose.copy()
    simulation.step(200)  # what is compiled or built at first is not counted
    for k in range(TICKS // TICKS_PER_STEP):
        goal = start.copy()
        goal[:3] += 0.02 * k / (TICKS // TICKS_PER_STEP), 0.0, 0.01 * (k % 50) / 50
        turn()
        needle.command_pose(goal.tolist())
        simulation.step(TICKS_PER_STEP)
    turn()
    return hashlib.sha256(poses(simulation)).hexdigest()


def demonstration(root: Path, turn: Turn) -> str:
    """One throw by the example of the revision; returns the digest of poses after every hundredth step."""
    from ligature.simulation import Simulation

    digest, calls, step = hashlib.sha256(), 0, Simulation.step

    def watched(simulation: Any, ticks: int = 1) -> None:
        nonlocal calls
        if calls % STEPS_PER_SPAN == 0:
            turn()
        step(simulation, ticks)
        calls += 1
        if calls % STEPS_PER_SPAN == 0:
            digest.update(poses(simulation))

    Simulation.step = watched
    sys.argv = ["suture.py", "--throws", "1", "--seed", "0", "--out", tempfile.mkdtemp()]
    sys.path.insert(0, str(root / "examples"))
    try:
        runpy.run_path(str(root / "examples" / "suture.py"), run_name="__main__")
    except SystemExit as end:
        if end.code:
            raise
    turn()
    return digest.hexdigest()


WORK = {"scene": scene, "demonstration": demonstration}


def work_in_turns(name: str, root: Path) -> None:
    """Do one work, a span for each line of the input; answer each with its seconds, and the last with the digest."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what the work prints is no answer
    begin = None

    def turn() -> None:
        nonlocal begin
        if begin is not None:
            answer(time.process_time() - begin)
        sys.stdin.readline()
        begin = time.process_time()

    def answer(what: float | str) -> None:
        answers.write(json.dumps(what) + "\n")
        answers.flush()

    answer(WORK[name](root, turn))


class Worker:
    """A process that does one work at a revision, span by span."""

    def __init__(self, name: str, root: Path) -> None:
        environment = {**os.environ, "PYTHONPATH": f"{root / 'simulator'}:{PROJECT}"}
        words = [sys.executable, str(HERE), "--child", name, str(root)]
        self._process = subprocess.Popen(
            words, cwd=root, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def span(self) -> float | str:
        """Do the next span; returns its seconds, or the digest when the work is done."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        answered = self._process.stdout.readline()
        if not answered:
            raise RuntimeError(f"{' '.join(map(str, self._process.args))} ended with status {self._process.wait()}")
        found: float | str = json.loads(answered)
        return found

    def end(self) -> None:
        """Wait for the process."""
        self._process.communicate()


class Round(NamedTuple):
    """The work done once by two revisions."""

    seconds: list[tuple[float, float]]
    """Of each span, by the processor."""
    digests: tuple[str, str]


def run(name: str, before: Path, after: Path) -> Round:
    """Do one work at two revisions, in turns."""
    workers = Worker(name, before), Worker(name, after)
    seconds: list[tuple[float, float]] = []
    while True:
        order = (0, 1) if len(seconds) % 2 else (1, 0)
        spans = {k: workers[k].span() for k in order}
        if isinstance(spans[0], str) or isinstance(spans[1], str):
            break
        seconds.append((spans[0], spans[1]))
    for k, worker in enumerate(workers):
        while not isinstance(spans[k], str):  # other bits take another time
            spans[k] = worker.span()
        worker.end()
    return Round(seconds, (str(spans[0]), str(spans[1])))


def compare(name: str, before: Path, after: Path, rounds: int) -> None:
    """Print what one work says of both."""
    run(name, before, after)  # compiles
    done = [run(name, before, after) for _ in range(rounds)]
    ratios = [second / first for one in done for first, second in one.seconds]
    low, median, high = statistics.quantiles(ratios)
    same = "the same bits" if len({digest for one in done for digest in one.digests}) == 1 else "OTHER BITS"
    sys.stdout.write(
        f"{name}: {same}; time after/before {median:.3f} (median of {len(ratios)} pairs of spans, of which the middle "
        f"half {low:.3f} to {high:.3f})\n"
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
        work_in_turns(asked.child[0], Path(asked.child[1]))
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
