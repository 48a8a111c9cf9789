"""Runs mutants, or generated scenes, in worker processes: ``python -m tests.fuzz.run --mutants 100000 --jobs 2``.

A mutant must end, within a time limit, accepted or with findings that name their place; a scene, with
``--scenes 10000``, must run a second as `tests.fuzz.simulate` states; a needle, with ``--paths 200``, must get through
tissue as `tests.fuzz.paths` states. Any other exception, a hang or a crash of the
process is a failure; its files are kept in ``build/fuzz``. Mutant and scene N are the same in every run, so that
``--first N --mutants 1`` repeats one.
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

from tests.fuzz import readers
from tests.fuzz.mutate import mutate
from tests.fuzz.scenes import scene
from tests.fuzz.seeds import Seed, seeds, write_scene

LIMIT = 10.0
"""Seconds for one mutant; the slowest valid seed takes 0.3."""

START_LIMIT = 120.0
"""Seconds in which a worker must be ready, its compiled code loaded."""

SCENE_LIMIT = 60.0
"""Seconds for one scene; the slowest takes 6, and the first of a worker loads compiled code."""

REPORT_EVERY = 30.0
"""Seconds between two lines of progress."""

CHUNK, SCENE_CHUNK = 1000, 25
"""Mutants, and scenes, that a worker is given at a time."""

MEMORY = 8 << 30
"""Bytes of address space of a worker."""

KEPT = Path(__file__).resolve().parents[2] / "build" / "fuzz"

Attempt = Callable[[Seed, Path, int], str]
Trial = Callable[[Path, int, Attempt | None], str]
"""What case N goes through in a folder of its own; returns its verdict, one word and more after a colon."""


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


def mutant_files(number: int) -> dict[str, bytes]:
    """The file of a mutant by its name."""
    seed, data = mutant(number)
    return {seed.name: data}


def scene_files(number: int) -> dict[str, bytes]:
    """The files of a generated scene by their names."""
    return {name: text.encode() for name, text in scene(number).files.items()}


def _use_own_cache(cache: Path) -> None:
    """Keep what mutants leave apart, but for the machine code of kernels, which takes minutes to compile."""
    from ligature.cache import cache_folder

    if not cache.exists():
        kernels = cache_folder() / "kernels"
        kernels.mkdir(exist_ok=True)
        cache.mkdir()
        (cache / "kernels").symlink_to(kernels)
    os.environ["LIGATURE_CACHE"] = str(cache)


def try_mutant(folder: Path, number: int, attempt: Attempt | None) -> str:
    """Put a mutant in the place of its seed and attempt it."""
    _use_own_cache(folder.parent / "cache")
    if attempt is None:
        from tests.fuzz.attempt import attempt
    if not (folder / "red.png").exists():
        write_scene(folder)
    seed, data = mutant(number)
    (folder / seed.name).write_bytes(data)
    try:
        return attempt(seed, folder, number)
    finally:
        (folder / seed.name).write_bytes(seed.data)


def try_scene(folder: Path, number: int, attempt: Attempt | None) -> str:
    """Simulate a generated scene."""
    from tests.fuzz.simulate import simulate

    return simulate(folder, number)


def path_files(number: int) -> dict[str, bytes]:
    """What a path of a needle through tissue is, in words."""
    from tests.fuzz.paths import drive

    return {"path.txt": f"{drive(number)}\n".encode()}


def try_path(folder: Path, number: int, attempt: Attempt | None) -> str:
    """Drive a needle through tissue."""
    from tests.fuzz.paths import drive, fault_of

    fault = fault_of(drive(number))
    return f"failure: {fault}" if fault else "sound"


@dataclass(frozen=True)
class Campaign:
    """A kind of cases: what they go through, their files, and what they are called in figures and reports."""

    trial: Trial
    files: Callable[[int], dict[str, bytes]]
    noun: str
    group: Callable[[int], str]
    warm: Callable[[Path], object] = os.fspath
    """Loads in a worker what its first cases would wait for; by default nothing."""


MUTANTS = Campaign(try_mutant, mutant_files, "mutant", lambda number: Path(mutant(number)[0].name).suffix[1:])
READERS = Campaign(
    readers.try_reader,
    lambda number: {readers.mutant(number)[0].name: readers.mutant(number)[1]},
    "file",
    lambda number: readers.mutant(number)[0].kind,
    readers.read_seeds,
)
SCENES = Campaign(try_scene, scene_files, "scene", lambda number: "scene")
PATHS = Campaign(try_path, path_files, "path", lambda number: "path")


def work(
    connection: Connection, folder: str, trial: Trial, warm: Callable[[Path], object], attempt: Attempt | None
) -> None:
    """Run the cases of each received range; reports the number of each before it starts, then how it ended."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    place = Path(folder, "scene")
    place.mkdir(exist_ok=True)
    warm(place)
    connection.send(("ready", 0, ""))
    while True:
        first, end = connection.recv()
        for number in range(first, end):
            connection.send(("begin", number, ""))
            try:
                verdict = trial(place, number, attempt)
            except Exception as error:
                verdict = f"failure: {type(error).__name__}: {str(error)[:300]}"
            connection.send(("end", number, verdict))
        connection.send(("ready", 0, ""))


class _Worker:
    """A worker process as its parent sees it."""

    def __init__(self, folder: Path, campaign: Campaign, attempt: Attempt | None) -> None:
        context = multiprocessing.get_context("spawn")
        folder.mkdir(exist_ok=True)
        self.connection, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(
            target=work, args=(theirs, str(folder), campaign.trial, campaign.warm, attempt), daemon=True
        )
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


