"""Reads bodies of soft tissue from their elements: a grid that fills the body's shape, and its materials.

SI units, frames as in `ligature.model.scene`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Element, Severity
from ligature.adf.diagnostics import length
from ligature.mesh import load_mesh
from ligature.mesh.surface import joined
from ligature.mesh.voxels import NoTissueError, usual_cell, voxelise
from ligature.model.frames import Array, frame
from ligature.model.geometry import FileContext, GeometryError
from ligature.model.material import KEYS, MATERIALS, TissueMaterial
from ligature.model.soft import TissueForm
from ligature.model.solids import surface_of

if TYPE_CHECKING:
    from ligature.mesh.grid import Grid
    from ligature.model.scene import Body
    from ligature.model.shapes import Collider, Visual

STARTS, DENSE = ("material", "youngs modulus"), ("material", "density")
"""Keys of which one begins a material, and of which one states its density."""
FACES = ("-x", "+x", "-y", "+y", "-z", "+z")
MOST_NODES = 6000
"""Most nodes of a body: with more, a step takes longer than the four ticks that it stands for."""
SETTLING = 1e-3
"""Seconds in which elastic forces are to be felt against the mass: a tick."""
STIFF_OVER_HEAVY = 1e10
"""Most elastic over inertial forces in `SETTLING`; from 10¹³ on elimination fails for a Poisson's ratio of 0.499."""
MOST_AROUND = 20
"""Nodes of the grid around a shape, for each of `MOST_NODES`: of a larger grid nothing is sampled."""


def tissue_of(
    element: Element, context: FileContext, visual: Visual, colliders: Sequence[Collider]
) -> TissueForm | None:
    """The tissue of a body's element, None for a rigid one; raises `GeometryError`.

    Its shape is that of the visual mesh, else of the visual primitives, else of the collision shapes.
    """
    if not element.has("ligature tissue"):
        return None
    form = form_of(element, *_surface(element, context, visual, colliders), _base(element))
    return replace(form, support=element.text("ligature tissue.carried by"))


def _base(element: Element) -> TissueMaterial | None:
    """The material of the whole body; None where every layer has its own, and the body none."""
    layers = element.children("ligature tissue.layers")
    if layers and not any(element.has(f"ligature tissue.{key}") for key in STARTS):
        lacking = [n for n, item in enumerate(layers) if not any(item.has(key) for key in STARTS)]
        if lacking:
            hint = f"give 'youngs modulus' in Pa, or material: {', '.join(MATERIALS)}; in every layer, or once for all"
            what = f"has no tissue material, and none in layer {lacking[0] + 1}"
            raise _error(element, "ligature tissue.layers", what, hint)
        return None
    return material_of(element, "ligature tissue.", None)


def form_of(element: Element, vertices: Array, faces: NDArray[np.int32], base: TissueMaterial | None) -> TissueForm:
    """The tissue that fills a surface, vertices (n, 3) in B and faces (m, 3); raises `GeometryError`."""
    cell = element.value("ligature tissue.cell size")
    if cell is None:
        cell = usual_cell(vertices, bool(element.texts("ligature tissue.fixed")))
    nodes = np.prod(np.ceil(np.ptp(vertices, axis=0) / cell) + 1.0)
    if nodes > MOST_AROUND * MOST_NODES:
        size = " x ".join(length(extent) for extent in np.ptp(vertices, axis=0))
        raise _error(element, "ligature tissue.cell size", f"lies in a grid of {nodes:.6g} nodes",
                     f"at most {MOST_NODES} are simulated; use cells above {length(cell)} in {size}")  # fmt: skip
    slits = [np.array([item.vector("from"), item.vector("to")]) for item in element.children("ligature tissue.slits")]
    materials, heights = _layers(element, base, float(vertices[:, 2].max()))
    try:
        grid, _ = voxelise(vertices, faces, cell, slits=slits, planes=((), (), heights))
    except NoTissueError as error:
        key = "ligature tissue.slits" if "slit" in error.message else "ligature tissue"
        raise _error(element, key, f"cannot be tissue: {error.message}", error.hint) from None
    middle = grid.nodes[grid.cells].mean(axis=1)[:, 2]
    layer = np.searchsorted(-np.array(heights), -middle).astype(np.int64)
    grid = replace(grid, layer=layer)
    if len(grid.nodes) > MOST_NODES:
        raise _error(element, "ligature tissue.cell size", f"has {len(grid.nodes)} nodes",
                     f"at most {MOST_NODES} are simulated; use larger cells than {length(cell)}")  # fmt: skip
    fixed = _fixed(element, grid)
    layers = element.children("ligature tissue.layers")
    stated = any(element.has(f"ligature tissue.{key}") for key in DENSE)
    stated = stated or (len(layers) > 0 and all(any(item.has(key) for key in DENSE) for item in layers))
    return TissueForm(grid, materials, fixed, own_density=stated, slits=tuple(slits))


