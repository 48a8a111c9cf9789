"""The keys of the format that follow from where an object stands; nothing of Blender."""

from __future__ import annotations

import numpy as np

from .ligature.authoring.motion import (
    JointPlace,
    moved_direction,
    moved_joint,
    moved_point,
    moved_pose,
    new_joint,
    new_light,
    new_pose,
    new_view,
    settled,
)
from .ligature.authoring.placement import JointKeys, same_place
from .placed import (
    NOISE,
    POSE_LENGTH,
    SHAPE_LENGTH,
    ZERO,
    JointFrames,
    Placed,
    PlacedShape,
    State,
    entries_of,
    equal_entries,
    pose_of,
    shape_state,
)

Keys = dict
"""Values of keys, typed, by path."""

JOINT_GEOMETRY = (
    "parent pivot", "child pivot", "parent axis", "child axis", "offset", "child offset", "joint offset",
)  # fmt: skip


def placed_keys(placed: Placed, before: State | None, unchanged: set[str], file_values: Keys) -> Keys:
    """The keys that transform, children and data of an object decide.

    ``file_values`` are those of the file that it was imported from, ``before`` its state then; the groups of keys that
    are ``unchanged`` since are as the file has them.
    """
    maker = {"joint": _joint, "camera": _camera, "light": _light}.get(placed.kind, _placed)
    return maker(placed, before or {}, unchanged, file_values)


def _kept(file_values: Keys, *names: str) -> Keys:
    return {
        path: value for path, value in file_values.items() if any(path == n or path.startswith(f"{n}.") for n in names)
    }


def _parent(placed: Placed, same: set[str], file_values: Keys) -> Keys:
    if "parent" in same:
        return _kept(file_values, "parent")
    return {"parent": placed.parent} if placed.parent else {}


def _before(placed: Placed, before: State, same: set[str]) -> np.ndarray | None:
    """The pose that the file's numbers state; None for a new object and for one that was parented to another since."""
    if "pose" not in before or (placed.kind != "body" and "parent" not in same):
        return None
    return pose_of(before["pose"])


def _placed(placed: Placed, before: State, same: set[str], file_values: Keys) -> Keys:
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
        was = _before(placed, before, same)
        reach = placed.far if was is None else placed.reach
        values["location"] = _pose(file_values.get("location"), was, placed.T, reach)
    if placed.shapes:
        values.update(_shapes(placed, before, same, file_values))
    return values


def _pose(given: tuple | None, before: np.ndarray | None, now: np.ndarray, reach: float) -> tuple:
    """The pose to write: the file's, or its default, moved as the object was; the object's own when it is new."""
    if before is None:
        return new_pose(now, reach)
    return moved_pose(given or new_pose(before, reach), before, now, reach)


def _shapes(placed: Placed, before: State, same: set[str], file_values: Keys) -> Keys:
    values: Keys = {}
    flat = before.get("inertial")
    if "inertial" in same:
        values.update(_kept(file_values, "inertial offset"))
    elif placed.inertial is not None:
        was = pose_of(flat) if flat else np.eye(4) if "inertial" in before else None
        values["inertial offset"] = _pose(file_values.get("inertial offset"), was, placed.inertial, _far(placed))
    for use, prefix in (("COLLISION", "collision "), ("VISUAL", "")):
        compound = "compound collision shape" if use == "COLLISION" else "compound shape"
        names = (f"{prefix}shape", f"{prefix}geometry", f"{prefix}offset" if prefix else "geometry", compound)
        moves_along = use == "COLLISION" and f"{prefix}shape" in file_values and "collision offset" not in file_values
        if use in same and not (moves_along and "inertial" not in same):
            values.update(_kept(file_values, *names))
            continue
        free = "inertial" in same or not moves_along
        values.update(_shape_keys(placed.shapes[use], before.get(use, []), use, file_values, _far(placed), free))
    return values


