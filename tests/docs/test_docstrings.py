"""Docstrings of the public surface name every parameter, what is returned and what is raised.

The form (summary, sections) is checked by ruff's pydocstyle rules in numpy's convention.
"""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from sphinx.ext import napoleon

from tests.conftest import ROOT

sys.path.insert(0, str(ROOT / "docs" / "site"))
import conf  # noqa: E402
import reference  # noqa: E402

PACKAGES = ["ligature", *(f"ligature.{name}" for name in (*reference.PUBLIC, *reference.PARTS))]
EVIDENT = {"self", "cls", "args", "kwargs"}


def surface() -> Iterator[tuple[str, Any]]:
    """Public classes, their methods, and functions, by their names."""
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in getattr(module, "__all__", ()):
            thing = getattr(module, name)
            if not getattr(thing, "__module__", "").startswith("ligature"):
                continue
            yield f"{package}.{name}", thing
            if inspect.isclass(thing):
                for key, member in vars(thing).items():
                    function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
                    if not key.startswith("_") and inspect.isfunction(function):
                        yield f"{package}.{name}.{key}", function


SURFACE = dict(surface())


def parameters(thing: Any) -> list[str]:
    """Names of the parameters that a caller gives."""
    call: Callable[..., Any] = thing.__init__ if inspect.isclass(thing) else thing
    if inspect.isclass(thing) and ("__init__" not in vars(thing) or dataclasses.is_dataclass(thing)):
        return []  # fields have documentation of their own
    return [name for name in inspect.signature(call).parameters if name not in EVIDENT and not name.startswith("_")]


def unexplained(thing: Any) -> list[str]:
    """Parameters that the docstring does not name: in a section, or as ``name`` in its text."""
    text = inspect.getdoc(thing) or ""
    if inspect.isclass(thing):
        text += "\n" + (inspect.getdoc(thing.__init__) or "")
    return [
        name
        for name in parameters(thing)
        if not re.search(rf"``[^`]*\b{name}\b[^`]*``|^(\w+, )*{name}(, \w+)*$", text, re.MULTILINE)
    ]


def test_the_page_of_the_package_documents_all_that_it_exports() -> None:
    documented = re.findall(r"auto(?:class|function):: (ligature\.\w+)", reference.top())
    assert documented == sorted(documented, key=lambda name: name != "ligature.load")
    assert set(documented) == {f"ligature.{name}" for name in importlib.import_module("ligature").__all__}


def test_the_surface_is_not_empty() -> None:
    assert len(SURFACE) > 100


@pytest.mark.parametrize("name", SURFACE)
def test_public_object_explains_its_parameters(name: str) -> None:
    thing = SURFACE[name]
    assert inspect.getdoc(thing), f"{name} has no docstring"
    unnamed = unexplained(thing) if len(parameters(thing)) > 1 else []
    assert unnamed == []


@pytest.mark.parametrize("name", [name for name, thing in SURFACE.items() if not inspect.isclass(thing)])
def test_what_lists_parameters_describes_what_it_returns(name: str) -> None:
    text = inspect.getdoc(SURFACE[name]) or ""
    if "Parameters\n---" in text and inspect.signature(SURFACE[name]).return_annotation not in ("None", None):
        assert "Returns\n---" in text


ENDINGS = {"Exit", "BadParameter", "SystemExit", "StopIteration", "NotImplementedError", "KeyboardInterrupt"}
"""Exceptions that end a program or an iteration: callers do not handle them."""


def raised(function: ast.FunctionDef) -> set[str]:
    """The exceptions of the ``raise`` statements of a function, but for those that it may catch itself."""
    found, nodes = set(), list[ast.AST](function.body)
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Lambda):
            continue
        if isinstance(node, ast.Try) and node.handlers:
            nodes += [*node.handlers, *node.orelse, *node.finalbody]
            continue
        if isinstance(node, ast.Raise) and node.exc is not None:
            error = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            found.add(getattr(error, "id", getattr(error, "attr", "")))
        nodes += ast.iter_child_nodes(node)
    return {name for name in found if name[:1].isupper()} - ENDINGS


def silent_raises(path: Path) -> Iterator[str]:
    """Public functions of a module that raise what neither their docstring nor the module's names."""
    module = ast.parse(path.read_text("utf-8"))
    classes = [node for node in module.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_")]
    for owner in (module, *classes):
        prefix = f"{owner.name}." if isinstance(owner, ast.ClassDef) else ""
        for function in owner.body:
            if not isinstance(function, ast.FunctionDef) or function.name.startswith("_"):
                continue
            text = ast.get_docstring(function)  # an override without one has that of its base
            known = f"{text}{ast.get_docstring(module)}"
            if text and any(name not in known for name in raised(function)):
                yield f"{path.name}: {prefix}{function.name}"


def test_public_functions_name_the_exceptions_that_they_raise() -> None:
    files = (ROOT / "simulator" / "ligature").rglob("*.py")
    assert {name for file in files for name in silent_raises(file)} == set()


@pytest.mark.parametrize("what", ["attribute", "data", "property"])
@pytest.mark.parametrize(
    "text", ["Ticks between checks: one takes 5 µs.", "Pose (7,): x y z qx qy qz qw.\n\nThen: more."]
)
def test_a_colon_in_the_docstring_of_an_attribute_separates_no_type(what: str, text: str) -> None:
    docstring = conf.NumpyDocstring(text, napoleon.Config(), what=what, name="NAME")
    assert "\n".join(docstring.lines()).strip() == text
