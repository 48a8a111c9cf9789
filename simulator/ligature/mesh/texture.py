"""Finds the picture files that materials name, below the scene's roots only."""

from __future__ import annotations

from pathlib import Path, PureWindowsPath

from ligature.adf.lacking import lack_of
from ligature.adf.resolver import ResolutionError, Resolver
from ligature.mesh.mesh import LOOK, Findings


def texture_file(name: str, path: Path, line: int, folder: Path, resolver: Resolver, findings: Findings) -> Path | None:
    """The file that a material calls ``name``: as written, else by its bare name, in ``folder``.

    Exporters often write the absolute path of the author's machine, so that only the name is of use.
    A texture that is absent keeps its path; one that may not be opened is None; both are findings
    about ``line`` of ``path``.
    """
    refusal: ResolutionError | None = None
    allowed: list[Path] = []
    for reference in (name, PureWindowsPath(name).name):
        try:
            allowed.append(resolver.resolve(reference, folder))
        except ResolutionError as error:
            refusal = refusal or error
    for candidate in allowed:
        if lack_of(candidate) is None:
            return candidate
    if refusal is not None:
        findings.add(path, f"texture: {refusal.diagnostic.message}", line, refusal.diagnostic.hint, code=LOOK)
    else:
        lack = lack_of(allowed[0])
        fault, hint = lack or ("does not exist", "")
        findings.add(path, f"texture '{name[:200]}' {fault}", line, hint or f"looked for {allowed[0]}", code=LOOK)
    return allowed[0] if allowed else None