def _shape_keys(shapes: list[PlacedShape], before: list, use: str, file_values: Keys, far: float, free: bool) -> Keys:
    """The keys of primitives of which some changed; those of the file are found by their place in it."""
    prefix, compound = ("collision ", "compound collision shape") if use == "COLLISION" else ("", "compound shape")
    single = f"{prefix}shape" in file_values
    if single:
        block = f"{prefix}geometry."
        items = [{path.replace(block, "geometry.", 1): value for path, value in _kept(file_values, block[:-1]).items()}]
        items[0]["shape"] = file_values[f"{prefix}shape"]
        if prefix and "collision offset" in file_values:
            items[0]["offset"] = file_values["collision offset"]
    else:
        items = list(file_values.get(compound, ()))
    written, used = [], set()
    for one in shapes:
        known = one.order < len(items) and one.order not in used and len(before) >= _end(one.order)
        used |= {one.order}
        entry = before[_end(one.order - 1) : _end(one.order)] if known else None
        written.append(_shape_item(one, items[one.order] if known else {}, entry, far, free))
    was_single = single or compound not in file_values
    if len(shapes) == 1 and was_single and (use == "COLLISION" or same_place(shapes[0].T_owner, np.eye(4))):
        item = written[0]
        values = {f"{prefix}{path}" if path != "offset" else "collision offset": v for path, v in item.items()}
        return values if prefix else {path: v for path, v in values.items() if path != "collision offset"}
    return {compound: tuple(written)} if written else {}


def _end(order: int) -> int:
    return (order + 1) * (SHAPE_LENGTH + POSE_LENGTH)


def _shape_item(one: PlacedShape, item: Keys, before: list | None, far: float, free: bool) -> Keys:
    """A primitive as it is to stand in the file; ``item`` are the file's keys, ``before`` its state then.

    ``free`` is whether a pose that the file does not give may stay out of it.
    """
    changed = before is None or not equal_entries(before[:SHAPE_LENGTH], shape_state(one.shape))
    offset = _kept(item, "offset")
    if changed:
        geometry = {f"geometry.{key}": value for key, value in one.shape.geometry().items()}
        if "geometry.axis" in item and one.shape.kind not in ("BOX", "SPHERE", "PLANE"):
            geometry["geometry.axis"] = one.shape.axis
        other = {p: v for p, v in item.items() if not p.startswith("geometry.") and p not in ("shape", "offset")}
        result = {"shape": one.shape.kind, **geometry, **other}
    else:
        result = {path: value for path, value in item.items() if path != "offset"}
    if before is None:
        return {**result, "offset": new_pose(one.T_owner, far)}
    was = before[SHAPE_LENGTH:]
    if (offset or free) and equal_entries(was, entries_of(one.T_owner), "pose"):
        return {**result, **offset}
    return {**result, "offset": _pose(item.get("offset"), pose_of(was), one.T_owner, far)}


def _far(placed: Placed) -> float:
    """The largest coordinate of an object's children, in its frame."""
    frames = [s.T_owner for shapes in placed.shapes.values() for s in shapes]
    frames += [placed.inertial] if placed.inertial is not None else []
    return max((float(np.abs(T[:3, 3]).max()) for T in frames), default=0.0)


def _joint(placed: Placed, before: State, same: set[str], file_values: Keys) -> Keys:
    values: Keys = {}
    if "ends" in same:
        values.update(_kept(file_values, "parent", "child"))
    else:
        values.update(zip(("parent", "child"), placed.ends, strict=True))
    if "frames" in same or placed.frames is None:
        values.update(_kept(file_values, *JOINT_GEOMETRY))
        return values
    turn = "offset" if "offset" in file_values or "child offset" not in file_values else "child offset"
    if "ends" not in same or not before.get("frames") or "parent pivot" not in file_values:
        return {**values, **_geometry(_new_joint(placed.frames), turn)}
    given = JointKeys(
        *(file_values[name] for name in JOINT_GEOMETRY[:4]),
        file_values.get(turn, 0.0),
        file_values.get("joint offset", 0.0),
    )
    keys = _geometry(_moved_joint(placed.frames, given, before["frames"]), turn)
    values.update(_kept(file_values, *JOINT_GEOMETRY))
    values.update({name: value for name, value in keys.items() if name in file_values or value != 0.0})
    return values


