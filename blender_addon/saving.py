"""Writes what an export has prepared: all files or none, and no file of somebody else unless that is allowed."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from .export_checks import ExportError
from .ligature.authoring.save import SaveError, foreign, save_all


@dataclass
class Export:
    """What an export writes, and what it noticed.

    Attributes
    ----------
    files
        All files with their content, also those that have it already.
    roots
        Folders outside which nothing is written.
    notes
        What the user should know before anything is written.
    own
        Digests of the files that are this export's own, by path.
    """

    files: dict[Path, bytes] = field(default_factory=dict)
    roots: tuple[Path, ...] = ()
    text: str = ""
    notes: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    own: dict[str, str] = field(default_factory=dict)
    written: list[Path] = field(default_factory=list)

    @cached_property
    def foreign(self) -> list[Path]:
        """Existing files that would be replaced and that are not this export's own."""
        return foreign(self.files, self.own)


class ForeignFiles(ExportError):
    """An export that would replace files that are not its own; nothing was written."""

    def __init__(self, files: list[Path]) -> None:
        listed = ", ".join(f"'{file}'" for file in files[:8]) + (
            f" and {len(files) - 8} more" if len(files) > 8 else ""
        )
        super().__init__(
            f"{listed} would be replaced, and the scene neither was opened from there nor wrote that; allow it with "
            "'Replace Files', or choose an empty folder"
        )
        self.files = files


def write(done: Export, replace: bool = False) -> None:
    """Write what was prepared, all of it or nothing; raises `ExportError`."""
    if done.foreign and not replace:
        raise ForeignFiles(done.foreign)
    try:
        done.written = save_all(done.files, done.roots)
    except SaveError as error:
        raise ExportError(str(error)) from error
