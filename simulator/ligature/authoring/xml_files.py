"""XML files of strangers, looked at before a library reads them: well formed, of sane size, without entities."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

from ligature.paths import open_file

MOST_BYTES = 1 << 26
MOST_ELEMENTS, MOST_LEVELS = 1_000_000, 100
"""Bounds of a file; the largest robots have some 10 000 elements, nested ten deep."""


class XmlError(ValueError):
    """A file that is not read; the message gives place and reason."""


def check_xml(path: Path) -> None:
    """Raise `XmlError` for an ill-formed or a too large file, and for one that declares entities.

    Entities multiply (a few lines become gigabytes) or fetch other files; no robot needs them.
    """
    if path.stat().st_size > MOST_BYTES:
        raise XmlError(f"{path}: error: has more than {MOST_BYTES >> 20} MiB")
    parser = expat.ParserCreate()
    elements = levels = 0

    def refuse(why: str) -> NoReturn:
        raise XmlError(f"{path}:{parser.CurrentLineNumber}:{parser.CurrentColumnNumber + 1}: error: {why}")

    def declared(*_: Any) -> None:
        refuse("declares a document type; write the values out, without entities")

    def begins(name: str, _: Any) -> None:
        nonlocal elements, levels
        elements, levels = elements + 1, levels + 1
        if elements > MOST_ELEMENTS:
            refuse(f"has more than {MOST_ELEMENTS} elements")
        if levels > MOST_LEVELS:
            refuse(f"'{name[:40]}' is nested in more than {MOST_LEVELS} elements")

    def ends(_: str) -> None:
        nonlocal levels
        levels -= 1

    parser.StartDoctypeDeclHandler = declared
    parser.StartElementHandler, parser.EndElementHandler = begins, ends
    try:
        with open_file(path) as file:
            parser.Parse(file.read(), True)
    except expat.ExpatError as error:
        why = expat.errors.messages[error.code]
        raise XmlError(f"{path}:{error.lineno}:{error.offset + 1}: error: not well-formed XML: {why}") from None
    except (ValueError, LookupError) as error:
        if isinstance(error, XmlError):
            raise
        raise XmlError(f"{path}: error: {error}") from None
