"""Plug-ins that the files of a scene name (as in AMBF): which, where they are, what they are given.

Nothing is loaded here: `ligature.plugins` runs them, for users who allow it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ligature.adf import Diagnostic, Document, Element, Mark, ResolutionError, Resolver, Severity
from ligature.adf.lacking import lack_of
from ligature.adf.rules import LIBRARIES

MAX_VALUES = 250
"""Most numbers of one topic of a plug-in: those of one command."""

_NOT_PARAMETERS = ("name", "filename", "path", "publishes", "subscribes")


@dataclass(frozen=True)
class PluginEntry:
    """One entry of ``plugins``.

    Attributes
    ----------
    name
        Unique in the scene; part of its topics.
    path, entry_point
        A Python file below the roots of the scene, or the name of an installed entry point.
    kind, body
        The kind of file or object that has the entry, ``launch``, ``world``, ``model`` or ``body``, and the index of
        the body, -1 for the others.
    publishes, subscribes
        Topics of its own, and how many numbers each has.
    parameters
        All other keys of the entry, as nested dicts, lists and texts.
    """

    name: str
    path: Path | None
    entry_point: str
    kind: str
    body: int = -1
    publishes: Mapping[str, int] = field(default_factory=dict)
    subscribes: Mapping[str, int] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    mark: Mark | None = None


def topic_rows(topics: Sequence[Mapping[str, int]]) -> list[dict[str, slice]]:
    """Where the numbers of each topic stand, for each plug-in by name: one topic after the other."""
    places, at = [], 0
    for sizes in topics:
        rows = {}
        for name, size in sizes.items():
            rows[name] = slice(at, at + size)
            at += size
        places.append(rows)
    return places


def row_count(places: Sequence[Mapping[str, slice]]) -> int:
    """How many numbers all topics of `topic_rows` have together."""
    return max((place.stop for rows in places for place in rows.values()), default=0)


def plugin_entries(
    documents: Sequence[Document], bodies: Mapping[Mark | None, int], resolver: Resolver
) -> tuple[tuple[PluginEntry, ...], list[Diagnostic]]:
    """The plug-ins of the files of a scene in the order in which they run, and what is wrong with others.

    ``bodies`` are the indices of bodies by where files define them.
    """
    found: list[PluginEntry] = []
    findings: list[Diagnostic] = []
    for element, body in _owners(documents, bodies):
        entries = element.value("plugins")
        for item in entries if isinstance(entries, list) else []:
            if not isinstance(item, dict) or not {"name", "filename"} <= item.keys():
                continue  # the checker reports it
            try:
                entry = _entry(element, body, item, resolver)
            except (ValueError, ResolutionError) as error:
                refused = error.diagnostic if isinstance(error, ResolutionError) else None
                reason, hint = (refused.message, refused.hint) if refused else (str(error), "")
                message = f"plug-in '{item['name']}' is left out: {reason}"
                compiled = str(item["filename"]).endswith(LIBRARIES)
                severity = Severity.INFO if compiled else Severity.WARNING
                findings.append(Diagnostic(severity, message, element.mark_of("plugins"), hint, "plugin"))
                continue
            taken = sum(other.name == entry.name or other.name.startswith(f"{entry.name}_") for other in found)
            found.append(replace(entry, name=f"{entry.name}_{taken + 1}") if taken else entry)
    return tuple(found), findings


def _owners(documents: Sequence[Document], bodies: Mapping[Mark | None, int]) -> Iterator[tuple[Element, int]]:
    """All elements that may have plug-ins, files before bodies, with the index of the body or -1."""
    tops = {document.top.mark: document for document in documents}
    for document in tops.values():
        yield document.top, -1
    for document in tops.values():
        for element in document.elements("bodies") if document.kind == "model" else ():
            if element.mark in bodies:
                yield element, bodies[element.mark]


def _entry(element: Element, body: int, item: Mapping[str, Any], resolver: Resolver) -> PluginEntry:
    """The plug-in of one entry; raises ValueError or `ResolutionError` with the reason why there is none."""
    name, file = str(item["name"] or "").strip(), str(item["filename"] or "").strip()
    if not name.isidentifier():
        raise ValueError(f"'{name}' is not a valid name; use letters, digits and '_'")
    path = None
    if file.endswith(".py"):
        mark = element.mark_of("plugins")
        folder = resolver.resolve(str(item.get("path") or ""), element.mark.file.parent, mark)
        path = resolver.resolve(file, folder, mark)
        lack = lack_of(path)
        if lack is not None:
            raise ResolutionError(Diagnostic(Severity.WARNING, f"'{path}' {lack.fault}", mark, lack.hint, "plugin"))
    elif file.endswith(LIBRARIES) or "/" in file:
        raise ValueError(f"'{file}' is a C++ library for AMBF; write the plug-in in Python")
    return PluginEntry(
        name, path, "" if path else file, element.kind, body, _topics(item, "publishes"), _topics(item, "subscribes"),
        {key: value for key, value in item.items() if key not in _NOT_PARAMETERS}, element.mark_of("plugins"),
    )  # fmt: skip


def _topics(item: Mapping[str, Any], key: str) -> dict[str, int]:
    """Topics with their numbers of values; raises ValueError."""
    listed = item.get(key) or {}
    if not isinstance(listed, dict):
        raise ValueError(f"'{key}' is not a block such as {{force: 3}}")
    topics = {}
    for topic, size in listed.items():
        text = str(size)
        if not topic.isidentifier() or not text.isdecimal() or not 1 <= int(text) <= MAX_VALUES:
            raise ValueError(f"'{key}.{topic}: {text[:20]}' must be a topic with 1 to {MAX_VALUES} numbers")
        topics[topic] = int(text)
    return topics
