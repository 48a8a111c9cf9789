"""Volumes: as in AMBF, a stack of pictures becomes a body in the shape of its iso-surface.

Frames and units as in `ligature.model.scene`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ligature.adf import Diagnostic, Element, ResolutionError, Severity
from ligature.mesh.isosurface import isosurface
from ligature.model.frames import pose_matrix
from ligature.model.geometry import FileContext, GeometryError, colour_of
from ligature.model.pictures import PictureError
from ligature.model.scene import Body, Identity
from ligature.model.shapes import Collider, TriMesh, Visual
from ligature.model.slices import read_field, slice_files
from ligature.model.voxels import FULL, Rendering, VolumeForm, VolumeLook

SAMPLES, FEWEST_MOST_SAMPLES = 4.0, (1.0, 20.0)
"""Samples of a ray for each voxel at quality 1, and their bounds: coarser ones step over thin walls."""

CARRIED_MASS, LEAST_MASS = 1e-3, 1e-6
"""Mass of a volume on a moving body, in masses of that body, and at least, kg: AMBF's have none."""


def volume_of(element: Element, context: FileContext) -> Callable[..., Body]:
    """Makes a body of ``index``, ``identity`` and ``parent`` (a `Body` or None); raises `GeometryError`."""
    form = _form(element, context)
    vertices, faces = isosurface(form.values, form.level)
    surface = TriMesh(form.placed(vertices), faces, element.key, smooth=True)
    colour, visible = colour_of(element), element.flag("visible")
    T = pose_matrix(*element.pose("location"))

    def make(index: int, identity: Identity, parent: Body | None) -> Body:
        carried = parent is not None and not parent.static
        mass = max(CARRIED_MASS * parent.mass, LEAST_MASS) if parent is not None and carried else 0.0
        size = np.ptp(surface.vertices, axis=0)
        middle = np.eye(4)
        middle[:3, 3] = 0.5 * (surface.vertices.min(axis=0) + surface.vertices.max(axis=0))
        shape = (Collider(surface, np.eye(4)),)
        return Body(
            index=index,
            identity=identity,
            mass=mass,
            inertia=mass / 12.0 * (size @ size - size**2) if carried else np.zeros(3),
            T_body_inertial=middle if carried else np.eye(4),
            T_world_body=T if parent is None else parent.T_world_body @ T,
            gravity=np.zeros(3) if parent is None else parent.gravity,
            colliders=() if carried else shape,
            visual=Visual(shapes=shape, colour=colour, visible=visible),
            volume=form,
        )

    return make


def _form(element: Element, context: FileContext) -> VolumeForm:
    """The voxels of a volume; raises `GeometryError` when none is inside."""
    mark = element.mark_of("images")

    def error(message: str, hint: str = "") -> GeometryError:
        return GeometryError(Diagnostic(Severity.ERROR, f"volume '{element.key}': {message}", mark, hint, "volume"))

    level = element.number("iso-surface value")
    if not 0.0 < level <= 1.0:
        raise error(f"'iso-surface value' is {level:g}", "give a number above 0, up to 1")
    prefix, suffix = element.text("images.prefix"), element.text("images.format")
    try:
        folder = context.resolver.resolve(element.text("images.path"), context.folder, mark)
        files = slice_files(folder, prefix, suffix, element.integer("images.count"), context.resolver)
        if not files:
            raise error(f"'{folder}' has no file {prefix}0.{suffix} or such", "check path, prefix and format")
        values = np.rint(FULL * read_field(files)).astype(np.uint8)
    except ResolutionError as refused:
        raise error(refused.diagnostic.message, refused.diagnostic.hint) from refused
    except (PictureError, OSError) as refused:
        raise error(str(refused)) from refused
    if not (values >= FULL * level).any():
        raise error(f"nothing in its pictures is as bright as 'iso-surface value' {level:g}", "give a lower value")
    size = element.number("scale") * np.array(element.vector("dimensions"))
    if not (size > 0.0).all():
        raise error("'dimensions' and 'scale' must be above 0", "give metres")
    return VolumeForm(values, FULL * level, size, _look(element, level))


def _look(element: Element, level: float) -> VolumeLook:
    """Rendering settings of a volume whose surface is at ``level``, 0 to 1."""
    rendering = Rendering(element.text("ligature rendering"))
    samples = float(np.clip(SAMPLES * element.number("quality"), *FEWEST_MOST_SAMPLES))
    points = [
        [point.number("value"), *(point.number(colour) for colour in "rgb"), point.number("opacity")]
        for point in element.children("ligature transfer function")
    ]
    if not points:
        points = [[0.5 * level, 1.0, 1.0, 1.0, 0.0], [level, 1.0, 1.0, 1.0, 1.0]]
    for before, after, child in zip(
        points, points[1:], element.children("ligature transfer function")[1:], strict=False
    ):
        if after[0] <= before[0]:
            message = f"volume '{element.key}': value {after[0]:g} of its transfer function follows {before[0]:g}"
            mark = child.mark_of("value")
            raise GeometryError(Diagnostic(Severity.ERROR, message, mark, "let values rise", "volume"))
    return VolumeLook(rendering, samples, 1e3 * element.number("optical density"), np.array(points))
