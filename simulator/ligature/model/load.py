"""From a launch file, or a single model file, to a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ligature.adf import (
    AdfError,
    Diagnostic,
    Document,
    Element,
    LaunchDocument,
    Mark,
    ResolutionError,
    Resolver,
    Severity,
    read_any,
    read_devices,
    read_model,
    read_world,
)
from ligature.bundle import launch_file
from ligature.model.builder import SceneBuilder
from ligature.model.geometry import shader_files
from ligature.model.naming import prefixed, topic_name
from ligature.model.scene import InputDevice, Scene, WorldSettings
from ligature.model.shapes import ShaderFiles
from ligature.model.softening import Softening

SKYBOX_FACES = ("right", "left", "top", "bottom", "front", "back")


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
    ValueError
        For a material of ``soft`` that does not exist.
    """
    start, softening = launch_file(Path(path)), Softening(soft)
    resolver = Resolver.for_file(start, [Path(root) for root in (*roots, *(Path(f).parent for f in files))])
    try:
        document = read_any(start, resolver)
    except AdfError as error:
        raise SceneError(*error.diagnostics) from error
    if document.kind == "launch":
        assert isinstance(document, LaunchDocument)
        scene = _load_launch(document, models, files, resolver, arms, devices, softening)
    elif document.kind == "model":
        scene = _load_models([document], files, resolver, start.stem, arms, softening)
    else:
        message = f"'{start}' is a {document.kind} file, not a launch or model file"
        raise SceneError(Diagnostic(Severity.ERROR, message, Mark(document.path, 1, 1), "name the launch file"))
    findings = softening.report(Mark(document.path, 1, 1))
    if findings:
        scene = replace(scene, diagnostics=(*scene.diagnostics, *findings))
    if not scene.bodies:
        errors = [d for d in scene.diagnostics if d.severity >= Severity.ERROR]
        raise SceneError(Diagnostic(Severity.ERROR, "the file yields no body to simulate", document.top.mark), *errors)
    return prefixed(scene, namespace_prefix)


def _name_of(path: Path) -> str:
    """A scene in ``suturing/launch.yaml`` is called ``suturing``; another launch file names its scene itself."""
    return path.resolve().parent.name if path.stem == "launch" else path.stem


def _load_models(
    documents: Sequence[Document],
    files: Sequence[str | Path],
    resolver: Resolver,
    name: str,
    arms: Sequence[Mapping[str, str]] | None,
    softening: Softening,
) -> Scene:
    builder = SceneBuilder(name, resolver, _with_arms(WorldSettings(), arms), softening)
    for document in [*_extra(files, resolver, builder), *documents]:
        builder.diagnostics += document.diagnostics
        builder.add_model(document, None)
    return builder.finish()


def _extra(files: Sequence[str | Path], resolver: Resolver, builder: SceneBuilder) -> list[Document]:
    documents = []
    for file in files:
        try:
            documents.append(read_model(Path(file), resolver))
        except AdfError as error:
            builder.diagnostics += error.diagnostics
    return documents


def _load_launch(
    launch: LaunchDocument,
    models: Sequence[int] | None,
    files: Sequence[str | Path],
    resolver: Resolver,
    arms: Sequence[Mapping[str, str]] | None,
    devices: Sequence[int],
    softening: Softening,
) -> Scene:
    found = list(launch.diagnostics)
    world = _world_document(launch, resolver, found)
    shaders = None if world is None else shader_files(world.top, "shaders", world.path.parent)
    builder = SceneBuilder(
        _name_of(launch.path), resolver, _with_arms(_settings(world, shaders, launch), arms), softening
    )
    builder.diagnostics += found
    if world is not None:
        _add_environment(world, builder, resolver)
        builder.add_world(world)
    for document in _extra(files, resolver, builder):
        builder.diagnostics += document.diagnostics
        builder.add_model(document, shaders)
    for document in _selected(launch, models, resolver, builder):
        builder.add_model(document, shaders)
    _add_devices(launch, builder, resolver, devices, shaders)
    return builder.finish()


def _world_document(launch: LaunchDocument, resolver: Resolver, found: list[Diagnostic]) -> Document | None:
    reference = launch.world
    if reference is None:
        return None
    if reference.path is None:
        found += [reference.diagnostic] if reference.diagnostic else []
        return None
    try:
        world = read_world(reference.path, resolver)
    except AdfError as error:
        found += error.diagnostics
        return None
    found += world.diagnostics
    return world


def _with_arms(settings: WorldSettings, arms: Sequence[Mapping[str, str]] | None) -> WorldSettings:
    """The settings with other arms than the file's, where some are given."""
    if arms is None:
        return settings
    return replace(settings, extra={**settings.extra, "ligature arms": [dict(arm) for arm in arms]})


