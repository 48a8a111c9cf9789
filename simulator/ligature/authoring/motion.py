"""Applies the change of a pose to what a file states, so that numbers that did not change keep their digits.

An editor holds poses in single precision, and a file holds rounded ones: neither follows exactly from the other. What
is written is therefore the file's own numbers, moved by what changed between two readings of the editor. Poses are
(4, 4) matrices in metres; angles in radians.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ligature.adf.frames import Array, axis_rotation, frame, inverse, matrix_rpy, rpy_matrix
from ligature.authoring.placement import (
    JointKeys,
    Pose,
    Vector,
    child_pose,
    joint_keys,
    joint_pose,
    light_keys,
    same_place,
    vector,
    view_keys,
)

SINGLE = 2.0**-23
"""Distance of single-precision numbers around one."""

TURN = 5e-7
"""Radians, and lengths of directions, below which a difference is the noise of single precision."""

TINY = 1e-9
"""Metres and radians below which a number is written as zero."""

MOVED = 2e-6
"""Radians below which an orientation counts as the same (see `placement.SAME_PLACE`)."""

LOOSE, LOOSE_TURN, EXACT = 0.1, 0.05, 1e-5
"""What poses of rounded files are off their joints: a share of the pivots' lengths, an angle, and metres at least."""

AT_ZERO = 1e-4
"""Radians below which a joint is at its position zero: what files round of poses and offsets."""

DECIMALS = 17
_ROUND = ("revolute", "torsion spring")
_TURNING = ("p2p", "cone twist")
_SLIDES = {"prismatic": 0, "linear spring": 2}
"""Axis of frame A along which a joint of a type slides."""
_LOOSE_IN_ALL = ("six dof", "six dof spring")


@dataclass(frozen=True, eq=False)
class JointPlace:
    """Where a joint and its child body stand in the parent body's frame."""

    T_parent_joint: Array
    T_parent_child: Array


def settled(value: float, was: float | None = None, noise: float = 0.0) -> float:
    """The shortest decimal that is ``value`` in single precision, or ``was`` or zero within the ``noise``.

    ``noise`` is how exactly the editor knows the value; a quarter of it is left to the digits.
    """
    own = 0.49 * float(np.spacing(np.float32(abs(value))))
    for kept in (was, 0.0):
        if kept is not None and abs(value - kept) <= max(own, noise):
            return kept
    for places in range(DECIMALS):
        short = round(value, places)
        if abs(short - value) <= max(own, noise / 4.0):
            return short + 0.0
    return float(value)


def moved_pose(was: Pose, before: Array, now: Array, reach: float = 0.0) -> Pose:
    """The pose ``was`` of a file after its object moved from ``before`` to ``now``.

    ``reach`` is the greatest coordinate that ``now`` was computed from; 0 for one that the editor stores itself.
    """
    noise = SINGLE * 2.0 * reach
    position = tuple(_shifted(*numbers, noise) for numbers in zip(was[0], before[:3, 3], now[:3, 3], strict=True))
    if _angle(before, now) <= MOVED:
        return position, was[1]  # type: ignore[return-value]
    turn = now[:3, :3] @ before[:3, :3].T @ rpy_matrix(*was[1])
    return position, _settled(near_rpy(turn, was[1]), was[1], TURN)  # type: ignore[return-value]


def new_pose(T: Array, reach: float = 0.0) -> Pose:
    """A pose in short decimals, for a file that states none yet."""
    return _settled(vector(T[:3, 3]), None, SINGLE * 2.0 * reach), _settled(matrix_rpy(T[:3, :3]), None, TURN)


