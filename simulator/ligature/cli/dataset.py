"""``ligature dataset``: what is in a dataset, one file of an interrupted one, and the formats of LeRobot.

Where an episode cannot be read, the others can.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from ligature.cli.numbers import counted
from ligature.datasets.probe import probe
from ligature.datasets.quality import EXACT, not_finite, pace
from ligature.datasets.store import DatasetError, damaged, episode_names, invalid, join, opened


def info(file: Path, console: Console) -> int:
    """Print the episodes of a dataset; the exit status is 1 where it, or one of them, cannot be read."""

    def report(bad: dict[str, str]) -> None:
        with opened(file, bad) as found:
            attributes, names = found.attrs, episode_names(found, bad)
            closed = "" if attributes.get("closed", True) else "; 'ligature dataset join' makes one file of it"
            write(f"{attributes['format']} of Ligature {attributes['version']}, scene {attributes['scene']}{closed}")
            arms = ", ".join(found.get("arms", ()))
            write(f"{counted(len(names), 'episode')} at {attributes['rate']:g} samples a second, arms {arms}")
            for name in names:
                write(f"{name}: {_episode(found[name], attributes)}")
        if bad:
            raise DatasetError(invalid(file, bad))

    write = _printer(console)
    return _reported(report, file, console)


def _episode(episode: Any, of_all: Any) -> str:
    attributes, phases = episode.attrs, list(map(str, of_all["phases"]))
    outcome = "success" if attributes["success"] else "failure"
    labels, counts = np.unique(episode["phase"][:], return_counts=True)
    shares = ", ".join(f"{phases[k] or 'none'} {n}" for k, n in zip(labels, counts, strict=True))
    judged = outcome if attributes.get("judged", True) else "not judged"
    length = f"{attributes['samples']} samples, {judged}"
    return "; ".join([length, shares, *_remarkable(episode, float(of_all["rate"]))])


def _remarkable(episode: Any, rate: float) -> Iterator[str]:
    """How far the times of an episode are off its rate, and numbers that are none."""
    found = pace(episode["time"][:], rate)
    if not found.holds:
        yield f"its times are {found.measured:.4g} samples a second, not {rate:g}"
    elif found.off > EXACT:
        yield f"up to {1e3 * found.off:.3g} ms off the rate"
    if fault := not_finite(episode):
        yield fault


def join_episodes(file: Path, console: Console) -> int:
    """Make one file of a dataset whose writer was killed."""

    def run(bad: dict[str, str]) -> None:
        _printer(console)(f"{file}: {counted(join(file, bad), 'episode')} in one file")
        if bad:
            raise DatasetError(f"{invalid(file, bad)}; they stay where they are")

    return _reported(run, file, console)


def export(source: Path, target: Path, format: str, codec: str, license: str, console: Console) -> int:
    """Write a dataset in one of LeRobot's formats; the exit status is 1 when that is not possible."""

    def write(bad: dict[str, str]) -> None:
        from ligature.datasets.lerobot import export as run_export

        begin = time.perf_counter()
        run_export(source, target, format, codec, license, _printer(console), bad)
        size = sum(path.stat().st_size for path in target.rglob("*") if path.is_file())
        seconds = time.perf_counter() - begin
        _printer(console)(
            f"{target}: {format}, {size / 1e6:.1f} MB in {seconds:.1f} s ({source.stat().st_size / 1e6:.1f} MB before)"
        )

    return _reported(write, source, console)


def _printer(console: Console) -> Callable[[str], None]:
    return lambda text: console.print(text, markup=False)


def _reported(work: Callable[[dict[str, str]], None], file: Path, console: Console) -> int:
    """The exit status of ``work``, which takes the episodes that cannot be read, with the reasons."""
    try:
        bad = probe(file)
        with damaged(file):
            work(bad)
    except (DatasetError, ValueError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    return 0