def _settings(world: Document | None, shaders: ShaderFiles | None, launch: LaunchDocument) -> WorldSettings:
    extra: dict[str, Any] = {}
    if launch.top.has("ligature arms"):
        extra["ligature arms"] = launch.top.raw_value("ligature arms")
    if world is None:
        return WorldSettings(extra=extra)
    top = world.top
    namespace = top.text("namespace")
    skybox = None
    if top.has("skybox") and all(top.has(f"skybox.{face}") for face in SKYBOX_FACES):
        folder = world.path.parent / top.text("skybox.path")
        skybox = {face: folder / top.text(f"skybox.{face}") for face in SKYBOX_FACES}
    return WorldSettings(
        namespace=namespace,
        topic=topic_name(namespace, "World"),
        gravity=np.array(top.vector("gravity")),
        max_substeps=top.integer("max iterations"),
        shaders=shaders,
        skybox=skybox,
        extra=extra,
    )


def _add_environment(world: Document, builder: SceneBuilder, resolver: Resolver) -> None:
    """The environment comes before everything and without the world's shader (§29.21)."""
    top = world.top
    if not top.has("environment"):
        return
    mark = top.mark_of("environment")
    try:
        path = resolver.resolve(top.text("environment"), world.path.parent, mark)
        document = read_model(path, resolver)
    except ResolutionError as error:
        builder.report(Diagnostic(Severity.ERROR, error.diagnostic.message, mark, error.diagnostic.hint, "path"))
        return
    except AdfError as error:
        builder.diagnostics += error.diagnostics
        return
    builder.diagnostics += document.diagnostics
    builder.add_model(document, None)


def _selected(
    launch: LaunchDocument, models: Sequence[int] | None, resolver: Resolver, builder: SceneBuilder
) -> list[Document]:
    """The model files of ``models`` that can be read; the others are findings."""
    count = len(launch.models)
    documents = []
    for index in range(count) if models is None else models:
        if not 0 <= index < count:
            message = f"model index {index} is out of range; 'multibody configs' lists {count}, counted from 0"
            builder.report(Diagnostic(Severity.ERROR, message, launch.top.mark_of("multibody configs"), "", "index"))
            continue
        reference = launch.models[index]
        if reference.path is None:
            if reference.diagnostic is not None:
                builder.report(reference.diagnostic)
            continue
        try:
            document = read_model(reference.path, resolver)
        except AdfError as error:
            builder.diagnostics += error.diagnostics
            continue
        builder.diagnostics += document.diagnostics
        documents.append(document)
    return documents


def _add_devices(
    launch: LaunchDocument, builder: SceneBuilder, resolver: Resolver, chosen: Sequence[int],
    shaders: ShaderFiles | None,
) -> None:  # fmt: skip
    reference = launch.devices
    if reference is None or reference.path is None:
        if reference is not None and reference.diagnostic is not None:
            builder.report(reference.diagnostic)
        return
    try:
        document = read_devices(reference.path, resolver)
    except AdfError as error:
        builder.diagnostics += error.diagnostics
        return
    builder.diagnostics += document.diagnostics
    elements = document.elements("input devices")
    builder.devices += [_device(element) for element in elements]
    for index in dict.fromkeys(chosen):
        if not 0 <= index < len(elements):
            message = (
                f"input device index {index} is out of range; 'input devices' lists {len(elements)}, counted from 0"
            )
            builder.report(Diagnostic(Severity.ERROR, message, document.top.mark_of("input devices"), "", "index"))
        elif elements[index].text("simulated multibody"):
            proxy = _proxy(elements[index], document, builder, resolver, shaders)
            builder.devices[index] = replace(builder.devices[index], proxy=proxy)


def _proxy(
    element: Element, document: Document, builder: SceneBuilder, resolver: Resolver, shaders: ShaderFiles | None
) -> int:
    """Create the proxy of an input device; the index of its root link, -1 when it is unavailable."""
    mark = element.mark_of("simulated multibody")
    try:
        path = resolver.resolve(element.text("simulated multibody"), document.path.parent, mark)
        model = read_model(path, resolver)
    except ResolutionError as error:
        builder.report(Diagnostic(Severity.ERROR, error.diagnostic.message, mark, error.diagnostic.hint, "path"))
        return -1
    except AdfError as error:
        builder.diagnostics += error.diagnostics
        return -1
    builder.diagnostics += model.diagnostics
    return builder.add_proxy(model, shaders, element)


def _device(element: Element) -> InputDevice:
    return InputDevice(
        element.key,
        element.text("hardware name"),
        element.text("root link"),
        element.raw(),
        element.mark,
    )
