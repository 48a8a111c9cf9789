"""``ligature check``: every finding of scene files, one a line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from rich.console import Console

import ligature
from ligature.adf import (
    AdfError,
    Diagnostic,
    Document,
    LaunchDocument,
    Mark,
    ResolutionError,
    Resolver,
    Severity,
    read_any,
    read_model,
    read_world,
)
from ligature.adf.lacking import lack_of
from ligature.authoring.lint import OF_LOADING, READER, lint
from ligature.bundle import meant
from ligature.cli.numbers import counted
from ligature.mesh import load_mesh
from ligature.model import reach
from ligature.model.pictures import read_picture, unreadable
from ligature.model.scene import Scene
from ligature.physics import guard, inertias, overlaps, springs
from ligature.physics.engine import Engine

_STYLES = {Severity.ERROR: "red", Severity.WARNING: "yellow", Severity.INFO: "", Severity.DEBUG: "dim"}


def check(
    files: Sequence[Path],
    roots: Sequence[Path],
    strict: bool,
    verbose: bool,
    console: Console,
    models: Sequence[int] | None = None,
    author: bool = False,
) -> int:
    """Print the findings of ``files``, also those for their ``author``; returns 1 when one is an error."""
    status = 0
    for file in files:
        found = findings(file, roots, strict, models)
        if author:
            found = _distinct([*found, *_for_authors(file, roots, models)])
        for diagnostic in found:
            if diagnostic.severity > Severity.DEBUG or verbose:
                console.print(str(diagnostic), style=_STYLES[diagnostic.severity], markup=False)
        errors = sum(d.severity >= Severity.ERROR for d in found)
        warnings = sum(d.severity is Severity.WARNING for d in found)
        console.print(f"{file}: {counted(errors, 'error')}, {counted(warnings, 'warning')}", markup=False)
        status = status or int(errors > 0)
    return status


def findings(file: Path, roots: Sequence[Path], strict: bool, models: Sequence[int] | None = None) -> list[Diagnostic]:
    """Findings of one file: those of reading it, and for launch and model files those of resolving it.

    ``models`` are indices of the launch file's models; None checks all.
    """
    resolver = Resolver.for_file(file, roots)
    try:
        document = read_any(file, resolver, strict)
    except AdfError as error:
        return [replace(found, hint=found.hint or meant(file)) for found in error.diagnostics]
    if document.kind not in ("launch", "model") or (strict and not document.ok):
        return document.diagnostics
    if document.kind == "model" and not _has_bodies(document):
        alone = "the file has no body, so it runs only together with a file that has one"
        return [*document.diagnostics, Diagnostic(Severity.INFO, alone, document.top.mark)]
    try:
        scene = ligature.load(file, models, roots=roots)
    except ligature.SceneError as error:
        return _distinct([*document.diagnostics, *error.diagnostics])
    later = [
        *reach.findings(scene), *inertias.findings(scene), *guard.findings(scene), *_at_start(scene),
        *_shaders(scene, resolver), *_looks(scene, resolver),
    ]  # fmt: skip
    return _distinct([*document.diagnostics, *scene.diagnostics, *later])


def _for_authors(file: Path, roots: Sequence[Path], models: Sequence[int] | None) -> list[Diagnostic]:
    """What would surprise the author of a model or world file, or of those of a launch file: as in Blender."""
    resolver = Resolver.for_file(file, roots)
    found: list[Diagnostic] = []
    for document in _documents(file, resolver, models):
        marks = {element.key: element.node.mark for listed in document.lists.values() for element in listed}
        found += [
            Diagnostic(
                each.severity,
                f"{each.key or document.kind}: {each.message}",
                marks.get(each.key, document.top.mark),
                each.hint,
                each.rule,
            )
            for each in lint(document, resolver)
            if not each.rule.startswith(READER) and each.rule not in OF_LOADING
        ]
    return found


def _documents(file: Path, resolver: Resolver, models: Sequence[int] | None) -> Iterator[Document]:
    """The file, or the world file and the chosen models of a launch file, as far as they can be read."""
    with suppress(AdfError):
        document = read_any(file, resolver)
        if not isinstance(document, LaunchDocument):
            yield document
            return
        chosen = [document.models[i] for i in range(len(document.models)) if models is None or i in models]
        for reference, read in ((document.world, read_world), *((each, read_model) for each in chosen)):
            if reference is not None and reference.path is not None:
                with suppress(AdfError):
                    yield read(reference.path, resolver)


def _shaders(scene: Scene, resolver: Resolver) -> list[Diagnostic]:
    """Shader files that cannot be read, one finding for each program; drawing finds what is wrong in others."""
    cameras = [files for c in scene.cameras for files in (c.preprocessing_shaders, c.depth_shaders)]
    found = []
    for files in dict.fromkeys([*(body.visual.shaders for body in scene.bodies), *cameras]):
        if files is None:
            continue
        try:
            for path in (files.vertex, files.fragment):
                resolver.read_bytes(path, mark=files.mark)
        except ResolutionError as error:
            hint = error.diagnostic.hint or "the built-in shader is used instead"
            found.append(replace(error.diagnostic, severity=Severity.WARNING, hint=hint, code="render"))
    return found


def _looks(scene: Scene, resolver: Resolver) -> list[Diagnostic]:
    """What is wrong in mesh files that are drawn, and in pictures: their textures, those of the sky."""
    found: list[Diagnostic] = []
    pictures: list[Path] = []
    for face, picture in (scene.world.skybox or {}).items():
        lack = lack_of(picture)
        if lack is not None:
            message = f"sky box: the picture '{picture.name}' of its {face} {lack.fault}"
            found.append(Diagnostic(Severity.WARNING, message, Mark(picture, 1, 1), lack.hint, "render"))
        else:
            pictures.append(picture)
    visuals = [*(body.visual for body in scene.bodies), *(ghost.visual for ghost in scene.ghosts)]
    for path in dict.fromkeys(visual.mesh for visual in visuals if visual.visible):
        if path is None:
            continue
        try:
            mesh = load_mesh(path, resolver)
            found += [d for d in mesh.diagnostics if d.severity > Severity.DEBUG]
            materials = [part.material for part in mesh.parts if part.material is not None]
            pictures += [
                value for material in materials for value in vars(material).values() if isinstance(value, Path)
            ]
        except AdfError as error:
            hints = (error.diagnostics[0].hint, "what has this mesh is drawn without it; AMBF leaves it out")
            hint = "; ".join(filter(None, hints))
            found += [replace(d, severity=Severity.WARNING, hint=hint) for d in error.diagnostics]
    return [*found, *_broken(dict.fromkeys(pictures))]


def _broken(pictures: Iterable[Path]) -> Iterator[Diagnostic]:
    for path in pictures:
        try:
            read_picture(path)
        except FileNotFoundError:
            pass  # as the file that names it has stated
        except (OSError, ValueError) as error:
            yield unreadable(path, error)


def _at_start(scene: Scene) -> list[Diagnostic]:
    """Findings of the bodies as they start in the physics."""
    engine = Engine(scene, 1e-3)
    try:
        return [*overlaps.findings(engine), *springs.findings(engine)]
    finally:
        engine.close()


def _has_bodies(document: Document) -> bool:
    """Whether a model file can stand alone; others hang on bodies of earlier files."""
    return any(document.elements(name) for name in ("bodies", "soft bodies", "volumes", "sutures"))


def _distinct(found: Sequence[Diagnostic]) -> list[Diagnostic]:
    """Each finding once, in its last form: the scene adds consequences to the finding of a file."""
    return list({(d.severity, d.message, d.mark): d for d in found}.values())
