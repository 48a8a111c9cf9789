"""Each line of the table of conformance names tests that exist, and each test made for it stands in a line."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "conformance.md").read_text()
CITED = re.findall(r"`(test_\w+\.py)::(test_\w+)`", PAGE)
LINES = [
    line
    for part in PAGE.split("\n## ")[1:]
    if not part.startswith("Differences")
    for line in part.splitlines()
    if line.startswith("| ") and not line.startswith(("| the dVRK |", "| program |"))
]


def functions(file: str) -> set[str]:
    """Names of a module's test functions."""
    found = [path for folder in ("ros", "robots") if (path := ROOT / "tests" / folder / file).exists()]
    assert len(found) == 1, f"{file}: {len(found)} modules of this name"
    tree = ast.parse(found[0].read_text())
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")}


@pytest.mark.parametrize("line", LINES)
def test_every_line_names_tests_that_exist(line: str) -> None:
    cited = re.findall(r"`(test_\w+\.py)::(test_\w+)`", line)
    assert cited, "the line names no test"
    for file, name in cited:
        assert name in functions(file), f"{file} has no {name}"


def test_every_test_of_conformance_stands_in_a_line() -> None:
    assert functions("test_conformance.py") == {name for file, name in CITED if file == "test_conformance.py"}
    assert len(LINES) > 30
