"""Runs mutants in worker processes: ``python -m tests.fuzz.run --mutants 100000``.

A mutant must end, within a time limit, as a success or as a finding with its place. Any other
exception, a hang or a crash of the process is a failure; its file is kept.
"""

from __future__ import annotations

import argparse
import multiprocessing
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.fuzz.mutate import mutate
from tests.fuzz.seeds import MTL, seeds

LIMIT = 10.0
"""Seconds for one mutant; the slowest valid seed takes 0.1."""

BATCH = 500


def attempt(name: str, data: bytes, folder: Path) -> str:
    """Load one mutant; returns how it ended. Raises what no user should ever see."""
    import ligature
    from ligature.adf import AdfError, Resolver, read_any
    from ligature.mesh import collision_parts, load_mesh

    (folder / "part.mtl").write_text(MTL)
    path = folder / name
    path.write_bytes(data)
    try:
        if name.endswith(".yaml"):
            read_any(path, Resolver([folder]))
            ligature.load(path, roots=[folder])
        else:
            mesh = load_mesh(folder / "part.obj" if name == "part.mtl" else path, Resolver([folder]))
            collision_parts(mesh, "hull")
            collision_parts(mesh, "trimesh")
    except AdfError as error:
        assert error.diagnostics and all(d.message for d in error.diagnostics)
        return "finding"
    return "success"


def work(seed: int, count: int, folder: str, queue: multiprocessing.Queue[tuple[str, int, str]]) -> None:
    """Run mutants ``seed`` … ``seed + count``; tells each before it starts and how it ended."""
    base, files = Path(folder), seeds()
    (base / "part.obj").write_bytes(dict(files)["part.obj"])
    for number in range(seed, seed + count):
        rng = random.Random(number)
        name, original = files[number % len(files)]
        queue.put(("begin", number, name))
        try:
            queue.put((attempt(name, mutate(original, rng), base), number, name))
        except Exception as error:
            queue.put((f"failure: {type(error).__name__}: {error}", number, name))
    queue.put(("done", seed, ""))


def run(mutants: int, first: int = 0) -> tuple[Counter[str], list[str]]:
    """Run ``mutants`` mutants; returns how they ended, and the failures."""
    ended: Counter[str] = Counter()
    failures: list[str] = []
    context = multiprocessing.get_context("spawn")
    number, end = first, first + mutants
    with tempfile.TemporaryDirectory() as folder:
        while number < end:
            queue: multiprocessing.Queue[tuple[str, int, str]] = context.Queue()
            process = context.Process(target=work, args=(number, min(BATCH * 20, end - number), folder, queue))
            process.start()
            number = _watch(process, queue, number, ended, failures)
            process.kill()
            process.join()
    return ended, failures


def _watch(
    process: multiprocessing.process.BaseProcess,
    queue: multiprocessing.Queue[tuple[str, int, str]],
    number: int,
    ended: Counter[str],
    failures: list[str],
) -> int:
    """Collect results of one worker; returns the number of the next mutant."""
    current, since = (number, ""), time.monotonic() + 60.0
    while True:
        try:
            what, index, name = queue.get(timeout=0.5)
        except Exception:
            if not process.is_alive() or time.monotonic() - since > LIMIT:
                kind = "hang" if process.is_alive() else f"crash (status {process.exitcode})"
                failures.append(f"mutant {current[0]} of {current[1]}: {kind}")
                return current[0] + 1
            continue
        if what == "begin":
            current, since = (index, name), time.monotonic()
        elif what == "done":
            return current[0] + 1
        else:
            ended[what.split(":")[0]] += 1
            if what.startswith("failure"):
                failures.append(f"mutant {index} of {name}: {what}")


def main() -> int:
    """Entry point."""
    flags = argparse.ArgumentParser(description=__doc__)
    flags.add_argument("--mutants", type=int, default=100_000)
    flags.add_argument("--first", type=int, default=0)
    given = flags.parse_args()
    begin = time.monotonic()
    ended, failures = run(given.mutants, given.first)
    for failure in failures[:50]:
        sys.stdout.write(f"{failure}\n")
    sys.stdout.write(
        f"{given.mutants} mutants in {time.monotonic() - begin:.0f} s: {dict(ended)}, {len(failures)} failures\n"
    )
    return int(bool(failures))


if __name__ == "__main__":
    sys.exit(main())
