"""Checks of a model for authors: what would surprise them in the simulator, with what would be right."""

from __future__ import annotations

from collections.abc import Iterator

from ligature.adf import Document, Resolver, Severity
from ligature.authoring.lint import bodies, files, joints
from ligature.authoring.lint.subject import RULES, Finding, Subject

OF_ALL_FILES = ("duplicate-identifier", "clipping-ratio")
"""Rules that hold for world files too; all others are about models."""

OF_LOADING = ("mesh-missing", "path-outside", "reference-elsewhere", "reference-unresolved")
"""Rules about what loading the scene reports too, with the other files that it has."""

READER = "reader:"
"""Begins the rules of what the reader of the format finds."""


def lint(
    document: Document,
    resolver: Resolver,
    unsaved: frozenset[str] = frozenset(),
    inflated: frozenset[str] = frozenset(),
) -> list[Finding]:
    """All findings of a model or world file, the reader's first; ``unsaved`` and ``inflated`` are as in `Subject`."""
    return [finding for found in lint_by_rule(document, resolver, unsaved, inflated) for finding in found]


def lint_by_rule(
    document: Document,
    resolver: Resolver,
    unsaved: frozenset[str] = frozenset(),
    inflated: frozenset[str] = frozenset(),
) -> Iterator[list[Finding]]:
    """The findings of `lint`, those of one rule at a time."""
    yield [
        Finding(f"{READER}{d.code}", d.severity, _key_of(document, d.message), d.message, d.hint)
        for d in document.diagnostics
        if d.severity >= Severity.WARNING
    ]
    subject = Subject(document, resolver, unsaved, inflated)
    for name, check in RULES.items():
        if document.kind == "model" or name in OF_ALL_FILES:
            yield list(check(subject))


def _key_of(document: Document, message: str) -> str:
    """The object that a finding of the reader names."""
    keys = {element.key for listed in document.lists.values() for element in listed}
    return next((key for key in sorted(keys, key=len, reverse=True) if f"'{key}'" in message), "")


__all__ = [
    "OF_ALL_FILES",
    "OF_LOADING",
    "READER",
    "RULES",
    "Finding",
    "Subject",
    "bodies",
    "files",
    "joints",
    "lint",
    "lint_by_rule",
]