def check_density(element: Element, form: TissueForm) -> None:
    """Raise `GeometryError` for tissue so light for its stiffness that rounding hides its mass from a step's matrix."""
    material = max(form.materials, key=lambda m: m.youngs * (1.0 + m.damping / SETTLING) / m.density)
    stiff = material.youngs * (1.0 + material.damping / SETTLING) * SETTLING**2
    least = stiff / (STIFF_OVER_HEAVY * float(form.grid.sizes.min()) ** 2)
    if form.fixed.any() or material.density >= least:
        return
    key = "ligature tissue.density" if element.has("ligature tissue.density") else "mass"
    what = f"has {material.density:.3g} kg/m³, too little for a Young's modulus of {material.youngs:.3g} Pa"
    raise _error(element, key, what, f"give a larger mass, softer tissue, or at least {least:.3g} kg/m³")


def inertial_of(form: TissueForm, mass: float, T_body_inertial: Array | None) -> tuple[Array, Array]:
    """Inertial frame (4, 4) in B, the given one if any, and moments (3,) of ``mass`` kilograms of tissue at rest."""
    shares = form.cell_masses / form.cell_masses.sum()
    centres, sizes = form.grid.nodes[form.grid.cells].mean(axis=1), form.grid.sizes
    if T_body_inertial is None:
        T_body_inertial = frame(np.eye(3), shares @ centres)
    at = (centres - T_body_inertial[:3, 3]) @ T_body_inertial[:3, :3]
    square = shares @ (at**2 + sizes**2 / 12.0)
    return T_body_inertial, mass * (square.sum() - square)


def tissue_findings(bodies: Iterable[Body]) -> list[Diagnostic]:
    """Findings that name the bodies of tissue and the size of their grids."""
    findings = []
    for body in bodies:
        if body.tissue is not None:
            grid = body.tissue.grid
            edges = _edges(np.median(grid.sizes, axis=0))
            young = " and ".join(dict.fromkeys(f"{m.youngs:.3g}" for m in body.tissue.materials))
            message = f"'{body.identity.identifier}' is soft tissue: {len(grid.nodes)} nodes, cells of {edges}"
            message += f", Young's modulus {young} Pa"
            findings.append(Diagnostic(Severity.INFO, message, body.identity.mark, "docs/tissue.md", "tissue"))
    return findings


def _edges(size: Array) -> str:
    """Edges (3,) of a cell, in the unit that suits a message."""
    large = size.max() >= 0.1
    return " x ".join(f"{edge if large else 1e3 * edge:.2g}" for edge in size) + (" m" if large else " mm")


