"""Makes bodies soft that their files know as rigid: ``--soft BODY`` and ``--soft BODY=MATERIAL``."""

from __future__ import annotations

from collections.abc import Sequence

from ligature.adf import Diagnostic, Document, Mark, Severity
from ligature.adf.nodes import parse
from ligature.model.material import MATERIALS

BLOCK = "ligature tissue"
USUAL = "silicone pad"


class Softening:
    """The bodies that a user wants soft, and which of them were found.

    Parameters
    ----------
    requests
        ``BODY`` or ``BODY=MATERIAL``: key, key without ``BODY``, or name of a body, and a named material.

    Raises
    ------
    ValueError
        For a material that does not exist.
    """

    def __init__(self, requests: Sequence[str]) -> None:
        self._material: dict[str, str] = {}
        for request in requests:
            body, _, material = request.partition("=")
            if (material or USUAL) not in MATERIALS:
                raise ValueError(f"--soft {request}: '{material}' is no material; give one of {', '.join(MATERIALS)}")
            self._material[body] = material or USUAL
        self._missing = set(self._material)

    def apply(self, document: Document) -> None:
        """Give the bodies of a document that are wanted soft the block of a file."""
        for element in document.elements("bodies"):
            for name in (element.key, element.key.removeprefix("BODY "), element.text("name")):
                if name in self._material:
                    self._missing.discard(name)
                    if not element.has(BLOCK):
                        text = f"{BLOCK}: {{material: {self._material[name]}}}"
                        element.node.entries.update(parse(text, document.path).entries)
                    break

    def report(self, start: Mark) -> list[Diagnostic]:
        """Findings about bodies that do not exist."""
        hint = "give the key or the name of a body, such as --soft 'BODY Phantom'"
        return [
            Diagnostic(Severity.ERROR, f"no body is called '{name}', so none is made soft", start, hint, "tissue")
            for name in sorted(self._missing)
        ]
