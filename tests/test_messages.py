"""Errors about what a user wrote say what would be right."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

from tests.conftest import ROOT

PACKAGE = ROOT / "simulator" / "ligature"
HINTED = {"failure": 3, "_error": 2, "_refusal": 2, "fail": 2}
"""Functions that make an error of a file, each with the position of its hint."""

OPTIONS = ("BadParameter", "error")
"""What makes errors of a command's options: of typer, and of argparse as `flags.error`."""

RIGHT = re.compile(r"\b(must|needs?|at least|at most|allowed|choose|write|give|add|name|install|not)\b")
"""Words that state what would be right."""


def calls(source: str) -> Iterator[tuple[int, str, ast.Call]]:
    """Line and name of the function of each call of a text."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            yield node.lineno, name, node


def words(call: ast.Call) -> str:
    """The constant texts among the arguments of a call."""
    return " ".join(n.value for n in ast.walk(call) if isinstance(n, ast.Constant) and isinstance(n.value, str))


def without_what_is_right(source: str, hinted: dict[str, int], options: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    """Line and text of calls that make errors which neither have a hint nor state what would be right."""
    for line, name, call in calls(source):
        text = words(call)
        if " " not in text.strip():  # what another function worded
            continue
        if name in hinted:
            has_hint = len(call.args) > hinted[name] or "hint" in {keyword.arg for keyword in call.keywords}
            if not has_hint and not re.search(r"\b(must|within)\b", text):
                yield line, text
        elif name in options and not RIGHT.search(text):
            yield line, text


@pytest.mark.parametrize("package", ["adf", "mesh", "teleop", "cli"])
def test_errors_of_files_and_options_say_what_would_be_right(package: str) -> None:
    options = OPTIONS if package == "cli" else ()
    paths = sorted((PACKAGE / package).rglob("*.py"))
    made = sum(name in HINTED or name in options for path in paths for _, name, _ in calls(path.read_text("utf-8")))
    assert made >= 5
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for path in paths
        for line, text in without_what_is_right(path.read_text("utf-8"), HINTED, options)
    ]
    assert found == []


def test_what_says_only_what_is_wrong_is_found() -> None:
    source = """
failure(path, "the file is empty", 3)
failure(path, "the file is empty", 3, "export it again")
failure(path, "the file is empty", hint="export it again")
self.fail(mark, "it must be a list")
self.fail(mark, "it is no list")
typer.BadParameter("--names is wrong")
typer.BadParameter("--names must be 'a'")
typer.BadParameter(str(error))
"""
    assert [line for line, _ in without_what_is_right(source, HINTED, OPTIONS)] == [2, 6, 7]
