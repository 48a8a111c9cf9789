"""Reads where Blender's objects stand, and states it in the keys of the format.

World poses are composed from the objects' own transforms and parents, so that hidden objects and
excluded collections count like all others. Pure arithmetic lives in `ligature.authoring`.
"""

from __future__ import annotations

import json
from math import pi

import bpy
import numpy as np
from mathutils import Matrix

from .ligature.adf.frames import matrix_quaternion
from .ligature.authoring.placement import (
    JointKeys,
    Pose,
    joint_keys,
    joint_pose,
    light_keys,
    light_pose,
    matrix_of,
    pose_of,
    rigid,
    same_place,
    vector,
    view_keys,
    view_pose,
)
from .ligature.authoring.shapes import Shape
from .properties import KIND_OF_ROLE
from .references import reference
from .schema_properties import decimal, decimals

SHAPED = ("BODY", "GHOST_OBJECT", "SOFT_BODY")
FAR = 1e9
"""Metres beyond which a place is an accident: Blender makes an infinite location the greatest float."""

TINY = 1e-9
"""Numbers below this are the noise of single precision and become zero."""


def rest_matrix(obj: bpy.types.Object) -> np.ndarray:
    """World matrix (4, 4) of an object from its own transform and its parents'."""
    if obj.constraints or obj.parent_type not in ("OBJECT", "ARMATURE", "LATTICE"):
        return np.array(obj.matrix_world, dtype=float)
    own = np.array(obj.matrix_basis, dtype=float)
    if obj.parent is None:
        return own
    return rest_matrix(obj.parent) @ np.array(obj.matrix_parent_inverse, dtype=float) @ own


def rest_pose(obj: bpy.types.Object) -> np.ndarray:
    """Rigid world pose (4, 4); raises ValueError for what has no place, with the object's name."""
    matrix = rest_matrix(obj)
    if not (np.abs(matrix) < FAR).all():
        raise ValueError(
            f"'{obj.name}' has a transform that is not a number or beyond all measure; clear location, rotation, scale"
        )
    if abs(np.linalg.det(matrix[:3, :3])) < 1e-12:
        raise ValueError(f"'{obj.name}' has a scale of zero; give it a size")
    return rigid(matrix)


def place(obj: bpy.types.Object, T: np.ndarray) -> None:
    """Put an object at a rigid pose in its parent's frame; as a quaternion, which single precision holds well."""
    obj.rotation_mode = "QUATERNION"
    x, y, z, w = matrix_quaternion(np.asarray(T)[:3, :3])
    obj.location = T[:3, 3]
    obj.rotation_quaternion = (w, x, y, z)


def hang(obj: bpy.types.Object, parent: bpy.types.Object, T: np.ndarray) -> None:
    """Parent an object at a pose in the parent's rigid frame; the parent's scale is taken out."""
    obj.parent = parent
    obj.matrix_parent_inverse = Matrix(np.linalg.inv(scaling(parent)).tolist())
    place(obj, T)


def scaling(obj: bpy.types.Object) -> np.ndarray:
    """What is left of the world matrix beside its rigid pose: scale, shear and mirroring (4, 4)."""
    return np.linalg.inv(rest_pose(obj)) @ rest_matrix(obj)


def relative_pose(parent: bpy.types.Object | None, obj: bpy.types.Object) -> np.ndarray:
    """Pose of an object in its parent's frame, or in the world."""
    own = rest_pose(obj)
    return own if parent is None else np.linalg.inv(rest_pose(parent)) @ own


def owner_of(obj: bpy.types.Object) -> bpy.types.Object | None:
    """The object of a file, if any, that an object is parented to."""
    parent = obj.parent
    return parent if parent is not None and parent.adf.role in KIND_OF_ROLE else None


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


def clean(pose: Pose) -> Pose:
    """A pose in short decimals."""
    position, orientation = ([0.0 if abs(v) < TINY else decimal(v) for v in part] for part in pose)
    return tuple(position), tuple(orientation)


def tidy(values) -> tuple[float, ...]:
    """Numbers in short decimals, noise as zero."""
    return tuple(0.0 if abs(v) < TINY else decimal(v) for v in vector(values))


