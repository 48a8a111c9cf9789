"""Joints that no tree holds, as Bullet constraints.

Bullet has no constraint for most types of joints between trees. So a closing joint is built as any other, on the tree
of its inner body, and carries a part of its outer body, which is welded to the rest of that: limits, motors, springs
and reported positions are those of joints of trees. A point-to-point joint is a constraint of points.

A weld holds what the start of the scene holds, so that nothing is torn then. Along what the other joints of a loop
hold differently, in spite of corrected frames (`ligature.model.assembly`), the closing joint is free.
"""

from __future__ import annotations

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.adf.diagnostics import length
from ligature.model.frames import inverse, matrix_pose7, matrix_quaternion, pose7_matrix
from ligature.model.mechanism import Chain, chain_of
from ligature.model.scene import Closure
from ligature.physics.articulation import is_point, needs_link
from ligature.physics.engine import CLOSING, Engine
from ligature.physics.linkage import End, lay_out, moving_trees
from ligature.physics.projection import MOVED, close_loops, measure_loops
from ligature.tables import table_of

Array = NDArray[np.float64]

MAX_FORCE = 1e5
"""Maximum force of a closure in newtons: enough for any arm, and finite so that jammed bodies do not diverge."""

PACE = 1.0
"""Speed in m/s at which wide gaps are closed: bodies do not get it, but what is in their way is pushed by it."""

PUSH = 0.01
"""Speed in m/s at which Bullet closes gaps at most; bodies keep what it gives them, the lighter ones a multiple."""

TORN = 0.005
"""Gap in metres above which a loop is torn: its trees are damped then."""

TORN_DAMPING = (8.0, 1.0)
"""Linear and angular damping in 1/s of the trees of such a loop; at 50 m/s Bullet makes it 0.4 in a tick of 1 ms."""

OPEN = 1e-4
"""Gap in metres from which on an open loop is reported."""

UNBOUNDED = 500.0
"""Speed in rad/s or m/s of a coordinate that Bullet allows, so that no torque which is commanded makes a tree diverge.

Bullet stops a link at 100 whatever hangs on it. That tears loops open, and where coordinates of a light link and of a
heavy one on it nearly cancel, it throws the heavy one. The projection slows them down together.
"""

STUCK = 1e-3
"""Distance (rad, m) of a joint from its limit at which the limit is what holds a loop open."""


