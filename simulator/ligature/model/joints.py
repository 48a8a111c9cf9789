"""Joints between two bodies, of one element each.

Frames and units as in `ligature.model.scene`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ligature.adf import Element, scalars
from ligature.adf.schema.keys import FARTHEST
from ligature.model.frames import Array, inverse, joint_frames
from ligature.model.scene import Body, Gains, Identity, Joint, JointType, OutputType, SixDof

SIX = tuple(f"{half}.{axis}" for half in ("linear", "angular") for axis in "xyz")


def joint_of(
    element: Element, index: int, identity: Identity, parent: Body, child: Body, scales: tuple[float, float]
) -> Joint:
    """A joint between two bodies; ``scales`` multiply the pivots of parent and child."""
    kind = JointType(element.value("type") or "revolute")
    offset = element.value("offset")
    frames = joint_frames(
        parent.T_body_inertial,
        child.T_body_inertial,
        np.array(element.vector("parent pivot")) * scales[0],
        np.array(element.vector("child pivot")) * scales[1],
        element.vector("parent axis"),
        element.vector("child axis"),
        element.number("child offset") if offset is None else offset,
        element.number("joint offset"),
        kind is JointType.PRISMATIC,
    )
    T_zero = parent.T_body_inertial @ frames.T_parent_child @ np.linalg.inv(child.T_body_inertial)
    low, high = _limits(element, kind)
    springs = kind in (JointType.LINEAR_SPRING, JointType.TORSION_SPRING)
    span = _span(element) if springs else None
    equilibrium = _scalar(element, "equilibrium point") if springs else None
    if equilibrium is None:
        equilibrium = 0.0 if span is None else sum(span) / 2
    output = element.value("controller output type")
    default_output = "FORCE" if element.has("controller") else "VELOCITY"
    return Joint(
        index=index,
        identity=identity,
        type=kind,
        parent=parent.index,
        child=child.index,
        axis=frames.axis,
        T_parent_a=frames.T_parent_a,
        T_child_b=frames.T_child_b,
        T_parent_child_zero=T_zero,
        low=low,
        high=high,
        freed=span is not None and low is None,
        controller=Gains(*(element.number(f"controller.{k}") for k in "PID")),
        output=OutputType[output or default_output],
        max_motor_impulse=element.number("max motor impulse"),
        erp=element.number("joint erp"),
        cfm=element.number("joint cfm"),
        stiffness=(_scalar(element, "stiffness") or 0.0) if springs else 0.0,
        damping=(_scalar(element, "damping") or 0.0) if springs else 0.0,
        equilibrium=equilibrium,
        six_dof=_six_dof(element, kind),
        cone_twist=_cone_twist(element, kind),
        motor_enabled=_motor(element.value("enable motor")),
        feedback=element.flag("enable feedback"),
        passive=element.flag("passive"),
    )


def _motor(value: Any) -> bool:
    """What ``enable motor`` means: old files give 0 or 1, others a truth value; anything else counts as true."""
    try:
        return not isinstance(value, str) or (value != "0" and scalars.flag(value))
    except ValueError:
        return True


def _span(element: Element) -> tuple[float, float] | None:
    """The ends of the limits as the file gives them; None unless it gives both, and the joint can be between them."""
    low, high = element.value("joint limits.low"), element.value("joint limits.high")
    if low is None or high is None or FARTHEST < low <= high or low <= high < -FARTHEST:
        return None
    return float(low), float(high)


def _limits(element: Element, kind: JointType) -> tuple[float | None, float | None]:
    """Both limits or none; a fixed joint has none, one with low > high neither, as in Bullet."""
    span = _span(element)
    limited = (JointType.REVOLUTE, JointType.PRISMATIC, JointType.LINEAR_SPRING, JointType.TORSION_SPRING)
    return (None, None) if span is None or kind not in limited or span[0] > span[1] else span


def _scalar(element: Element, path: str) -> float | None:
    """A number where the schema also allows a block; None for a block, and for a number that cannot be used."""
    value = element.value(path)
    return None if isinstance(value, dict) else value


def _six_dof(element: Element, kind: JointType) -> SixDof | None:
    if kind not in (JointType.SIX_DOF, JointType.SIX_DOF_SPRING):
        return None

    def six(block: str, middle: str = "") -> Array:
        names = [f"{block}.{s.replace('.', middle + '.') if middle else s}" for s in SIX]
        return np.array([element.number(name) for name in names])

    low, high = six("joint limits", ".low"), six("joint limits", ".high")
    wrapped = [np.where(np.abs(v) > np.pi, (v + np.pi) % (2 * np.pi) - np.pi, v) for v in (low, high)]
    low[3:], high[3:] = wrapped[0][3:], wrapped[1][3:]
    if kind is JointType.SIX_DOF:
        return SixDof(low, high, np.zeros(6), np.zeros(6), np.zeros(6))
    yields = element.number("ligature yield moment") if element.has("ligature yield moment") else math.inf
    return SixDof(low, high, six("stiffness"), six("damping"), six("equilibrium point"), yields)


def _cone_twist(element: Element, kind: JointType) -> tuple[float, float, float] | None:
    if kind is not JointType.CONE_TWIST:
        return None
    return (
        element.number("joint limits.x"),
        element.number("joint limits.y"),
        element.number("joint limits.z"),
    )


def fixed_joint(index: int, identity: Identity, parent: Body, child: Body) -> Joint:
    """A joint that holds ``child`` to ``parent`` as both stand."""
    T_parent_child = inverse(parent.T_world_body) @ child.T_world_body
    T_a = inverse(parent.T_body_inertial) @ T_parent_child @ child.T_body_inertial
    return Joint(
        index, identity, JointType.FIXED, parent.index, child.index, axis=T_a[:3, 2], T_parent_a=T_a,
        T_child_b=np.eye(4), T_parent_child_zero=T_parent_child, passive=True,
    )  # fmt: skip
