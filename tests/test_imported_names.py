"""Names that files import from modules of the project are there, also in tests that run seldom."""

from __future__ import annotations

import ast
import subprocess
from functools import cache
from pathlib import Path

from tests.conftest import ROOT

FOLDERS = ("simulator", "tests", "examples", "scenes", "docs", "blender_addon")
FILES = sorted(
    ROOT / name
    for name in subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "--", *(f"{folder}/**.py" for folder in FOLDERS)],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.split()
)  # fmt: skip


def module(name: str) -> Path | None:
    """File of a module of the project or its tests."""
    for root in (ROOT / "simulator", ROOT):
        path = root.joinpath(*name.split("."))
        for file in (path.with_suffix(".py"), path / "__init__.py"):
            if file.is_file():
                return file
    return None


@cache
def defined(file: Path) -> frozenset[str] | None:
    """Names at the top of a module; None when it makes some as it is asked for them."""
    names = set()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names.update(alias.asname or alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    return None if {"__getattr__", "*"} & names else frozenset(names)


def absent(text: str | bytes) -> list[str]:
    """What a file imports by name from modules of ours that neither define it nor have it as a part."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.ImportFrom) or node.level or not node.module:
            continue
        if node.module.partition(".")[0] not in ("ligature", "tests"):
            continue
        file = module(node.module)
        if file is None:
            found.append(node.module)
            continue
        names = defined(file)
        found += [
            f"{node.module}.{alias.name}"
            for alias in node.names
            if names is not None and alias.name not in names and module(f"{node.module}.{alias.name}") is None
        ]
    return found


def test_imported_names_of_ours_are_defined() -> None:
    missing = {str(file.relative_to(ROOT)): absent(file.read_bytes()) for file in FILES}
    assert len(missing) > 1000
    assert {file: names for file, names in missing.items() if names} == {}


def test_a_missing_name_is_found() -> None:
    text = """
from tests.conftest import ROOT, CORNER
from tests import conftest, nothing
from tests.nowhere import a
def later():
    from ligature.tasks.knots import closed
"""
    assert absent(text) == [
        "tests.conftest.CORNER", "tests.nothing", "tests.nowhere", "ligature.tasks.knots.closed",
    ]  # fmt: skip


def test_what_a_module_offers_to_all_is_there() -> None:
    missing, lists = [], 0
    for file in FILES:
        for node in ast.parse(file.read_bytes()).body:
            if not (isinstance(node, ast.Assign) and any(ast.unparse(target) == "__all__" for target in node.targets)):
                continue
            lists += 1
            there, offered = defined(file), {n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant)}
            missing += [f"{file.relative_to(ROOT)}: {name}" for name in offered - there] if there is not None else []
    assert lists > 20 and not missing, missing
