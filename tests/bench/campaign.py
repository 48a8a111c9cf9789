"""Rows of a campaign over seeds in a file of JSON lines, so that a long one can be broken off and taken up again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

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
