"""Campaigns over seeds: rows in a file of JSON lines, so that a long one can be broken off and taken up again."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import ligature

Row = dict[str, Any]
"""What is kept of one seed."""


def read(file: Path, *keys: str) -> dict[tuple[Any, ...], Row]:
    """The newest row for each value of ``keys``."""
    rows = map(json.loads, file.read_text(encoding="utf-8").splitlines() if file.exists() else ())
    return {tuple(row[key] for key in keys): row for row in rows}


def keep(file: Path, row: Row) -> None:
    """Add a row."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("a", encoding="utf-8") as kept:
        kept.write(json.dumps(row) + "\n")


def authored(texts: dict[str, str], folder: Path, scenes: Path) -> ligature.Scene:
    """The scene of an authoring script's ``texts``, written to ``folder`` beside which its neighbours in ``scenes`` lie."""
    for name, text in texts.items():
        (folder / name).write_text(text.replace(" ../", f" {scenes}/"), encoding="utf-8")
    return ligature.load(folder / "launch.yaml", roots=[scenes])


def arguments(description: str) -> argparse.ArgumentParser:
    """The options that all campaigns have."""
    found = argparse.ArgumentParser(description=description)
    found.add_argument("count", type=int, nargs="?", default=100)
    found.add_argument("start", type=int, nargs="?", default=0)
    found.add_argument("--into", type=Path)
    found.add_argument("--table", action="store_true", help="only print the table of what is there")
    return found


def go_on(
    given: argparse.Namespace, into: Path, attempt: Callable[[int], Row], table: Callable[[list[Row]], Iterator[str]],
    report: Callable[[Row], str] = json.dumps, **which: Any,
) -> int:  # fmt: skip
    """Run the seeds that ``into`` lacks, and print a line a seed and the table of all rows.

    A row belongs to a seed and to the values of ``which``, the keys that distinguish campaigns in one file. With an
    option ``again``, seeds that failed run once more. Returns the exit status.
    """
    into, keys = given.into or into, (*which, "seed")
    for seed in () if given.table else range(given.start, given.start + given.count):
        before = read(into, *keys).get((*which.values(), seed))
        if before is not None and (before["success"] or not getattr(given, "again", False)):
            continue
        row = attempt(seed)
        keep(into, row)
        sys.stdout.write(report(row) + "\n")
        sys.stdout.flush()
    sys.stdout.write("\n".join(table(list(read(into, *keys).values()))) + "\n")
    return 0
