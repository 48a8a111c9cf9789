"""Makes bodies soft that their files know as rigid: ``--soft BODY`` and ``--soft BODY=MATERIAL``."""

from __future__ import annotations

from collections.abc import Sequence

from ligature.adf import Diagnostic, Document, Mark, Severity
from ligature.adf.nodes import parse
from ligature.model.material import MATERIALS

BLOCK = "ligature tissue"
USUAL = "silicone pad"


def requested(requests: Sequence[str]) -> dict[str, str]:
    """The material by body of ``BODY`` or ``BODY=MATERIAL``; raises ValueError for one that does not exist."""
    materials = {}
    for request in requests:
        body, _, material = request.partition("=")
        if (material or USUAL) not in MATERIALS:
            raise ValueError(
                f"--soft {request}: '{material}' is not a known material; give one of {', '.join(MATERIALS)}"
            )
        materials[body] = material or USUAL
    return materials


def soften(documents: Sequence[Document], requests: Sequence[str], start: Mark) -> list[Diagnostic]:
    """Give the bodies that the user requested as soft the block that a file would have.

    Parameters
    ----------
    documents
        Files of which nothing is built yet; their elements change.
    requests
        ``BODY`` or ``BODY=MATERIAL``: key, key without ``BODY``, or name of a body, and a named material.
    start
        The file that the user named, for findings.

    Returns
    -------
    list of Diagnostic
        The bodies that do not exist.

    Raises
    ------
    ValueError
        For a material that does not exist.
    """
    materials = requested(requests)
    missing = set(materials)
    for document in documents:
        for element in document.elements("bodies"):
            names = (element.key, element.key.removeprefix("BODY "), element.text("name"))
            name = next((name for name in names if name in materials), None)
            if name is not None:
                missing.discard(name)
                if not element.has(BLOCK):
                    text = f"{BLOCK}: {{material: {materials[name]}}}"
                    element.node.entries.update(parse(text, document.path).entries)
    hint = "give the key or the name of a body, such as --soft 'BODY Phantom'"
    return [
        Diagnostic(Severity.ERROR, f"no body is called '{name}', so none is made soft", start, hint, "tissue")
        for name in sorted(missing)
    ]
