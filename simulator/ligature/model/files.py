"""Reads every file of a scene, in the order in which AMBF loads them, before anything is built."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
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
from ligature.adf.reader import Reference
from ligature.model.geometry import shader_files
from ligature.model.naming import topic_name
from ligature.model.scene import WorldSettings
from ligature.model.shapes import ShaderFiles
from ligature.paths import real_path

SKYBOX_FACES = ("right", "left", "top", "bottom", "front", "back")

Arms = Sequence[Mapping[str, str]]


@dataclass(frozen=True)
class ModelFile:
    """A file whose objects are to be built.

    Attributes
    ----------
    document
        A model file, or the world file, of which only cameras and lights are built.
    shaders
        The world's shaders, for bodies that have none of their own.
    device
        Index of the input device whose proxy the model is; None for any other model.
    """

    document: Document
    shaders: ShaderFiles | None = None
    device: int | None = None


@dataclass
class SceneFiles:
    """Everything that a scene is built from.

    Attributes
    ----------
    start
        The file that the user named.
    models
        In the order in which their objects enter the scene.
    devices
        The blocks of all input devices, with or without proxy.
    findings
        What is wrong in the files, in the order of reading.
    """

    name: str
    start: Document
    resolver: Resolver
    world: WorldSettings = field(default_factory=WorldSettings)
    models: list[ModelFile] = field(default_factory=list)
    devices: tuple[Element, ...] = ()
    findings: list[Diagnostic] = field(default_factory=list)


def read_scene(
    start: Path,
    resolver: Resolver,
    models: Sequence[int] | None,
    further: Sequence[str | Path],
    arms: Arms | None,
    devices: Sequence[int],
) -> SceneFiles:
    """Read the files of the scene that begins with ``start``; the parameters are those of `ligature.load`.

    Raises `AdfError` when ``start`` cannot be read or names no model.
    """
    document = read_any(start, resolver)
    if document.kind == "launch":
        assert isinstance(document, LaunchDocument)
        return _Reading(document, resolver).launch(document, models, further, arms, devices)
    if document.kind == "model":
        return _Reading(document, resolver).model(document, further, arms)
    message = f"'{start}' is a {document.kind} file, not a launch or model file"
    raise AdfError(Diagnostic(Severity.ERROR, message, Mark(document.path, 1, 1), "name the launch file"))


class _Reading:
    """Reads the files of a scene; a file that cannot be read becomes a finding."""

    def __init__(self, start: Document, resolver: Resolver) -> None:
        self._files = SceneFiles(start.path.stem, start, resolver)
        self._resolver = resolver
        self._found = self._files.findings

    def model(self, document: Document, further: Sequence[str | Path], arms: Arms | None) -> SceneFiles:
        """A scene of model files alone."""
        self._files.world = _settings(None, None, _chosen_arms({}, arms))
        self._add_further(further, None)
        self._found += document.diagnostics
        self._add(document)
        return self._files

    def launch(
        self,
        launch: LaunchDocument,
        models: Sequence[int] | None,
        further: Sequence[str | Path],
        arms: Arms | None,
        devices: Sequence[int],
    ) -> SceneFiles:
        """What a launch file names: the world, its environment, models, and proxies of input devices."""
        files = self._files
        files.name = _name_of(launch.path)
        self._found += launch.diagnostics
        world = self._named(launch.world, read_world)
        shaders = None if world is None else shader_files(world.top, "shaders", world.path.parent)
        files.world = _settings(world, shaders, _chosen_arms(_listed_arms(launch), arms))
        if world is not None:
            # the environment comes before everything and without the world's shader
            if world.top.has("environment"):
                self._add(self._referred(world.top, "environment", world))
            self._add(world)
        self._add_further(further, shaders)
        self._add_selected(launch, models, shaders)
        self._add_devices(launch, devices, shaders)
        return files

    def _read(self, path: Path, read: Any = read_model) -> Document | None:
        """The document at ``path``, with what is wrong in it noted; None when it cannot be read."""
        try:
            document: Document = read(path, self._resolver)
        except AdfError as error:
            self._found += error.diagnostics
            return None
        self._found += document.diagnostics
        return document

    def _named(self, reference: Reference | None, read: Any = read_model) -> Document | None:
        """The document that a launch file names."""
        if reference is None:
            return None
        if reference.path is None:
            self._found += [reference.diagnostic] if reference.diagnostic else []
            return None
        return self._read(reference.path, read)

    def _referred(self, element: Element, key: str, document: Document) -> Document | None:
        """The model that a value of ``document`` names."""
        mark = element.mark_of(key)
        try:
            path = self._resolver.resolve(element.text(key), document.path.parent, mark)
            model = read_model(path, self._resolver)
        except ResolutionError as error:
            self._found.append(
                Diagnostic(Severity.ERROR, error.diagnostic.message, mark, error.diagnostic.hint, "path")
            )
            return None
        except AdfError as error:
            self._found += error.diagnostics
            return None
        self._found += model.diagnostics
        return model

    def _add(self, document: Document | None, shaders: ShaderFiles | None = None, device: int | None = None) -> None:
        if document is not None:
            self._files.models.append(ModelFile(document, shaders, device))

    def _add_further(self, further: Sequence[str | Path], shaders: ShaderFiles | None) -> None:
        for file in further:
            self._add(self._read(Path(file)), shaders)

    def _add_selected(self, launch: LaunchDocument, models: Sequence[int] | None, shaders: ShaderFiles | None) -> None:
        """The model files of ``models``; an index that is out of range is a finding."""
        count = len(launch.models)
        for index in range(count) if models is None else models:
            if 0 <= index < count:
                self._add(self._named(launch.models[index]), shaders)
            else:
                message = f"model index {index} is out of range; 'multibody configs' lists {count}, counted from 0"
                self._found.append(_out_of_range(message, launch, "multibody configs"))

    def _add_devices(self, launch: LaunchDocument, chosen: Sequence[int], shaders: ShaderFiles | None) -> None:
        """All input devices, and the proxies of those that are chosen."""
        document = self._named(launch.devices, read_devices)
        if document is None:
            return
        devices = self._files.devices = document.elements("input devices")
        for index in dict.fromkeys(chosen):
            if 0 <= index < len(devices):
                if devices[index].text("simulated multibody"):
                    self._add(self._referred(devices[index], "simulated multibody", document), shaders, index)
            else:
                message = (
                    f"input device index {index} is out of range; 'input devices' lists {len(devices)}, counted from 0"
                )
                self._found.append(_out_of_range(message, document, "input devices"))


def _out_of_range(message: str, document: Document, key: str) -> Diagnostic:
    return Diagnostic(Severity.ERROR, message, document.top.mark_of(key), "", "index")


def _name_of(path: Path) -> str:
    """A scene in ``suturing/launch.yaml`` is called ``suturing``; another launch file names its scene itself."""
    return real_path(path).parent.name if path.stem == "launch" else path.stem


def _listed_arms(launch: LaunchDocument) -> dict[str, Any]:
    """The arms that a launch file states, if it does."""
    return {"ligature arms": launch.top.raw_value("ligature arms")} if launch.top.has("ligature arms") else {}


def _chosen_arms(listed: dict[str, Any], arms: Arms | None) -> dict[str, Any]:
    """The file's arms, or ``arms`` where some are given."""
    return listed if arms is None else {"ligature arms": [dict(arm) for arm in arms]}


def _settings(world: Document | None, shaders: ShaderFiles | None, extra: dict[str, Any]) -> WorldSettings:
    """The settings of a world file; the defaults without one."""
    if world is None:
        return WorldSettings(extra=extra)
    top = world.top
    namespace = top.text("namespace")
    skybox = None
    if top.has("skybox") and all(top.text(f"skybox.{face}") for face in SKYBOX_FACES):
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