def run(
    cases: int,
    first: int = 0,
    jobs: int = 1,
    attempt: Attempt | None = None,
    limit: float = LIMIT,
    campaign: Campaign = MUTANTS,
    chunk: int = CHUNK,
    log: Callable[[str], object] = lambda line: None,
) -> Outcome:
    """Run ``cases`` cases of a campaign from number ``first`` on in ``jobs`` processes.

    ``attempt`` is what a mutant goes through; it must be importable; None stands for
    `tests.fuzz.attempt.attempt`, which only the workers import. ``log`` gets each failure as it happens, and
    progress every `REPORT_EVERY` seconds.
    """
    outcome = Outcome()
    begin = reported = time.monotonic()
    known = 0
    todo = [(a, min(a + chunk, first + cases)) for a in range(first, first + cases, chunk)][::-1]
    with tempfile.TemporaryDirectory(prefix="ligature-fuzz-") as folder:
        count = min(jobs, len(todo))
        workers = {slot: _Worker(Path(folder, str(slot)), campaign, attempt) for slot in range(count)}
        while workers:
            wait([worker.connection for worker in workers.values()], timeout=0.2)
            for failure in outcome.failures[known:]:
                log(f"{failure}\n")
            known = len(outcome.failures)
            if time.monotonic() - reported > REPORT_EVERY:
                reported = time.monotonic()
                log(f"{reported - begin:5.0f} s  {sum(outcome.ended.values())} of {cases} {campaign.noun}s\n")
            for slot, worker in list(workers.items()):
                reason = _listen(worker, todo, outcome, limit, campaign)
                if reason == "idle":
                    worker.stop()
                    del workers[slot]
                elif reason:
                    worker.stop()
                    _fail(worker, reason, todo, outcome, campaign)
                    workers[slot] = _Worker(Path(folder, str(slot)), campaign, attempt)
    return outcome


def _listen(worker: _Worker, todo: list[tuple[int, int]], outcome: Outcome, limit: float, campaign: Campaign) -> str:
    """Take what a worker states; returns why it must be stopped, or nothing."""
    try:
        while worker.connection.poll():
            what, number, verdict = worker.connection.recv()
            worker.since = time.monotonic()
            if what == "begin":
                worker.number = number
            elif what == "end":
                _count(number, verdict, outcome, campaign)
            elif todo:
                worker.range = todo.pop()
                worker.connection.send(worker.range)
            else:
                return "idle"
    except (EOFError, OSError):
        worker.process.join(timeout=5.0)
        return f"crash (status {worker.process.exitcode})"
    return f"hang (more than {limit:g} s)" if worker.overdue(limit) else ""


def _count(number: int, verdict: str, outcome: Outcome, campaign: Campaign) -> None:
    outcome.ended[f"{campaign.group(number)} {verdict.split(':')[0]}"] += 1
    if verdict.startswith("failure"):
        _keep(number, verdict, outcome, campaign)


def _fail(worker: _Worker, reason: str, todo: list[tuple[int, int]], outcome: Outcome, campaign: Campaign) -> None:
    """Note that a worker was lost, and put back what it had not begun."""
    if worker.number is None:
        raise RuntimeError(f"a worker did not start: {reason}")
    outcome.ended[f"{campaign.group(worker.number)} failure"] += 1
    _keep(worker.number, reason, outcome, campaign)
    if worker.number + 1 < worker.range[1]:
        todo.append((worker.number + 1, worker.range[1]))


def _keep(number: int, reason: str, outcome: Outcome, campaign: Campaign) -> None:
    KEPT.mkdir(parents=True, exist_ok=True)
    files = campaign.files(number)
    for name, data in files.items():
        (KEPT / f"{number}-{name}").write_bytes(data)
    outcome.failures.append(f"{campaign.noun} {number} of {min(files)}: {reason}")


KINDS = {
    "mutants": (MUTANTS, LIMIT, CHUNK),
    "scenes": (SCENES, SCENE_LIMIT, SCENE_CHUNK),
    "readers": (READERS, LIMIT, CHUNK),
    "paths": (PATHS, SCENE_LIMIT, SCENE_CHUNK),
}
"""Campaigns by their option: seconds for a case, and cases of one process."""


def main() -> int:
    """Entry point."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kind = flags.add_mutually_exclusive_group()
    kind.add_argument("--mutants", type=int, help="mutants of scenes; 100 000 by default")
    kind.add_argument("--scenes", type=int, help="generated scenes, instead of mutants")
    kind.add_argument("--readers", type=int, help="mutants of files that are no scenes, instead of mutants of scenes")
    kind.add_argument("--paths", type=int, help="paths of needles through tissue, instead of mutants")
    flags.add_argument("--first", type=int, default=0, help="number of the first one")
    flags.add_argument("--jobs", type=int, default=2, help="worker processes")
    given = flags.parse_args()
    begin = time.monotonic()
    asked = {name: count for name in KINDS if (count := getattr(given, name)) is not None}
    noun, cases = next(iter(asked.items()), ("mutants", 100_000))
    campaign, limit, chunk = KINDS[noun]
    outcome = run(
        cases, given.first, given.jobs, limit=limit, campaign=campaign, chunk=chunk, log=sys.stderr.write
    )  # fmt: skip
    ended = ", ".join(f"{key} {count}" for key, count in sorted(outcome.ended.items()))
    seconds = time.monotonic() - begin
    sys.stdout.write(f"{cases} {noun} in {seconds:.0f} s: {ended}; {len(outcome.failures)} failures\n")
    return int(bool(outcome.failures))


if __name__ == "__main__":
    sys.exit(main())
