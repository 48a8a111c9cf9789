"""Recognises threads: chains of round bodies joined by bending springs become one elastic rod (DESIGN §4.1).

A chain is four or more bodies with one capsule, cylinder or sphere each, joined one after the other
by ``six dof spring`` joints whose translation is locked. ``ligature rod: false`` on the file, a body
or a joint keeps it as bodies. Metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ligature.model.frames import Array
from ligature.model.scene import Body, Capsule, Cylinder, Joint, JointType, RodChain, Sphere

LEAST_ELEMENTS = 4


def rod_chains(bodies: Sequence[Body], joints: Sequence[Joint], opted_out: frozenset[int]) -> tuple[RodChain, ...]:
    """The chains of a scene; ``opted_out`` are bodies that must stay bodies."""
    fit = {b.index for b in bodies if b.index not in opted_out and not b.static and _round(b)}
    springs = [j for j in joints if _bends(j) and j.parent in fit and j.child in fit]
    neighbours: dict[int, list[Joint]] = {}
    for joint in springs:
        neighbours.setdefault(joint.parent, []).append(joint)
        neighbours.setdefault(joint.child, []).append(joint)
    chains = []
    seen: set[int] = set()
    for start in sorted(neighbours):
        if start in seen or len(neighbours[start]) != 1:
            continue
        path, links = _walk(start, neighbours)
        seen.update(path)
        if len(path) >= LEAST_ELEMENTS and path[0] < path[-1]:
            chains.append(_chain(path, links, bodies, joints))
        elif len(path) >= LEAST_ELEMENTS:
            chains.append(_chain(path[::-1], links[::-1], bodies, joints))
    return tuple(chains)


def without_joints_between(
    chains: Sequence[RodChain], joints: Sequence[Joint]
) -> tuple[tuple[RodChain, ...], tuple[Joint, ...]]:
    """The chains with the anchors that a rod can have, to bodies outside all rods, and the joints that are none."""
    members = {body for chain in chains for body in chain.bodies}
    between = {j for chain in chains for j in chain.anchors if {joints[j].parent, joints[j].child} <= members}
    kept = tuple(replace(chain, anchors=tuple(j for j in chain.anchors if j not in between)) for chain in chains)
    return kept, tuple(joints[j] for j in sorted(between))


def _round(body: Body) -> bool:
    return len(body.colliders) == 1 and isinstance(body.colliders[0].shape, Capsule | Cylinder | Sphere)


def _bends(joint: Joint) -> bool:
    six = joint.six_dof
    return joint.type is JointType.SIX_DOF_SPRING and six is not None and bool((six.low[:3] == six.high[:3]).all())


def _walk(start: int, neighbours: dict[int, list[Joint]]) -> tuple[list[int], list[Joint]]:
    path = [start]
    links: list[Joint] = []
    while True:
        onward = [j for j in neighbours[path[-1]] if j not in links]
        if len(onward) != 1 or len(neighbours[path[-1]]) > 2:
            return path, links
        joint = onward[0]
        other = joint.child if joint.parent == path[-1] else joint.parent
        if other in path:
            return path, links
        links.append(joint)
        path.append(other)


def _pivot(joint: Joint, body: int, bodies: Sequence[Body]) -> Array:
    """The joint's origin in the body frame B."""
    T = joint.T_parent_a if joint.parent == body else joint.T_child_b
    return np.asarray((bodies[body].T_body_inertial @ T)[:3, 3])


def _chain(path: list[int], links: list[Joint], bodies: Sequence[Body], joints: Sequence[Joint]) -> RodChain:
    lengths = []
    for i, body in enumerate(path):
        ends = [_pivot(j, body, bodies) for j in links[max(i - 1, 0) : i + 1]]
        centre = bodies[body].colliders[0].T_body_shape[:3, 3]
        half = float(np.linalg.norm(ends[0] - centre))
        lengths.append(float(np.linalg.norm(ends[1] - ends[0])) if len(ends) == 2 else 2 * half)
    inner = {j.index for j in links}
    members = set(path)
    anchors = [j.index for j in joints if j.index not in inner and {j.parent, j.child} & members]
    shape = bodies[path[0]].colliders[0].shape
    assert isinstance(shape, Capsule | Cylinder | Sphere)
    return RodChain(
        bodies[path[0]].identity.identifier,
        tuple(path),
        tuple(j.index for j in links),
        tuple(anchors),
        shape.radius,
        np.array(lengths),
    )
