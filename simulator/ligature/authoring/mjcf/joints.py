"""Joints of a compiled MuJoCo model as joints of the format.

A hinge or slide becomes one joint; slides and hinges in one place become a six-DOF joint, whose axes the format
moves in the same order. A hinge or slide that nothing drives and that has stiffness or damping becomes a spring,
since joints that take commands have neither in the format.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ligature.adf.frames import Array, frame, inverse, minimal_rotation
from ligature.adf.update import Item
from ligature.authoring.mjcf.model import inertial_frame, is_static, name_of, names_of, owner_of
from ligature.authoring.placement import joint_keys

_FREE, _BALL, _SLIDE, _HINGE = range(4)
_DRIVES_JOINT = (0, 1)  # transmissions of actuators: a joint, a joint in the parent's frame

_SIX = [f"{half}.{{}}.{a}" for half in ("linear", "angular") for a in "xyz"]
_HINGE_PLACES = (2, 1, 0)
"""Axes of the joint frame that hinges of one body take, first to last: the format turns about Z, then Y, then X."""


def joints_of(model: Any, body: int, poses: list[Array], notes: list[str]) -> Iterator[Item]:
    """The joint between a body and its parent, if they are joined."""
    if body == 0:
        return
    name = name_of(model, "body", body)
    parent = owner_of(model, int(model.body_parentid[body]))
    first = int(model.body_jntadr[body])
    joints = list(range(first, first + int(model.body_jntnum[body])))
    kinds = [int(model.jnt_type[j]) for j in joints]
    if kinds == [_FREE] or (not joints and is_static(model, body)):
        return
    for joint in joints:
        _note_unsupported(model, joint, notes)
    if not joints:
        label, values, T_joint = name, {"type": "fixed"}, np.eye(4)
    elif kinds == [_BALL]:
        label, T_joint = name_of(model, "jnt", joints[0]), frame(np.eye(3), model.jnt_pos[joints[0]])
        values = {"type": "p2p"}
    elif len(joints) == 1:
        label, T_joint = name_of(model, "jnt", joints[0]), _axis_frame(model, joints[0])
        values = _single(model, joints[0])
    else:
        label = " ".join(name_of(model, "jnt", joint) for joint in joints)
        several = _several(model, joints)
        if several is None:
            notes.append(
                f"body '{name}' has the joints {names_of(model, 'jnt', joints)}, "
                "which one joint of ADF cannot express; the body stays free"
            )
            return
        values, T_joint = several
    T_parent_child = inverse(poses[parent]) @ poses[body]
    prismatic = values["type"] == "prismatic"
    ends = [inertial_frame(model, each) for each in (parent, body)]
    keys = joint_keys(T_parent_child @ T_joint, T_parent_child, ends[0], ends[1], prismatic)
    where = {
        "parent": f"BODY {name_of(model, 'body', parent)}", "child": f"BODY {name}",
        "parent pivot": keys.parent_pivot, "child pivot": keys.child_pivot,
        "parent axis": keys.parent_axis, "child axis": keys.child_axis,
        "offset": keys.offset, "joint offset": keys.joint_offset,
    }  # fmt: skip
    yield Item("joint", f"JOINT {label}", {"name": label, **values, **where})


def _axis_frame(model: Any, joint: int) -> Array:
    """Pose in the body of a joint frame whose Z, of a prismatic joint its X, is the joint's axis."""
    prismatic = model.jnt_type[joint] == _SLIDE and not _is_sprung(model, joint)
    e = (1.0, 0.0, 0.0) if prismatic else (0.0, 0.0, 1.0)
    return frame(minimal_rotation(e, np.asarray(model.jnt_axis[joint], dtype=float)), model.jnt_pos[joint])


def _is_driven(model: Any, joint: int) -> bool:
    drives = zip(model.actuator_trntype, model.actuator_trnid[:, 0], strict=True)
    return any(kind in _DRIVES_JOINT and target == joint for kind, target in drives)


def _is_sprung(model: Any, joint: int) -> bool:
    """Whether a joint becomes a spring: it has stiffness or damping, and nothing drives it."""
    dof = int(model.jnt_dofadr[joint])
    return bool(first(model.jnt_stiffness[joint]) or first(model.dof_damping[dof])) and not _is_driven(model, joint)


def first(value: Any) -> float:
    """A coefficient; of a polynomial the linear one."""
    return float(np.ravel(value)[0])


def _range(model: Any, joint: int) -> tuple[float, float] | None:
    """Limits relative to the reference configuration; None without limits."""
    if not model.jnt_limited[joint]:
        return None
    zero = float(model.qpos0[model.jnt_qposadr[joint]])
    low, high = (float(v) - zero for v in model.jnt_range[joint])
    return low, high


def _spring(model: Any, joint: int) -> tuple[float, float, float]:
    """Stiffness, damping, and rest position from the reference configuration on."""
    place = int(model.jnt_qposadr[joint])
    rest = float(model.qpos_spring[place] - model.qpos0[place])
    return first(model.jnt_stiffness[joint]), first(model.dof_damping[model.jnt_dofadr[joint]]), rest