def _new_joint(frames: JointFrames) -> JointKeys:
    """Keys of a new joint, from where it, its parent and its child stand."""
    now = JointPlace(frames.T_parent_joint, frames.T_parent_child)
    return new_joint(now, frames.inertial, frames.kind, frames.scales, frames.reach)


def _moved_joint(frames: JointFrames, keys: JointKeys, before: list) -> JointKeys:
    """Keys of a file's joint that stood as the state ``before``."""
    first = JointPlace(pose_of(before[:POSE_LENGTH]), pose_of(before[POSE_LENGTH:]))
    now = JointPlace(frames.T_parent_joint, frames.T_parent_child)
    return moved_joint(keys, first, now, frames.inertial, frames.kind, frames.scales, frames.reach)


def _geometry(keys: JointKeys, turn: str) -> Keys:
    return {
        "parent pivot": keys.parent_pivot,
        "child pivot": keys.child_pivot,
        "parent axis": keys.parent_axis,
        "child axis": keys.child_axis,
        turn: keys.offset,
        "joint offset": keys.joint_offset,
    }


def _camera(placed: Placed, before: State, same: set[str], file_values: Keys) -> Keys:
    values = _parent(placed, same, file_values)
    was = _before(placed, before, same)
    if "pose" in same:
        values.update(_kept(file_values, "location", "look at", "up"))
    elif was is None:
        keys = new_view(placed.T, _distance(file_values), placed.far)
        values.update(zip(("location", "look at", "up"), keys, strict=True))
    else:
        location, look_at = (file_values.get(name, ZERO) for name in ("location", "look at"))
        values["location"] = moved_pose((location, ZERO), was, placed.T, placed.reach)[0]
        values["look at"] = moved_point(look_at, was, placed.T, placed.reach)
        up = moved_direction(file_values.get("up", (0.0, 0.0, 1.0)), was, placed.T)
        if "up" in file_values or up != (0.0, 0.0, 1.0):
            values["up"] = up
    if placed.lens is None:
        values.update(_kept(file_values, *LENS))
        return values
    first = before.get("lens") or [None] * 3
    for name, old, now in zip(LENS, first, placed.lens, strict=True):
        values.update(_number(name, old, now, file_values))
    if any(name in values for name in LENS[1:]):  # the format wants both
        values = {**dict(zip(LENS[1:], (settled(v) for v in placed.lens[1:]), strict=True)), **values}
    return values


LENS = ("field view angle", "clipping plane.near", "clipping plane.far")


def _number(name: str, old: float | None, now: float, file_values: Keys) -> Keys:
    """A number of Blender's data: the file's, or its default, where it did not change."""
    if old is not None and abs(now - old) <= 2e-6 * max(1e-3, abs(old)):
        return _kept(file_values, name)
    return {name: settled(now, file_values.get(name), NOISE * abs(now))}


def _distance(file_values: Keys) -> float:
    """Distance from the file's camera to its target; one metre when the file does not state it."""
    a, b = (np.array(file_values.get(name, ZERO)) for name in ("location", "look at"))
    return float(np.linalg.norm(a - b)) or 1.0


def _light(placed: Placed, before: State, same: set[str], file_values: Keys) -> Keys:
    values = _parent(placed, same, file_values)
    was = _before(placed, before, same)
    if "pose" in same:
        values.update(_kept(file_values, "location", "direction"))
    elif was is None or not any(file_values.get("direction", ZERO)):
        values.update(zip(("location", "direction"), new_light(placed.T, placed.far), strict=True))
    else:
        values["location"] = moved_pose((file_values.get("location", ZERO), ZERO), was, placed.T, placed.reach)[0]
        values["direction"] = moved_direction(file_values["direction"], was, placed.T)
    if placed.cone is None:
        values.update(_kept(file_values, "cutoff angle"))
        return values
    old = before.get("cone")
    values.update(_number("cutoff angle", old[0] / 2.0 if old else None, placed.cone / 2.0, file_values))
    return values
