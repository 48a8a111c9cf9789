"""Sphinx's settings for the site; `build.py` lays out its sources."""

from __future__ import annotations

import re
import types
from pathlib import Path
from typing import Any

import ligature
from sphinx.ext.napoleon.docstring import NumpyDocstring

project = "Ligature"
author = "The Ligature developers"
copyright = "the Ligature developers, BSD-3-Clause"
version = release = ligature.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns: list[str] = []
default_role = "py:obj"  # `name` in a docstring links to the object where there is a page of it
suppress_warnings = ["autodoc.mocked_object"]

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_preprocess_types = False
napoleon_attr_annotations = False

html_theme = "furo"
html_title = f"Ligature {release}"
html_favicon = str(Path(__file__).with_name("favicon.svg"))
html_static_path: list[str] = []
html_copy_source = False
html_show_sphinx = False

_TABLE = re.compile(r"^\|(.+)\|$")


def _tables(lines: list[str]) -> list[str]:
    """Docstring lines whose Markdown tables have become ``list-table`` directives."""
    out: list[str] = []
    index = 0
    while index < len(lines):
        if not _TABLE.match(lines[index].strip()):
            out.append(lines[index])
            index += 1
            continue
        rows = []
        while index < len(lines) and (found := _TABLE.match(lines[index].strip())):
            rows.append([cell.strip() for cell in found[1].split("|")])
            index += 1
        out += ["", ".. list-table::", "   :header-rows: 1", ""]
        for row in (row for row in rows if not all(set(cell) <= set("-: ") for cell in row)):
            out += [f"   {'* -' if column == 0 else '  -'} {cell}" for column, cell in enumerate(row)]
        out.append("")
    return out


def _docstring(app: Any, what: str, name: str, object: Any, options: Any, lines: list[str]) -> None:
    lines[:] = _tables(lines)


def _skip(app: Any, what: str, name: str, object: Any, skip: bool, options: Any) -> bool | None:
    """Leave out names for types of others: their documentation is numpy's."""
    ours = (getattr(object, "__module__", None) or "").startswith("ligature")
    return True if isinstance(object, types.GenericAlias) and not ours else None


def _whole_text(docstring: Any) -> tuple[str, list[str]]:
    """No type, and all lines of an attribute's docstring: Napoleon takes what stands before a colon for a type."""
    lines = docstring._dedent(docstring._consume_to_end())
    return "", NumpyDocstring(lines, docstring._config).lines()


NumpyDocstring._consume_inline_attribute = _whole_text


def setup(app: Any) -> None:
    """Connect what Sphinx calls."""
    app.connect("autodoc-process-docstring", _docstring)
    app.connect("autodoc-skip-member", _skip)