def near_rpy(R: Array, was: Vector) -> Vector:
    """Angles r, p, y in radians of the rotation ``R`` (3, 3): of all equivalent ones those nearest to ``was``."""
    p = float(np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0])))
    if np.hypot(R[0, 0], R[1, 0]) < MOVED:  # only the sum, or the difference, of r and y is defined
        side = 1.0 if p > 0.0 else -1.0
        between = float(np.arctan2(side * R[0, 1], R[1, 1]))
        return _wrapped((side * was[2] + between, p, was[2]), was)
    r, y = float(np.arctan2(R[2, 1], R[2, 2])), float(np.arctan2(R[1, 0], R[0, 0]))
    both = [_wrapped(found, was) for found in ((r, p, y), (r + pi, pi - p, y + pi))]
    r, p, y = min(both, key=lambda found: sum(abs(a - b) for a, b in zip(found, was, strict=True)))
    side = 1.0 if np.sin(p) > 0.0 else -1.0
    for kept in ((was[0], p, y + side * (was[0] - r)), (r + side * (was[2] - y), p, was[2])):
        if np.abs(rpy_matrix(*kept) - R).max() <= TURN:  # near the pole r and y are known much worse than their sum
            return kept
    return r, p, y


def moved_direction(was: Vector, before: Array, now: Array) -> Vector:
    """A direction of a file after its object turned from ``before`` to ``now``; its length stays."""
    if _angle(before, now) <= MOVED:
        return was
    turned = now[:3, :3] @ before[:3, :3].T @ np.asarray(was, dtype=float)
    return _settled(turned, was, TURN * max(float(np.linalg.norm(turned)), 1e-3))


def moved_point(was: Vector, before: Array, now: Array, reach: float = 0.0) -> Vector:
    """A point of a file that moves with its object from ``before`` to ``now``."""
    motion = change(before, now, SINGLE * 2.0 * reach)
    point = motion[:3, :3] @ np.asarray(was, dtype=float) + motion[:3, 3]
    return _settled(point, was, SINGLE * 2.0 * max(reach, float(np.abs(point).max())))


def new_view(T: Array, distance: float, reach: float = 0.0) -> tuple[Vector, Vector, Vector]:
    """Location, look-at point and up direction of a view, in short decimals."""
    location, look_at, up = view_keys(T, distance)
    noise = SINGLE * 2.0 * max(reach, *(abs(v) for v in look_at))
    return _settled(location, None, SINGLE * 2.0 * reach), _settled(look_at, None, noise), _settled(up, None, TURN)


def new_light(T: Array, reach: float = 0.0) -> tuple[Vector, Vector]:
    """Location and direction of a lamp, in short decimals."""
    location, direction = light_keys(T)
    return _settled(location, None, SINGLE * 2.0 * reach), _settled(direction, None, TURN)


def change(before: Array, now: Array, noise: float = 0.0) -> Array:
    """The motion (4, 4) that takes ``before`` to ``now``, in the frame of both; below the noise it is none."""
    if _angle(before, now) > MOVED:
        return now @ inverse(before)
    shift = now[:3, 3] - before[:3, 3]
    return frame(np.eye(3), np.where(np.abs(shift) <= noise, 0.0, shift))


def follows(
    keys: JointKeys,
    place: JointPlace,
    inertial: tuple[Array, Array] = (np.eye(4), np.eye(4)),
    kind: str = "revolute",
    scales: tuple[float, float] = (1.0, 1.0),
) -> bool:
    """Whether the bodies of a joint stand where it holds them, but for its own motion and what files round.

    Files made elsewhere state joints whose bodies all stand in one place; such joints do not follow from the poses.
    """
    scaled = _scaled(keys, scales)
    motion = _motion(*_poses(scaled, inertial, kind == "prismatic"), place)
    shift = motion[:3, 3].copy()
    if kind in _SLIDES:
        shift[_SLIDES[kind]] = 0.0
    if kind in _TURNING:
        turn = 0.0
    elif kind in _ROUND:
        turn = float(np.arccos(np.clip(motion[2, 2], -1.0, 1.0)))
    else:
        turn = _angle(np.eye(4), motion)
    size = float(np.linalg.norm(scaled.parent_pivot) + np.linalg.norm(scaled.child_pivot))
    return float(np.linalg.norm(shift)) <= EXACT + LOOSE * size and turn <= LOOSE_TURN