def _single(model: Any, joint: int) -> dict[str, Any]:
    """Type, limits and spring of one hinge or slide."""
    hinge, limits = model.jnt_type[joint] == _HINGE, _range(model, joint)
    if not _is_sprung(model, joint):
        values: dict[str, Any] = {"type": "revolute" if hinge else "prismatic"}
    elif limits is None:  # a spring of the format needs limits; one axis of a six-DOF spring can be free
        return _six_keys(model, {5 if hinge else 2: (joint, 1.0)})
    else:
        stiffness, damping, rest = _spring(model, joint)
        values = {"type": "torsion spring" if hinge else "linear spring", "stiffness": stiffness, "damping": damping,
                  "equilibrium point": rest}  # fmt: skip
    if limits is not None:
        values["joint limits.low"], values["joint limits.high"] = limits
    return values


def _several(model: Any, joints: list[int]) -> tuple[dict[str, Any], Array] | None:
    """Slides, then hinges in one point, along axes at right angles: a six-DOF joint and its pose in the body."""
    kinds = [int(model.jnt_type[j]) for j in joints]
    slides = [j for j in joints if model.jnt_type[j] == _SLIDE]
    hinges = [j for j in joints if model.jnt_type[j] == _HINGE]
    if kinds != [_SLIDE] * len(slides) + [_HINGE] * len(hinges) or max(len(slides), len(hinges)) > 3:
        return None
    if any(not np.allclose(model.jnt_pos[j], model.jnt_pos[hinges[0]], atol=1e-9) for j in hinges):
        return None
    columns: dict[int, Array] = {}
    used: dict[int, tuple[int, float]] = {}
    for joint, place in zip(hinges, _HINGE_PLACES, strict=False):
        columns[place] = np.asarray(model.jnt_axis[joint], dtype=float)
        used[3 + place] = (joint, 1.0)
    for joint in slides:
        axis = np.asarray(model.jnt_axis[joint], dtype=float)
        along = [p for p, column in columns.items() if abs(column @ axis) > 1.0 - 1e-9 and p not in used]
        free = [p for p in range(3) if p not in columns]
        if not along and not free:
            return None
        place = (along or free)[0]
        columns.setdefault(place, axis)
        used[place] = (joint, float(np.sign(columns[place] @ axis)))
    R = _completed(columns)
    if R is None:
        return None
    turned = {place: (joint, sign * float(np.sign(R[:, place % 3] @ columns[place % 3])))
              for place, (joint, sign) in used.items()}  # fmt: skip
    anchor = model.jnt_pos[hinges[0]] if hinges else np.zeros(3)
    return _six_keys(model, turned), frame(R, anchor)


def _completed(columns: dict[int, Array]) -> Array | None:
    """A right-handed rotation with these columns, of three the last maybe negated; None unless orthogonal."""
    R = np.zeros((3, 3))
    for place, axis in columns.items():
        if any(abs(R[:, other] @ axis) > 1e-6 for other in range(3)):
            return None
        R[:, place] = axis
    missing = [place for place in range(3) if place not in columns]
    if len(missing) == 2:
        a = next(iter(columns))
        side = np.cross(R[:, a], np.eye(3)[int(np.argmin(np.abs(R[:, a])))])
        R[:, missing[0]] = side / np.linalg.norm(side)
    if missing:
        last = missing[-1]
        R[:, last] = np.cross(R[:, (last + 1) % 3], R[:, (last + 2) % 3])
    elif np.linalg.det(R) < 0.0:
        R[:, list(columns)[-1]] *= -1.0
    return R


def _six_keys(model: Any, used: dict[int, tuple[int, float]]) -> dict[str, Any]:
    """Keys of a six-DOF joint with some axes in use, each by a joint and with its sign; the others are locked."""
    sprung = any(_is_sprung(model, joint) for joint, _ in used.values())
    values: dict[str, Any] = {"type": "six dof spring" if sprung else "six dof"}
    for place, path in enumerate(_SIX):
        joint, sign = used.get(place, (None, 1.0))
        limits = (0.0, 0.0) if joint is None else _range(model, joint) or (1.0, -1.0)  # low above high is free
        if joint is not None and sign < 0.0 and limits != (1.0, -1.0):
            limits = (-limits[1], -limits[0])
        values[f"joint limits.{path.format('low')}"], values[f"joint limits.{path.format('high')}"] = limits
        if sprung:
            stiffness, damping, rest = (0.0, 0.0, 0.0) if joint is None else _spring(model, joint)
            single = path.replace("{}.", "")
            values[f"stiffness.{single}"], values[f"damping.{single}"] = stiffness, damping
            values[f"equilibrium point.{single}"] = sign * rest
    return values


def _note_unsupported(model: Any, joint: int, notes: list[str]) -> None:
    """Note properties of a joint that have no counterpart."""
    name, kind, dof = name_of(model, "jnt", joint), int(model.jnt_type[joint]), int(model.jnt_dofadr[joint])
    lost = []
    if kind == _BALL:
        lost += ["its limit"] if model.jnt_limited[joint] else []
        lost += ["its stiffness"] if first(model.jnt_stiffness[joint]) else []
    if first(model.dof_damping[dof]) and (kind == _BALL or _is_driven(model, joint)):
        lost.append("its damping")
    elif first(model.jnt_stiffness[joint]) and kind != _BALL and _is_driven(model, joint):
        lost.append("its stiffness")
    lost += ["its friction"] if model.dof_frictionloss[dof] else []
    lost += ["its armature"] if model.dof_armature[dof] else []
    if lost:
        notes.append(f"joint '{name}': {', '.join(lost)} cannot be expressed and is left out")