def state_of(obj: bpy.types.Object) -> dict[str, list]:
    """What the object's transform, children and data state, by the group of keys that it decides.

    Compared with the state just after the import it shows which keys keep the file's own text.
    """
    role = obj.adf.role
    state: dict[str, list] = {}
    if role == "JOINT":
        parent, child = obj.adf.parent_object, obj.adf.child_object
        state["ends"] = [
            reference(obj, parent, obj.adf.parent_text) if parent else obj.adf.parent_text,
            reference(obj, child, obj.adf.child_text) if child else obj.adf.child_text,
        ]
        if parent is not None and child is not None:
            state["frames"] = [*_flat(relative_pose(parent, obj)), *_flat(relative_pose(parent, child))]
        return state
    owner = owner_of(obj)
    state["pose"] = _flat(relative_pose(owner, obj))
    state["parent"] = [reference(obj, owner, obj.adf.parent_text) if owner else obj.adf.parent_text]
    if role == "CAMERA" and obj.type == "CAMERA":
        state["lens"] = [obj.data.angle_y, obj.data.clip_start, obj.data.clip_end]
    if role == "LIGHT" and obj.type == "LIGHT":
        state["cone"] = [getattr(obj.data, "spot_size", pi)]
    if role in SHAPED:
        state["inertial"] = _flat(inertial_frame(obj)) if children_with(obj, "INERTIAL") else []
        for use in ("COLLISION", "VISUAL"):
            state[use] = [
                part
                for child in shapes_of(obj, use)
                for part in (*_shape_state(child), *_flat(relative_pose(obj, child)))
            ]
    return state


def _shape_state(obj: bpy.types.Object) -> list:
    shape = shape_of(obj)
    return [shape.kind, *shape.size, shape.radius, shape.height, shape.axis, *shape.normal, shape.offset]


def _flat(matrix: np.ndarray) -> list[float]:
    return [round(float(v), 9) for v in matrix[:3].ravel()]


def unchanged(obj: bpy.types.Object, group: str, state: dict[str, list]) -> bool:
    """Whether a group of keys states what it stated when the object was imported."""
    if not obj.adf.imported:
        return False
    before, now = json.loads(obj.adf.imported).get(group), state.get(group)
    if before is None or now is None or len(before) != len(now):
        return before is None and now is None
    for a, b in zip(before, now, strict=True):
        if isinstance(a, str) or isinstance(b, str):
            if a != b:
                return False
        elif abs(a - b) > 2e-6 * max(1.0, abs(a)):
            return False
    return True


def placed_keys(obj: bpy.types.Object, file_values: dict) -> dict:
    """The keys that transform, children and data of an object decide (`PLACED`), typed, by path.

    ``file_values`` are those of the file that it was imported from; they stay where nothing moved.
    """
    state = state_of(obj)
    makers = {"JOINT": _joint, "CAMERA": _camera, "LIGHT": _light}
    return makers.get(obj.adf.role, _placed)(obj, state, file_values)


def _kept(file_values: dict, *names: str) -> dict:
    return {
        path: value for path, value in file_values.items() if any(path == n or path.startswith(f"{n}.") for n in names)
    }


def _parent(obj: bpy.types.Object, state: dict, file_values: dict) -> dict:
    if unchanged(obj, "parent", state):
        return _kept(file_values, "parent")
    return {"parent": state["parent"][0]} if state["parent"][0] else {}


def _placed(obj: bpy.types.Object, state: dict, file_values: dict) -> dict:
    kind = KIND_OF_ROLE[obj.adf.role]
    values: dict = {}
    if kind in ("vehicle", "input device"):
        return _kept(file_values, "parent", "location")
    if kind != "body":
        values.update(_parent(obj, state, file_values))
    elif "parent" in file_values:
        values["parent"] = file_values["parent"]
    if unchanged(obj, "pose", state):
        values.update(_kept(file_values, "location"))
    else:
        pose = clean(pose_of(relative_pose(owner_of(obj) if kind != "body" else None, obj)))
        values["location"] = pose
    if obj.adf.role in SHAPED:
        values.update(_shapes(obj, state, file_values))
    return values


