"""Draws what has no mesh: joint axes and limits, six-DOF boxes, springs, inertia, rays of sensors.

Lines are worked out when something changed, and drawn from then on; colours show what a line is.
"""

from __future__ import annotations

from math import pi

import bpy
import numpy as np

from . import compat
from .ligature.adf.frames import Array, axis_rotation
from .poses import is_prismatic, rest_pose
from .tissue_grid import grid_lines, tissue_keys

COLOURS = {
    "axis": (0.2, 0.6, 1.0, 1.0),
    "limit": (1.0, 0.55, 0.1, 1.0),
    "spring": (0.3, 0.9, 0.4, 1.0),
    "inertia": (0.95, 0.3, 0.9, 1.0),
    "ray": (1.0, 0.9, 0.2, 1.0),
    "thread": (0.45, 0.35, 1.0, 1.0),
    "tissue": (0.95, 0.6, 0.55, 0.45),
    "held": (0.15, 0.75, 0.35, 0.9),
    "layer": (0.95, 0.85, 0.2, 0.6),
    "slit": (0.9, 0.05, 0.1, 1.0),
}
SIZE = 0.03
"""Length in metres at which objects without a size are drawn."""

SIZE_OF_HANDLE_GAP = 0.08 * SIZE
"""How far the handle of a limit stands off its place, so that those of a locked axis are two."""

_state: dict = {"handle": None, "dirty": True, "batches": [], "changes": 0}


def lines_of(scene: bpy.types.Scene) -> dict[str, list[Array]]:
    """Polylines (n, 3) in the world by colour, of all objects that the view layer shows."""
    lines: dict[str, list[Array]] = {name: [] for name in COLOURS}
    for obj in scene.objects:
        if obj.adf.role not in ("JOINT", "SENSOR", "INERTIAL", "SUTURE") or obj.hide_get():
            continue
        try:
            T = rest_pose(obj)
        except ValueError:
            continue  # Check Scene reports it
        maker = {"JOINT": _joint, "SENSOR": _sensor, "INERTIAL": _inertia, "SUTURE": _suture}[obj.adf.role]
        for colour, line in maker(obj):
            lines[colour].append(line @ T[:3, :3].T + T[:3, 3])
    for obj in scene.objects if scene.adf.show_tissue else ():
        if tissue_keys(obj) and not obj.hide_get():
            T = rest_pose(obj)
            for colour, edges in grid_lines(obj).items():
                lines[colour] += list(edges @ T[:3, :3].T + T[:3, 3])
    return lines


def _joint(obj: bpy.types.Object):
    group = obj.adf.joint
    axis = np.array([1.0, 0.0, 0.0]) if is_prismatic(obj) else np.array([0.0, 0.0, 1.0])
    yield "axis", np.array([-0.5 * SIZE * axis, SIZE * axis])
    if group.type.startswith("six dof"):
        yield from _six_dof(group)
    elif group.type == "cone twist":
        yield from _cone(group)
    elif group.is_property_set("joint_limits_low") and group.is_property_set("joint_limits_high"):
        low, high = group.joint_limits_low, group.joint_limits_high
        if group.type in ("prismatic", "linear spring"):
            yield "limit", np.array([low * axis, high * axis])
            for place in (low, high):
                yield "limit", place * axis + 0.2 * SIZE * _square(axis)
        else:
            yield "limit", SIZE * np.vstack([[[0, 0, 0]], _arc(low, high), [[0, 0, 0]]])
    if group.type.endswith("spring"):
        yield "spring", _coil(axis)


def _six_dof(group):
    low = np.array([getattr(group, f"joint_limits_linear_low_{a}") for a in "xyz"])
    high = np.array([getattr(group, f"joint_limits_linear_high_{a}") for a in "xyz"])
    if (high >= low).all() and (high > low).any():
        yield from (("limit", edge) for edge in _box_edges(low, high))
    for index, a in enumerate("xyz"):
        lower, upper = (getattr(group, f"joint_limits_angular_{end}_{a}") for end in ("low", "high"))
        if upper > lower:
            turn = (axis_rotation((0, 1, 0), pi / 2), axis_rotation((1, 0, 0), -pi / 2), np.eye(3))[index]
            yield "limit", SIZE * _arc(max(lower, -pi), min(upper, pi)) @ turn.T


