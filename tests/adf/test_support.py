"""The support table in the documentation is the one of the schema."""

from __future__ import annotations

from pathlib import Path

from ligature.adf.schema import SCHEMA
from ligature.adf.support import support_table

PAGE = Path(__file__).resolve().parents[2] / "docs" / "adf.md"


def test_the_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == support_table(), "write it again with `make docs`"


def test_no_key_stands_twice() -> None:
    for kind, keys in SCHEMA.items():
        paths = [key.path for key in keys]
        assert len(paths) == len(set(paths)), kind
