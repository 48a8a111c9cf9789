"""From a launch file, or a single model file, to a scene: read all files, convert their elements, build, complete."""

from __future__ import annotations

import operator
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ligature.adf import AdfError, Diagnostic, Resolver, Severity
from ligature.bundle import launch_file, meant
from ligature.model.builder import SceneBuilder
from ligature.model.completion import completed
from ligature.model.conversion import converted
from ligature.model.files import read_scene
from ligature.model.naming import prefixed
from ligature.model.plugins import plugin_entries
from ligature.model.scene import Scene
from ligature.model.softening import soften
from ligature.paths import check_list


class SceneError(AdfError):
    """A scene that cannot run at all; ``diagnostics`` are the reasons."""


def load(
    path: str | Path,
    models: Sequence[int] | None = None,
    files: Sequence[str | Path] = (),
    roots: Sequence[str | Path] = (),
    namespace_prefix: str = "",
    arms: Sequence[Mapping[str, str]] | None = None,
    devices: Sequence[int] = (),
    soft: Sequence[str] = (),
) -> Scene:
    """Load a scene.

    Parameters
    ----------
    path
        A launch file, one model file, or the name of a scene that comes with Ligature, such as ``suturing``.
    models
        Indices into the launch file's ``multibody configs``, in the order of loading; repeats are
        allowed. None loads all of them.
    files
        Further model files, loaded before those of ``models``.
    roots
        Folders below which files may be opened besides the scene's own.
    namespace_prefix
        Put before every namespace; what files refer to is settled before, so that it never changes that.
    arms
        Which bodies are arms, as the launch key ``ligature arms`` would state (`ligature.model.arms`), instead of
        what the file states and what is found.
    devices
        Indices of the input devices of a launch file whose proxies are to be there.
    soft
        Rigid bodies that are to be soft tissue, ``BODY`` or ``BODY=MATERIAL`` (`ligature.model.softening`).

    Returns
    -------
    Scene
        Immutable; what is wrong in its files and does not keep it from running is in ``diagnostics``.

    Raises
    ------
    SceneError
        When there is nothing to run: the file is not readable, or no body could be created.
    TypeError
        For a ``path`` that is none, for ``models`` or ``devices`` that are no list of whole numbers, and for one text
        or path where a list of them is needed: each of its letters would count.
    ValueError
        For a material of ``soft`` that does not exist.
    """
    if not isinstance(path, str | os.PathLike):
        raise TypeError(f"path is {path!r}; it must be the path of a file, or the name of a scene such as 'suturing'")
    if "\0" in os.fspath(path):  # the system would raise a ValueError of its own for it
        raise SceneError(Diagnostic(Severity.ERROR, f"{os.fspath(path)!r} holds a NUL character, as no path does"))
    models, devices = indices("models", models), indices("devices", devices) or ()
    for what, given in (("files", files), ("roots", roots), ("soft", soft), ("arms", arms or ())):
        check_list(what, given)
    if not all(isinstance(arm, Mapping) for arm in arms or ()):
        raise TypeError(f"arms is {arms!r}; it must be a list of mappings, such as [{{'name': 'MTML', 'kind': 'mtm'}}]")
    start = launch_file(Path(path))
    resolver = Resolver.for_file(start, [Path(root) for root in (*roots, *(Path(f).parent for f in files))])
    try:
        found = read_scene(start, resolver, models, files, arms, devices)
    except AdfError as error:
        raise SceneError(*(replace(d, hint=d.hint or meant(Path(path))) for d in error.diagnostics)) from error
    found.findings += soften([model.document for model in found.models], soft, found.start.top.mark)
    parts = [converted(model.document, resolver, model.shaders, found.world.gravity) for model in found.models]
    builder = SceneBuilder(found)
    for model, part in zip(found.models, parts, strict=True):
        builder.add(model, part)
    scene = completed(builder)
    documents = [found.start, *(model.document for model in found.models)]
    plugins, findings = plugin_entries(documents, {body.identity.mark: body.index for body in scene.bodies}, resolver)
    scene = replace(scene, plugins=plugins, diagnostics=(*scene.diagnostics, *findings))
    if not scene.bodies:
        # What kept the bodies out says enough.
        errors = [d for d in scene.diagnostics if d.severity >= Severity.ERROR]
        nothing = Diagnostic(Severity.ERROR, "the file contains no body to simulate", found.start.top.mark)
        raise SceneError(*(errors or [nothing]))
    return prefixed(scene, namespace_prefix)


def indices(what: str, given: object) -> tuple[int, ...] | None:
    """A list of indices, whatever holds it, or None for None; raises TypeError, which names ``what``, for others."""
    if given is None:
        return None
    try:
        if not isinstance(given, str | bytes):
            return tuple(operator.index(index) for index in given)  # type: ignore[attr-defined]
    except TypeError:
        pass
    raise TypeError(f"{what} is {given!r}; it must be a list of whole numbers, such as [0, 1]")
