"""Bodies that could not be built, and objects that depend on them: one finding for each cause with all consequences."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from ligature.adf import Diagnostic
from ligature.model.lookup import candidates

MOST_NAMED = 5
"""Most objects that a finding names; the others are counted."""


@dataclass
class LostBodies:
    """Identifiers of the bodies that are left out, the places of their findings, and who named them."""

    identifiers: list[str] = field(default_factory=list)
    places: list[int] = field(default_factory=list)
    dependants: list[dict[str, None]] = field(default_factory=list)

    def add(self, identifier: str, place: int) -> None:
        """Note a body whose finding stands at index ``place`` of the list of findings."""
        self.identifiers.append(identifier)
        self.places.append(place)
        self.dependants.append({})

    def took_along(self, dependant: str, texts: Iterable[str]) -> bool:
        """Whether one of ``texts`` names a body that is left out, which ``dependant`` then follows."""
        for text in texts:
            hits = candidates(self.identifiers, text) if text else []
            if hits:
                self.dependants[hits[0]][dependant] = None
                return True
        return False

    def name_what_goes_along(self, diagnostics: list[Diagnostic]) -> None:
        """Add to the findings of the bodies, in place, what is left out with them."""
        for place, dependants in zip(self.places, self.dependants, strict=True):
            if dependants:
                names = list(dependants)
                more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
                words = f"left out with it: {', '.join(names[:MOST_NAMED])}{more}"
                hint = diagnostics[place].hint
                diagnostics[place] = replace(diagnostics[place], hint=f"{hint}; {words}" if hint else words)
