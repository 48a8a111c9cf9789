"""Names of files, bodies and addresses are printed as they are: ``[/x]`` in one is no markup of the terminal."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest

from tests.conftest import ROOT

SOURCES = sorted((ROOT / "simulator" / "ligature" / "cli").glob("*.py"))


def read_as_markup(source: str) -> Iterator[int]:
    """Lines in which a terminal may read markup from what is not written there.

    They print something else than constants with markup, hand such a function to others, or make a table of texts.
    """
    tree = ast.parse(source)
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in ("print", "input") and "console" in ast.unparse(node.value):
            if id(node) not in called:
                yield node.lineno
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Table":
            yield from (k.lineno for k in node.keywords if k.arg == "title" and isinstance(k.value, ast.JoinedStr))
        if isinstance(node, ast.Call) and id(node.func) in called and isinstance(node.func, ast.Attribute):
            prints = node.func.attr in ("print", "input") and "console" in ast.unparse(node.func.value)
            plain = any(k.arg == "markup" and ast.unparse(k.value) == "False" for k in node.keywords)
            shown = [a for a in node.args if not isinstance(a, ast.Constant) and "Text." not in ast.unparse(a)]
            if prints and not plain and [a for a in shown if not (isinstance(a, ast.Name) and a.id == "table")]:
                yield node.lineno


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_no_command_reads_markup_from_a_name(path: object) -> None:
    assert list(read_as_markup(path.read_text("utf-8"))) == []  # type: ignore[attr-defined]


def test_what_is_read_as_markup_is_found() -> None:
    source = """
console.print("[red]constant")
console.print(f"{name}", markup=False)
self._console.print(Text.assemble(name))
console.print(table)
console.print(f"{name}")
console.print(name, style="red")
page(console.print)
Table(title=f"{name}")
Table(title=Text(f"{name}"))
self._console.print(text, style=style)
"""
    assert sorted(read_as_markup(source)) == [6, 7, 8, 9, 11]
