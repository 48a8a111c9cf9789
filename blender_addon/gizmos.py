"""Handles on the limits of the active joint: dragged along its axes, or around them; each drag is one step to undo.

A joint of one axis has two handles, a six-DOF joint twelve: boxes on the faces of its box of travel, and balls
at the ends of its arcs.
"""

from __future__ import annotations

from math import atan2, degrees, pi
from typing import NamedTuple

import bpy
import numpy as np
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Matrix

from .ligature.adf.frames import axis_rotation
from .overlay import SIZE, SIZE_OF_HANDLE_GAP, redraw
from .poses import is_prismatic, rest_pose

TURNS = (axis_rotation((0, 1, 0), pi / 2), axis_rotation((1, 0, 0), -pi / 2), np.eye(3))
"""Rotations of Z to each axis; arcs are drawn in the rotated XY plane."""

COLOURS = ((0.95, 0.25, 0.3), (0.5, 0.85, 0.1), (0.25, 0.5, 1.0))


class Limit(NamedTuple):
    """One end of the range of one axis: property, the other end's property, axis 0 to 2, kind, which end."""

    name: str
    other: str
    axis: int
    angular: bool
    high: bool


def limits_of(obj: bpy.types.Object | None) -> list[Limit]:
    """The limits of a joint that have handles; none for other objects."""
    if obj is None or obj.adf.role != "JOINT":
        return []
    kind = obj.adf.joint.type
    if kind.startswith("six dof"):
        names = [(f"joint_limits_{half}_{{}}_{a}", i, half == "angular")
                 for half in ("linear", "angular") for i, a in enumerate("xyz")]  # fmt: skip
    elif kind in ("revolute", "prismatic", "linear spring", "torsion spring"):
        names = [("joint_limits_{}", 0 if is_prismatic(obj) else 2, kind in ("revolute", "torsion spring"))]
    else:
        names = []
    found = [
        Limit(name.format(end), name.format(other), axis, angular, end == "high")
        for name, axis, angular in names
        for end, other in (("low", "high"), ("high", "low"))
    ]
    return [limit for limit in found if obj.adf.joint.is_property_set(limit.name)]


def place_of(obj: bpy.types.Object, limit: Limit) -> np.ndarray:
    """Where the handle of a limit is, in the world."""
    value = getattr(obj.adf.joint, limit.name)
    aside = SIZE_OF_HANDLE_GAP if limit.high else -SIZE_OF_HANDLE_GAP  # else those of a locked axis would be one
    if limit.angular:
        angle = float(np.clip(value, -pi, pi)) + aside / SIZE
        local = TURNS[limit.axis] @ (SIZE * np.array([np.cos(angle), np.sin(angle), 0.0]))
    else:
        local = np.eye(3)[limit.axis] * (value + aside)
    T = rest_pose(obj)
    return T[:3, :3] @ local + T[:3, 3]


def measure(obj: bpy.types.Object, limit: Limit, origin: np.ndarray, direction: np.ndarray) -> float | None:
    """Angle or place on a limit's axis that a line of sight points at; None where it points at none."""
    T = rest_pose(obj)
    start, towards = T[:3, :3].T @ (origin - T[:3, 3]), T[:3, :3].T @ direction
    axis = np.eye(3)[limit.axis]
    if limit.angular:
        slope = towards @ axis
        if abs(slope) < 1e-3 * np.linalg.norm(towards):
            return None  # the plane of the arc is seen from its edge
        point = TURNS[limit.axis].T @ (start - (start @ axis) / slope * towards)
        return atan2(point[1], point[0])
    across = towards - (towards @ axis) * axis
    if across @ across < 1e-6 * (towards @ towards):
        return None  # the axis is seen from its end
    return float((start - (start @ across) / (across @ across) * towards) @ axis)


def dragged(obj: bpy.types.Object, limit: Limit, start: float, change: float) -> float:
    """The value of a limit that was ``start`` and is dragged by ``change``: never past the other end."""
    if limit.angular:
        change = (change + pi) % (2.0 * pi) - pi
    bound = max if limit.high else min
    return bound(start + change, getattr(obj.adf.joint, limit.other))


class ADF_GT_limit(bpy.types.Gizmo):
    """A handle on one limit."""

    bl_idname = "ADF_GT_limit"

    __slots__ = ("before", "first", "limit", "shape")

    def setup(self):
        self.limit = None
        self.shape = self.new_custom_shape("TRIS", _box())

    def draw(self, context):
        self.draw_custom_shape(self.shape)

    def draw_select(self, context, select_id):
        self.draw_custom_shape(self.shape, select_id=select_id)

    def invoke(self, context, event):
        self.before = getattr(context.object.adf.joint, self.limit.name)
        self.first = self._measured(context, event)
        return {"RUNNING_MODAL"}

    def modal(self, context, event, tweak):
        now = self._measured(context, event)
        if now is not None and self.first is not None:
            value = dragged(context.object, self.limit, self.before, now - self.first)
            setattr(context.object.adf.joint, self.limit.name, value)
            redraw()
            shown = f"{degrees(value):.1f}°" if self.limit.angular else f"{1e3 * value:.2f} mm"
            context.area.header_text_set(f"{self.limit.name.replace('_', ' ').capitalize()}: {shown}")
        return {"RUNNING_MODAL"}

    def exit(self, context, cancel):
        context.area.header_text_set(None)
        if cancel:
            setattr(context.object.adf.joint, self.limit.name, self.before)
            redraw()
        else:
            bpy.ops.ed.undo_push(message="Drag Joint Limit")

    def _measured(self, context, event):
        place = (event.mouse_region_x, event.mouse_region_y)
        region, space = context.region, context.region_data
        origin, direction = region_2d_to_origin_3d(region, space, place), region_2d_to_vector_3d(region, space, place)
        return measure(context.object, self.limit, np.array(origin), np.array(direction))


class ADF_GGT_limits(bpy.types.GizmoGroup):
    """Handles on the limits of the active joint."""

    bl_label = "Joint Limits"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT"}

    @classmethod
    def poll(cls, context):
        return context.scene.adf.show_overlay and bool(limits_of(context.object))

    def setup(self, context):
        self.refresh(context)

    def refresh(self, context):
        limits = limits_of(context.object)
        while len(self.gizmos) < len(limits):
            gizmo = self.gizmos.new(ADF_GT_limit.bl_idname)
            gizmo.alpha, gizmo.alpha_highlight, gizmo.color_highlight = 0.9, 1.0, (1.0, 1.0, 1.0)
            gizmo.use_draw_modal = True
        for number, gizmo in enumerate(self.gizmos):
            gizmo.hide = number >= len(limits)
            if not gizmo.hide:
                gizmo.limit = limits[number]
                gizmo.color = COLOURS[limits[number].axis]
                gizmo.scale_basis = 0.07 if limits[number].angular else 0.1
        self.draw_prepare(context)

    def draw_prepare(self, context):
        for gizmo in self.gizmos:
            if not gizmo.hide and gizmo.limit is not None:
                gizmo.matrix_basis = Matrix.Translation(place_of(context.object, gizmo.limit))


def _box() -> list[tuple[float, float, float]]:
    """Triangles of a cube from -1 to 1."""
    corners = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            square = [np.roll((side, a, b), axis) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            corners += [tuple(map(float, square[i])) for i in (0, 1, 2, 0, 2, 3)]
    return corners


CLASSES = (ADF_GT_limit, ADF_GGT_limits)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
