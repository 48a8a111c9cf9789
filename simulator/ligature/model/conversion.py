"""Converts the elements of one document into parts that stand alone: without index, identity and other objects.

The way of a document is forward: its elements are converted here, all of them; the builder then names the parts,
settles the bodies that they name, and joins them. Frames and units as in `ligature.model.scene`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from ligature.adf import Diagnostic, Document, Element, Resolver
from ligature.model.frames import Array
from ligature.model.geometry import FileContext, GeometryError, shader_files
from ligature.model.mounted import camera_of, ghost_of, light_of, sensor_rays
from ligature.model.parts import body_of, sensor_of
from ligature.model.scene import Body, Camera, Ghost, Light, Sensor
from ligature.model.shapes import ShaderFiles
from ligature.model.soft_bodies import soft_body_of
from ligature.model.volumes import volume_of

Kind = TypeVar("Kind")


@dataclass(frozen=True)
class Part(Generic[Kind]):
    """One converted element.

    Attributes
    ----------
    element
        What it was converted from.
    make
        Makes the object of its ``index``, ``identity`` and, for a sensor, ``parent``; None when it cannot be built.
    findings
        What the conversion found, in order; the last is the reason where ``make`` is None.
    """

    element: Element
    make: Callable[..., Kind] | None
    findings: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True)
class Mounts:
    """The cameras and lights of a world or model file."""

    lights: tuple[Part[Light], ...]
    cameras: tuple[Part[Camera], ...]


@dataclass(frozen=True)
class ModelParts:
    """The parts of a model file; joints, actuators and sutures need built bodies and stay elements."""

    gravity: Array
    bodies: tuple[Part[Body], ...]
    soft_bodies: tuple[Part[Body], ...]
    ghosts: tuple[Part[Ghost], ...]
    volumes: tuple[Part[Body], ...]
    sensors: tuple[Part[Sensor], ...]
    mounts: Mounts


def converted(document: Document, resolver: Resolver, shaders: ShaderFiles | None, gravity: Array) -> ModelParts:
    """The parts of a model file; its own shaders and gravity (3,) come before those of the world."""
    top, folder, world = document.top, document.path.parent, gravity
    shaders = shader_files(top, "shaders", folder) or shaders
    if top.has("gravity"):
        gravity = np.array(top.vector("gravity"))

    def each(key: str, draft: Callable[[Element, FileContext], Callable[..., Any]]) -> tuple[Part[Any], ...]:
        return tuple(_converted(element, draft, document, resolver) for element in document.elements(key))

    return ModelParts(
        gravity,
        each("bodies", lambda element, context: body_of(element, context, gravity, shaders)),
        each("soft bodies", lambda element, context: soft_body_of(element, context, world, shaders)),
        each("ghost objects", ghost_of),
        each("volumes", volume_of),
        each("sensors", lambda element, _: sensor_of(element, sensor_rays(element, folder, resolver))),
        mounts(document),
    )


def mounts(document: Document) -> Mounts:
    """The cameras and lights of a file."""
    return Mounts(
        tuple(Part(element, light_of(element)) for element in document.elements("lights")),
        tuple(Part(element, camera_of(element, document.path.parent)) for element in document.elements("cameras")),
    )


def _converted(
    element: Element,
    draft: Callable[[Element, FileContext], Callable[..., Any]],
    document: Document,
    resolver: Resolver,
) -> Part[Any]:
    """Convert one element; if that fails, the last finding states why."""
    findings: list[Diagnostic] = []
    top = document.top
    context = FileContext(
        document.path.parent, top.text("high resolution path"), top.text("low resolution path"),
        resolver, findings.append,
    )  # fmt: skip
    try:
        make = draft(element, context)
    except GeometryError as error:
        return Part(element, None, (*findings, error.diagnostic))
    return Part(element, make, tuple(findings))
