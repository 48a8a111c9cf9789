"""Findings about scene files as values: severity, place, what is wrong, and what would be right."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path


def length(metres: float, digits: int = 3) -> str:
    """A length in the unit that suits a message: ``"0.102 mm"``, ``"1.04 m"``."""
    millimetres = f"{1e3 * metres:.{digits}g}"
    return f"{metres:.{digits}g} m" if "e+" in millimetres else f"{millimetres} mm"


def span(low: Iterable[float], high: Iterable[float]) -> str:
    """Two places, in the unit that suits a message: ``"from (0, 0, 1) to (20, 5.5, 3) mm"``."""
    one, other = list(low), list(high)
    far = max(abs(x) for x in (*one, *other)) >= 1.0
    first, last = (", ".join(f"{x if far else 1e3 * x:.3g}" for x in place) for place in (one, other))
    return f"from ({first}) to ({last}) {'m' if far else 'mm'}"


def one_line(text: str) -> str:
    """``text`` of a file with its line breaks and control characters as escapes, so that a finding stays one line."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class Severity(enum.IntEnum):
    """How much a finding matters; only errors make `ligature check` fail."""

    DEBUG = 0
    INFO = 1
    WARNING = 2
    ERROR = 3


@dataclass(frozen=True)
class Mark:
    """A place in a file; ``line`` and ``column`` count from 1."""

    file: Path
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True)
class Diagnostic:
    """One finding. ``hint`` is what would be right; ``code`` names the kind of finding."""

    severity: Severity
    message: str
    mark: Mark | None = None
    hint: str = ""
    code: str = ""

    def __str__(self) -> str:
        place = f"{self.mark}: " if self.mark else ""
        hint = f"; {self.hint}" if self.hint else ""
        return one_line(f"{place}{self.severity.name.lower()}: {self.message}{hint}")


def any_error(found: Iterable[Diagnostic]) -> bool:
    """Whether one of the findings is an error."""
    return any(d.severity >= Severity.ERROR for d in found)


class AdfError(Exception):
    """A file that cannot be used; ``diagnostics`` are the reasons."""

    def __init__(self, *diagnostics: Diagnostic) -> None:
        super().__init__("\n".join(map(str, diagnostics)))
        self.diagnostics = diagnostics
