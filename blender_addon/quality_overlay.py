"""Draws over a body's mesh how well its collision shapes stand for it: the figures as text, the deviation as colour.

Red lies outside all collision shapes, so that things sink in; blue lies below one, so that things stop before
they touch. Both are as strong as the Hausdorff distance at the ends of the scale.
"""

from __future__ import annotations

import blf
import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Matrix, Vector

from . import compat
from .overlay import changes
from .poses import SHAPED, rest_pose
from .quality import deviations_of, is_measured_now, kept_figures

BELOW, NONE, OUTSIDE = (0.1, 0.3, 1.0), (0.75, 0.8, 0.75), (1.0, 0.12, 0.1)
OPACITY = 0.85
NEARER = 1e-5
"""Part of the depth range by which the colours are drawn before the mesh that they lie on."""

SCALE = (140, 8)
"""Width and height in pixels of the scale under the figures."""

EDGE = 60.0
"""Pixels at the top of a view that its header and the name of the object take."""

_handles: list = []
_batches: dict = {}
_known: dict = {"changes": -1, "current": {}}


def shown_bodies(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The visible bodies that have figures, when they are to be drawn."""
    stored = context.scene.adf
    if not (stored.show_overlay and stored.show_quality):
        return []
    measured = [obj for obj in context.scene.objects if obj.adf.role in SHAPED and obj.adf.quality.measured]
    return [obj for obj in measured if obj.visible_get()]


def is_current(body: bpy.types.Object) -> bool:
    """Whether a body's figures are those of what it is now; looked at once after each change of the scene."""
    if _known["changes"] != changes():
        _known.update(changes=changes(), current={})
    if body.name not in _known["current"]:
        _known["current"][body.name] = is_measured_now(body)
    return _known["current"][body.name]


def words_of(body: bpy.types.Object) -> list[str]:
    """What is written over a body."""
    words = [body.name, *str(kept_figures(body)).split(", ")]
    return words if is_current(body) else [*words, "changed since; measure again"]


def colours_of(deviation: np.ndarray, distance: float) -> np.ndarray:
    """RGBA (…, 4) of deviations, the ends of the scale at ±``distance``."""
    share = np.clip(deviation / distance if distance > 0.0 else np.zeros_like(deviation), -1.0, 1.0)[..., None]
    end = np.where(share < 0.0, BELOW, OUTSIDE)
    return np.concatenate([(1.0 - abs(share)) * NONE + abs(share) * end, np.full(share.shape, OPACITY)], axis=-1)


def _draw_colours() -> None:
    import gpu
    from gpu_extras.batch import batch_for_shader

    bodies = [obj for obj in shown_bodies(bpy.context) if is_current(obj) and deviations_of(obj) is not None]
    if not bodies:
        return
    shader = compat.colour_shader()
    wanted = {obj.adf.quality.measured for obj in bodies}
    for gone in set(_batches) - wanted:
        del _batches[gone]
    for obj in bodies:
        kept = obj.adf.quality
        if kept.measured not in _batches:
            corners, deviation = deviations_of(obj)
            colours = colours_of(deviation, kept.distance).astype(np.float32).reshape(-1, 4)
            places = corners.astype(np.float32).reshape(-1, 3)
            _batches[kept.measured] = batch_for_shader(shader, "TRIS", {"pos": places, "color": colours})
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    shader.bind()
    with gpu.matrix.push_pop_projection():
        projection = gpu.matrix.get_projection_matrix()
        projection[2] = projection[2] - NEARER * projection[3]  # depth over w, alike at every distance
        gpu.matrix.load_projection_matrix(projection)
        for obj in bodies:
            with gpu.matrix.push_pop():
                gpu.matrix.multiply_matrix(Matrix(rest_pose(obj).tolist()))
                _batches[obj.adf.quality.measured].draw(shader)
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _draw_words() -> None:
    context = bpy.context
    size = 12.0 * context.preferences.system.ui_scale
    for obj in shown_bodies(context):
        words = words_of(obj)
        place = _above(context, obj, size * (1.4 * len(words) + 2.2))
        if place is None:
            continue
        x, y = place
        compat.text_size(0, size)
        blf.enable(0, blf.SHADOW)
        blf.shadow(0, 3, 0.0, 0.0, 0.0, 0.9)
        for number, word in enumerate(words, start=1):
            late = word.startswith("changed since")
            blf.color(0, 1.0, 0.6 if late else 1.0, 0.2 if late else 1.0, 1.0)
            blf.position(0, x, y - 1.4 * size * number, 0.0)
            blf.draw(0, word)
        if is_current(obj) and deviations_of(obj) is not None:
            _draw_scale(x, y - 1.4 * size * (len(words) + 0.7), obj.adf.quality.distance, size)
        blf.disable(0, blf.SHADOW)


def _draw_scale(x: float, y: float, distance: float, size: float) -> None:
    """A bar of the colours from −``distance`` to ``distance``, with its ends named."""
    from gpu_extras.batch import batch_for_shader

    width, height = SCALE
    across = np.linspace(-1.0, 1.0, 17)
    colours = np.repeat(colours_of(across, 1.0).astype(np.float32), 2, axis=0)
    places = [(x + width * (part + 1.0) / 2.0, y + side * height) for part in across for side in (0.0, 1.0)]
    shader = compat.colour_shader()
    pos = [(*place, 0.0) for place in places]
    batch_for_shader(shader, "TRI_STRIP", {"pos": pos, "color": colours}).draw(shader)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    compat.text_size(0, 0.8 * size)
    for word, part in ((f"{-1e3 * distance:.2f}", 0.0), (f"{1e3 * distance:+.2f} mm", 1.0)):
        blf.position(0, x + part * width - (size if part else 0.0), y - size, 0.0)
        blf.draw(0, word)
    compat.text_size(0, size)


def _above(context: bpy.types.Context, obj: bpy.types.Object, height: float) -> tuple[float, float] | None:
    """Where text of a height starts that stands above an object's box on the screen, and within the view."""
    region = context.region
    corners = [obj.matrix_world @ Vector(corner) for corner in obj.bound_box]
    places = [location_3d_to_region_2d(region, context.region_data, corner) for corner in corners]
    if any(place is None for place in places):
        return None  # behind the eye
    left, top = min(place.x for place in places), max(place.y for place in places)
    if not (left < region.width and top > 0.0):
        return None
    return max(left, 0.0), min(top + height, region.height - EDGE)


CLASSES = ()


def attach() -> None:
    """Start drawing, unless there is no window."""
    if bpy.app.background:
        return
    for draw, when in ((_draw_colours, "POST_VIEW"), (_draw_words, "POST_PIXEL")):
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", when))


def detach() -> None:
    """Stop drawing."""
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    _batches.clear()
