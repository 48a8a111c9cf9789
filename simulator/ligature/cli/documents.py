"""``ligature fmt``, ``diff`` and ``inertia``: canonical form, differences in meaning, and mass properties of scenes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from ligature.adf import AdfError, Document, Element, Resolver, Severity, read_any
from ligature.adf.update import items_of, new_text, same
from ligature.authoring.generate import mass_keys
from ligature.authoring.lint.subject import Subject
from ligature.authoring.save import SaveError, checked_text, save_all
from ligature.authoring.shapes import shapes_properties
from ligature.mesh.inertia import MassProperties, mass_properties
from ligature.mesh.load import EXTENSIONS, load_mesh
from ligature.mesh.surface import joined
from ligature.model.material import MATERIALS
from ligature.paths import real_path
from ligature.process import signals_held

DENSITY = 1000.0
"""kg/m³ of what states neither mass nor density."""


def fmt(files: Sequence[Path], check: bool, lossy: bool, console: Console) -> int:
    """Write files in canonical form, or report those that are not; returns the exit status.

    Comments, anchors and blocks that no list names have no place in the canonical form: a file that
    has them is left alone unless ``lossy``.
    """
    status = 0
    for file in files:
        document = _read(file, console)
        if document is None:
            status = 1
            continue
        text = new_text(document.kind, document.top.given(), items_of(document))
        lost = _lost(document)
        if text == document.text:
            continue
        if check:
            console.print(f"{file}: is not in canonical form", markup=False)
            status = 1
        elif lost and not lossy:
            console.print(
                f"{file}: not written, because {lost} would be lost; write it anyway with --lossy", markup=False
            )
            status = 1
        else:
            status = max(status, _save(file, text, console))
    return status


def _lost(document: Document) -> str:
    """Content of a file that the canonical form cannot represent."""
    if any(line.lstrip().startswith("#") or " #" in line for line in document.text.splitlines()):
        return "its comments"
    if any(d.code == "unlisted" for d in document.diagnostics):
        return "blocks that no list names"
    return "what cannot be read" if any(d.severity >= Severity.ERROR for d in document.diagnostics) else ""


def _save(file: Path, text: str, console: Console) -> int:
    try:
        with signals_held():
            save_all({real_path(file): checked_text(text, file)})
    except SaveError as error:
        console.print(str(error), style="red", markup=False)
        return 1
    console.print(f"{file}: written", markup=False)
    return 0


def diff(before: Path, after: Path, console: Console) -> int:
    """Print what two files state differently, object by object; returns 1 when they differ."""
    documents = [_read(file, console) for file in (before, after)]
    if documents[0] is None or documents[1] is None:
        return 2
    old, new = ({i.key: (i.kind, dict(i.values)) for i in items_of(d)} for d in documents if d is not None)
    old[""], new[""] = (("file", d.top.given()) for d in documents if d is not None)
    lines: list[str] = []
    for key in dict.fromkeys((*old, *new)):
        if key not in new:
            lines.append(f"- {old[key][0]} '{key}'")
        elif key not in old:
            lines.append(f"+ {new[key][0]} '{key}'")
        else:
            lines += _changes(key or "file", old[key][1], new[key][1])
    for line in lines:
        console.print(line, markup=False)
    return int(bool(lines))


def _changes(key: str, old: dict[str, object], new: dict[str, object]) -> list[str]:
    lines = []
    for path in dict.fromkeys((*old, *new)):
        before, after = old.get(path), new.get(path)
        if before is None or after is None or not same(before, after):
            lines.append(f"  {key}: {path}: {_shown(before)} -> {_shown(after)}")
    return lines


def _shown(value: object) -> str:
    return "default" if value is None else str(value)


def inertia(file: Path, density: float | None, mass: float | None, console: Console) -> int:
    """Print the mass properties of a mesh file, or of every body of a model; returns the exit status.

    A body without mass has ``density``, by default that of its tissue or else `DENSITY`.
    """
    resolver = Resolver.for_file(file)
    if file.suffix.lower() in EXTENSIONS:
        try:
            solid = mass_properties(*joined(load_mesh(real_path(file), resolver).parts), density or DENSITY)
        except AdfError as error:
            console.print(str(error), style="red", markup=False)
            return 1
        except ValueError as error:
            console.print(f"{file}: {error}", style="red", markup=False)
            return 1
        _print_solid(file.name, solid if mass is None else solid.with_mass(mass), console)
        return 0
    document = _read(file, console)
    if document is None:
        return 1
    if document.kind != "model":
        console.print(f"{file}: this is a {document.kind} file; give a mesh or a model", style="red", markup=False)
        return 1
    subject = Subject(document, resolver)
    if not subject.bodies:
        console.print(f"{file}: the file has no body; give a mesh or a model", style="red", markup=False)
        return 1
    for body in subject.bodies.values():
        try:
            solid = _solid(subject, body)
        except ValueError as error:
            console.print(f"{body.key}: {error}", markup=False)
            continue
        weight = body.number("mass") if mass is None else mass
        weight = weight or (density or _tissue_density(body) or DENSITY) * solid.volume
        _print_solid(body.key, solid.with_mass(weight), console)
    return 0


def _tissue_density(body: Element) -> float | None:
    """The density in kg/m³ that a body states for its tissue as a whole; None where it states none."""
    if body.has("ligature tissue.density"):
        return body.number("ligature tissue.density")
    material = MATERIALS.get(body.text("ligature tissue.material")) if body.has("ligature tissue.material") else None
    return None if material is None else material.density


def _solid(subject: Subject, body: Element) -> MassProperties:
    """Mass properties at unit density, of the collision shapes, else of the mesh; tissue fills what is drawn first."""
    soft = body.has("ligature tissue")
    surface = subject.surface(body)
    placed = (subject.looks(body) if soft else []) or subject.shapes(body)
    shapes = [(shape, T) for shape, T in placed if shape.kind != "PLANE"]
    if shapes and not (soft and subject.mesh(body, "mesh") is not None):
        return shapes_properties(shapes)
    if surface is None:
        need = "a 'shape'" if soft else "a 'collision shape'"
        raise ValueError(f"there is neither a mesh nor a shape to measure; add {need} or a 'mesh'")
    return mass_properties(*surface)


def _print_solid(name: str, solid: MassProperties, console: Console) -> None:
    keys = mass_keys(solid)
    moments = ", ".join(f"i{a}: {keys[f'inertia.i{a}']:.6g}" for a in "xyz")
    (x, y, z), (r, p, yaw) = keys["inertial offset"]
    turned = f", orientation {{r: {r:.6g}, p: {p:.6g}, y: {yaw:.6g}}}" if np.any([r, p, yaw]) else ""
    console.print(
        f"{name}: mass {solid.mass:.6g} kg, volume {solid.volume:.6g} m³, inertia {{{moments}}}, "
        f"position {{x: {x:.6g}, y: {y:.6g}, z: {z:.6g}}}{turned}",
        markup=False,
    )


def _read(file: Path, console: Console) -> Document | None:
    try:
        return read_any(file, Resolver.for_file(file))
    except AdfError as error:
        console.print(str(error), style="red", markup=False)
        return None