class Closures:
    """What closes the loops of a scene: constraints, made where it starts, and a projection after each tick.

    The projection also slows down trees that are too fast.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine, self._client, self._scene = engine, engine.client, engine.scene
        self._share = CLOSING
        self._torn: set[int] = set()
        self._reported: set[int] = set()
        self._ends: list[End] = []
        engine.motions.forget_all()
        for closure in engine.scene.closures:
            mechanism = moving_trees(engine, self._trees_of(closure))
            if not mechanism:
                continue  # nothing of it can be moved, by a projection as little as by a constraint
            if needs_link(engine.scene, closure):
                self._hold_end(closure, mechanism)
            elif not closure.free:
                self._hold_point(closure, mechanism)
        self._ends.sort(key=lambda end: end.mechanism)
        self._arrays = lay_out(engine, self._ends)
        self._table = table_of(self._arrays)
        for tree in engine.trees:
            if tree.axes:
                pybullet.changeDynamics(tree.uid, -1, maxJointVelocity=UNBOUNDED, physicsClientId=self._client)

    def pace(self) -> None:
        """Have the coming tick close gaps by no more than `PACE` allows, and damp loops that come apart.

        What it sets follows from where the bodies are, so that snapshots need not keep it.
        """
        if not self._ends:
            return
        motions = self._engine.motions
        motions.read_all()
        widest = float(measure_loops(motions.table, self._table))
        within = PUSH * self._engine.dt
        self._close(CLOSING if CLOSING * widest <= within else within / widest)
        open_ = np.flatnonzero(self._arrays.gap > TORN) if widest > TORN else ()
        torn = {tree for k in open_ for tree in self._ends[k].trees}
        if torn != self._torn:
            self._damp(torn)

    def project(self, fast: bool) -> list[Diagnostic]:
        """After a tick, put mechanisms where their loops are closed; returns what is found open for the first time.

        ``fast`` is whether a coordinate of any tree exceeds `MAX_RATE`; such trees are slowed down.
        """
        if not (self._ends or fast):
            return []
        motions = self._engine.motions
        motions.prepare()
        left = float(close_loops(motions.handle, motions.table, self._table, PACE * self._engine.dt, self._engine.dt))
        if not motions.handle:
            self._hand_on()
        if left <= OPEN:
            return []
        fresh = [k for k in np.flatnonzero(self._arrays.gap > OPEN).tolist() if k not in self._reported]
        self._reported |= set(fresh)
        return [self._finding(k) for k in fresh]

    def begin(self) -> None:
        """Close gaps as fast, and damp as little, as a new client does; what is open is reported again."""
        self._damp(set())
        self._close(CLOSING)
        self._reported.clear()

    def snapshot(self) -> set[int]:
        """The loops that were reported as open."""
        return set(self._reported)

    def restore(self, snapshot: set[int]) -> None:
        """Continue from `snapshot`."""
        self._reported = set(snapshot)

    def _finding(self, k: int) -> Diagnostic:
        """That a loop is open, by how much, and why."""
        joints, end = self._scene.joints, self._ends[k]
        name = joints[end.joint].identity
        message = f"the loop of joint '{name.key}' is open by {length(self._arrays.gap[k])}"
        names = [f"'{joints[joint].identity.key}'" for joint in self._at_limits(end)]
        if names:
            message += f": {' and '.join(names)} {'is' if len(names) == 1 else 'are'} at the end of the range"
            hint = "widen the limits, or command less"
        else:
            message += ": the forces on it are too large for its bodies, or its joints contradict each other"
            hint = "command it slower and with less force, or look at its pivots and axes"
        return Diagnostic(Severity.WARNING, message, name.mark, hint, "loop")

    def _at_limits(self, end: End) -> list[int]:
        """Joints of a mechanism that are at a limit."""
        found: dict[int, None] = {}
        for tree in end.mechanism:
            positions = self._engine.motions.joints(tree)[0]
            for (_, joint, axis, _), q in zip(self._engine.trees[tree].axes, positions, strict=True):
                low, high = axis.low, axis.high
                if low is not None and high is not None and low < high and not low + STUCK < q < high - STUCK:
                    found[joint] = None
        return list(found)

    def _hand_on(self) -> None:
        """Set poses and velocities of mechanisms in Bullet, by PyBullet's functions."""
        arrays, engine = self._arrays, self._engine
        motions, client = engine.motions, self._client
        for m in np.flatnonzero(arrays.moved).tolist():
            for k in arrays.tree[arrays.tree_begin[m] : arrays.tree_begin[m + 1]].tolist():
                tree = engine.trees[k]
                if arrays.moved[m] == MOVED:
                    pose, twist = (a[motions.row(k, -1)].tolist() for a in (motions.pose, motions.twist))
                    if not tree.static:
                        pybullet.resetBasePositionAndOrientation(tree.uid, pose[:3], pose[3:], physicsClientId=client)
                        pybullet.resetBaseVelocity(tree.uid, twist[:3], twist[3:], physicsClientId=client)
                    axes = motions.slices[k]
                    for (link, *_), q, v in zip(tree.axes, motions.position[axes], motions.velocity[axes], strict=True):
                        pybullet.resetJointState(tree.uid, link, float(q), float(v), physicsClientId=client)
                motions.forget(k)

    def _close(self, share: float) -> None:
        if share != self._share:
            self._share = share
            pybullet.setPhysicsEngineParameter(erp=share, physicsClientId=self._client)

    def _damp(self, torn: set[int]) -> None:
        """Damp the trees ``torn`` and no others more than their files state."""
        for index in sorted(torn ^ self._torn):
            tree = self._engine.trees[index]
            linear, angular = np.maximum(TORN_DAMPING, tree.damping) if index in torn else tree.damping
            pybullet.changeDynamics(
                tree.uid, -1, linearDamping=float(linear), angularDamping=float(angular), physicsClientId=self._client
            )
        self._torn = torn

    def _hold_end(self, closure: Closure, mechanism: tuple[int, ...]) -> None:
        """Join the end of a closing joint to its outer body."""
        engine = self._engine
        inner, outer = engine.place_of[closure.inner], engine.place_of[closure.outer]
        tree = engine.trees[inner.tree]
        link = tree.ends[closure.joint]
        row = engine.motions.row(inner.tree, link)
        engine.motions.links(inner.tree)
        T_world_link = pose7_matrix(engine.motions.pose[row])
        point = is_point(self._scene, closure)
        # at the joint: a force there does not turn the light end about its axis, so that the solver's rows agree
        T_link_end = np.eye(4) if point else self._chain(closure).T_outer
        T_outer_end = inverse(self._frame(closure.outer)) @ T_world_link @ T_link_end
        kind = pybullet.JOINT_POINT2POINT if point else pybullet.JOINT_FIXED
        self._create(kind, (tree.uid, link), (outer.uid, outer.link), T_link_end, T_outer_end)
        self._watch(closure, mechanism, row, T_link_end, T_outer_end, point)

    def _hold_point(self, closure: Closure, mechanism: tuple[int, ...]) -> None:
        inner, outer = self._engine.place_of[closure.inner], self._engine.place_of[closure.outer]
        T_inner = self._chain(closure).T_inner
        T_outer_end = inverse(self._frame(closure.outer)) @ self._frame(closure.inner) @ T_inner
        self._create(pybullet.JOINT_POINT2POINT, (inner.uid, inner.link), (outer.uid, outer.link), T_inner, T_outer_end)
        row = self._engine.motions.row(inner.tree, inner.link)
        self._watch(closure, mechanism, row, T_inner, T_outer_end, True)

    def _watch(
        self,
        closure: Closure,
        mechanism: tuple[int, ...],
        row: int,
        T_inner_end: Array,
        T_outer_end: Array,
        point: bool,
    ) -> None:
        outer = self._engine.place_of[closure.outer]
        rows = row, self._engine.motions.row(outer.tree, outer.link)
        frames = matrix_pose7(T_inner_end), matrix_pose7(T_outer_end)
        self._ends.append(End(closure.joint, self._trees_of(closure), mechanism, rows, frames, point))

    def _trees_of(self, closure: Closure) -> tuple[int, int]:
        """Trees of the bodies that a loop's joint joins."""
        place_of = self._engine.place_of
        return place_of[closure.inner].tree, place_of[closure.outer].tree

    def _chain(self, closure: Closure) -> Chain:
        joint = self._scene.joints[closure.joint]
        return chain_of(joint, joint.child == closure.outer)

    def _frame(self, body: int) -> Array:
        """Inertial frame (4, 4) of a body in the world."""
        pose, twist = np.empty(7), np.empty(6)
        self._engine.place_of[body].read_inertial(pose, twist)
        return pose7_matrix(pose)

    def _create(self, kind: int, one: tuple[int, int], other: tuple[int, int], T_one: Array, T_other: Array) -> None:
        constraint = pybullet.createConstraint(
            *one, *other, kind, [0.0] * 3, T_one[:3, 3].tolist(), T_other[:3, 3].tolist(),
            matrix_quaternion(T_one[:3, :3]).tolist(), matrix_quaternion(T_other[:3, :3]).tolist(),
            physicsClientId=self._client,
        )  # fmt: skip
        pybullet.changeConstraint(constraint, maxForce=MAX_FORCE, physicsClientId=self._client)
