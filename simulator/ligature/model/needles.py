"""Recognises needles: free bodies whose collision shapes are a thin wire along an arc; metres, inertial frame I.

All of the shapes must lie close around the arc, and all of the arc must lie in the shapes. The arc must leave its
chord by more than the shapes leave the arc: a convex body has its chord inside, so that none is a needle.
``ligature needle: false`` on a body keeps it from being one; ``true`` asks for a finding where it is none.
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
from ligature.model.solids import surface_of

Array = NDArray[np.float64]

SLENDER = 10.0
"""Least length of a needle over the greatest distance of its shapes from its centre line."""

BENT = 2.0
"""Least distance of the middle of an arc from its chord over the distance of the shapes from the arc."""

GAPS = 50.0
"""Length of a needle over the greatest gap of its shapes along the centre line, from there to the next shape."""

ALONG, FINEST = 40, 16
"""Points of the centre line that are looked at; most parts of an edge of the surface between points that are."""

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
    if not spread[1] > 1e-6 * spread[0]:
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
    alone = {tree.links[0].body for tree in forest if len(tree.links) == 1}
    anchors = [joints[j] for rod in rods for j in rod.anchors]
    found, findings = [], []
    for index, body in enumerate(bodies):
        tails = [_tail(joint, index) for joint in anchors if index in (joint.parent, joint.child)]
        try:
            arc = _centre_line(body, index in alone, tails)
        except ValueError as error:
            if body.needle:
                findings.append(_no_needle(body, str(error)))
            continue
        found.append(Needle(index, arc))
        findings.append(_finding(arc, body))
    return tuple(found), findings


def _finding(arc: Arc, body: Body) -> Diagnostic:
    size = f"{1e3 * arc.length:.1f} mm long, radius {1e3 * arc.radius:.1f} mm"
    message, hint = f"'{body.identity.identifier}' is a needle, {size}", "opt out with 'ligature needle: false'"
    return Diagnostic(Severity.INFO, message, body.identity.mark, hint, "needle")


def _no_needle(body: Body, reason: str) -> Diagnostic:
    message = f"'{body.identity.identifier}' is to be a needle, but is none: {reason}"
    hint = "what is recognised: docs/your_scene.md"
    return Diagnostic(Severity.WARNING, message, body.identity.mark, hint, "needle")


def _tail(joint: Joint, body: int) -> Array:
    """Where a thread is attached to ``body``, in its inertial frame."""
    return np.asarray((joint.T_parent_a if joint.parent == body else joint.T_child_b)[:3, 3])


def _centre_line(body: Body, free: bool, tails: list[Array]) -> Arc:
    """The arc of a body's shapes, tip away from its thread; raises ValueError with why a body is no needle."""
    if body.needle is False or not body.colliders:
        raise ValueError("it opted out" if body.colliders else "it has no collision shape")
    if body.static or not free:
        raise ValueError("its mass is 0" if body.static else "a joint holds it")
    T = inverse(body.T_body_inertial)
    arc = fit_arc(np.vstack([_outline(part) for part in body.colliders]) @ T[:3, :3].T + T[:3, 3])
    _check_size(arc)
    surfaces = [surface_of(part) for part in body.colliders]
    _check_shapes(arc, [(v @ T[:3, :3].T + T[:3, 3])[f] for v, f in filter(None, surfaces)])
    if tails and np.linalg.norm(tails[0] - arc.point(0.0)) < np.linalg.norm(tails[0] - arc.point(arc.length)):
        return Arc(arc.centre, arc.x, -arc.y, arc.radius, -arc.end, -arc.begin)
    return arc


def _check_size(arc: Arc) -> None:
    if arc.length > LONGEST:
        raise ValueError(f"it is {1e3 * arc.length:.0f} mm long, more than {1e3 * LONGEST:.0f} mm")
    turn = arc.end - arc.begin
    if turn > WIDEST_TURN:
        raise ValueError(f"it turns by {np.degrees(turn):.0f} degrees, more than {np.degrees(WIDEST_TURN):.0f}")


def _check_shapes(arc: Arc, surfaces: list[Array]) -> None:
    """Raise ValueError unless the corners (m, 3, 3) of closed surfaces are a thin wire along the arc."""
    _check_thickness(arc, np.vstack([corners.reshape(-1, 3) for corners in surfaces]))  # large meshes end here
    points = np.vstack([_sampled(corners, arc.length / ALONG) for corners in surfaces])
    _check_thickness(arc, points)
    for depth in np.linspace(0.0, arc.length, ALONG + 1).tolist():
        place = arc.point(depth)
        gap = np.sqrt(((points - place) ** 2).sum(axis=1).min())
        if gap > arc.length / GAPS and not any(_inside(corners, place) for corners in surfaces):
            raise ValueError(f"its shapes leave a gap along an arc of {1e3 * arc.length:.0f} mm")


def _check_thickness(arc: Arc, points: Array) -> None:
    """Raise ValueError unless points (n, 3) are close to an arc, and it is bent by more than that."""
    thickness = float(_distances(arc, points).max())
    size = f"{1e3 * thickness:.2g} mm from an arc of {1e3 * arc.length:.0f} mm"
    if arc.length < SLENDER * thickness:
        raise ValueError(f"its shapes reach {size}, too thick")
    bow = arc.radius * (1.0 - math.cos(0.5 * (arc.end - arc.begin)))
    if bow < BENT * thickness:
        raise ValueError(f"its shapes reach {size}, which is bent by {1e3 * bow:.2g} mm only")


def _sampled(corners: Array, spacing: float) -> Array:
    """Points (n, 3) of triangles (m, 3, 3): their corners, and more along edges longer than ``spacing``."""
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = int(np.clip(np.ceil(edges.max() / spacing), 1, FINEST))
    shares = np.array([(i, j, parts - i - j) for i in range(parts + 1) for j in range(parts + 1 - i)]) / parts
    between = shares @ corners[edges > spacing]
    return np.vstack([corners.reshape(-1, 3), between.reshape(-1, 3)])


def _distances(arc: Arc, points: Array) -> Array:
    """Distances (n,) of points (n, 3) from an arc: from its circle, or its ends for what is not before it."""
    at, half, middle = points - arc.centre, 0.5 * (arc.end - arc.begin), 0.5 * (arc.begin + arc.end)
    across = np.hypot(at @ arc.x, at @ arc.y)
    before = at @ (math.cos(middle) * arc.x + math.sin(middle) * arc.y) >= math.cos(half) * across
    ends = np.array([arc.point(0.0), arc.point(arc.length)])
    beyond = np.linalg.norm(points[:, None] - ends, axis=2).min(axis=1)
    return np.where(before, np.hypot(across - arc.radius, at @ np.cross(arc.x, arc.y)), beyond)


def _inside(corners: Array, place: Array) -> bool:
    """Whether a place (3,) is in a closed surface: the solid angle of its triangles (m, 3, 3) there is that of a ball.

    Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 1983, 125.
    """
    if (place < corners.min(axis=(0, 1))).any() or (place > corners.max(axis=(0, 1))).any():
        return False
    a, b, c = np.moveaxis(corners - place, 1, 0)
    x, y, z = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    rest = x * y * z + (a * b).sum(axis=1) * z + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
    return abs(sum(map(math.atan2, volume.tolist(), rest.tolist()))) > math.pi


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
