"""Blocks of shared memory that killed runs left behind: files named by the process id of their supervisor."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

FOLDER = Path("/dev/shm")
_NAME = re.compile(r"ligature-(\d+)-[0-9a-f]+\Z")


def remove(name: str) -> None:
    """Remove the block ``name``, should its owner have died without doing so."""
    with suppress(OSError):  # such as a folder that cannot be written: then it was never made
        (FOLDER / name).unlink(missing_ok=True)


def remove_leftovers() -> list[str]:
    """Remove blocks of this user whose supervisor no longer lives; returns their names."""
    removed = []
    for path in FOLDER.glob("ligature-*"):
        match = _NAME.match(path.name)
        if match and not Path(f"/proc/{match.group(1)}").exists():
            with suppress(OSError):
                path.unlink()
                removed.append(path.name)
    return removed