def _cone(group):
    swing_y, swing_z = group.joint_limits_y, group.joint_limits_z
    angle = np.linspace(0.0, 2.0 * pi, 33)
    rim = np.column_stack(
        [np.ones(33), np.tan(min(swing_z, 1.5)) * np.cos(angle), np.tan(min(swing_y, 1.5)) * np.sin(angle)]
    )
    rim *= SIZE / np.linalg.norm(rim, axis=1, keepdims=True)
    yield "limit", rim
    for i in (0, 8, 16, 24):
        yield "limit", np.array([[0.0, 0.0, 0.0], rim[i]])


def _sensor(obj: bpy.types.Object):
    group = obj.adf.sensor
    for ray in group.array:
        start = np.array(ray.offset)
        yield "ray", np.array([start, start + group.range * np.array(ray.direction)])


def _suture(obj: bpy.types.Object):
    """The thread as it leaves its start, along +Z."""
    yield "thread", np.array([[0.0, 0.0, 0.0], [0.0, 0.0, obj.adf.suture.length]])


def _inertia(obj: bpy.types.Object):
    """The box that has the body's mass and moments: with edges from I = m/12 (y² + z²)."""
    body = obj.parent
    yield "inertia", SIZE / 6.0 * np.column_stack([_arc(-pi, pi)])
    if (
        body is None
        or body.adf.role != "BODY"
        or not body.adf.body.is_property_set("inertia_ix")
        or body.adf.body.mass <= 0.0
    ):
        return
    moments = np.array([getattr(body.adf.body, f"inertia_i{a}") for a in "xyz"])
    squares = 6.0 / body.adf.body.mass * (moments.sum() - 2.0 * moments)
    half = 0.5 * np.sqrt(np.maximum(squares, 0.0))
    yield from (("inertia", edge) for edge in _box_edges(-half, half))


def _arc(low: float, high: float) -> Array:
    angle = np.linspace(low, high, 25)
    return np.column_stack([np.cos(angle), np.sin(angle), np.zeros(25)])


def _square(axis: Array) -> Array:
    side = np.roll(axis, 1)
    other = np.cross(axis, side)
    return np.array([side + other, side - other, -side - other, -side + other, side + other])


def _coil(axis: Array) -> Array:
    side = np.roll(axis, 1)
    other = np.cross(axis, side)
    t = np.linspace(0.0, 1.0, 65)
    around = 0.15 * (np.outer(np.cos(8 * pi * t), side) + np.outer(np.sin(8 * pi * t), other))
    return SIZE * (around + np.outer(t, axis))


def _box_edges(low: Array, high: Array) -> list[Array]:
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    pairs = ((0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 6), (5, 7), (6, 7))
    return [corners[list(pair)] for pair in pairs]


def _draw() -> None:
    import gpu
    from gpu_extras.batch import batch_for_shader

    scene = bpy.context.scene
    if not scene.adf.show_overlay:
        return
    shader = compat.line_shader()
    if _state["dirty"]:
        _state["batches"] = []
        for name, lines in lines_of(scene).items():
            if lines:
                pairs = np.vstack([np.repeat(line, 2, axis=0)[1:-1] for line in lines]).astype(np.float32)
                _state["batches"].append((name, batch_for_shader(shader, "LINES", {"pos": pairs.tolist()})))
        _state["dirty"] = False
    gpu.state.blend_set("ALPHA")
    gpu.state.line_width_set(2.0)
    shader.bind()
    for name, batch in _state["batches"]:
        shader.uniform_float("color", COLOURS[name])
        batch.draw(shader)
    gpu.state.line_width_set(1.0)
    gpu.state.blend_set("NONE")


@bpy.app.handlers.persistent
def redraw(*arguments) -> None:
    """Work the lines out again when they are drawn next."""
    _state["dirty"] = True
    _state["changes"] += 1


def changes() -> int:
    """A number that grows with every change of the scene."""
    return _state["changes"]


CLASSES = ()


def attach() -> None:
    """Start drawing, unless there is no window."""
    bpy.app.handlers.depsgraph_update_post.append(redraw)
    bpy.app.handlers.load_post.append(redraw)
    bpy.app.handlers.undo_post.append(redraw)
    if not bpy.app.background:
        _state["handle"] = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def detach() -> None:
    """Stop drawing."""
    for handlers in (bpy.app.handlers.depsgraph_update_post, bpy.app.handlers.load_post, bpy.app.handlers.undo_post):
        handlers.remove(redraw)
    if _state["handle"] is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_state["handle"], "WINDOW")
    _state.update(handle=None, dirty=True, batches=[])
