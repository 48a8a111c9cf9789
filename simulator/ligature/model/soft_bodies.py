"""Soft bodies of AMBF as tissue that nothing holds.

Bullet's soft body is a surface of M kg with n nodes and springs along its edges; each iteration of a step takes away
the share ``kLST`` of what a spring is too long. For one spring between two nodes that leaves the stiffness

    k = κ / (1 - κ) · m / (2 dt²),   κ = 1 - (1 - kLST)^piterations,   m = M / n.

A sheet of such springs in triangles has the Young's modulus 2 k / √3 times its thickness (Ostoja-Starzewski, Applied
Mechanics Reviews 55, 2002, 35), and a surface S around a volume V resists a pull as a solid of 2/3 S / V times that
does, which is exact for cubes and spheres. ``kMT`` draws each node by that share of its way towards where it would be
in the shape at rest: a strain costs what springs of κ / (1 - κ) · m / dt² to all nodes would, and their mean square
distance from the centre makes a modulus of it. The sum of both is Young's modulus.

SI units, frames as in `ligature.model.scene`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Element, Severity
from ligature.adf.diagnostics import AdfError
from ligature.mesh import load_mesh
from ligature.mesh.surface import joined, open_edges
from ligature.mesh.voxels import volume
from ligature.model.doubts import doubts
from ligature.model.frames import Array, pose_matrix
from ligature.model.geometry import FileContext, GeometryError, collision_mesh, visual
from ligature.model.material import TissueMaterial
from ligature.model.scene import Body
from ligature.model.shapes import ShaderFiles
from ligature.model.soft import TissueForm
from ligature.model.tissue import check_density, form_of, inertial_of, material_of

STEP = 1e-3
"""Seconds between steps for which AMBF's stiffnesses hold."""

SOFTEST, STIFFEST = 4.0, 1e6
"""Bounds of Young's modulus from stiffnesses: the least over the pressure of a column of its own size, and Pa.

What is softer lies flat like a puddle; springs of ``kLST: 1`` do not yield at all.
"""

GRAVITY = 9.8
"""Acceleration in m/s² that this pressure is for."""

POISSON, POISSON_OF_VOLUME = 0.3, 0.45
"""Poisson's ratio of a network of springs, and where ``kVC`` or ``kPR`` keeps the volume."""

SHARES = ("kLST", "kMT", "kDP")
"""Keys of ``config`` from 0 to 1."""

MOST_PINS = 24
"""Fixed nodes up to which each is a pin; more hold the grid itself."""


def soft_body_of(
    element: Element, context: FileContext, gravity: Array, shaders: ShaderFiles | None
) -> Callable[..., Body]:
    """Makes a soft body of ``index`` and ``identity``; ``gravity`` (3,) is the world's. Raises `GeometryError`."""
    looks, mass = visual(element, context, shaders), element.number("mass")
    _report_shares(element, context)
    vertices, faces, points = _surface(element, context)
    form = form_of(element, vertices, faces, _material(element, context, vertices, faces, mass)).scaled(mass)
    check_density(element, form)
    held = _fixed_nodes(element, context, points)
    if len(held) > MOST_PINS:
        form = replace(form, fixed=_nearest(form, held))
    elif len(held):
        form = replace(form, pins=form.embed(held))
    T_body_inertial, inertia = inertial_of(form, mass, None)
    place = pose_matrix(*element.pose("location"))
    for doubt in doubts(element, form, mass, place[:3, :3], gravity):
        context.report(doubt)
    damping = 1.0 - (1.0 - min(max(element.number("config.kDP"), 0.0), 1.0)) ** round(1.0 / STEP)
    friction = element.value("ligature tissue.surface friction")
    return partial(
        Body,
        mass=0.0 if form.fixed.any() else mass,
        inertia=inertia,
        T_body_inertial=T_body_inertial,
        T_world_body=place,
        gravity=gravity,
        visual=looks,
        friction=element.number("config.kDF") if friction is None else float(friction),
        linear_damping=damping,
        angular_damping=damping,
        tissue=form,
    )


def _report_shares(element: Element, context: FileContext) -> None:
    """Report the keys beyond 0 and 1, of which the nearer one is taken."""
    for name in SHARES:
        value = element.number(f"config.{name}")
        if not 0.0 <= value <= 1.0:
            message = f"soft body '{element.key}' has the {name} {value:g}; {min(max(value, 0.0), 1.0):g} is taken"
            mark = element.mark_of(f"config.{name}")
            context.report(Diagnostic(Severity.WARNING, message, mark, "give 0 to 1", "tissue"))