def moved_joint(
    keys: JointKeys,
    before: JointPlace,
    now: JointPlace,
    inertial: tuple[Array, Array] = (np.eye(4), np.eye(4)),
    kind: str = "revolute",
    scales: tuple[float, float] = (1.0, 1.0),
    reach: float = 0.0,
) -> JointKeys:
    """The keys of a file's joint after it, its parent or its child moved; what did not change is the file's own.

    A joint that follows keeps its position: it holds the child where it stands now at the same angle or displacement.
    A joint that does not follow from the poses of its bodies stays as it is when these move, and keeps its own pose
    of the child when it is moved itself.
    """
    prismatic, noise = kind == "prismatic", SINGLE * 2.0 * reach
    joint_stays = same_place(before.T_parent_joint, now.T_parent_joint)
    child_stays = same_place(before.T_parent_child, now.T_parent_child)
    goes_along = follows(keys, before, inertial, kind, scales)
    child_stays = child_stays or not goes_along
    if joint_stays and child_stays:
        return keys
    T_joint_0, T_child_0 = _poses(_scaled(keys, scales), inertial, prismatic)
    T_joint = T_joint_0 if joint_stays else change(before.T_parent_joint, now.T_parent_joint, noise) @ T_joint_0
    own = _own_motion(_motion(T_joint_0, T_child_0, before), kind) if goes_along else None
    T_child = T_child_0 if own is None else T_joint_0 @ own @ inverse(T_joint_0) @ T_child_0
    if not child_stays:
        T_child = change(before.T_parent_child, now.T_parent_child, noise) @ T_child
    if own is not None:  # back to the position zero that keys are stated for, about the joint where it is now
        T_child = T_joint @ inverse(own) @ inverse(T_joint) @ T_child
    moved = _moved_keys(keys, (T_joint_0, T_child_0), (T_joint, T_child), inertial, prismatic, scales, noise)
    again = zip(_poses(_scaled(moved, scales), inertial, prismatic), (T_joint, T_child), strict=True)
    if all(same_place(found, wanted, 4.0 * MOVED) for found, wanted in again):
        return moved
    return _new_joint(joint_keys(T_joint, T_child, *inertial, prismatic, scales), noise)


def _motion(T_joint: Array, T_child: Array, place: JointPlace) -> Array:
    """How far the child of a joint stands from the pose that its keys state, in the joint's frame A."""
    return inverse(T_joint) @ place.T_parent_child @ inverse(T_child) @ T_joint


def _own_motion(motion: Array, kind: str) -> Array | None:
    """The part of a motion in frame A that a joint of this kind moves by itself; None where it is at zero."""
    turn, shift = np.eye(3), np.zeros(3)
    if kind in _SLIDES:
        shift[_SLIDES[kind]] = motion[_SLIDES[kind], 3]
    elif kind in _ROUND:
        turn = axis_rotation((0, 0, 1), float(np.arctan2(motion[1, 0] - motion[0, 1], motion[0, 0] + motion[1, 1])))
    elif kind in (*_TURNING, *_LOOSE_IN_ALL):
        turn = motion[:3, :3]
        shift = motion[:3, 3] if kind in _LOOSE_IN_ALL else shift
    own = frame(turn, shift)
    return None if np.abs(shift).max() <= EXACT and _angle(np.eye(4), own) <= AT_ZERO else own


def new_joint(
    place: JointPlace,
    inertial: tuple[Array, Array] = (np.eye(4), np.eye(4)),
    kind: str = "revolute",
    scales: tuple[float, float] = (1.0, 1.0),
    reach: float = 0.0,
) -> JointKeys:
    """Keys in short decimals of a joint that follows from where it and its bodies stand."""
    found = joint_keys(place.T_parent_joint, place.T_parent_child, *inertial, kind == "prismatic", scales)
    return _new_joint(found, SINGLE * 2.0 * reach)


def _new_joint(keys: JointKeys, noise: float) -> JointKeys:
    return JointKeys(
        _settled(keys.parent_pivot, None, noise),
        _settled(keys.child_pivot, None, noise),
        _settled(keys.parent_axis, None, TURN),
        _settled(keys.child_axis, None, TURN),
        settled(keys.offset, None, TURN),
        settled(keys.joint_offset, None, TURN),
    )


