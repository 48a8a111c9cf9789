"""What docstrings, comments and pages cite can be found by a reader: no section of a document that is not public."""

from __future__ import annotations

import re

import pytest

from tests.conftest import ROOT

FOLDERS = ("simulator", "blender_addon", "docs", "examples", "launch", "scenes", "tests")
PRIVATE = re.compile(
    r"interface reference|ADF specification|\b(?:ADF|DESIGN|specification) §|\(§|[,;] §|of §|by §", re.I
)
"""References to notes of the developers, and sections without a document."""

PUBLIC = re.compile(
    r"(?:(?:GLSL 1\.20|OpenGL 2\.1) \(?|(?:\d{4}\)?|Collision Detection), )§[\d.]+(?:(?:,| and) §[\d.]+)*"
)
"""Sections of standards, and of books that a title or a year names."""


def private_references(text: str) -> list[str]:
    """What a text cites that a reader cannot find."""
    return PRIVATE.findall(PUBLIC.sub("", re.sub(r"\s+", " ", text)))


def test_no_text_cites_a_document_that_is_not_public() -> None:
    paths = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*")) if path.suffix in (".py", ".md")]
    assert len(paths) > 1000
    citing = {path.relative_to(ROOT).as_posix() for path in paths if private_references(path.read_text("utf-8"))}
    assert citing == {"tests/docs/test_sources.py"}


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("Poses (7,) are rows (ADF\n    specification §1.5).", 1),
        ("a joint's frames (§15.2)", 1),
        ("joint type, §14", 1),
        ("Tables: interface reference §6.2.", 1),
        ("state of GLSL 1.20 (§7.4, §7.5) is", 0),
        ("Ericson, Real-Time Collision Detection (2005), section 5.1.9", 0),
    ],
)
def test_private_references_are_found(text: str, found: int) -> None:
    assert len(private_references(text)) == found
