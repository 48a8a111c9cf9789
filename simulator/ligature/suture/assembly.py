"""Sets up the arrays of a rod: the nodes and joints of its chain, and the points that hold it.

World axes, SI units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.suture import layout
from ligature.suture.description import Attachment, RodDescription, frame_quaternions
from ligature.suture.partners import JawPads, Partner, PointConstraint

Array = NDArray[np.float64]

LOCKED = 1e6
"""Stiffness in N m/rad of a locked joint axis."""


@dataclass(frozen=True)
class Numbering:
    """The numbers of a rod's nodes: the body at its head, the elements, the body at its tail, then all other bodies.

    Attributes
    ----------
    head, tail
        Attachments at the first and the last element, whose bodies are nodes of the chain.
    others
        All other attachments.
    first
        Node of the first element.
    chain, total
        Number of nodes of the chain, and of all.
    node_of
        Node of each body that the rod may meet.
    """

    head: Attachment | None
    tail: Attachment | None
    others: tuple[Attachment, ...]
    first: int
    chain: int
    total: int
    node_of: dict[int, int]

    @classmethod
    def of(cls, description: RodDescription, partners: Sequence[Partner]) -> Numbering:
        """Number the nodes of a rod among ``partners``; raises ValueError if it is attached to another body."""
        known = {partner.body for partner in partners}
        for attachment in description.attachments:
            if attachment.body not in known:
                raise ValueError(
                    f"rod '{description.name}' is attached to body {attachment.body}, which is missing in its partners"
                )
        n = len(description.mass)
        head = next((t for t in description.attachments if t.element == 0), None)
        at_tail = (t for t in description.attachments if t.element == n - 1 and (head is None or t.body != head.body))
        tail = next(at_tail, None)
        first = 1 if head else 0
        chain = first + n + (1 if tail else 0)
        node_of = {attachment.body: node for attachment, node in ((head, 0), (tail, chain - 1)) if attachment}
        apart = [partner.body for partner in partners if partner.body not in node_of]
        node_of |= {body: chain + k for k, body in enumerate(apart)}
        others = tuple(t for t in description.attachments if t is not head and t is not tail)
        return cls(head, tail, others, first, chain, chain + len(apart), node_of)


def chain_nodes(
    description: RodDescription, partners: Sequence[Partner], numbers: Numbering, dt: float
) -> layout.Nodes:
    """All nodes: the elements, and the bodies of ``partners``; ``dt`` is the length of a tick in seconds."""
    nodes = layout.nodes(numbers.total)
    own = slice(numbers.first, numbers.first + len(description.mass))
    nodes.mass[own], nodes.inertia[own] = description.mass, description.inertia
    nodes.gravity[own], nodes.radius[own] = description.gravity, description.radius
    nodes.friction[own], nodes.axis[own] = description.friction, description.ends
    left = 1.0 - np.clip(description.damping, 0.0, 1.0)
    # Powers of numbers, not of arrays, have the same bits on every processor.
    nodes.keep[own] = [[share**dt for share in row] for row in left.tolist()]
    for partner in partners:
        i = numbers.node_of[partner.body]
        nodes.fixed[i] = partner.fixed
        if not partner.fixed:
            nodes.mass[i], nodes.inertia[i], nodes.gravity[i] = (
                partner.mass,
                partner.inertia,
                partner.gravity,
            )
    return nodes


def point_constraint(description: RodDescription, attachment: Attachment) -> PointConstraint:
    """An attachment in the middle of the rod, as three points that stay together."""
    arm = 0.5 * float(np.linalg.norm(np.diff(description.ends[attachment.element], axis=0)))
    corners = arm * np.array([[1.0, 0.0, 0.0], [-0.5, 0.866, 0.0], [-0.5, -0.866, 0.0]])
    return PointConstraint(
        attachment.element,
        attachment.body,
        np.stack([corners @ T[:3, :3].T + T[:3, 3] for T in (attachment.T_element_a, attachment.T_body_b)], axis=1),
    )


def grasp_rows(pads: JawPads) -> list[Array]:
    """Rows (3, 2, 3) of `ligature.suture.point_constraints`, one for each point of a pair of pads."""
    rows = []
    for point in pads.points:
        row = np.zeros((3, 2, 3))
        row[0, 1], row[1, 1], row[2, 0, 0] = point, pads.normal, pads.limit / len(pads.points)
        rows.append(row)
    return rows


def chain_joints(description: RodDescription, head: Attachment | None, tail: Attachment | None) -> layout.Joints:
    """Joint arrays of the whole chain, those of the attachments at its ends included."""
    pivots, frames = list(description.pivots), list(description.frames)
    compliance = list(description.compliance)
    rows = {
        "stiffness": list(description.joint_stiffness), "damping": list(description.joint_damping),
        "rest": list(description.rest), "low": list(description.low), "high": list(description.high),
    }  # fmt: skip
    yields = description.yield_moment.tolist()
    stiffest = float(min(description.compliance))
    if head is not None:
        a, b = head.T_body_b, head.T_element_a
        pivots.insert(0, np.array([a[:3, 3], b[:3, 3]]))
        frames.insert(0, np.array([a[:3, :3], b[:3, :3]]))
        compliance.insert(0, stiffest)
        yields.insert(0, np.inf)
        seen = {"stiffness": head.stiffness, "damping": head.damping, "rest": -head.rest,
                "low": -head.high, "high": -head.low}  # fmt: skip
        for name, values in rows.items():
            values.insert(0, seen[name])
    if tail is not None:
        a, b = tail.T_element_a, tail.T_body_b
        pivots.append(np.array([a[:3, 3], b[:3, 3]]))
        frames.append(np.array([a[:3, :3], b[:3, :3]]))
        compliance.append(stiffest)
        yields.append(np.inf)
        for name, values in rows.items():
            values.append(getattr(tail, name))
    n = len(pivots)
    arrays = {name: np.array(values, dtype=float) for name, values in rows.items()}
    locked = arrays["low"] == arrays["high"]
    arrays["rest"] = np.where(locked, arrays["low"], arrays["rest"])
    arrays["stiffness"] = np.where(locked, LOCKED, arrays["stiffness"])
    weight = description.mass.sum() * 9.81
    span = np.linalg.norm(description.ends[:, 1] - description.ends[:, 0], axis=1).sum()
    bending = np.where(locked, 0.0, arrays["stiffness"]).max(axis=1)
    return layout.Joints(
        pivot=np.array(pivots), frame=frame_quaternions(np.array(frames)), compliance=np.array(compliance),
        **arrays, stop=np.maximum(100.0 * bending, 100.0 * weight * span),
        yields=np.array(yields),
        angle=np.zeros((n, 3)), load=np.zeros((n, 6)),
    )  # fmt: skip
