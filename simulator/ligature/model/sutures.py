"""Threads by physical data: length, size and material become the bodies and joints of one rod.

The thread starts at its ``location`` and leaves along +z of it, or leads through the points of its ``way`` in that
frame. SI units; frames as in `ligature.model.scene`.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ligature.adf import Diagnostic, Element, Severity
from ligature.adf.frames import minimal_rotation
from ligature.model.frames import Array, frame, pose_matrix
from ligature.model.geometry import GeometryError
from ligature.model.scene import Body, Identity, Joint, JointType, SixDof
from ligature.model.shapes import Capsule, Collider, Colour, Visual

USP_MILLIMETRES = {
    "10-0": 0.0245, "9-0": 0.0345, "8-0": 0.0445, "7-0": 0.0595, "6-0": 0.0845, "5-0": 0.1245, "4-0": 0.1745,
    "3-0": 0.2245, "2-0": 0.3195, "0": 0.3745, "1": 0.4495, "2": 0.5495,
}  # fmt: skip
"""Middle of the range of diameters that the United States Pharmacopeia, chapter 861, gives each size."""

LEAST_ELEMENTS, MOST_ELEMENTS = 4, 2000
DARK = Colour(diffuse=(0.1, 0.1, 0.35), ambient=(0.05, 0.05, 0.17))


def thread(
    element: Element, identity: Identity, first_body: int, first_joint: int, gravity: Array, parent: Body | None
) -> tuple[list[Body], list[Joint]]:
    """Bodies and joints of a suture, numbered from ``first_body`` and ``first_joint``; raises `GeometryError`."""
    radius = _diameter(element) / 2
    n = element.integer("elements")
    length = element.number("length") / max(n, 1)
    if not LEAST_ELEMENTS <= n <= MOST_ELEMENTS:
        raise _error(element, "elements", f"has {n} elements", f"give {LEAST_ELEMENTS} to {MOST_ELEMENTS}")
    if not length > 0.0:
        raise _error(element, "length", "has no length", "give metres")
    T_world_start = pose_matrix(*element.pose("location"))
    if parent is not None:
        T_world_start = parent.T_world_body @ T_world_start
    mass = element.number("density") * np.pi * radius**2 * length
    across = mass * (length**2 / 12 + radius**2 / 4)
    colour = _colour(element)
    bodies = []
    places = _way(element, n, length)
    for i in range(n):
        T = T_world_start @ places[i]
        shape = (Collider(Capsule(radius, length + 2 * radius), np.eye(4)),)
        bodies.append(
            Body(
                index=first_body + i,
                identity=_numbered(identity, i),
                mass=mass,
                inertia=np.array([across, across, mass * radius**2 / 2]),
                T_body_inertial=np.eye(4),
                T_world_body=T,
                gravity=gravity,
                colliders=shape,
                visual=Visual(shapes=shape, colour=colour),
                collision_margin=radius / 10,
                friction=element.number("friction"),
                rolling_friction=0.0,
                restitution=0.0,
            )
        )
    joints = [_bend(element, identity, first_joint + i, bodies[i], bodies[i + 1], length, radius) for i in range(n - 1)]
    if parent is not None:
        joints.append(_swage(element, identity, first_joint + n - 1, parent, bodies[0], length))
    return bodies, joints


def _way(element: Element, n: int, length: float) -> list[Array]:
    """Poses (4, 4) of ``n`` elements of a length in the frame of ``location``: straight, or along the suture's ``way``.

    Each ends where the way is first as far from its beginning as it is long; beyond the way they go straight on.
    """
    points = np.array([[point.number(axis) for axis in "xyz"] for point in element.children("way")]).reshape(-1, 3)
    if not len(points):
        return [frame(np.eye(3), (0.0, 0.0, (i + 0.5) * length)) for i in range(n)]
    at, R, places, edge, corners = np.zeros(3), np.eye(3), [], 0, np.vstack([np.zeros(3), points])
    for _ in range(n):
        way = R[:, 2]
        while edge < len(points):
            if np.linalg.norm(corners[edge + 1] - at) >= length:
                a, d = corners[edge] - at, corners[edge + 1] - corners[edge]
                b, c = a @ d / (d @ d), (a @ a - length**2) / (d @ d)
                way = (a + (math.sqrt(b * b - c) - b) * d) / length
                break
            edge += 1
        R = minimal_rotation(R[:, 2], way / np.linalg.norm(way)) @ R
        places.append(frame(R, at + 0.5 * length * R[:, 2]))
        at = at + length * R[:, 2]
    return places


def _colour(element: Element) -> Colour:
    """The colour of a suture: its ``color rgba``, else dark blue."""
    if not element.has("color rgba"):
        return DARK
    r, g, b, a = (element.number(f"color rgba.{c}") for c in "rgba")
    return Colour(diffuse=(r, g, b), ambient=(r / 2, g / 2, b / 2), alpha=a)


def _diameter(element: Element) -> float:
    if element.has("diameter"):
        value = element.number("diameter")
        if value > 0.0:
            return value
        raise _error(element, "diameter", f"has the diameter {value:g}", "give metres")
    size = element.text("USP size")
    if size in USP_MILLIMETRES:
        return USP_MILLIMETRES[size] * 1e-3
    raise _error(
        element, "USP size", f"has the USP size '{size}'", f"give diameter, or one of {', '.join(USP_MILLIMETRES)}"
    )


def _yield_strain(element: Element) -> float:
    """Stretch of the skin from which a bend stays; infinite where none does."""
    return element.number("yield strain") if element.has("yield strain") else math.inf


def _bend(
    element: Element, identity: Identity, index: int, before: Body, after: Body, length: float, radius: float
) -> Joint:
    """The joint between two elements: bending stiffness E I / l, torsional stiffness G J / l."""
    modulus = element.number("youngs modulus")
    shear = modulus / (2 * (1 + element.number("poisson ratio")))
    area_moment = np.pi * radius**4 / 4
    bending, torsion = modulus * area_moment / length, shear * 2 * area_moment / length
    stiffness = np.array([0.0, 0.0, 0.0, bending, bending, torsion])
    six = SixDof(
        low=np.array([0.0, 0.0, 0.0, -np.pi, -np.pi, -np.pi]),
        high=np.array([0.0, 0.0, 0.0, np.pi, np.pi, np.pi]),
        stiffness=stiffness,
        damping=stiffness * element.number("damping time"),
        equilibrium=np.zeros(6),
        yield_moment=bending * _yield_strain(element) / radius * length,
    )
    return Joint(
        index=index,
        identity=_numbered(identity, index),
        type=JointType.SIX_DOF_SPRING,
        parent=before.index,
        child=after.index,
        axis=np.array([0.0, 0.0, 1.0]),
        T_parent_a=frame(np.eye(3), (0.0, 0.0, length / 2)),
        T_child_b=frame(np.eye(3), (0.0, 0.0, -length / 2)),
        T_parent_child_zero=frame(np.eye(3), (0.0, 0.0, length)),
        six_dof=six,
        passive=True,
    )


def _swage(element: Element, identity: Identity, index: int, parent: Body, first: Body, length: float) -> Joint:
    """The fixed joint that attaches the start of the thread to its parent."""
    T_parent_start = pose_matrix(*element.pose("location"))
    T_inertial = np.linalg.inv(parent.T_body_inertial) @ T_parent_start
    T_zero = T_parent_start @ frame(np.eye(3), (0.0, 0.0, length / 2))
    return Joint(
        index=index,
        identity=_numbered(identity, index),
        type=JointType.FIXED,
        parent=parent.index,
        child=first.index,
        axis=T_inertial[:3, 2],
        T_parent_a=T_inertial,
        T_child_b=frame(np.eye(3), (0.0, 0.0, -length / 2)),
        T_parent_child_zero=T_zero,
        passive=True,
        release=element.number("release force") if element.has("release force") else math.inf,
    )


def _numbered(identity: Identity, i: int) -> Identity:
    """The identity of one element; elements have no topics of their own."""
    suffix = f"_{i:03d}"
    return replace(
        identity,
        key=identity.key + suffix,
        name=identity.name + suffix,
        identifier=identity.identifier + suffix,
        topic=identity.topic + suffix,
        passive=True,
    )


def _error(element: Element, key: str, message: str, hint: str) -> GeometryError:
    text = f"suture '{element.key}' {message}"
    return GeometryError(Diagnostic(Severity.ERROR, text, element.mark_of(key), hint, "suture"))
