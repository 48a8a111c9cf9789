"""Makes the demonstration's suture from many places of the needle, and keeps how each went.

    python -m tests.bench.demo_seeds [N] [START] [--throws T] [--into FILE] [--again] [--table]

Runs N seeds from START on, without a film, and adds a line of JSON a seed to FILE (default `build/demo_seeds.jsonl`).
Seeds that FILE has for the same number of throws are passed over, so that a long run can be broken off and taken up
again; ``--again`` runs those that failed once more. Ends with the table of FILE in Markdown; ``--table`` does only that.
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import ligature

from tests.bench.campaign import Row, arguments, go_on

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples"))
import suture  # noqa: E402


def attempt(seed: int, throws: int) -> Row:
    """One suture in a world of its own, and what came of it: seconds, millimetres, newtons."""
    simulation = ligature.Simulation(ligature.load(suture.SCENE))
    suture.scatter(simulation, seed)
    started = time.perf_counter()
    score, measures, stopped = suture.operate(simulation, throws)
    took = time.perf_counter() - started
    return {
        "seed": seed,
        "throws": throws,
        "success": score.success and not stopped,
        "why": stopped or score.why,
        "simulated": round(simulation.time, 3),
        "took": round(took, 1),
        "load": round(os.getloadavg()[0], 1),
        "miss": round(1e3 * max(score.misses, default=0.0), 3),
        "tissue": round(measures.tissue_force, 3),
        "tension": round(measures.thread_tension, 3),
        "drops": measures.drops,
        "state": simulation.state_hash()[:16],
    }


def reported(row: Row) -> str:
    """One line about one seed."""
    end = f"sutured, holes missed by {row['miss']:.2f} mm at worst" if row["success"] else f"FAILED: {row['why']}"
    pace = row["simulated"] / row["took"]
    return f"seed {row['seed']}: {end}; {row['simulated']:.1f} s, {pace:.2f} times real time at load {row['load']}"


def seeds_of(numbers: list[int]) -> str:
    """Seeds as ranges: 0–6, 9."""
    parts: list[list[int]] = []
    for n in sorted(numbers):
        if parts and n == parts[-1][-1] + 1:
            parts[-1].append(n)
        else:
            parts.append([n])
    return ", ".join(str(p[0]) if len(p) == 1 else f"{p[0]}–{p[-1]}" for p in parts)


def table(rows: list[Row]) -> Iterator[str]:
    """Markdown: a line for each number of throws."""
    yield "| throws | seeds | sutured | simulated, s | times real time (load) | hole missed, mm | tissue, N | thread, N |"
    yield "|---|---|---|---|---|---|---|---|"
    for throws in sorted({row["throws"] for row in rows}):
        ran = [row for row in rows if row["throws"] == throws]
        good = [row for row in ran if row["success"]]
        if not good:
            yield f"| {throws} | {seeds_of([row['seed'] for row in ran])} | 0 of {len(ran)} | | | | | |"
            continue
        pace = statistics.median(row["simulated"] / row["took"] for row in good)
        load = statistics.median(row["load"] for row in good)
        simulated = statistics.median(row["simulated"] for row in good)
        miss, tissue, tension = (
            f"{statistics.median(row[key] for row in good):.2f}, {max(row[key] for row in good):.2f} at worst"
            for key in ("miss", "tissue", "tension")
        )
        yield (
            f"| {throws} | {seeds_of([row['seed'] for row in ran])} | {len(good)} of {len(ran)} "
            f"| {simulated:.1f} | {pace:.2f} ({load:.1f}) | {miss} | {tissue} | {tension} |"
        )
    for row in rows:
        if not row["success"]:
            yield f"\n{row['throws']} throws, seed {row['seed']}: {row['why']}"


def main() -> int:
    """Entry point."""
    options = arguments("Sutures from many places of the needle.")
    options.add_argument("--throws", type=int, default=2)
    options.add_argument("--again", action="store_true", help="run seeds that failed once more")
    given = options.parse_args()
    into, throws = ROOT / "build" / "demo_seeds.jsonl", given.throws
    return go_on(given, into, lambda seed: attempt(seed, throws), table, reported, throws=throws)


if __name__ == "__main__":
    sys.exit(main())
