"""Where an object stands, as plain data, and the keys of the format that follow from it; nothing of Blender.

Poses are (4, 4); metres and radians.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .decimals import clean, decimal, tidy
from .ligature.authoring.placement import JointKeys, joint_keys, light_keys, pose_of, same_place, view_keys
from .ligature.authoring.shapes import Shape

Keys = dict
"""Values of keys, typed, by path."""

JOINT_GEOMETRY = (
    "parent pivot", "child pivot", "parent axis", "child axis", "offset", "child offset", "joint offset",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class JointFrames:
    """A joint between two bodies: its pose and the child's in the parent, both inertial frames, and both scales."""

    T_parent_joint: np.ndarray
    T_parent_child: np.ndarray
    inertial: tuple[np.ndarray, np.ndarray]
    scales: tuple[float, float]
    prismatic: bool

    def keys(self) -> JointKeys:
        """Keys of the joint from where it, its parent and its child stand."""
        return joint_keys(self.T_parent_joint, self.T_parent_child, *self.inertial, self.prismatic, self.scales)


@dataclass(frozen=True, eq=False)
class Placed:
    """What the transform, children and data of an object of this ``kind`` state.

    Attributes
    ----------
    parent, ends
        How the file names the owner of the object, or both bodies of a joint.
    T_owner, T_world
        The object's pose in its owner, or in the world without one, and in the world.
    frames
        Of a joint between two bodies.
    lens, cone
        Of a camera: opening, near and far; of a lamp: opening.
    inertial, shapes
        Of what has a shape: the inertial frame if it has one, primitives and their poses for "COLLISION" and "VISUAL".
    """

    kind: str
    parent: str = ""
    ends: tuple[str, str] | None = None
    T_owner: np.ndarray | None = None
    T_world: np.ndarray | None = None
    frames: JointFrames | None = None
    lens: tuple[float, float, float] | None = None
    cone: float | None = None
    inertial: np.ndarray | None = None
    shapes: dict[str, list[tuple[Shape, np.ndarray]]] = field(default_factory=dict)

    def state(self) -> dict[str, list]:
        """Numbers and texts by the group of keys that they decide.

        Compared with the state just after the import it shows which keys keep the file's own text.
        """
        if self.ends is not None:
            state: dict[str, list] = {"ends": [*self.ends]}
            if self.frames is not None:
                state["frames"] = [*_flat(self.frames.T_parent_joint), *_flat(self.frames.T_parent_child)]
            return state
        state = {"pose": _flat(self.T_owner), "parent": [self.parent]}
        if self.lens is not None:
            state["lens"] = [*self.lens]
        if self.cone is not None:
            state["cone"] = [self.cone]
        if self.shapes:
            state["inertial"] = [] if self.inertial is None else _flat(self.inertial)
            for use, shapes in self.shapes.items():
                state[use] = [part for shape, T in shapes for part in (*_shape_state(shape), *_flat(T))]
        return state


def _shape_state(shape: Shape) -> list:
    return [shape.kind, *shape.size, shape.radius, shape.height, shape.axis, *shape.normal, shape.offset]


def _flat(matrix: np.ndarray) -> list[float]:
    return [round(float(v), 9) for v in matrix[:3].ravel()]


def unchanged_groups(imported: dict[str, list] | None, state: dict[str, list]) -> set[str]:
    """The groups of keys that state what they stated when the object was imported; none for one made anew."""
    if imported is None:
        return set()
    return {group for group in (*_GROUPS, *state) if _same(imported.get(group), state.get(group))}


_GROUPS = ("ends", "frames", "pose", "parent", "lens", "cone", "inertial", "COLLISION", "VISUAL")


def _same(before: list | None, now: list | None) -> bool:
    if before is None or now is None or len(before) != len(now):
        return before is None and now is None
    for a, b in zip(before, now, strict=True):
        if isinstance(a, str) or isinstance(b, str):
            if a != b:
                return False
        elif abs(a - b) > 2e-6 * max(1.0, abs(a)):
            return False
    return True


def placed_keys(placed: Placed, same: set[str], file_values: Keys) -> Keys:
    """The keys that transform, children and data of an object decide.

    ``file_values`` are those of the file that it was imported from; they stay in the groups that are the ``same``.
    """
    makers = {"joint": _joint, "camera": _camera, "light": _light}
    return makers.get(placed.kind, _placed)(placed, same, file_values)


