"""Recognises needles: free bodies whose collision shapes line up along an arc; metres, inertial frame I.

``ligature needle: false`` on a body keeps it from being one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.model.frames import inverse
from ligature.model.piercing import Arc, Needle
from ligature.model.scene import Articulation, Body, Joint, RodChain
from ligature.model.shapes import Box, Capsule, Collider, Cone, Cylinder, Hull, Shape, Sphere, TriMesh

Array = NDArray[np.float64]

SLENDER = 5.0
"""Least length of a needle over the greatest distance of its shapes from its centre line."""

FIT_STEPS = 5
"""Newton steps of a fit; the first guess is off by tenths of a millimetre where the needle is thick."""

LONGEST, WIDEST_TURN = 0.1, np.radians(240.0)
"""A longer or more closed arc is no needle; the widest in use are five eighths of a circle."""


def fit_arc(points: Array) -> Arc:
    """The arc through ``points`` (n, 3) along a needle, tip last (least squares).

    Raises ValueError for fewer than three points or points on a line.
    """
    if len(points) < 3:
        raise ValueError("an arc needs three points")
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle, full_matrices=False)
    if spread[1] < 1e-6 * spread[0]:
        raise ValueError("an arc needs three points that are not on one line")
    flat = (points - middle) @ axes[:2].T
    u, v, radius = _circle(flat)
    # Angles from the middle of the arc, so that none of them lies across the seam.
    towards = math.atan2(-v, -u)
    angles = np.array([math.atan2(y - v, x - u) for x, y in flat.tolist()]) - towards
    angles = (angles + np.pi) % (2.0 * np.pi) - np.pi
    x = math.cos(towards) * axes[0] + math.sin(towards) * axes[1]
    y = math.cos(towards) * axes[1] - math.sin(towards) * axes[0]
    if angles[-1] < angles[0]:
        y, angles = -y, -angles
    centre = middle + u * axes[0] + v * axes[1]
    return Arc(centre, x, y, radius, float(angles.min()), float(angles.max()))


def _circle(points: Array) -> tuple[float, float, float]:
    """Centre and radius of the circle nearest to ``points`` (n, 2): Kåsa's fit, then Gauss and Newton's."""
    rows = np.column_stack([2.0 * points, np.ones(len(points))])
    u, v, w = np.linalg.lstsq(rows, (points**2).sum(axis=1), rcond=None)[0]
    circle = np.array([u, v, np.sqrt(w + u * u + v * v)])
    for _ in range(FIT_STEPS):
        off = points - circle[:2]
        distance = np.hypot(*off.T)
        slope = np.column_stack([-off / np.maximum(distance, 1e-12)[:, None], -np.ones(len(points))])
        circle = circle - np.linalg.lstsq(slope, distance - circle[2], rcond=None)[0]
    return float(circle[0]), float(circle[1]), float(circle[2])


def find_needles(
    bodies: Sequence[Body], joints: Sequence[Joint], forest: Sequence[Articulation], rods: Sequence[RodChain]
) -> tuple[tuple[Needle, ...], list[Diagnostic]]:
    """The needles among the bodies that no joint but a thread's holds, and a finding that names each."""
    alone = [tree.links[0].body for tree in forest if len(tree.links) == 1]
    anchors = [joints[j] for rod in rods for j in rod.anchors]
    found = []
    for index in alone:
        body = bodies[index]
        if body.static or body.needle is False or not body.colliders:
            continue
        arc = _centre_line(body, [_tail(joint, index) for joint in anchors if index in (joint.parent, joint.child)])
        if arc is not None:
            found.append(Needle(index, arc))
    return tuple(found), [_finding(needle, bodies[needle.body]) for needle in found]


def _finding(needle: Needle, body: Body) -> Diagnostic:
    size = f"{1e3 * needle.arc.length:.1f} mm long, radius {1e3 * needle.arc.radius:.1f} mm"
    message, hint = f"'{body.identity.identifier}' is a needle, {size}", "opt out with 'ligature needle: false'"
    return Diagnostic(Severity.INFO, message, body.identity.mark, hint, "needle")


def _tail(joint: Joint, body: int) -> Array:
    """Where a thread is attached to ``body``, in its inertial frame."""
    return np.asarray((joint.T_parent_a if joint.parent == body else joint.T_child_b)[:3, 3])


def _centre_line(body: Body, tails: list[Array]) -> Arc | None:
    """The arc of a body's shapes, tip away from its thread; None for a body that is no needle."""
    T = inverse(body.T_body_inertial)
    points = np.vstack([_outline(part) for part in body.colliders]) @ T[:3, :3].T + T[:3, 3]
    try:
        arc = fit_arc(points)
    except ValueError:
        return None
    offsets = points - arc.centre
    across = np.hypot(offsets @ arc.x, offsets @ arc.y) - arc.radius
    thickness = np.hypot(across, offsets @ np.cross(arc.x, arc.y)).max()
    if arc.length < SLENDER * thickness or arc.length > LONGEST or arc.end - arc.begin > WIDEST_TURN:
        return None
    if tails and np.linalg.norm(tails[0] - arc.point(0.0)) < np.linalg.norm(tails[0] - arc.point(arc.length)):
        return Arc(arc.centre, arc.x, -arc.y, arc.radius, -arc.end, -arc.begin)
    return arc


def _outline(part: Collider) -> Array:
    """Points (n, 3) of a shape in B whose middle line is that of the shape."""
    T = part.T_body_shape
    return np.asarray(_corners(part.shape) @ T[:3, :3].T + T[:3, 3])


def _corners(shape: Shape) -> Array:
    if isinstance(shape, Hull | TriMesh):
        return shape.vertices
    if isinstance(shape, Box):
        signs = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1).T
        return np.asarray(signs * shape.size)
    if isinstance(shape, Cylinder | Capsule | Cone):
        return np.array([[0.0, 0.0, -0.5 * shape.height], [0.0, 0.0, 0.5 * shape.height]])
    return np.zeros((1 if isinstance(shape, Sphere) else 0, 3))
