"""A grasp that yields: two jaws hold a body by friction, up to a limit surface; world axes, SI units.

The pads touch the body in a patch. What the patch carries without slipping, of tangential force and of
moment about its normal, lies within an ellipsoid (Howe and Cutkosky, Practical force-motion models for
sliding manipulation, 1996); its size follows the force between the jaws. All else is held rigidly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse, pose7_matrix
from ligature.suture.motion import Motion, rotation_vector_of

Array = NDArray[np.float64]

CORRECTION = 0.2
"""Share of a misplacement that a tick takes back."""

PRESSURE_ARM = 2.0 / 3.0
"""Mean arm of friction in an evenly pressed disc, in radii."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Where and how the pads touch: ``T_jaw_patch`` (4, 4) in the jaw's inertial frame, its z axis normal
    to the pads; ``radius`` of the touching area in metres; Coulomb ``friction`` of one pad.
    """

    T_jaw_patch: Array
    radius: float
    friction: float

    def limits(self, normal_force: float) -> tuple[float, float]:
        """Largest tangential force (N) and largest moment about the normal (N m) of both pads together."""
        force = 2.0 * self.friction * max(normal_force, 0.0)
        return force, force * PRESSURE_ARM * self.radius


def share_of_limit(force: Array, moment: float, limits: tuple[float, float]) -> float:
    """Square root of the ellipsoid's left side: above 1 the patch slips. ``force`` (2,) is tangential."""
    if limits[0] <= 0.0:
        return float("inf") if np.any(force) or moment else 0.0
    return float(np.sqrt((force @ force) / limits[0] ** 2 + moment**2 / limits[1] ** 2))


class Grasp:
    """One body held between the jaws of one tool.

    Parameters
    ----------
    patch
        Where the pads touch.
    T_jaw_body
        (4, 4) pose of the body's inertial frame in the jaw's, as grasped.
    """

    def __init__(self, patch: Patch, T_jaw_body: Array) -> None:
        self.patch = patch
        self.T_patch_body = inverse(patch.T_jaw_patch) @ T_jaw_body
        self.slipped = False

    def impulse(self, jaw: Motion, body: Motion, normal_force: float, dt: float) -> tuple[Array, Array]:
        """Impulses (6,) of this tick on the body and on the jaw, each about its centre of mass.

        ``normal_force`` presses the jaws together, in newtons. Where the pads slip, the held pose
        follows, so that nothing pulls the body back.
        """
        T_patch = pose7_matrix(jaw.pose) @ self.patch.T_jaw_patch
        point, axes = T_patch[:3, 3], np.kron(np.eye(2), T_patch[:3, :3])
        K = axes.T @ (jaw.admittance_at(point) + body.admittance_at(point)) @ axes
        error = self._misplacement(T_patch, pose7_matrix(body.pose))
        wish = -(axes.T @ (body.velocity_at(point) - jaw.velocity_at(point))) - CORRECTION / dt * error
        held = np.linalg.solve(K, wish)
        force, moment = self.patch.limits(normal_force)
        share = share_of_limit(held[:2], float(held[5]), (force * dt, moment * dt))
        self.slipped = share > 1.0
        if self.slipped:
            held = _clamped(K, wish, held, 1.0 / share)
            self._follow(error)
        world = np.asarray(axes @ held, dtype=float)
        return body.about_centre(world, point), jaw.about_centre(-world, point)

    def _misplacement(self, T_patch: Array, T_body: Array) -> Array:
        """How far the body is off its held pose, (6,) at the patch in patch axes."""
        off = inverse(T_patch) @ T_body @ inverse(self.T_patch_body)
        return np.concatenate([off[:3, 3], rotation_vector_of(off[:3, :3])])

    def _follow(self, error: Array) -> None:
        """Take the slid part of a misplacement, along the pads and about their normal, for the held pose."""
        slid = np.eye(4)
        c, s = np.cos(error[5]), np.sin(error[5])
        slid[:2, :2] = [[c, -s], [s, c]]
        slid[:2, 3] = error[:2]
        self.T_patch_body = slid @ self.T_patch_body


def _clamped(K: Array, wish: Array, held: Array, scale: float) -> Array:
    """The impulse with its sliding part scaled down to the limit, and the rest rigid all the same."""
    slides, rigid = [0, 1, 5], [2, 3, 4]
    out = np.zeros(6)
    out[slides] = scale * held[slides]
    left = wish[rigid] - K[np.ix_(rigid, slides)] @ out[slides]
    out[rigid] = np.linalg.solve(K[np.ix_(rigid, rigid)], left)
    return out