def _shapes(obj: bpy.types.Object, state: dict, file_values: dict) -> dict:
    values: dict = {}
    if unchanged(obj, "inertial", state):
        values.update(_kept(file_values, "inertial offset"))
    elif children_with(obj, "INERTIAL"):
        values["inertial offset"] = clean(pose_of(inertial_frame(obj)))
    for use, prefix in (("COLLISION", "collision "), ("VISUAL", "")):
        compound = "compound collision shape" if use == "COLLISION" else "compound shape"
        names = (f"{prefix}shape", f"{prefix}geometry", f"{prefix}offset" if prefix else "geometry", compound)
        if unchanged(obj, use, state):
            values.update(_kept(file_values, *names))
            continue
        shapes = shapes_of(obj, use)
        was_single = f"{prefix}shape" in file_values or compound not in file_values
        if (
            len(shapes) == 1
            and was_single
            and (use == "COLLISION" or same_place(relative_pose(obj, shapes[0]), np.eye(4)))
        ):
            shape = shape_of(shapes[0])
            values[f"{prefix}shape"] = shape.kind
            values.update({f"{prefix}geometry.{key}": value for key, value in shape.geometry().items()})
            if use == "COLLISION":
                values["collision offset"] = clean(pose_of(relative_pose(obj, shapes[0])))
        elif shapes:
            values[compound] = tuple(_compound_item(obj, child) for child in shapes)
    return values


def _compound_item(obj: bpy.types.Object, child: bpy.types.Object) -> dict:
    shape = shape_of(child)
    return {
        "shape": shape.kind,
        **{f"geometry.{key}": value for key, value in shape.geometry().items()},
        "offset": clean(pose_of(relative_pose(obj, child))),
    }


def _joint(obj: bpy.types.Object, state: dict, file_values: dict) -> dict:
    values: dict = {}
    if unchanged(obj, "ends", state):
        values.update(_kept(file_values, "parent", "child"))
    else:
        values.update(zip(("parent", "child"), state["ends"], strict=True))
    geometry = ("parent pivot", "child pivot", "parent axis", "child axis", "offset", "child offset", "joint offset")
    if unchanged(obj, "frames", state) or "frames" not in state:
        values.update(_kept(file_values, *geometry))
        return values
    keys = solved_joint(obj)
    values.update(
        {
            "parent pivot": tidy(keys.parent_pivot),
            "child pivot": tidy(keys.child_pivot),
            "parent axis": tidy(keys.parent_axis),
            "child axis": tidy(keys.child_axis),
            "offset": tidy((keys.offset, 0, 0))[0],
            "joint offset": tidy((keys.joint_offset, 0, 0))[0],
        }
    )
    return values


def solved_joint(obj: bpy.types.Object) -> JointKeys:
    """Keys of a joint from where it, its parent and its child stand."""
    parent, child = obj.adf.parent_object, obj.adf.child_object
    return joint_keys(
        relative_pose(parent, obj),
        relative_pose(parent, child),
        inertial_frame(parent),
        inertial_frame(child),
        is_prismatic(obj),
        (parent.adf.body.scale or 1.0, child.adf.body.scale or 1.0),
    )


def is_prismatic(obj: bpy.types.Object) -> bool:
    """Whether the joint moves along its X instead of about its Z."""
    return obj.adf.joint.type == "prismatic"


def _camera(obj: bpy.types.Object, state: dict, file_values: dict) -> dict:
    values = _parent(obj, state, file_values)
    if unchanged(obj, "pose", state):
        values.update(_kept(file_values, "location", "look at", "up"))
    else:
        keys = view_keys(relative_pose(owner_of(obj), obj), _distance(file_values))
        values.update({name: tidy(part) for name, part in zip(("location", "look at", "up"), keys, strict=True)})
    if unchanged(obj, "lens", state):
        values.update(_kept(file_values, "field view angle", "clipping plane"))
    elif "lens" in state:
        angle, near, far = map(decimal, state["lens"])
        values.update({"field view angle": angle, "clipping plane.near": near, "clipping plane.far": far})
    return values


def _distance(file_values: dict) -> float:
    """How far the file's camera looks; one metre when it states nothing."""
    a, b = (np.array(file_values.get(name, (0.0, 0.0, 0.0))) for name in ("location", "look at"))
    return float(np.linalg.norm(a - b)) or 1.0


def _light(obj: bpy.types.Object, state: dict, file_values: dict) -> dict:
    values = _parent(obj, state, file_values)
    if unchanged(obj, "pose", state):
        values.update(_kept(file_values, "location", "direction"))
    else:
        location, direction = light_keys(relative_pose(owner_of(obj), obj))
        values.update({"location": tidy(location), "direction": tidy(direction)})
    if unchanged(obj, "cone", state):
        values.update(_kept(file_values, "cutoff angle"))
    elif "cone" in state:
        values["cutoff angle"] = decimal(state["cone"][0] / 2.0)
    return values


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
