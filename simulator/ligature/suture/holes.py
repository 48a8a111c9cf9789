"""Tissue holes: a needle half way through is held at each hole, sideways by the tissue and along by friction.

A hole is a point of the tissue. The needle's centre line is an arc; where it passes a hole, the tissue
pushes it back sideways like a spring, and rubs along it: viscous friction F = -K v as in the paper of
the challenge, and Coulomb friction that keeps a released needle where it was left. A puncture
anywhere makes another such point. World axes, SI units.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.suture.motion import Motion, skew

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Arc:
    """Centre line of a needle in its inertial frame: ``centre`` (3,), unit axes ``x`` and ``y`` (3,) of its
    plane, ``radius``, and angles ``begin`` < ``end`` from x towards y; the tip is at ``end``.
    """

    centre: Array
    x: Array
    y: Array
    radius: float
    begin: float
    end: float

    def nearest(self, point: Array) -> tuple[float, Array, Array]:
        """Depth of the arc's nearest point to ``point`` (3,), that point, and the tangent towards the tip.

        Depth is the length of arc from there to the tip.
        """
        off = point - self.centre
        middle = 0.5 * (self.begin + self.end)
        around = float(np.arctan2(off @ self.y, off @ self.x))
        near = middle + (around - middle + np.pi) % (2.0 * np.pi) - np.pi
        angle = min(max(near, self.begin), self.end)
        out = np.cos(angle) * self.x + np.sin(angle) * self.y
        tangent = np.cos(angle) * self.y - np.sin(angle) * self.x
        return self.radius * (self.end - angle), self.centre + self.radius * out, tangent


def fit_arc(points: Array) -> Arc:
    """The arc through ``points`` (n, 3) along a needle, tip last (least squares).

    Raises ValueError for fewer than three points or points on a line.
    """
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle)
    if len(points) < 3 or spread[1] < 1e-6 * spread[0]:
        raise ValueError("an arc needs three points that are not on one line")
    flat = (points - middle) @ axes[:2].T
    u, v, w = np.linalg.lstsq(np.column_stack([2.0 * flat, np.ones(len(flat))]), (flat**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(w + u * u + v * v))
    angles = np.unwrap(np.arctan2(flat[:, 1] - v, flat[:, 0] - u))
    x, y = axes[0], axes[1]
    if angles[-1] < angles[0]:
        y, angles = -y, -angles
        v = -v
    return Arc(middle + u * x + v * y, x, y, radius, float(angles[0]), float(angles[-1]))


@dataclass(frozen=True, eq=False)
class Tissue:
    """How a hole holds: sideways ``stiffness`` N/m and ``damping`` N s/m, along the needle ``drag`` N s/m and
    ``friction`` N; ``reach`` metres is how far sideways a needle can be and still be inside.
    """

    stiffness: float = 4000.0
    damping: float = 5.0
    drag: float = 10.0
    friction: float = 0.2
    reach: float = 0.002


@dataclass(frozen=True, eq=False)
class Insertion:
    """A needle in a hole: the hole's index, ``depth`` of needle beyond it (m), ``force`` (3,) on the needle (N)."""

    hole: int
    depth: float
    force: Array


def insertions(
    needle: Motion, arc: Arc, holes: Array, hole_velocities: Array, tissue: Tissue, dt: float
) -> tuple[Array, list[Insertion]]:
    """Impulse (6,) of the tissue on a needle about its centre of mass in this tick, and where it is inserted.

    ``holes`` and ``hole_velocities`` (h, 3) are the points that the needle overlaps: entry, exit, and as
    many along the channel between as shall hold its direction. All springs are evaluated together at
    the end of the tick, so that any stiffness is stable.
    """
    T = pose7_matrix(needle.pose)
    passed = []
    for index, hole in enumerate(holes):
        depth, local, tangent = arc.nearest(T[:3, :3].T @ (hole - T[:3, 3]))
        point = T[:3, :3] @ local + T[:3, 3]
        if np.linalg.norm(point - hole) <= tissue.reach:
            passed.append(_Passage(index, depth, point, _axes(T[:3, :3] @ tangent), point - hole))
    if not passed:
        return np.zeros(6), []
    to_holes = np.vstack([_jacobian(needle, p) for p in passed])
    inverse_inertia = (needle.rotation * needle.inverse_inertia) @ needle.rotation.T
    inverse_mass = np.zeros((6, 6))
    inverse_mass[:3, :3], inverse_mass[3:, 3:] = needle.inverse_mass * np.eye(3), inverse_inertia
    A = to_holes @ inverse_mass @ to_holes.T
    drift = np.concatenate([p.axes.T @ hole_velocities[p.hole] for p in passed])
    offsets = np.concatenate([p.axes.T @ p.aside for p in passed])
    held = _hold(A, to_holes @ needle.twist - drift, offsets, tissue, dt)
    forces = held.reshape(-1, 3) / dt
    found = [Insertion(p.hole, p.depth, p.axes @ f) for p, f in zip(passed, forces, strict=True)]
    return to_holes.T @ held, found


@dataclass(frozen=True, eq=False)
class _Passage:
    """Where a needle passes a hole: its point, axes (3, 3) with the tangent first, and offset from the hole."""

    hole: int
    depth: float
    point: Array
    axes: Array
    aside: Array


def _axes(tangent: Array) -> Array:
    """A right-handed triad (3, 3), ``tangent`` in its first column."""
    across = np.cross(tangent, np.eye(3)[int(np.argmin(np.abs(tangent)))])
    across /= np.linalg.norm(across)
    return np.column_stack([tangent, across, np.cross(tangent, across)])


def _jacobian(needle: Motion, passage: _Passage) -> Array:
    """Velocity (3, 6) of the needle at a passage, in its axes, from the needle's twist."""
    return np.asarray(passage.axes.T @ np.hstack([np.eye(3), -skew(passage.point - needle.pose[:3])]))


def _hold(A: Array, velocity: Array, offsets: Array, tissue: Tissue, dt: float) -> Array:
    """Impulses (3 h,) at all passages: springs sideways, drag and Coulomb friction along.

    ``A`` (3 h, 3 h) is the change of ``velocity`` for a unit of impulse. Friction first sticks
    everywhere; where that takes more than it can, it slides.
    """
    n = len(velocity)
    along = np.arange(n) % 3 == 0
    gain = np.where(along, dt * tissue.drag, dt * tissue.damping + dt * dt * tissue.stiffness)
    limit = tissue.friction * dt
    slides = np.zeros(n)
    while True:
        sticks = along & (slides == 0.0)
        M = np.where(sticks[:, None], A, np.eye(n) + gain[:, None] * A)
        wish = -np.where(along, slides * limit, dt * tissue.stiffness * offsets)
        wish -= np.where(sticks, velocity, gain * velocity)
        held = np.linalg.lstsq(M, np.where(sticks, -velocity, wish), rcond=1e-9)[0]
        over = sticks & (np.abs(held) > limit)
        if not over.any():
            return held
        slides = np.where(over, -np.sign(held), slides)
