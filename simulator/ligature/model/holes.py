"""Recognises tissue holes: ghost objects in the opening of a ring of shapes on their parent body.

That is how the suturing challenge builds its phantom: each entry and exit is a body with four capsules
around an opening and a flat ghost in it. ``ligature hole`` on a ghost reports it, or denies it; metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.model.frames import inverse
from ligature.model.piercing import Hole
from ligature.model.scene import Body, Ghost
from ligature.model.shapes import Box, Capsule, Collider, Cone, Cylinder, Hull, Shape, Sphere, TriMesh

Array = NDArray[np.float64]

LEAST_RING = 3
"""Fewest shapes that make a ring."""

Z_TO = {0: [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 1: [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
        2: np.eye(3).tolist()}  # fmt: skip
"""Rotations whose columns are the axes of a frame with z along axis 0, 1 or 2."""


def find_holes(ghosts: Sequence[Ghost], bodies: Sequence[Body]) -> tuple[tuple[Hole, ...], list[Diagnostic]]:
    """The holes of a scene, whose parents must be settled, and a finding that names each."""
    found: list[Hole] = []
    findings: list[Diagnostic] = []
    for ghost in ghosts:
        parent = ghost.attachment.parent
        if ghost.hole is False or parent is None or parent[0] != "body" or not ghost.colliders:
            continue
        body = bodies[parent[1]]
        R, half = _opening(ghost.colliders[0].shape)
        T = ghost.attachment.T_parent_object @ ghost.colliders[0].T_body_shape
        T_body_hole = T.copy()
        T_body_hole[:3, :3] = T[:3, :3] @ R
        if ghost.hole or _ringed(body.colliders, T_body_hole, half):
            found.append(
                Hole(len(found), ghost.identity.identifier, ghost.index, body.index, T_body_hole, half, ghost.tissue)
            )
            message = f"'{ghost.identity.identifier}' is a tissue hole: it constrains the needle and thread inside it"
            hint = "opt out with 'ligature hole: false'"
            findings.append(Diagnostic(Severity.INFO, message, ghost.identity.mark, hint, "hole"))
    return tuple(found), findings


def _opening(shape: Shape) -> tuple[Array, Array]:
    """Axes (3, 3) of the opening in the frame of a ghost's shape, z through it, and its half sizes (2,)."""
    if isinstance(shape, Box | Hull | TriMesh):
        size = shape.size if isinstance(shape, Box) else np.ptp(shape.vertices, axis=0)
        R = np.array(Z_TO[int(np.argmin(size))])
        return R, np.asarray(0.5 * np.abs(R.T @ size)[:2])
    radius = shape.radius if isinstance(shape, Sphere | Cylinder | Capsule | Cone) else 0.0
    return np.eye(3), np.full(2, radius)


def _ringed(colliders: Sequence[Collider], T_body_hole: Array, half: Array) -> bool:
    """Whether shapes surround the opening on all sides and none is inside it."""
    if len(colliders) < LEAST_RING:
        return False
    centres = np.array([(inverse(T_body_hole) @ part.T_body_shape)[:3, 3] for part in colliders])
    distance = np.hypot(centres[:, 0], centres[:, 1])
    if np.any(distance < 0.3 * half.min()) or np.any(np.abs(centres[:, 2]) > half.max()):
        return False
    if np.any(distance > 3.0 * half.max()):
        return False
    around = np.array(sorted(math.atan2(y, x) for x, y, _ in centres.tolist()))
    gaps = np.diff(np.append(around, around[0] + 2.0 * np.pi))
    return bool(gaps.max() < np.pi)
