"""All rods of a scene: built from recognised chains, advanced once a tick beside the rigid bodies.

A rod's elements are bodies of the scene; their frames are inertial frames I here and body frames B
outside. World axes, SI units.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.model.scene import Body, Joint, JointType, RodChain, Scene
from ligature.model.state import StateRecord
from ligature.suture import projection as contacts
from ligature.suture import solver
from ligature.suture.bodies import Bodies
from ligature.suture.colliders import Colliders

Array = NDArray[np.float64]

ITERATIONS = 2
"""Rounds of contact projection and joint solve a tick."""

RIGID = 1e6
"""Bending stiffness in N·m/rad of a joint that does not bend."""

NEXT_TO_ANCHOR = 3
"""Elements next to an anchor that do not touch the anchored body, in which they begin."""


@dataclass(frozen=True)
class _Tie:
    """One joint of the solver's chain: pivots and rest frames in the inertial frames of its two nodes."""

    pivot_a: Array
    pivot_b: Array
    rest_a: Array
    rest_b: Array
    stiffness: Array
    damping: Array


class Rod:
    """One rod: its elements, and up to one rigid body tied to each end."""

    def __init__(self, scene: Scene, chain: RodChain, dt: float) -> None:
        self._dt = dt
        self.chain = chain
        bodies = scene.bodies
        self._head = self._anchor(scene, chain.bodies[0])
        self._tail = self._anchor(scene, chain.bodies[-1])
        self.nodes = [
            *([self._head[1]] if self._head else []), *chain.bodies, *([self._tail[1]] if self._tail else []),
        ]  # fmt: skip
        self._first = 1 if self._head else 0
        self._own = slice(self._first, self._first + len(chain.bodies))
        members = [bodies[b] for b in self.nodes]
        self._inverse_mass = np.array([0.0 if b.static else 1.0 / b.mass for b in members])
        self._inverse_inertia = np.array([_inverse(b) for b in members])
        self._T_inertial = [b.T_body_inertial for b in members]
        self._rest_pose = [matrix_pose7(b.T_world_body @ b.T_body_inertial) for b in members]
        self._gravity = np.array([b.gravity for b in members])
        self._decay = np.array([((1 - b.linear_damping) ** dt, (1 - b.angular_damping) ** dt) for b in members])
        joints = [
            *([self._head[0]] if self._head else []),
            *(scene.joints[j] for j in chain.joints),
            *([self._tail[0]] if self._tail else []),
        ]
        ties = [_tie(joint, self.nodes[j]) for j, joint in enumerate(joints)]
        self._pivot_a, self._pivot_b = (
            np.array([t.pivot_a for t in ties]),
            np.array([t.pivot_b for t in ties]),
        )
        self._rest_a, self._rest_b = np.array([t.rest_a for t in ties]), np.array([t.rest_b for t in ties])
        self._k, self._d = np.array([t.stiffness for t in ties]), np.array([t.damping for t in ties])
        self._setup_points(bodies[chain.bodies[0]].friction)
        self.reset()

    def _setup_points(self, friction: float) -> None:
        """Contact points: the middle of each element, its far pivot, and the near pivot of the first."""
        elements, places = [], []
        for i in range(self._own.start, self._own.stop):
            places.append(np.zeros(3))
            elements.append(i)
            if i < len(self._pivot_a):
                places.append(self._pivot_a[i])
                elements.append(i)
            elif i > 0:
                places.append(-self._pivot_b[i - 1])
                elements.append(i)
        if self._own.start == 0 and len(self._pivot_a):
            places.append(-self._pivot_a[0])
            elements.append(0)
        self._point_element = np.array(elements, dtype=np.int64)
        self._point_local = np.array(places)
        self._friction = friction

    @staticmethod
    def _anchor(scene: Scene, end: int) -> tuple[Joint, int] | None:
        """The joint and body that an end element is tied to."""
        for rod in scene.rods:
            for index in rod.anchors:
                joint = scene.joints[index]
                if end in (joint.parent, joint.child):
                    other = joint.child if joint.parent == end else joint.parent
                    if other not in scene.rod_bodies:
                        return joint, other
        return None

    def reset(self) -> None:
        """Put every element back to its initial pose, at rest."""
        poses = np.array(self._rest_pose)
        self.x, self.q = poses[:, :3].copy(), poses[:, 3:].copy()
        self.v, self.w = np.zeros_like(self.x), np.zeros_like(self.x)
        self.tension = np.zeros(max(len(self._pivot_a), 1))

    def memory(self) -> dict[str, Array]:
        """Everything that lasts from tick to tick."""
        return {name: np.array(getattr(self, name)) for name in ("x", "q", "v", "w", "tension")}

    def recall(self, memory: dict[str, Array]) -> None:
        """Continue from `memory`."""
        for name, value in memory.items():
            setattr(self, name, value.copy())

    def step(self, bodies: Bodies, colliders: Colliders) -> None:
        """Advance by one tick and push the bodies that the rod is tied to or touches."""
        dt = self._dt
        self._read_anchors(bodies)
        colliders.update(bodies, self.x[self._own].min(axis=0), self.x[self._own].max(axis=0))
        found = self._detect(colliders)
        x_old, q_old = self.x.copy(), self.q.copy()
        carried_bend = self._bends()
        own = self._own
        self.v[own] = (self.v[own] + self._gravity[own] * dt) * self._decay[own, :1]
        self.w[own] *= self._decay[own, 1:]
        self.x += self.v * dt
        for i in range(len(self.x)):
            solver.turn(self.q[i], *(self.w[i] * dt))
        x_free, q_free = self.x.copy(), self.q.copy()
        stiffness = self._k * dt * dt + self._d * dt
        multiplier = np.zeros((len(self._pivot_a), 6))
        surface = self._surface_motion(bodies, found)
        for _ in range(ITERATIONS):
            if found.count:
                contacts.project(
                    self.x, self.q, x_old, q_old, self._inverse_mass, self._inverse_inertia, found.count,
                    found.element, found.local, found.normal, found.offset, surface, found.friction,
                    found.pressed, found.pulled,
                )  # fmt: skip
            solver.solve_joints(
                self.x, self.q, self._inverse_mass, self._inverse_inertia, self._pivot_a, self._pivot_b,
                self._rest_a, self._rest_b, stiffness, carried_bend, multiplier,
            )  # fmt: skip
        self._finish(x_old, q_old)
        self.tension = np.linalg.norm(multiplier[:, :3], axis=1) / dt**2
        self._push_anchors(bodies, x_free, q_free)
        self._push_touched(bodies, found)

    def write(self, state: StateRecord) -> None:
        """Write poses and twists of the elements, and the tension at each element's far joint in newtons."""
        for i, body in enumerate(self.chain.bodies):
            node = i + self._first
            T = pose7_matrix(np.concatenate([self.x[node], self.q[node]])) @ inverse(self._T_inertial[node])
            state["body_pose"][0, body] = matrix_pose7(T)
            state["body_twist"][0, body, :3] = self.v[node]
            state["body_twist"][0, body, 3:] = self.w[node]
            if node < len(self.tension):
                state["rod_tension"][0, body] = self.tension[node]

    def finite(self) -> bool:
        """Whether the state is usable."""
        return bool(np.isfinite(self.x).all() and np.isfinite(self.q).all() and np.isfinite(self.v).all())

    def _read_anchors(self, bodies: Bodies) -> None:
        for node in self._anchor_nodes():
            T = pose7_matrix(bodies.pose7(self.nodes[node])) @ self._T_inertial[node]
            pose = matrix_pose7(T)
            self.x[node], self.q[node] = pose[:3], pose[3:]
            twist = bodies.twist6(self.nodes[node])
            self.v[node], self.w[node] = twist[:3], twist[3:]

    def _anchor_nodes(self) -> list[int]:
        return [*([0] if self._head else []), *([len(self.nodes) - 1] if self._tail else [])]

    def _bends(self) -> Array:
        """d dt φ of every joint at the start of the tick, (joints, 3)."""
        out, R, angles = np.zeros_like(self._k), np.empty((3, 3)), np.empty(3)
        for j in range(len(out)):
            if np.any(self._d[j]):
                solver.bend(self.q[j], self.q[j + 1], self._rest_a[j], self._rest_b[j], R, angles)
                out[j] = self._d[j] * self._dt * angles
        return out

    def _detect(self, colliders: Colliders) -> _Found:
        found = _Found()
        if not len(colliders.body):
            return found
        speed = np.linalg.norm(self.v, axis=1) + np.linalg.norm(self._gravity, axis=1) * self._dt
        found.count = contacts.detect(
            self.x, self.q, speed, self._point_element, self._point_local, self.chain.radius, colliders.body,
            colliders.kind, colliders.size, colliders.planes, colliders.plane_range, colliders.pose,
            colliders.bound, self._skip(colliders), self._dt, found.element, found.local, found.normal,
            found.offset, found.body,
        )  # fmt: skip
        by_body = dict(zip(colliders.body.tolist(), colliders.friction.tolist(), strict=True))
        found.friction = np.array([self._friction * by_body[b] for b in found.body[: found.count].tolist()])
        found.pressed, found.pulled = np.zeros(found.count), np.zeros((found.count, 3))
        return found

    def _skip(self, colliders: Colliders) -> NDArray[np.bool_]:
        """Pairs (colliders, nodes) that do not touch: elements beside an anchor and the anchored body."""
        cached = getattr(self, "_skipped", None)
        if cached is None:
            cached = np.zeros((len(colliders.body), len(self.nodes)), dtype=bool)
            n = len(self.nodes)
            if self._head:
                cached[colliders.body == self.nodes[0], : 1 + NEXT_TO_ANCHOR] = True
            if self._tail:
                cached[colliders.body == self.nodes[-1], n - 1 - NEXT_TO_ANCHOR :] = True
            self._skipped = cached
        return cached

    def _surface_motion(self, bodies: Bodies, found: _Found) -> Array:
        """How far each touched surface moves during the tick, (contacts, 3)."""
        out = np.zeros((found.count, 3))
        for body in sorted(set(found.body[: found.count].tolist())):
            twist = bodies.twist6(body)
            if np.any(twist):
                centre = bodies.pose7(body)[:3]
                rows = found.body[: found.count] == body
                points = self.x[found.element[: found.count][rows]]
                out[rows] = (twist[:3] + np.cross(twist[3:], points - centre)) * self._dt
        return out

    def _finish(self, x_old: Array, q_old: Array) -> None:
        """Velocities from positions."""
        self.v = (self.x - x_old) / self._dt
        turned = np.empty(3)
        for i in range(len(self.x)):
            solver.rotation_between(q_old[i], self.q[i], turned)
            self.w[i] = turned / self._dt

    def _push_anchors(self, bodies: Bodies, x_free: Array, q_free: Array) -> None:
        """Give the change of momentum of the tied bodies back to them."""
        turned, R = np.empty(3), np.empty((3, 3))
        for node in self._anchor_nodes():
            if self._inverse_mass[node] == 0.0:
                continue
            solver.rotation_between(q_free[node], self.q[node], turned)
            solver.quaternion_to_matrix(self.q[node], R)
            inertia = 1.0 / self._inverse_inertia[node]
            impulse = (self.x[node] - x_free[node]) / self._dt / self._inverse_mass[node]
            moment = R @ (inertia * (R.T @ turned)) / self._dt
            bodies.apply_impulse(self.nodes[node], impulse, moment)

    def _push_touched(self, bodies: Bodies, found: _Found) -> None:
        """Push the touched bodies by the opposite of what their contacts did."""
        pressed = found.pressed[: found.count] > 0.0
        for body in sorted(set(found.body[: found.count][pressed].tolist())):
            rows = np.flatnonzero((found.body[: found.count] == body) & pressed)
            force = -(found.pressed[rows, None] * found.normal[rows] + found.pulled[rows])
            points = self.x[found.element[rows]]
            centre = bodies.pose7(body)[:3]
            bodies.apply_impulse(
                body, force.sum(axis=0) / self._dt, np.cross(points - centre, force).sum(axis=0) / self._dt
            )


