"""Every promise of SECURITY.md names a test that is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from ligature.cockpit.orders import ORDERS

from tests.fuzz.readers import READERS

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "SECURITY.md").read_text("utf-8")
ROWS = [
    line for line in TEXT.partition("## Guarantees")[2].partition("## Fuzzing results")[0].splitlines()
    if line.startswith("| ") and not line.startswith(("| guarantee", "|---"))
]  # fmt: skip


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[2:50])
def test_a_promise_has_its_test(row: str) -> None:
    tests = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", row)
    assert tests, "no test is named"
    for file, name in tests:
        text = (ROOT / file).read_text("utf-8")
        assert re.search(rf"^def {name}\(" if name else r"^def test_\w+\(", text, re.MULTILINE), (file, name)


def test_there_is_a_promise_for_every_reader_and_for_the_page() -> None:
    assert len(ROWS) >= 24


def test_every_reader_and_every_order_of_the_page_is_in_the_tables_of_what_was_fuzzed() -> None:
    fuzzed = TEXT.partition("## Fuzzing results")[2].partition("## Limits")[0]
    for word in ORDERS:
        assert f"| {word} |" in fuzzed, word
    rows = fuzzed.lower()
    for reader in READERS:
        assert reader.kind.lower().split()[-1] in rows, reader.kind
