"""Checks of files: meshes and materials on the disk, units, cameras, old keys, noise, leftovers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ligature.adf import Element, ResolutionError, Severity
from ligature.authoring.lint.subject import HIGH, Finding, Subject, rule
from ligature.paths import real_path

LARGEST, SMALLEST = 100.0, 1e-3
"""Metres beyond which a model is suspected of another unit."""

NEAR_TO_FAR = 1e5
NOISE = 1e-6
_ABSOLUTE = re.compile(r"([A-Za-z]:)?[\\/]")
_MESH_KEYS = ("mesh", "collision mesh")
_OLD_KEYS = ("detached", "redundant", "controller gains")


@rule("duplicate-identifier")
def duplicate_identifier(subject: Subject) -> Iterator[Finding]:
    """Of two definitions with one key the second is lost."""
    for twice in subject.document.root.duplicates:
        message = f"'{twice.text}' is defined twice; the second definition is ignored (line {twice.mark.line})"
        yield Finding(
            "duplicate-identifier", Severity.ERROR, twice.text, message, "give one of them another identifier"
        )


@rule("mesh-missing")
def mesh_missing(subject: Subject) -> Iterator[Finding]:
    """A body whose mesh cannot be loaded is not created."""
    for element, key, path in _mesh_files(subject):
        if path.name in subject.unsaved:
            continue
        try:
            real = subject.resolver.allow(path)
        except ResolutionError as error:
            yield Finding(
                "path-outside", Severity.ERROR, element.key, error.diagnostic.message, "keep meshes with the scene"
            )
            continue
        fallback = key == "collision mesh" and (subject.folder(element, HIGH) / path.name).is_file()
        if not real.is_file():
            severity = Severity.WARNING if fallback else Severity.ERROR
            message = f"its {key} '{path.name}' is not in {path.parent}"
            yield Finding("mesh-missing", severity, element.key, message, "export the mesh, or correct the name")


@rule("mesh-empty")
def mesh_empty(subject: Subject) -> Iterator[Finding]:
    """A file without faces shows nothing and collides with nothing."""
    for element, key, path in _mesh_files(subject):
        mesh = subject.mesh(element, key)
        if mesh is not None and not any(len(part.faces) for part in mesh.parts):
            yield Finding(
                "mesh-empty", Severity.ERROR, element.key, f"its {key} '{path.name}' has no face", "export it again"
            )


@rule("material-dialect")
def material_dialect(subject: Subject) -> Iterator[Finding]:
    """The reference takes the rest of a texture line for the name: no options, no absolute paths."""
    for element, _, path in _mesh_files(subject):
        library = path.with_suffix(".mtl")
        if not library.is_file() or not subject.resolver.exists(library):
            continue
        for number, line in enumerate(subject.resolver.read_text(library).splitlines(), 1):
            word, _, rest = line.strip().partition(" ")
            rest = rest.strip()
            if not word.startswith("map_"):
                continue
            if rest.startswith("-"):
                message = f"{library.name}:{number} has an option before the texture's name"
            elif _ABSOLUTE.match(rest):
                message = f"{library.name}:{number} names a texture by an absolute path"
            else:
                continue
            yield Finding("material-dialect", Severity.ERROR, element.key, message, "export the mesh again")


@rule("normal-map-without-uv")
def normal_map_without_uv(subject: Subject) -> Iterator[Finding]:
    """A normal map needs texture coordinates."""
    for element, key, path in _mesh_files(subject):
        mesh = subject.mesh(element, key) if key == "mesh" else None
        for part in mesh.parts if mesh else ():
            if part.material is not None and part.material.normal_map is not None and part.uvs is None:
                message = f"'{part.name}' of {path.name} has a normal map and no texture coordinates"
                yield Finding("normal-map-without-uv", Severity.WARNING, element.key, message, "unwrap the mesh")


@rule("low-equals-high")
def low_equals_high(subject: Subject) -> Iterator[Finding]:
    """A collision mesh as fine as the visual one is no low-resolution mesh."""
    for body in subject.bodies.values():
        high = subject.mesh_path(body, "mesh")
        low = subject.mesh_path(body, "collision mesh")
        if high is None or low is None or high == low or body.has("collision shape"):
            continue
        if (
            high.is_file()
            and low.is_file()
            and high.stat().st_size == low.stat().st_size
            and _same_bytes(subject, high, low)
        ):
            message = f"its collision mesh '{low.name}' is a copy of the visual mesh"
            yield Finding("low-equals-high", Severity.WARNING, body.key, message, "decompose or decimate it")


@rule("file-unreferenced")
def file_unreferenced(subject: Subject) -> Iterator[Finding]:
    """Meshes that nothing names are left over; another file of the folder may use them.

    A folder that is not below the file's own belongs to several models, whose files may lie anywhere.
    """
    home = real_path(subject.document.path.parent)
    used = {real_path(path) for _, _, path in _mesh_files(subject)}
    folders = {path.parent for path in used}
    others = [
        f for f in subject.document.path.parent.glob("*.yaml") if real_path(f) != real_path(subject.document.path)
    ]
    texts = [subject.resolver.read_text(f) for f in others if subject.resolver.exists(f)]
    for folder in sorted(f for f in folders if f.is_dir() and f.is_relative_to(home)):
        for file in sorted(folder.iterdir()):
            if file.suffix.lower() not in (".obj", ".stl", ".3ds") or real_path(file) in used:
                continue
            if not any(file.name in text for text in texts):
                message = f"nothing refers to '{file.name}' in {folder.name}"
                hint = "remove it, unless a file of another folder uses it"
                yield Finding("file-unreferenced", Severity.WARNING, "", message, hint)


@rule("unit-smell")
def unit_smell(subject: Subject) -> Iterator[Finding]:
    """A model larger than a house or smaller than a millimetre is in another unit."""
    places = [b.pose("location")[0] for b in subject.bodies.values()]
    corners = [np.asarray(p) for p in places]
    for body in subject.bodies.values():
        mesh = subject.outside(body)
        if mesh is not None and len(mesh.vertices):
            place, vertices = np.asarray(body.pose("location")[0]), mesh.vertices * body.number("scale")
            corners += [place + vertices.min(0), place + vertices.max(0)]
    if len(corners) < 2:
        return
    size = float(np.ptp(np.array(corners), axis=0).max())
    if size > LARGEST or 0.0 < size < SMALLEST:
        yield Finding("unit-smell", Severity.WARNING, "", f"the model is {size:.3g} m large", "lengths are metres")


@rule("clipping-ratio")
def clipping_ratio(subject: Subject) -> Iterator[Finding]:
    """Depth is precise only when near and far are not too far apart."""
    for camera in subject.document.elements("cameras"):
        near, far = camera.number("clipping plane.near"), camera.number("clipping plane.far")
        if near > 0.0 and far / near > NEAR_TO_FAR:
            message = f"it sees from {near:g} m to {far:g} m, a ratio of {far / near:.2g}"
            yield Finding("clipping-ratio", Severity.WARNING, camera.key, message, "keep the ratio below 100000")


@rule("legacy-key")
def legacy_key(subject: Subject) -> Iterator[Finding]:
    """Keys of old exporters that do nothing."""
    for joint in subject.joints:
        for name in _OLD_KEYS:
            if joint.has(name):
                message = f"'{name}' has no effect"
                yield Finding("legacy-key", Severity.WARNING, joint.key, message, "remove it", {name: None})


@rule("float-noise")
def float_noise(subject: Subject) -> Iterator[Finding]:
    """Numbers of vectors and poses that are meant to be zero; masses, moments and damping may well be small."""
    for element in subject.objects:
        noisy = [path for path, value in element.given().items() if isinstance(value, tuple) and _noisy(value)]
        if noisy:
            message = f"'{noisy[0]}' holds numbers that are nearly zero"
            yield Finding("float-noise", Severity.INFO, element.key, message, "they are the rounding of an exporter")


def _noisy(value: object) -> bool:
    if isinstance(value, float):
        return 0.0 < abs(value) < NOISE
    return isinstance(value, tuple) and len(value) <= 3 and any(_noisy(v) for v in value)


def _mesh_files(subject: Subject) -> Iterator[tuple[Element, str, Path]]:
    for element in subject.objects:
        if element.kind in ("body", "ghost object", "soft body"):
            for key in _MESH_KEYS:
                path = subject.mesh_path(element, key)
                if path is not None and not (key == "collision mesh" and element.has("collision shape")):
                    yield element, key, path


def _same_bytes(subject: Subject, a: Path, b: Path) -> bool:
    try:
        return subject.resolver.read_bytes(a) == subject.resolver.read_bytes(b)
    except ResolutionError:
        return False