class _Found:
    """The contacts of one tick."""

    def __init__(self) -> None:
        n = contacts.MAX_CONTACTS
        self.count = 0
        self.element, self.body = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        self.local, self.normal, self.offset = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n)
        self.friction, self.pressed, self.pulled = np.zeros(0), np.zeros(0), np.zeros((0, 3))


class Rods:
    """The rods of a scene."""

    def __init__(self, scene: Scene, dt: float = 1e-3) -> None:
        self.rods = [Rod(scene, chain, dt) for chain in scene.rods]
        self._colliders = Colliders(scene) if scene.rods else None

    def step(self, bodies: Bodies) -> None:
        """Advance every rod by one tick."""
        for rod in self.rods:
            assert self._colliders is not None
            rod.step(bodies, self._colliders)

    def write_state(self, state: StateRecord) -> None:
        """Write the elements of every rod into a state record."""
        for rod in self.rods:
            rod.write(state)

    def reset(self) -> None:
        """Put every rod back to its initial shape, at rest."""
        for rod in self.rods:
            rod.reset()
        if self._colliders is not None:
            self._colliders.restart()

    def heal(self) -> list[Diagnostic]:
        """Put rods that diverged back to their initial shape, and say so."""
        found = []
        for rod in self.rods:
            if not rod.finite():
                rod.reset()
                message = f"rod '{rod.chain.name}' diverged and was put back to its initial shape"
                found.append(Diagnostic(Severity.ERROR, message, code="diverged"))
        return found

    def memory(self) -> list[dict[str, Array]]:
        """Everything that lasts from tick to tick."""
        if self._colliders is not None:
            self._colliders.restart()
        return [rod.memory() for rod in self.rods]

    def recall(self, memory: list[dict[str, Array]]) -> None:
        """Continue from `memory`."""
        for rod, kept in zip(self.rods, memory, strict=True):
            rod.recall(kept)
        if self._colliders is not None:
            self._colliders.restart()


def _inverse(body: Body) -> Array:
    """Inverse principal moments (3,); a rotation without inertia is that of a ball of 1 mm."""
    if body.static:
        return np.zeros(3)
    ball = 0.4 * body.mass * 1e-6
    return np.asarray(1.0 / np.where(body.inertia > 0.0, body.inertia, ball))


def _tie(joint: Joint, first: int) -> _Tie:
    """A joint as the solver wants it; ``first`` is the body that comes first in the chain."""
    T_parent, T_child = joint.T_parent_a, joint.T_child_b
    T_a, T_b = (T_parent, T_child) if joint.parent == first else (T_child, T_parent)
    six = joint.six_dof
    if six is not None:
        stiffness, damping = six.stiffness[3:].copy(), six.damping[3:].copy()
        locked = six.low[3:] == six.high[3:]
        stiffness[locked], damping[locked] = RIGID, 0.0
    elif joint.type is JointType.P2P:
        stiffness, damping = np.zeros(3), np.zeros(3)
    else:
        stiffness, damping = np.full(3, RIGID), np.zeros(3)
    a, b = matrix_pose7(T_a), matrix_pose7(T_b)
    return _Tie(a[:3], b[:3], a[3:], b[3:], stiffness, damping)
