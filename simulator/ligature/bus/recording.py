"""The command that begins and ends a recording during a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ligature.model.messages import Message, Text, wire

SUFFIX = ".record"
MOST_BYTES = 150
"""Of a name: with what is put after it, file systems take it."""


@dataclass(frozen=True)
class Recording(Message, code=11):
    """Record what happens from now on as the file ``name`` in the folder of recordings; an empty name ends it."""

    name: str = wire(Text())

    def check_together(self, counts: Mapping[str, int] | None) -> None:  # noqa: D102
        file_name(self.name)


def file_name(text: str) -> str:
    """The file that a person means by ``text``, a name without folders.

    Raises ValueError with the allowed names.
    """
    name = text.strip()
    if "/" in name or name.startswith(".") or not name.isprintable():
        raise ValueError(f"'{text[:40]}' is not a valid name of a recording; use letters and digits, without folders")
    if len(name.encode()) > MOST_BYTES:
        raise ValueError(f"the name of a recording must have at most {MOST_BYTES} bytes, not {len(name.encode())}")
    return name if not name or name.endswith(SUFFIX) else name + SUFFIX
