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

from ligature.grasping.friction import (
    friction_limits,
    grasp_arrays,
    motions,
    scratch,
    solve,
)
from ligature.grasping.motion import Motion
from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.tables import table_of

Array = NDArray[np.float64]


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
        force, moment, _ = friction_limits(self.friction, self.half_width, float(normal_force))
        return force, moment


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
    arrays
        What the law needs and keeps of this one grasp.
    """

    def __init__(self, patch: Patch, T_palm_body: Array) -> None:
        self.patch = patch
        self.arrays = grasp_arrays(1)
        self.arrays.pads[0] = patch.friction, patch.half_width, 0.0
        self._place(T_palm_body)

    def _place(self, T_palm_body: Array) -> None:
        """Hold the body at ``T_palm_body`` by the patch where it is."""
        self.arrays.patch[0] = matrix_pose7(self.patch.T_palm_patch)
        self.arrays.held[0] = matrix_pose7(inverse(self.patch.T_palm_patch) @ T_palm_body)

    @property
    def held(self) -> Array:
        """Pose (7,) of the body's inertial frame in the patch, as held."""
        return self.arrays.held[0]

    @property
    def normal_force(self) -> float:
        """Force between the fingers in newtons; the owner keeps it up to date."""
        return float(self.arrays.pads[0, 2])

    @normal_force.setter
    def normal_force(self, force: float) -> None:
        self.arrays.pads[0, 2] = force

    @property
    def load(self) -> Array:
        """Force and moment (6,) on the body at the patch, in patch axes, in the last tick."""
        return self.arrays.load[0]

    @property
    def slipped(self) -> Array:
        """Metres and radians (2,) that the body has slipped since it was grasped."""
        return self.arrays.slid[0]

    @property
    def slides(self) -> NDArray[np.bool_]:
        """Whether the body slips along the pads, and pulls them apart (2,)."""
        return self.arrays.slides[0]

    def begin(self, palm: Motion) -> None:
        """Record the holder's velocity at the start of the grasp."""
        T = self.world_patch(palm.pose)
        velocity = palm.velocity_at(T[:3, 3])
        self.arrays.pace[0] = np.concatenate([T[:3, :3].T @ velocity[:3], T[:3, :3].T @ velocity[3:]])

    def world_patch(self, palm_pose: Array) -> Array:
        """Pose (4, 4) of the patch with the holder's inertial frame at ``palm_pose`` (7,)."""
        return np.asarray(pose7_matrix(palm_pose) @ self.patch.T_palm_patch)

    def move_patch(self, T_palm_patch: Array) -> None:
        """Move the patch on the holder; body and loads stay."""
        T_palm_body = self.patch.T_palm_patch @ pose7_matrix(self.held)
        self.patch = replace(self.patch, T_palm_patch=T_palm_patch)
        self._place(T_palm_body)

    def share(self) -> float:
        """Used share of the limit surface in the last tick, 0 to 1."""
        return share_of_limit(self.load[:2], float(self.load[5]), self.patch.limits(self.normal_force))


class GraspSolver:
    """Solves ``count`` grasps of one body together; reused from tick to tick.

    Attributes
    ----------
    motions
        Motion of the body and the holders; the caller fills it in.
    motion_table, room_table
        The addresses of these arrays, and of scratch, for compiled code.
    """

    def __init__(self, count: int) -> None:
        self.motions, self._arrays, self._scratch = motions(count), grasp_arrays(count), scratch(count)
        self.motion_table, self.room_table = table_of(self.motions), table_of(self._scratch)
        self._table, self._taken = table_of(self._arrays), (self._arrays, table_of(self._arrays))

    def take(self, grasps: Sequence[Grasp]) -> NDArray[np.int64]:
        """The addresses of the arrays of ``grasps`` for one solution, to be followed by `give_back`."""
        if len(grasps) == 1:  # its own arrays serve
            if self._taken[0] is not grasps[0].arrays:
                self._taken = grasps[0].arrays, table_of(grasps[0].arrays)
            return self._taken[1]
        for g, grasp in enumerate(grasps):
            for together, own in zip(self._arrays, grasp.arrays, strict=True):
                together[g] = own[0]
        return self._table

    def give_back(self, grasps: Sequence[Grasp]) -> None:
        """Put the arrays of several grasps back where `take` took them from."""
        if len(grasps) > 1:
            for g, grasp in enumerate(grasps):
                for together, own in zip(self._arrays, grasp.arrays, strict=True):
                    own[0] = together[g]

    def solve(self, grasps: Sequence[Grasp], dt: float) -> Array:
        """Impulses (1 + g, 6) of one tick on the body and on the holders, each about its centre of mass.

        `Motions.body_twist` is the twist after the tick without the grasps. Holders keep their velocity within the
        tick: the springs of a needle do not move an arm of kilograms.
        """
        solve(self.motion_table, self.take(grasps), self.room_table, dt)
        self.give_back(grasps)
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
