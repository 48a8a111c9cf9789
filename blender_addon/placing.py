"""Puts Blender's objects where files state; the reverse of `poses`."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from .ligature.adf.frames import matrix_quaternion
from .ligature.authoring.placement import JointKeys, joint_pose, light_pose, matrix_of, view_pose
from .poses import inertial_frame, scaling


def place(obj: bpy.types.Object, T: np.ndarray) -> None:
    """Put an object at a rigid pose in its parent's frame; as a quaternion, which single precision holds well."""
    obj.rotation_mode = "QUATERNION"
    x, y, z, w = matrix_quaternion(np.asarray(T)[:3, :3])
    obj.location = T[:3, 3]
    obj.rotation_quaternion = (w, x, y, z)


def parent_to(obj: bpy.types.Object, parent: bpy.types.Object, T: np.ndarray) -> None:
    """Parent an object at a pose in the parent's rigid frame; the parent's scale is taken out."""
    obj.parent = parent
    obj.matrix_parent_inverse = Matrix(np.linalg.inv(scaling(parent)).tolist())
    place(obj, T)


def place_view(values: dict) -> np.ndarray:
    """Pose of a camera object."""
    zero = (0.0, 0.0, 0.0)
    return view_pose(values.get("location", zero), values.get("look at", zero), values.get("up", (0.0, 0.0, 1.0)))


def place_light(values: dict) -> np.ndarray:
    """Pose of a lamp object."""
    if "direction" in values:
        return light_pose(values.get("location", (0, 0, 0)), values["direction"])
    turned = matrix_of((values.get("location", (0, 0, 0)), values.get("location.orientation", (0, 0, 0))))
    return light_pose(turned[:3, 3], turned[:3, 0])


def place_joint(values: dict, parent: bpy.types.Object | None, child: bpy.types.Object | None) -> np.ndarray:
    """Pose of a joint object in its parent body."""
    scales = [body.adf.body.scale if body else 1.0 for body in (parent, child)]
    offset = values.get("offset", values.get("child offset", 0.0))
    keys = JointKeys(
        tuple(scales[0] * v for v in values["parent pivot"]),
        tuple(scales[1] * v for v in values["child pivot"]),
        values["parent axis"],
        values["child axis"],
        offset,
        values.get("joint offset", 0.0),
    )
    frames = [inertial_frame(body) if body else np.eye(4) for body in (parent, child)]
    return joint_pose(keys, *frames, values.get("type") == "prismatic")
