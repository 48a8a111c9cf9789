"""A frictional grasp with a limit surface: pads hold a body until it slips; world axes, SI units.

The pads touch the body in a patch. The tangential force and the moment about the normal that the patch carries
without slip lie within an ellipsoid (Howe and Cutkosky, Practical force-motion models for
sliding manipulation, 1996); its size follows the force between the fingers. Within it the pads are stiff
springs; beyond it the body slips, and the anchors of the springs follow. A normal force above the force between the
fingers pulls the pads apart. The other two moments have no limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ligature.grasping.friction import grasp_arrays, motions, predict_free, scratch, solve
from ligature.grasping.motion import Motion
from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.tables import table_of

Array = NDArray[np.float64]

LINE_ARM = 0.5
"""Mean arm of friction on an evenly pressed line, in halves of its length: a wire across a pad."""

LEAST_FORCE = 1e-9
"""Least normal force in newtons, which keeps the limits positive."""


@dataclass(frozen=True, eq=False)
class Patch:
    """The contact patch of two pads.

    ``T_palm_patch`` (4, 4) is in the holder's inertial frame, its z axis normal to the pads; ``half_width`` of the pads
    in metres; Coulomb ``friction`` of one pad.
    """

    T_palm_patch: Array
    half_width: float
    friction: float

    def limits(self, normal_force: float) -> tuple[float, float]:
        """Largest tangential force (N) and largest moment about the normal (N m) of both pads together."""
        force = 2.0 * self.friction * max(normal_force, LEAST_FORCE)
        return force, force * LINE_ARM * self.half_width


def share_of_limit(force: Array, moment: float, limits: tuple[float, float]) -> float:
    """Square root of the ellipsoid's left side: at 1 the patch slips. ``force`` (2,) is tangential."""
    return float(np.sqrt((force @ force) / limits[0] ** 2 + moment**2 / limits[1] ** 2))


class Grasp:
    """One body held between two pads.

    Parameters
    ----------
    patch
        Where the pads touch.
    T_palm_body
        (4, 4) pose of the body's inertial frame in that of the jaw's holder, as grasped.

    Attributes
    ----------
    patch_pose
        (7,) pose of the patch in the inertial frame of the jaw's holder.
    normal_force
        Force between the fingers in newtons; the owner keeps it up to date.
    load
        (6,) force and moment on the body at the patch, in patch axes, in the last tick.
    slipped
        (2,) metres and radians that the body has slipped since it was grasped.
    """

    def __init__(self, patch: Patch, T_palm_body: Array) -> None:
        self.patch = patch
        self.patch_pose = matrix_pose7(patch.T_palm_patch)
        self.held = matrix_pose7(inverse(patch.T_palm_patch) @ T_palm_body)
        self.normal_force = 0.0
        self.load = np.zeros(6)
        self.slipped = np.zeros(2)
        self.slides = np.zeros(2, dtype=np.bool_)
        self.pace, self.lag = np.zeros(6), np.zeros(6)

    def begin(self, palm: Motion) -> None:
        """Record the holder's velocity at the start of the grasp."""
        T = self.world_patch(palm.pose)
        velocity = palm.velocity_at(T[:3, 3])
        self.pace = np.concatenate([T[:3, :3].T @ velocity[:3], T[:3, :3].T @ velocity[3:]])

    def world_patch(self, palm_pose: Array) -> Array:
        """Pose (4, 4) of the patch with the holder's inertial frame at ``palm_pose`` (7,)."""
        return np.asarray(pose7_matrix(palm_pose) @ self.patch.T_palm_patch)

    def move_patch(self, T_palm_patch: Array) -> None:
        """Move the patch on the holder; body and loads stay."""
        T_palm_body = self.patch.T_palm_patch @ pose7_matrix(self.held)
        self.patch = replace(self.patch, T_palm_patch=T_palm_patch)
        self.patch_pose = matrix_pose7(T_palm_patch)
        self.held = matrix_pose7(inverse(T_palm_patch) @ T_palm_body)

    def share(self) -> float:
        """Used share of the limit surface in the last tick, 0 to 1."""
        return share_of_limit(self.load[:2], float(self.load[5]), self.patch.limits(self.normal_force))


class GraspSolver:
    """Solves ``count`` grasps of one body together; reused from tick to tick.

    Attributes
    ----------
    motions
        Motion of the body and the holders; the caller fills it in.
    """

    def __init__(self, count: int) -> None:
        self.motions, self._grasps, self._scratch = motions(count), grasp_arrays(count), scratch(count)
        self._tables = table_of(self.motions), table_of(self._grasps), table_of(self._scratch)

    def predict_free(self, own_mass: float, gravity: Array, dt: float) -> Array:
        """See `ligature.grasping.friction.predict_free`; returns `Motions.attached_load`."""
        predict_free(self._tables[0], self._tables[2], own_mass, gravity, dt)
        return self.motions.attached_load

    def solve(self, grasps: Sequence[Grasp], dt: float) -> Array:
        """Impulses (1 + g, 6) of one tick on the body and on the holders, each about its centre of mass.

        `Motions.body_twist` is the twist after the tick without the grasps. Holders keep their velocity within the
        tick: the springs of a needle do not move an arm of kilograms.
        """
        held = self._grasps
        for g, grasp in enumerate(grasps):
            held.patch[g], held.held[g], held.slid[g] = grasp.patch_pose, grasp.held, grasp.slipped
            held.pace[g], held.lag[g] = grasp.pace, grasp.lag
            held.limits[g, :2] = grasp.patch.limits(grasp.normal_force)
            held.limits[g, 2] = max(grasp.normal_force, LEAST_FORCE)
        solve(*self._tables, dt)
        for g, grasp in enumerate(grasps):
            grasp.held[:], grasp.load[:], grasp.slipped[:] = held.held[g], held.load[g], held.slid[g]
            grasp.pace[:], grasp.lag[:], grasp.slides[:] = held.pace[g], held.lag[g], held.slides[g]
        return self.motions.impulse


def solve_once(grasps: Sequence[Grasp], palms: Sequence[Motion], body: Motion, dt: float) -> Array:
    """One `GraspSolver.solve` for a body and holders with the given motion."""
    solver = GraspSolver(len(grasps))
    at = solver.motions
    at.body_pose[:], at.body_twist[:] = body.pose, body.twist
    at.inverse[0], at.inverse[1:] = body.inverse_mass, body.inverse_inertia
    for g, palm in enumerate(palms):
        at.palm_pose[g], at.palm_twist[g] = palm.pose, palm.twist
    return solver.solve(grasps, dt)


def warm_up() -> None:
    """Compile the kernels or load them from the cache, so that the first grasp of a run does not wait."""
    origin = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    still = Motion(origin, np.zeros(6), 1.0, np.ones(3))
    solve_once([Grasp(Patch(np.eye(4), 1e-3, 0.5), np.eye(4))], [still], still, 1e-3)
    GraspSolver(1).predict_free(1.0, np.zeros(3), 1e-3)
