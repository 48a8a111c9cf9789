"""Reads where Blender's objects stand.

World poses are composed from the objects' own transforms and parents, so that hidden objects and
excluded collections count like all others. Pure arithmetic is in `ligature.authoring`.
"""

from __future__ import annotations

from math import atan, pi

import bpy
import numpy as np

from .decimals import decimal, decimals
from .ligature.authoring.placement import rigid
from .ligature.authoring.shapes import Shape
from .placed import JointFrames, Placed, PlacedShape
from .properties import KIND_OF_ROLE
from .references import owner_of

SHAPED = ("BODY", "GHOST_OBJECT", "SOFT_BODY")
FAR = 1e9
"""Metres beyond which a position is invalid: Blender replaces an infinite location by the greatest float."""


def rest_matrix(obj: bpy.types.Object) -> np.ndarray:
    """World matrix (4, 4) of an object from its own transform and its parents'."""
    if obj.constraints or obj.parent_type not in ("OBJECT", "ARMATURE", "LATTICE") or _on_path(obj):
        return np.array(obj.matrix_world, dtype=float)
    own = np.array(obj.matrix_basis, dtype=float)
    if obj.parent is None:
        return own
    return rest_matrix(obj.parent) @ np.array(obj.matrix_parent_inverse, dtype=float) @ own


def _on_path(obj: bpy.types.Object) -> bool:
    """Whether the parent is a curve that carries its children along."""
    return obj.parent is not None and obj.parent.type == "CURVE" and obj.parent.data.use_path


def rest_pose(obj: bpy.types.Object) -> np.ndarray:
    """Rigid world pose (4, 4); raises ValueError for what has no place, with the object's name."""
    matrix = rest_matrix(obj)
    if not (np.abs(matrix) < FAR).all():
        raise ValueError(
            f"'{obj.name}' has a transform that is not finite or far too large; clear location, rotation, scale"
        )
    if abs(np.linalg.det(matrix[:3, :3])) < 1e-12:
        raise ValueError(f"'{obj.name}' has a scale of zero; give it a size")
    return rigid(matrix)


def scaling(obj: bpy.types.Object) -> np.ndarray:
    """What is left of the world matrix beside its rigid pose: scale, shear and mirroring (4, 4)."""
    return np.linalg.inv(rest_pose(obj)) @ rest_matrix(obj)


def relative_pose(parent: bpy.types.Object | None, obj: bpy.types.Object) -> np.ndarray:
    """Pose of an object in its parent's frame, or in the world."""
    own = rest_pose(obj)
    return own if parent is None else np.linalg.inv(rest_pose(parent)) @ own


def children_with(obj: bpy.types.Object, role: str) -> list[bpy.types.Object]:
    """The exported children of a role, in their order in the file."""
    children = [child for child in obj.children if child.adf.role == role and child.adf.export]
    return sorted(children, key=lambda child: (child.adf.shape.order, child.name))


def shapes_of(obj: bpy.types.Object, use: str) -> list[bpy.types.Object]:
    """The primitives of a body for collision or for looks."""
    return [child for child in children_with(obj, "SHAPE") if child.adf.shape.use == use]


def shape_of(obj: bpy.types.Object) -> Shape:
    """The primitive that an object stands for, its scale applied."""
    data = obj.adf.shape
    x, y, z = (float(f"{abs(s):.6g}") for s in np.diag(scaling(obj))[:3])  # the digits behind come of turning
    along = {"X": x, "Y": y, "Z": z}[data.axis]
    across = max(s for a, s in zip("XYZ", (x, y, z), strict=True) if a != data.axis)
    if data.kind == "SPHERE":
        across = max(x, y, z)
    size = tuple(decimal(a * b) for a, b in zip(data.size, (x, y, z), strict=True))
    return Shape(
        data.kind, size, decimal(data.radius * across), decimal(data.height * along), data.axis, decimals(data.normal),
        decimal(data.offset),
    )  # fmt: skip


def inertial_frame(obj: bpy.types.Object) -> np.ndarray:
    """Pose of the inertial frame in the body; identity without one."""
    frames = children_with(obj, "INERTIAL")
    return relative_pose(obj, frames[0]) if frames else np.eye(4)


def placed(obj: bpy.types.Object, names: tuple[str, ...]) -> Placed:
    """What the object's transform, children and data state; raises ValueError for what has no place.

    ``names`` are those of `owner_names`.
    """
    role, kind = obj.adf.role, KIND_OF_ROLE[obj.adf.role]
    if role == "JOINT":
        bodies = (obj.adf.parent_object, obj.adf.child_object)
        frames = None if None in bodies else _joint_frames(obj, *bodies)
        return Placed(kind, ends=names, T=relative_pose(owner_of(obj), obj), frames=frames)
    owner, own = owner_of(obj), rest_pose(obj)
    T = own if owner is None or role == "BODY" else np.linalg.inv(rest_pose(owner)) @ own
    shaped = role in SHAPED
    return Placed(
        kind,
        parent=names[0],
        T=T,
        reach=0.0 if obj.parent is None and not obj.constraints else _reach(T),
        far=0.0 if owner is None or role == "BODY" else max(_reach(own), _reach(rest_pose(owner))),
        lens=(opening_of(obj.data, scene_of(obj)), obj.data.clip_start, obj.data.clip_end)
        if (role, obj.type) == ("CAMERA",) * 2
        else None,
        cone=getattr(obj.data, "spot_size", pi) if (role, obj.type) == ("LIGHT",) * 2 else None,
        inertial=inertial_frame(obj) if shaped and children_with(obj, "INERTIAL") else None,
        shapes={use: _placed_shapes(obj, use) for use in ("COLLISION", "VISUAL")} if shaped else {},
    )


def scene_of(obj: bpy.types.Object) -> bpy.types.Scene:
    """The scene in which an object is seen."""
    scenes = obj.users_scene
    return bpy.context.scene if not scenes or bpy.context.scene in scenes else scenes[0]


def opening_of(camera: bpy.types.Camera, scene: bpy.types.Scene) -> float:
    """The vertical opening of a camera, in radians, as its pictures have it in a scene.

    Blender states that of the sensor's height, which is the picture's only if the sensor is fitted to it.
    """
    if camera.sensor_fit == "VERTICAL":
        return camera.angle_y
    render = scene.render
    width, height = render.resolution_x * render.pixel_aspect_x, render.resolution_y * render.pixel_aspect_y
    upright = camera.sensor_fit == "AUTO" and height > width
    return 2.0 * atan(0.5 * camera.sensor_width / camera.lens * (1.0 if upright else height / width))


def _reach(T: np.ndarray) -> float:
    """The greatest coordinate of a pose."""
    return float(np.abs(T[:3, 3]).max())


def _placed_shapes(obj: bpy.types.Object, use: str) -> list[PlacedShape]:
    return [
        PlacedShape(shape_of(child), relative_pose(obj, child), child.adf.shape.order) for child in shapes_of(obj, use)
    ]


def _joint_frames(obj: bpy.types.Object, parent: bpy.types.Object, child: bpy.types.Object) -> JointFrames:
    return JointFrames(
        relative_pose(parent, obj),
        relative_pose(parent, child),
        (inertial_frame(parent), inertial_frame(child)),
        tuple(body.adf.body.scale or 1.0 for body in (parent, child)),
        obj.adf.joint.type,
        max(_reach(rest_pose(one)) for one in (obj, parent, child)),
    )


def is_prismatic(obj: bpy.types.Object) -> bool:
    """Whether the joint moves along its X instead of about its Z."""
    return obj.adf.joint.type == "prismatic"