def stiffness_of(element: Element, vertices: Array, faces: NDArray[np.int32], mass: float) -> float:
    """Young's modulus in Pa that ``config`` amounts to for ``mass`` kilograms in a welded, closed surface."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area, inside = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()), volume(vertices, faces)
    unit = mass / len(vertices) / STEP**2
    springs = 0.5 * unit * _hardness(element.number("config.kLST"), element.integer("config.piterations"))
    shape = unit * _hardness(element.number("config.kMT"), 1)
    square = float((vertices - vertices.mean(axis=0)).var(axis=0).mean())
    young = 2.0 / 3.0 * area / inside * 2.0 / np.sqrt(3.0) * springs + shape * len(vertices) * square / inside
    return float(young)


def bounded(young: float, vertices: Array, faces: NDArray[np.int32], mass: float) -> float:
    """Young's modulus that ``mass`` kilograms in a closed surface may have, the nearest to the given one."""
    column = mass / volume(vertices, faces) * GRAVITY * float(np.ptp(vertices, axis=0).max())
    return min(max(young, SOFTEST * column), STIFFEST)


def _hardness(share: float, times: int) -> float:
    """κ / (1 - κ), for a gain that removes a share of an error several times a step."""
    left = (1.0 - min(max(share, 0.0), 1.0)) ** max(times, 0)
    return (1.0 - left) / left if left > 0.0 else np.inf


def _material(
    element: Element, context: FileContext, vertices: Array, faces: NDArray[np.int32], mass: float
) -> TissueMaterial:
    """The material that the file states in Ligature's own block, else that of the stiffnesses in ``config``."""
    given = [element.value(f"ligature tissue.{key}") for key in ("material", "youngs modulus")]
    if any(value is not None for value in given):
        return material_of(element, "ligature tissue.", None)
    keeps = any(element.number(f"config.{key}") > 0.0 for key in ("kVC", "kPR"))
    wanted = stiffness_of(element, vertices, faces, mass)
    young = bounded(wanted, vertices, faces, mass)
    if young != wanted:
        what = f"gets a Young's modulus of {young:.3g} Pa; its 'config' amounts to {wanted:.3g}"
        message = f"soft body '{element.key}' {what}"
        hint = "state one by 'ligature tissue: {youngs modulus: …}', docs/tissue.md"
        context.report(Diagnostic(Severity.INFO, message, element.mark_of("config"), hint, "tissue"))
    base = TissueMaterial(young, POISSON_OF_VOLUME if keeps else POISSON)
    return material_of(element, "ligature tissue.", base) if element.has("ligature tissue") else base


def _surface(element: Element, context: FileContext) -> tuple[Array, NDArray[np.int32], Array]:
    """The closed surface in B: vertices (n, 3), faces (m, 3); and the vertices as the file numbers them."""
    name = element.text("collision mesh") if element.has("collision mesh") else element.text("mesh")
    if not name:
        raise _error(element, "mesh", "has no mesh", "give a closed 'mesh'")
    try:
        mesh = load_mesh(collision_mesh(element, name, context), context.resolver)
    except AdfError as error:
        raise GeometryError(error.diagnostics[0]) from error
    vertices, faces = joined(mesh.parts)
    if not len(faces):
        raise _error(
            element, "mesh", f"has the mesh '{name}' without faces", "give a closed surface; ropes are `sutures`"
        )
    missing = open_edges(faces)
    if missing:
        what = f"is cloth: '{name}' has {missing} open edges, and open surfaces are not simulated"
        raise _error(element, "mesh", what, "give it a thickness, so that the mesh is closed")
    if volume(vertices, faces) < 0.0:
        faces = np.ascontiguousarray(faces[:, ::-1])
    scale = element.number("scale")
    points = mesh.vertices if mesh.points is None else mesh.points
    return vertices * scale, faces, points * scale


def _fixed_nodes(element: Element, context: FileContext, points: Array) -> Array:
    """Places in B of the vertices that stay, (k, 3); as in AMBF the first index that does not exist ends the list."""
    held = []
    for index in element.numbers("config.fixed nodes"):
        if not 0 <= index < len(points):
            message = f"soft body '{element.key}' has no node {index:g} to fix; it and those after it are left out"
            mark = element.mark_of("config.fixed nodes")
            context.report(Diagnostic(Severity.WARNING, message, mark, f"use 0 to {len(points) - 1}", "tissue"))
            break
        held.append(points[int(index)])
    places: Array = np.unique(np.array(held).reshape(-1, 3), axis=0)
    return places


def _nearest(form: TissueForm, places: Array) -> NDArray[np.bool_]:
    """The grid's nodes (n,) that are nearest to places (k, 3)."""
    fixed = np.zeros(len(form.grid.nodes), dtype=bool)
    for place in places:
        fixed[np.argmin(((form.grid.nodes - place) ** 2).sum(axis=1))] = True
    return fixed


def _error(element: Element, key: str, message: str, hint: str) -> GeometryError:
    text = f"soft body '{element.key}' {message}"
    return GeometryError(Diagnostic(Severity.ERROR, text, element.mark_of(key), hint, "tissue"))
