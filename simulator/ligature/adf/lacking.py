"""Explains why a path is not a readable file, and what would be right."""

from __future__ import annotations

import difflib
import errno
import os
import re
import stat
from pathlib import Path, PureWindowsPath
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:/")
MOST_NAMES = 10_000
"""Most files of a folder among which one of another case is looked for."""


ALIKE = 0.8
"""How alike a name must be to be meant, of 1."""


class Lack(NamedTuple):
    """What is wrong with a path, as the end of a sentence, and a hint, which may be empty."""

    fault: str
    hint: str


def lack_of(path: Path) -> Lack | None:
    """What keeps ``path`` from being read as a file; None for one that can be."""
    try:
        mode = os.stat(path).st_mode
    except OSError as error:
        return _unfound(path, error)
    if stat.S_ISDIR(mode):
        return Lack("is a folder", "give the path of a file in it")
    if not stat.S_ISREG(mode):
        return Lack("is not a regular file", "give the path of a file")
    if not os.access(path, os.R_OK, effective_ids=True):
        return Lack("cannot be read: permission denied", "let your user read it")
    return None


def instead_of_url(url: str) -> str:
    """What to write instead of ``url`` in a scene file."""
    parts = urlsplit(url)
    if parts.scheme == "file":
        return f"give the path itself: '{unquote(parts.path)}'"
    if parts.scheme in ("package", "model"):
        return "give the path from the folder of this file: packages are not looked up"
    return "give the path of a file"


def _unfound(path: Path, error: OSError) -> Lack:
    """The fault and the hint for a ``path`` whose lookup failed with ``error``."""
    if error.errno == errno.ELOOP:
        return Lack("is a link in a circle", "let it lead to a file")
    if error.errno not in (errno.ENOENT, errno.ENOTDIR):
        return Lack(f"cannot be read: {(error.strerror or str(error)).lower()}", "let your user read its folder")
    if os.path.islink(path):
        return Lack("is a link that leads to no file", "mend the link, or give the file itself")
    return Lack("does not exist", _spelling(path))


def _spelling(path: Path) -> str:
    """The right spelling of what is missing of ``path``: of another system, in another case, or nearly so; or empty."""
    there = path.parent
    while not there.is_dir() and there != there.parent:
        there = there.parent
    reference = str(path.relative_to(there))
    if _URL.match(reference):
        return instead_of_url(reference)
    windows = PureWindowsPath(reference)
    if windows.drive:
        return f"'{windows.drive}' is a drive of Windows: give the path from the folder of this file"
    if "\\" in reference:
        return f"write '{windows.as_posix()}', with '/' between folders"
    if reference.startswith("~"):
        return "'~' is not expanded here: write the path of your home folder"
    wanted = path.relative_to(there).parts[0].casefold()
    try:
        with os.scandir(there) as names:
            same = [entry.name for entry, _ in zip(names, range(MOST_NAMES), strict=False)]
    except OSError:
        return ""
    found = sorted(name for name in same if name.casefold() == wanted)
    if found:
        return f"upper and lower case differ; the folder has '{there / found[0]}'"
    alike = difflib.get_close_matches(path.relative_to(there).parts[0], sorted(same), 1, ALIKE)
    return f"did you mean '{there / alike[0]}'?" if alike else ""