def material_of(element: Element, prefix: str, below: TissueMaterial | None) -> TissueMaterial:
    """The material of a block or layer: that of its name, else of the block, with the numbers that it states."""
    name = element.text(f"{prefix}material")
    start = MATERIALS[name] if name else below
    given = {field: element.value(prefix + key) for field, key in KEYS.items()}
    given = {field: value for field, value in given.items() if value is not None}
    if start is None and "youngs" not in given:
        hint = f"give 'youngs modulus' in Pa, or material: {', '.join(MATERIALS)}"
        raise _error(element, f"{prefix}material", "has no tissue material", hint)
    values = {field.name: getattr(start, field.name) for field in fields(TissueMaterial)} if start else {}
    try:
        return TissueMaterial(**{**values, **given})
    except ValueError as error:
        first = next((key for field, key in KEYS.items() if str(error).startswith(field)), "poisson ratio")
        raise _error(element, prefix + first, f"cannot be tissue: {error}", "see docs/tissue.md") from None


def _layers(
    element: Element, base: TissueMaterial | None, top: float
) -> tuple[tuple[TissueMaterial, ...], list[float]]:
    """Materials from the top down, and the heights in B between them."""
    layers = element.children("ligature tissue.layers")
    if not layers:
        assert base is not None  # only layers make up for it
        return (base,), []
    materials, heights = [], []
    for number, item in enumerate(layers):
        materials.append(material_of(item, "", base))
        thickness = item.value("thickness")
        if number == len(layers) - 1:
            break
        if thickness is None or not thickness > 0.0:
            raise _error(item, "thickness", "is a layer without thickness", "give metres; the lowest may have none")
        top -= thickness
        heights.append(top)
    return tuple(materials), heights


def _fixed(element: Element, grid: Grid) -> NDArray[np.bool_]:
    """The nodes of the faces that the file holds, those at the ends of the grid along the axes of B."""
    fixed = np.zeros(len(grid.nodes), dtype=bool)
    if element.has("ligature tissue.fixed") and element.raw_value("ligature tissue.fixed") is None:
        raise _error(element, "ligature tissue.fixed", "has no value for 'fixed'",
                     "give faces such as [-z], or [] for none; remove the key to have its default")  # fmt: skip
    for face in element.texts("ligature tissue.fixed"):
        if face not in FACES:
            raise _error(element, "ligature tissue.fixed", f"has no face '{face}'", f"give faces of {', '.join(FACES)}")
        along = grid.site[:, "xyz".index(face[1])]
        fixed |= along == (along.max() if face[0] == "+" else along.min())
    pieces = grid.pieces()
    if fixed.any():
        loose = sorted(set(pieces.tolist()) - set(pieces[fixed].tolist()))
        if loose:
            raise _error(element, "ligature tissue.fixed", f"has {len(loose)} pieces that are not held",
                         "hold them by a further face, shorten the slits, or use smaller cells")  # fmt: skip
    elif pieces.max() > 0:
        raise _error(element, "ligature tissue", f"consists of {pieces.max() + 1} pieces",
                     "use smaller cells, shorten the slits, or hold the pieces by 'fixed'")  # fmt: skip
    if fixed.all():
        raise _error(
            element, "ligature tissue.fixed", "has no node that can move", "hold fewer faces or use smaller cells"
        )
    return fixed


def _surface(
    element: Element, context: FileContext, visual: Visual, colliders: Sequence[Collider]
) -> tuple[Array, NDArray[np.int32]]:
    """The closed surface of a body, in its frame B: vertices (n, 3) and faces (m, 3)."""
    if visual.mesh is not None:
        vertices, faces = joined(load_mesh(visual.mesh, context.resolver).parts)
        return vertices * visual.scale, faces
    shapes = visual.shapes or tuple(colliders)
    if len(shapes) != 1:
        what = "has no shape" if not shapes else f"has {len(shapes)} shapes"
        raise _error(element, "ligature tissue", f"is tissue but {what}", "give a closed 'mesh' or one 'shape'")
    surface = surface_of(shapes[0])
    if surface is None:
        raise _error(element, "ligature tissue", "is tissue, but its shape is a plane", "give a shape with a volume")
    return surface


def _error(element: Element, key: str, message: str, hint: str) -> GeometryError:
    text = f"{element.kind} '{element.key}' {message}"
    return GeometryError(Diagnostic(Severity.ERROR, text, element.mark_of(key), hint, "tissue"))
