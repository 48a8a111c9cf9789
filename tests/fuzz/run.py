"""Runs mutants in worker processes: ``python -m tests.fuzz.run --mutants 100000 --jobs 2``.

A mutant must end, within a time limit, accepted or with findings that name their place. Any other
exception, a hang or a crash of the process is a failure; its file is kept in ``build/fuzz``. Mutant
N is the same in every run, so that ``--first N --mutants 1`` repeats it.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from tests.fuzz.mutate import mutate
from tests.fuzz.seeds import Seed, seeds, write_scene

LIMIT = 10.0
"""Seconds for one mutant; the slowest valid seed takes 0.3."""

START_LIMIT = 120.0
"""Seconds in which a worker must be ready, its compiled code loaded."""

CHUNK = 1000
"""Mutants that a worker is given at a time."""

MEMORY = 8 << 30
"""Bytes of address space of a worker."""

KEPT = Path(__file__).resolve().parents[2] / "build" / "fuzz"

Attempt = Callable[[Seed, Path, int], str]


@dataclass
class Outcome:
    """How the mutants ended, by kind of file and verdict, and what should not have happened."""

    ended: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)

    def total(self, verdict: str) -> int:
        """Number of mutants of all kinds that ended as ``verdict``."""
        return sum(count for key, count in self.ended.items() if key.endswith(" " + verdict))


def mutant(number: int) -> tuple[Seed, bytes]:
    """The seed and the content of a mutant."""
    files = seeds()
    seed = files[number % len(files)]
    return seed, mutate(seed.data, random.Random(number), seed.binary, seed.yaml)


def work(connection: Connection, folder: str, attempt: Attempt | None) -> None:
    """Run the mutants of each received range; tells the number of each before it starts, then how it ended."""
    os.environ["LIGATURE_CACHE"] = os.path.join(folder, "cache")
    if attempt is None:
        from tests.fuzz.attempt import attempt
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    scene = Path(folder, "scene")
    scene.mkdir(exist_ok=True)
    write_scene(scene)
    connection.send(("ready", 0, ""))
    while True:
        first, end = connection.recv()
        for number in range(first, end):
            connection.send(("begin", number, ""))
            seed, data = mutant(number)
            (scene / seed.name).write_bytes(data)
            try:
                verdict = attempt(seed, scene, number)
            except Exception as error:
                verdict = f"failure: {type(error).__name__}: {str(error)[:300]}"
            (scene / seed.name).write_bytes(seed.data)
            connection.send(("end", number, verdict))
        connection.send(("ready", 0, ""))


class _Worker:
    """A worker process as its parent sees it."""

    def __init__(self, folder: Path, attempt: Attempt | None) -> None:
        context = multiprocessing.get_context("spawn")
        folder.mkdir(exist_ok=True)
        self.connection, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(target=work, args=(theirs, str(folder), attempt), daemon=True)
        self.process.start()
        theirs.close()
        self.number: int | None = None
        self.range = (0, 0)
        self.since = time.monotonic()

    def overdue(self, limit: float) -> bool:
        """Whether the worker has been silent for too long."""
        return time.monotonic() - self.since > (START_LIMIT if self.number is None else limit)

    def stop(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.join()
        self.connection.close()


def run(mutants: int, first: int = 0, jobs: int = 1, attempt: Attempt | None = None, limit: float = LIMIT) -> Outcome:
    """Run ``mutants`` mutants from number ``first`` on in ``jobs`` processes.

    ``attempt`` says what a mutant goes through; it must be importable; None stands for
    `tests.fuzz.attempt.attempt`, which only the workers import.
    """
    outcome = Outcome()
    todo = [(a, min(a + CHUNK, first + mutants)) for a in range(first, first + mutants, CHUNK)][::-1]
    with tempfile.TemporaryDirectory(prefix="ligature-fuzz-") as folder:
        count = min(jobs, len(todo))
        workers = {slot: _Worker(Path(folder, str(slot)), attempt) for slot in range(count)}
        while workers:
            wait([worker.connection for worker in workers.values()], timeout=0.2)
            for slot, worker in list(workers.items()):
                reason = _listen(worker, todo, outcome, limit)
                if reason == "idle":
                    worker.stop()
                    del workers[slot]
                elif reason:
                    worker.stop()
                    _fail(worker, reason, todo, outcome)
                    workers[slot] = _Worker(Path(folder, str(slot)), attempt)
    return outcome


def _listen(worker: _Worker, todo: list[tuple[int, int]], outcome: Outcome, limit: float) -> str:
    """Take what a worker says; returns why it must be stopped, or nothing."""
    try:
        while worker.connection.poll():
            what, number, verdict = worker.connection.recv()
            worker.since = time.monotonic()
            if what == "begin":
                worker.number = number
            elif what == "end":
                _count(number, verdict, outcome)
            elif todo:
                worker.range = todo.pop()
                worker.connection.send(worker.range)
            else:
                return "idle"
    except (EOFError, OSError):
        worker.process.join(timeout=5.0)
        return f"crash (status {worker.process.exitcode})"
    return f"hang (more than {limit:g} s)" if worker.overdue(limit) else ""


def _count(number: int, verdict: str, outcome: Outcome) -> None:
    seed, data = mutant(number)
    outcome.ended[f"{Path(seed.name).suffix[1:]} {verdict.split(':')[0]}"] += 1
    if verdict.startswith("failure"):
        _keep(number, seed, data, verdict, outcome)


def _fail(worker: _Worker, reason: str, todo: list[tuple[int, int]], outcome: Outcome) -> None:
    """Note that a worker was lost, and put back what it had not begun."""
    if worker.number is None:
        raise RuntimeError(f"a worker did not start: {reason}")
    seed, data = mutant(worker.number)
    outcome.ended[f"{Path(seed.name).suffix[1:]} failure"] += 1
    _keep(worker.number, seed, data, reason, outcome)
    if worker.number + 1 < worker.range[1]:
        todo.append((worker.number + 1, worker.range[1]))


def _keep(number: int, seed: Seed, data: bytes, reason: str, outcome: Outcome) -> None:
    KEPT.mkdir(parents=True, exist_ok=True)
    (KEPT / f"{number}-{seed.name}").write_bytes(data)
    outcome.failures.append(f"mutant {number} of {seed.name}: {reason}")


def main() -> int:
    """Entry point."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--mutants", type=int, default=100_000)
    flags.add_argument("--first", type=int, default=0, help="number of the first mutant")
    flags.add_argument("--jobs", type=int, default=2, help="worker processes")
    given = flags.parse_args()
    begin = time.monotonic()
    outcome = run(given.mutants, given.first, given.jobs)
    for failure in outcome.failures[:50]:
        sys.stdout.write(f"{failure}\n")
    ended = ", ".join(f"{key} {count}" for key, count in sorted(outcome.ended.items()))
    seconds = time.monotonic() - begin
    sys.stdout.write(f"{given.mutants} mutants in {seconds:.0f} s: {ended}; {len(outcome.failures)} failures\n")
    return int(bool(outcome.failures))


if __name__ == "__main__":
    sys.exit(main())
