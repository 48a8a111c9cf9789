"""The messages that the page of questions quotes are messages of the code."""

from __future__ import annotations

import re

import pytest

from tests.conftest import ROOT

PAGE = (ROOT / "docs" / "questions.md").read_text("utf-8").partition("## Troubleshooting")[2]
QUOTED = [
    quote for row in re.findall(r"^\| ([^|]+) \|", PAGE, re.MULTILINE)[2:] for quote in re.findall(r"`([^`]+)`", row)
    if " " in quote
]  # fmt: skip
"""Quotations in the first column of the table; single words are names of keys and topics."""


def test_the_page_quotes_messages() -> None:
    assert len(QUOTED) >= 9


@pytest.mark.parametrize("quote", QUOTED)
def test_a_quoted_message_is_in_the_code(quote: str) -> None:
    files = (ROOT / "simulator" / "ligature").rglob("*.py")
    assert any(quote in path.read_text("utf-8") for path in files), quote