def _moved_keys(
    keys: JointKeys,
    before: tuple[Array, Array],
    now: tuple[Array, Array],
    inertial: tuple[Array, Array],
    prismatic: bool,
    scales: tuple[float, float],
    noise: float,
) -> JointKeys:
    """The file's keys plus the difference of the keys that both poses, of joint and child, have by themselves."""
    first, last = (joint_keys(*pair, *inertial, prismatic, scales) for pair in (before, now))
    in_child = [inverse(T_child) @ T_joint for T_joint, T_child in (before, now)]
    return JointKeys(
        _added(keys.parent_pivot, first.parent_pivot, last.parent_pivot, noise / scales[0]),
        _added(keys.child_pivot, first.child_pivot, last.child_pivot, noise / scales[1]),
        moved_direction(keys.parent_axis, before[0], now[0]),
        moved_direction(keys.child_axis, *in_child),
        _added_angle(keys.offset, first.offset, last.offset),
        _added_angle(keys.joint_offset, first.joint_offset, last.joint_offset),
    )


def _poses(keys: JointKeys, inertial: tuple[Array, Array], prismatic: bool) -> tuple[Array, Array]:
    """Poses (4, 4) of joint and child in the parent's frame that keys state, with pivots as `_scaled` has them."""
    return joint_pose(keys, *inertial, prismatic), child_pose(keys, *inertial, prismatic)


def _scaled(keys: JointKeys, scales: tuple[float, float]) -> JointKeys:
    """The keys with pivots as the simulator takes them."""
    parent, child = (
        vector(s * np.asarray(p)) for s, p in zip(scales, (keys.parent_pivot, keys.child_pivot), strict=True)
    )
    return replace(keys, parent_pivot=parent, child_pivot=child)


def _shifted(was: float, before: float, now: float, noise: float) -> float:
    """A number of a file, changed by the difference of ``before`` and ``now``."""
    own = 0.5 * float(np.spacing(np.float32(abs(before))))
    if abs(now - before) <= max(own, noise):
        return was
    return settled(now if abs(was - before) <= own else was + float(now - before), was, max(noise, TINY))


def _added(was: Vector, first: Vector, last: Vector, noise: float) -> Vector:
    return tuple(  # type: ignore[return-value]
        w if abs(b - a) <= max(noise, TINY) else settled(w + b - a, w, max(noise, TINY))
        for w, a, b in zip(was, first, last, strict=True)
    )


def _added_angle(was: float, first: float, last: float) -> float:
    turn = (last - first + pi) % (2.0 * pi) - pi
    return was if abs(turn) <= TURN else settled(_wrapped_angle(was + turn, 0.0 if abs(was) <= pi else was), was, TURN)


def _settled(values: Array | Vector, was: Vector | None, noise: float) -> Vector:
    old = was or (None, None, None)
    return tuple(settled(float(v), w, max(noise, TINY)) for v, w in zip(values, old, strict=True))  # type: ignore[return-value]


def _wrapped(values: tuple[float, ...], was: Vector) -> Vector:
    return tuple(_wrapped_angle(v, w) for v, w in zip(values, was, strict=True))  # type: ignore[return-value]


def _wrapped_angle(value: float, was: float) -> float:
    """The angle that means ``value`` and lies within half a turn of ``was``."""
    return value - 2.0 * pi * round((value - was) / (2.0 * pi))


def _angle(A: Array, B: Array) -> float:
    """Angle between two orientations; exact for small ones too."""
    R = B[:3, :3] @ A[:3, :3].T
    sine = 0.5 * float(np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]))
    return float(np.arctan2(sine, 0.5 * (float(np.trace(R)) - 1.0)))


__all__ = [
    "JointPlace", "change", "follows", "moved_direction", "moved_joint", "moved_point", "moved_pose", "near_rpy",
    "new_joint", "new_light", "new_pose", "new_view", "settled",
]  # fmt: skip
