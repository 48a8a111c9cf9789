"""Joints that no tree holds, as Bullet constraints.

Bullet has no constraint for most types of joints between trees. So a closing joint is built as any other, on the tree
of its inner body, and carries a part of its outer body, which is welded to the rest of that: limits, motors, springs
and reported positions are those of joints of trees. A point-to-point joint is a constraint of points.

A weld holds what the start of the scene holds, so that nothing is torn then. Along what the other joints of a loop
hold differently, in spite of corrected frames (`ligature.model.assembly`), the closing joint is free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.frames import inverse, matrix_quaternion, pose7_matrix
from ligature.model.mechanism import Chain, chain_of
from ligature.model.scene import Closure, Scene
from ligature.physics.articulation import Tree, is_point, needs_link
from ligature.physics.bodies import Placement
from ligature.physics.motions import Motions

Array = NDArray[np.float64]

MAX_FORCE = 1e5
"""Force in newtons that a closure may use; enough for any arm, finite so that a jam does not explode."""


CLOSING = 0.8
"""Part of a loop's gap that is closed within a tick; Bullet's 0.2 lets a swinging linkage open by 0.5 mm."""

PACE = 1.0
"""Speed in m/s at which gaps are closed at most: a loop that came apart must not throw its bodies."""

TORN = 0.005
"""Gap in metres from which on a loop comes apart: what it holds is damped then."""

TORN_DAMPING = (8.0, 1.0)
"""Linear and angular damping in 1/s of the trees of such a loop; at 50 m/s Bullet makes it 0.4 in a tick of 1 ms."""


class Closures:
    """The constraints of a scene's loops, made where the scene starts, for ticks of ``dt``."""

    def __init__(
        self, client: int, scene: Scene, trees: Sequence[Tree], place_of: Mapping[int, Placement], motions: Motions,
        dt: float,
    ) -> None:  # fmt: skip
        self._client, self._scene, self._trees = client, scene, trees
        self._place_of, self._motions = place_of, motions
        self.ids: list[int] = []
        self._dt, self._share = dt, CLOSING
        ends: list[tuple[int, Array, int, Array]] = []
        self._ends = ends
        motions.forget_all()
        held = [closure for closure in scene.closures if needs_link(scene, closure) or not closure.free]
        for closure in held:
            if needs_link(scene, closure):
                self._hold_end(closure)
            else:
                self._hold_point(closure)
        self._rows = np.array([[one, other] for one, _, other, _ in ends], dtype=np.int64).reshape(-1, 2).T
        self._points = np.array([[one, other] for _, one, _, other in ends]).reshape(-1, 2, 3).transpose(1, 0, 2)
        self._joined = [(self._place_of[c.inner].tree, self._place_of[c.outer].tree) for c in held]
        self._looped = sorted({tree for pair in self._joined for tree in pair})
        self._torn: set[int] = set()

    def pace(self) -> None:
        """Have the coming tick close gaps by no more than `PACE` allows, and damp loops that come apart.

        What it sets follows from where the bodies are, so that snapshots need not keep it.
        """
        if not self._looped:
            return
        for tree in self._looped:
            self._motions.links(tree)
        one, other = (
            _placed(self._motions.pose[rows], points) for rows, points in zip(self._rows, self._points, strict=True)
        )
        gaps = np.sqrt(((one - other) ** 2).sum(axis=1))
        widest = float(gaps.max())
        self._close(CLOSING if CLOSING * widest <= PACE * self._dt else PACE * self._dt / widest)
        torn = {tree for k in np.flatnonzero(gaps > TORN) for tree in self._joined[k]} if widest > TORN else set()
        if torn != self._torn:
            self._damp(torn)

    def begin(self) -> None:
        """Close gaps as fast, and damp as little, as a new client does."""
        self._damp(set())
        self._close(CLOSING)

    def _close(self, share: float) -> None:
        if share != self._share:
            self._share = share
            pybullet.setPhysicsEngineParameter(erp=share, physicsClientId=self._client)

    def _damp(self, torn: set[int]) -> None:
        """Damp the trees ``torn`` and no others more than their files state."""
        for index in sorted(torn ^ self._torn):
            tree = self._trees[index]
            linear, angular = np.maximum(TORN_DAMPING, tree.damping) if index in torn else tree.damping
            pybullet.changeDynamics(
                tree.uid, -1, linearDamping=float(linear), angularDamping=float(angular), physicsClientId=self._client
            )
        self._torn = torn

    def _hold_end(self, closure: Closure) -> None:
        """Join the end of a closing joint to its outer body."""
        inner, outer = self._place_of[closure.inner], self._place_of[closure.outer]
        tree = self._trees[inner.tree]
        link = tree.ends[closure.joint]
        self._motions.links(inner.tree)
        T_world_link = pose7_matrix(self._motions.pose[self._motions.row(inner.tree, link)])
        point = is_point(self._scene, closure)
        # at the joint: a force there does not turn the light end about its axis, so that the solver's rows agree
        T_link_end = np.eye(4) if point else self._chain(closure).T_outer
        T_outer_end = inverse(self._frame(closure.outer)) @ T_world_link @ T_link_end
        kind = pybullet.JOINT_POINT2POINT if point else pybullet.JOINT_FIXED
        self._create(kind, (tree.uid, link), (outer.uid, outer.link), T_link_end, T_outer_end)
        self._watch(self._motions.row(inner.tree, link), T_link_end, outer, T_outer_end)

    def _hold_point(self, closure: Closure) -> None:
        inner, outer = self._place_of[closure.inner], self._place_of[closure.outer]
        T_inner = self._chain(closure).T_inner
        T_outer_end = inverse(self._frame(closure.outer)) @ self._frame(closure.inner) @ T_inner
        self._create(pybullet.JOINT_POINT2POINT, (inner.uid, inner.link), (outer.uid, outer.link), T_inner, T_outer_end)
        self._watch(self._motions.row(inner.tree, inner.link), T_inner, outer, T_outer_end)

    def _watch(self, row: int, T_inner_end: Array, outer: Placement, T_outer_end: Array) -> None:
        ends = T_inner_end[:3, 3], self._motions.row(outer.tree, outer.link), T_outer_end[:3, 3]
        self._ends.append((row, *ends))

    def _chain(self, closure: Closure) -> Chain:
        joint = self._scene.joints[closure.joint]
        return chain_of(joint, joint.child == closure.outer)

    def _frame(self, body: int) -> Array:
        """Inertial frame (4, 4) of a body in the world."""
        pose, twist = np.empty(7), np.empty(6)
        self._place_of[body].read_inertial(pose, twist)
        return pose7_matrix(pose)

    def _create(self, kind: int, one: tuple[int, int], other: tuple[int, int], T_one: Array, T_other: Array) -> None:
        constraint = pybullet.createConstraint(
            *one, *other, kind, [0.0] * 3, T_one[:3, 3].tolist(), T_other[:3, 3].tolist(),
            matrix_quaternion(T_one[:3, :3]).tolist(), matrix_quaternion(T_other[:3, :3]).tolist(),
            physicsClientId=self._client,
        )  # fmt: skip
        pybullet.changeConstraint(constraint, maxForce=MAX_FORCE, physicsClientId=self._client)
        self.ids.append(int(constraint))


def _placed(poses: Array, points: Array) -> Array:
    """Points (k, 3) of frames at ``poses`` (k, 7) in the world."""
    axis = poses[:, 3:6]
    turned = np.cross(axis, points)
    turned = 2.0 * (poses[:, 6:7] * turned + np.cross(axis, turned))
    return np.asarray(poses[:, :3] + points + turned)
