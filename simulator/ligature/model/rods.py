"""Recognises threads: chains of round bodies joined by bending springs become one elastic rod.

A chain is four or more bodies with one capsule, cylinder or sphere each, joined one after the other
by ``six dof spring`` joints whose translation is locked. ``ligature rod: false`` on the file, a body
or a joint keeps it as bodies. Metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ligature.adf import Diagnostic, Severity
from ligature.adf.diagnostics import length
from ligature.model.frames import Array
from ligature.model.scene import Body, Joint, JointType, RodChain, Sensor, SensorType
from ligature.model.shapes import Capsule, Cylinder, Sphere

LEAST_ELEMENTS = 4
LEAST_LENGTH, MOST_LENGTH = 1e-3, 1e4
"""Length of a rod's element over its radius; a chain with a shorter or a longer one stays bodies."""


def find_rods(
    bodies: Sequence[Body], joints: Sequence[Joint], sensors: Iterable[Sensor], opted_out: frozenset[int]
) -> tuple[tuple[RodChain, ...], list[Body], list[Diagnostic]]:
    """The rods of a scene, its bodies with elements where their joints hold them, and what is to be reported.

    ``opted_out`` are bodies that must stay bodies.
    """
    chains = _chains(bodies, joints, opted_out)
    misshapen = [_misshapen(chain) for chain in chains]
    fit = [chain for chain, element in zip(chains, misshapen, strict=True) if element is None]
    rods, between = _without_joints_between(fit, joints)
    moved, findings = _joined(rods, bodies, joints)
    placed = [replace(b, T_world_body=moved[b.index]) if b.index in moved else b for b in bodies]
    findings += [_finding_of_joint(joint) for joint in between]
    findings += [
        _finding_of_length(chain, element, bodies[chain.bodies[element]])
        for chain, element in zip(chains, misshapen, strict=True)
        if element is not None
    ]
    elements = {body for rod in rods for body in rod.bodies}
    findings += [
        _finding_of_sensor(sensor)
        for sensor in sensors
        if sensor.type is SensorType.RESISTANCE and sensor.parent in elements
    ]
    return rods, placed, findings + [_finding_of_rod(rod, bodies) for rod in rods]


def _finding_of_joint(joint: Joint) -> Diagnostic:
    """Finding for a joint between two elements of rods, which has no effect: rods attach to bodies only."""
    message = f"joint '{joint.identity.key}' connects two rod elements; ignoring it"
    hint = "connect an element and a body, or set 'ligature rod: false' for one of the two chains"
    return Diagnostic(Severity.ERROR, message, joint.identity.mark, hint, "rod")


def _finding_of_sensor(sensor: Sensor) -> Diagnostic:
    """Finding for a resistance sensor on a rod, which pushes the bodies that it touches and not the rod."""
    message = f"resistance sensor '{sensor.identity.key}' applies no force to the rod that carries it"
    hint = "mount it on a body, or set 'ligature rod: false'"
    return Diagnostic(Severity.WARNING, message, sensor.identity.mark, hint, "rod")


def _misshapen(chain: RodChain) -> int | None:
    """Which element of a chain, the first of them, is too short or too long for a rod."""
    slender = chain.lengths / chain.radius
    found = np.flatnonzero((slender < LEAST_LENGTH) | (slender > MOST_LENGTH))
    return int(found[0]) if len(found) else None


def _finding_of_length(chain: RodChain, element: int, body: Body) -> Diagnostic:
    """Finding for a chain that stays bodies for the length of one ``element``."""
    long = chain.lengths[element] > chain.radius
    message = (
        f"{len(chain.bodies)} bodies from '{chain.name}' on are not simulated as an elastic rod: "
        f"the joints of '{body.identity.key}' "
        + (f"make it {length(chain.lengths[element])} long" if long else "leave it no length")
    )
    hint = f"move their pivots {'together' if long else 'apart'}"
    return Diagnostic(Severity.WARNING, message, body.identity.mark, hint, "rod")


def _finding_of_rod(rod: RodChain, bodies: Sequence[Body]) -> Diagnostic:
    message = f"{len(rod.bodies)} bodies from '{rod.name}' on are simulated as one elastic rod"
    mark = bodies[rod.bodies[0]].identity.mark
    return Diagnostic(Severity.INFO, message, mark, "opt out with 'ligature rod: false'", "rod")


def _chains(bodies: Sequence[Body], joints: Sequence[Joint], opted_out: frozenset[int]) -> tuple[RodChain, ...]:
    """The chains of a scene."""
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


def _without_joints_between(
    chains: Sequence[RodChain], joints: Sequence[Joint]
) -> tuple[tuple[RodChain, ...], tuple[Joint, ...]]:
    """The chains with only their anchors to bodies outside all rods, and the joints between rods that were dropped."""
    members = {body for chain in chains for body in chain.bodies}
    between = {j for chain in chains for j in chain.anchors if {joints[j].parent, joints[j].child} <= members}
    kept = tuple(replace(chain, anchors=tuple(j for j in chain.anchors if j not in between)) for chain in chains)
    return kept, tuple(joints[j] for j in sorted(between))


def _joined(
    chains: Sequence[RodChain], bodies: Sequence[Body], joints: Sequence[Joint]
) -> tuple[dict[int, Array], list[Diagnostic]]:
    """Initial poses (4, 4), by body, of elements whose joints are open by more than their length, and findings.

    The element in the middle of the chain's places stays, and the others follow from it; no element turns.
    """
    moved: dict[int, Array] = {}
    found = []
    for chain in chains:
        places = np.array([bodies[b].T_world_body[:3, 3] for b in chain.bodies])
        root = int(np.argmin(np.linalg.norm(places - np.median(places, axis=0), axis=1)))
        last = len(chain.bodies) - 1
        ways = [(i, i - 1, i - 1) for i in range(root + 1, last + 1)] + [(i, i + 1, i) for i in range(root - 1, -1, -1)]
        for i, before, link in ways:
            body, other, joint = bodies[chain.bodies[i]], bodies[chain.bodies[before]], joints[chain.joints[link]]
            there = moved.get(other.index, other.T_world_body)
            at = there[:3, :3] @ _pivot(joint, other.index, bodies) + there[:3, 3]
            own = body.T_world_body[:3, :3] @ _pivot(joint, body.index, bodies) + body.T_world_body[:3, 3]
            off = float(np.linalg.norm(at - own))
            if off <= max(chain.lengths[i], chain.lengths[before]):
                continue
            moved[body.index] = body.T_world_body.copy()
            moved[body.index][:3, 3] += at - own
            message = (
                f"'{body.identity.identifier}' starts {length(off)} away from its location: "
                f"joint '{joint.identity.key}' requires it, as an element of a rod"
            )
            hint = "move the body, or the joint's pivots"
            found.append(Diagnostic(Severity.INFO, message, joint.identity.mark, hint, "moved"))
    return moved, found


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
