"""Deferred parents: which body carries an object, settled while objects arrive, as in AMBF."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

from ligature.adf import Diagnostic, Mark, Severity
from ligature.model.lookup import candidates

ARRIVAL = ("actuator", "camera", "light", "body", "ghost", "sensor", "volume", "joint")
"""Order of kinds in which the objects of one file enter the world."""

Key = tuple[str, int]
"""Kind and index of an object."""


@dataclass
class Arrivals:
    """The objects of the world so far, and those that still wait for a parent."""

    known: dict[str, list[tuple[str, int]]] = field(default_factory=dict)
    waiting: dict[Key, tuple[str, str, Mark | None]] = field(default_factory=dict)
    parents: dict[Key, Key] = field(default_factory=dict)
    diagnostics: list[Diagnostic] = field(default_factory=list)

    def wait(self, kind: str, index: int, identifier: str, parent_text: str, mark: Mark | None) -> None:
        """Note that an object wants the parent ``parent_text``."""
        if parent_text:
            self.waiting[kind, index] = (identifier, parent_text, mark)

    def enter(self, objects: list[tuple[str, int, str, str]]) -> None:
        """Let the objects of one file enter: (kind, index, identifier, key) each, in any order."""
        for kind, index, identifier, _ in sorted(objects, key=lambda o: (ARRIVAL.index(o[0]), o[3])):
            self.known.setdefault(kind, []).append((identifier, index))
            self._settle((kind, index), identifier)

    def report_orphans(self) -> None:
        """State which objects found no parent."""
        for identifier, text, mark in self.waiting.values():
            message = f"'{identifier}' has the parent '{text}', which is missing or ambiguous"
            self.diagnostics.append(
                Diagnostic(
                    Severity.WARNING,
                    message,
                    mark,
                    "its location is read in the world frame; name one existing object",
                    "parent",
                )
            )

    def attached(self, kind: str, items: Iterable[Any]) -> tuple[Any, ...]:
        """The ghosts, cameras or lights with the parents that they found."""
        return tuple(
            replace(item, attachment=replace(item.attachment, parent=self.parents.get((kind, item.index))))
            for item in items
        )

    def _settle(self, newcomer: Key, identifier: str) -> None:
        for waiter, (_, text, mark) in list(self.waiting.items()):
            if waiter == newcomer:
                parent = self._search(text, waiter)
            elif text == identifier or text in identifier:
                parent = newcomer
                if text != identifier:
                    message = f"parent '{text}' is incomplete; using '{identifier}'"
                    self.diagnostics.append(Diagnostic(Severity.INFO, message, mark, "", "parent"))
            else:
                parent = None
            if parent is not None:
                self.parents[waiter] = parent
                del self.waiting[waiter]

    def _search(self, text: str, waiter: Key) -> Key | None:
        found: list[Key] = []
        for kind, objects in self.known.items():
            others = [(name, index) for name, index in objects if (kind, index) != waiter]
            hits = candidates([name for name, _ in others], text)
            if len(hits) == 1:
                found.append((kind, others[hits[0]][1]))
        return found[0] if len(found) == 1 else None
