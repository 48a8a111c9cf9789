"""Docstrings of the public surface name every parameter, what is returned and what is raised.

The form (summary, sections) is checked by ruff's pydocstyle rules in numpy's convention.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from sphinx.ext import napoleon

from tests.conftest import ROOT

sys.path.insert(0, str(ROOT / "docs" / "site"))
import conf  # noqa: E402
import reference  # noqa: E402

ROOMS = ["ligature", *(f"ligature.{name}" for name in reference.ROOMS)]
EVIDENT = {"self", "cls", "args", "kwargs"}


def surface() -> Iterator[tuple[str, Any]]:
    """Public classes, their methods, and functions, by their names."""
    for room in ROOMS:
        module = importlib.import_module(room)
        for name in getattr(module, "__all__", ()):
            thing = getattr(module, name)
            if not getattr(thing, "__module__", "").startswith("ligature"):
                continue
            yield f"{room}.{name}", thing
            if inspect.isclass(thing):
                for key, member in vars(thing).items():
                    function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
                    if not key.startswith("_") and inspect.isfunction(function):
                        yield f"{room}.{name}.{key}", function


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
    documented = re.findall(r"auto(?:class|function):: (ligature\.\w+)", reference.package())
    assert documented == sorted(documented, key=lambda name: name != "ligature.load")
    assert set(documented) == {f"ligature.{name}" for name in importlib.import_module("ligature").__all__}


def test_the_surface_is_not_empty() -> None:
    assert len(SURFACE) > 100


@pytest.mark.parametrize("name", SURFACE)
def test_public_object_explains_its_parameters(name: str) -> None:
    thing = SURFACE[name]
    text = inspect.getdoc(thing)
    assert text, f"{name} has no docstring"
    few = parameters(thing)
    if len(few) > 1:
        assert unexplained(thing) == []


@pytest.mark.parametrize("name", [name for name, thing in SURFACE.items() if not inspect.isclass(thing)])
def test_what_lists_parameters_describes_what_it_returns(name: str) -> None:
    text = inspect.getdoc(SURFACE[name]) or ""
    if "Parameters\n---" in text and inspect.signature(SURFACE[name]).return_annotation not in ("None", None):
        assert "Returns\n---" in text


@pytest.mark.parametrize("what", ["attribute", "data", "property"])
@pytest.mark.parametrize(
    "text", ["Ticks between checks: one takes 5 µs.", "Pose (7,): x y z qx qy qz qw.\n\nThen: more."]
)
def test_a_colon_in_the_docstring_of_an_attribute_separates_no_type(what: str, text: str) -> None:
    docstring = conf.NumpyDocstring(text, napoleon.Config(), what=what, name="NAME")
    assert "\n".join(docstring.lines()).strip() == text