def _kept(file_values: Keys, *names: str) -> Keys:
    return {
        path: value for path, value in file_values.items() if any(path == n or path.startswith(f"{n}.") for n in names)
    }


def _parent(placed: Placed, same: set[str], file_values: Keys) -> Keys:
    if "parent" in same:
        return _kept(file_values, "parent")
    return {"parent": placed.parent} if placed.parent else {}


def _placed(placed: Placed, same: set[str], file_values: Keys) -> Keys:
    if placed.kind in ("vehicle", "input device"):
        return _kept(file_values, "parent", "location")
    values: Keys = {}
    if placed.kind != "body":
        values.update(_parent(placed, same, file_values))
    elif "parent" in file_values:
        values["parent"] = file_values["parent"]
    if "pose" in same:
        values.update(_kept(file_values, "location"))
    else:
        values["location"] = clean(pose_of(placed.T_world if placed.kind == "body" else placed.T_owner))
    if placed.shapes:
        values.update(_shapes(placed, same, file_values))
    return values


def _shapes(placed: Placed, same: set[str], file_values: Keys) -> Keys:
    values: Keys = {}
    if "inertial" in same:
        values.update(_kept(file_values, "inertial offset"))
    elif placed.inertial is not None:
        values["inertial offset"] = clean(pose_of(placed.inertial))
    for use, prefix in (("COLLISION", "collision "), ("VISUAL", "")):
        compound = "compound collision shape" if use == "COLLISION" else "compound shape"
        names = (f"{prefix}shape", f"{prefix}geometry", f"{prefix}offset" if prefix else "geometry", compound)
        if use in same:
            values.update(_kept(file_values, *names))
            continue
        shapes = placed.shapes[use]
        was_single = f"{prefix}shape" in file_values or compound not in file_values
        if len(shapes) == 1 and was_single and (use == "COLLISION" or same_place(shapes[0][1], np.eye(4))):
            shape, T = shapes[0]
            values[f"{prefix}shape"] = shape.kind
            values.update({f"{prefix}geometry.{key}": value for key, value in shape.geometry().items()})
            if use == "COLLISION":
                values["collision offset"] = clean(pose_of(T))
        elif shapes:
            values[compound] = tuple(_compound_item(*shape) for shape in shapes)
    return values


def _compound_item(shape: Shape, T: np.ndarray) -> Keys:
    geometry = {f"geometry.{key}": value for key, value in shape.geometry().items()}
    return {"shape": shape.kind, **geometry, "offset": clean(pose_of(T))}


def _joint(placed: Placed, same: set[str], file_values: Keys) -> Keys:
    values: Keys = {}
    if "ends" in same:
        values.update(_kept(file_values, "parent", "child"))
    else:
        values.update(zip(("parent", "child"), placed.ends, strict=True))
    if "frames" in same or placed.frames is None:
        values.update(_kept(file_values, *JOINT_GEOMETRY))
        return values
    keys = placed.frames.keys()
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


def _camera(placed: Placed, same: set[str], file_values: Keys) -> Keys:
    values = _parent(placed, same, file_values)
    if "pose" in same:
        values.update(_kept(file_values, "location", "look at", "up"))
    else:
        keys = view_keys(placed.T_owner, _distance(file_values))
        values.update({name: tidy(part) for name, part in zip(("location", "look at", "up"), keys, strict=True)})
    if "lens" in same:
        values.update(_kept(file_values, "field view angle", "clipping plane"))
    elif placed.lens is not None:
        angle, near, far = map(decimal, placed.lens)
        values.update({"field view angle": angle, "clipping plane.near": near, "clipping plane.far": far})
    return values


def _distance(file_values: Keys) -> float:
    """How far the file's camera looks; one metre when it states nothing."""
    a, b = (np.array(file_values.get(name, (0.0, 0.0, 0.0))) for name in ("location", "look at"))
    return float(np.linalg.norm(a - b)) or 1.0


def _light(placed: Placed, same: set[str], file_values: Keys) -> Keys:
    values = _parent(placed, same, file_values)
    if "pose" in same:
        values.update(_kept(file_values, "location", "direction"))
    else:
        location, direction = light_keys(placed.T_owner)
        values.update({"location": tidy(location), "direction": tidy(direction)})
    if "cone" in same:
        values.update(_kept(file_values, "cutoff angle"))
    elif placed.cone is not None:
        values["cutoff angle"] = decimal(placed.cone / 2.0)
    return values
