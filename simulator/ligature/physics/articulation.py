"""Builds the Bullet multibody of one articulation of the scene.

Link frames sit at the joints' constraint frames; the inertial frame of each link is the ADF
inertial frame I of its body, so that Bullet's centre-of-mass pose is the pose of I. A static root with
links below it stands as a body of its own beside a base without shape: for what touches the root
Bullet would otherwise work through all links, in three rows a contact point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.mesh import CollisionCache
from ligature.model.frames import inverse, matrix_quaternion
from ligature.model.scene import Articulation, Body, Joint, Scene
from ligature.physics import shapes
from ligature.physics.axes import Axis, axes_of
from ligature.physics.response import moved_inertia

Array = NDArray[np.float64]

LIGHT = 1e-3
"""Mass and inertia of a link between two axes of one joint, as a part of the body it carries."""

LEAST_INERTIA = 1e-12
"""Moments below this (kg·m²) are replaced by those of a 1 cm ball: Bullet cannot invert them."""

LIMIT_SLACK = 1e-9
"""Travel in metres or radians beyond a limit: a joint at rest exactly on it would cost Bullet a constraint row."""


STIFFEST, MOST_DAMPED = 16.0, 0.8
"""A spring acts in full up to m / (16 dt²), a damper up to 0.8 m / dt (ADF specification §15.4)."""


@dataclass
class _Plan:
    """Columns of pybullet.createMultiBody, one entry a link."""

    masses: list[float] = field(default_factory=list)
    inertias: list[Array] = field(default_factory=list)
    shapes: list[int] = field(default_factory=list)
    positions: list[list[float]] = field(default_factory=list)
    orientations: list[list[float]] = field(default_factory=list)
    inertial_positions: list[list[float]] = field(default_factory=list)
    inertial_orientations: list[list[float]] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    types: list[int] = field(default_factory=list)
    directions: list[list[float]] = field(default_factory=list)

    def add(self, parent: int, type_: int, axis: Array, T_parent_link: Array, T_link_inertial: Array) -> None:
        self.parents.append(parent + 1)
        self.types.append(type_)
        self.directions.append(axis.tolist())
        self.positions.append(T_parent_link[:3, 3].tolist())
        self.orientations.append(matrix_quaternion(T_parent_link[:3, :3]).tolist())
        self.inertial_positions.append(T_link_inertial[:3, 3].tolist())
        self.inertial_orientations.append(matrix_quaternion(T_link_inertial[:3, :3]).tolist())

    def frames(self) -> list[LinkFrame]:
        """Where the links sit."""
        return [
            LinkFrame(parent, type_, np.array(axis), np.array(at + around), np.array(offset + turn))
            for parent, type_, axis, at, around, offset, turn in zip(
                self.parents, self.types, self.directions, self.positions, self.orientations,
                self.inertial_positions, self.inertial_orientations, strict=True,
            )
        ]  # fmt: skip


@dataclass(frozen=True, eq=False)
class LinkFrame:
    """Where a link sits: ``parent`` counts links from 1, 0 is the base; ``type`` is Bullet's joint type.

    ``axis`` (3,) is in the link frame; ``parent_link`` (7,) is the link frame in its parent's with the joint at
    zero, that of the base being its inertial frame; ``link_inertial`` (7,) the inertial frame in the link frame.
    """

    parent: int
    type: int
    axis: Array
    parent_link: Array
    link_inertial: Array


@dataclass
class Tree:
    """A Bullet multibody: its id, link of each body (-1 is the base), and its single axes by link.

    ``stand`` is the id under which the root's shapes stand: ``uid``, or a static body of their own.
    """

    uid: int
    stand: int
    root: int
    link_of: dict[int, int]
    axes: list[tuple[int, int, Axis, float]]
    """Link, ADF joint, axis and effective mass or inertia of every degree of freedom."""
    static: bool
    frames: list[LinkFrame]

    @property
    def moving_links(self) -> list[int]:
        """Links that carry a body."""
        return [link for link in self.link_of.values() if link >= 0]

    def place(self, body: int) -> tuple[int, int]:
        """Bullet's id and link of a body."""
        link = self.link_of[body]
        return (self.stand, -1) if link < 0 else (self.uid, link)

    @property
    def bases(self) -> tuple[int, ...]:
        """The ids that move when the root is put elsewhere."""
        return (self.uid,) if self.stand == self.uid else (self.stand, self.uid)


def build(client: int, cache: CollisionCache, scene: Scene, articulation: Articulation, dt: float) -> Tree:
    """Create the multibody of ``articulation`` at the poses of the scene's files, for ticks of ``dt``."""
    bodies, joints = scene.bodies, scene.joints
    root = bodies[articulation.links[0].body]
    plan = _Plan()
    link_of = {root.index: -1}
    T_link_inertial = {root.index: np.eye(4)}
    axes: list[tuple[int, int, Axis, float]] = []
    for link in articulation.links[1:]:
        assert link.joint is not None
        inner = bodies[articulation.links[link.parent_link].body]
        _append(plan, client, cache, bodies[link.body], joints[link.joint], inner, link_of, T_link_inertial, axes, dt)
    T_world_inertial = root.T_world_body @ root.T_body_inertial
    at = {
        "basePosition": T_world_inertial[:3, 3].tolist(),
        "baseOrientation": matrix_quaternion(T_world_inertial[:3, :3]).tolist(),
        "physicsClientId": client,
    }
    T_own = inverse(root.T_body_inertial)
    shape = shapes.create(client, cache, root.colliders, T_own, not root.static, root.collision_margin)
    stand = None
    if root.static and plan.masses and shape != shapes.NO_SHAPE:
        stand = pybullet.createMultiBody(baseMass=0.0, baseCollisionShapeIndex=shape, **at)
        shape = shapes.NO_SHAPE
    uid = pybullet.createMultiBody(
        baseMass=root.mass,
        baseCollisionShapeIndex=shape,
        linkMasses=plan.masses,
        linkCollisionShapeIndices=plan.shapes,
        linkVisualShapeIndices=[-1] * len(plan.masses),
        linkPositions=plan.positions,
        linkOrientations=plan.orientations,
        linkInertialFramePositions=plan.inertial_positions,
        linkInertialFrameOrientations=plan.inertial_orientations,
        linkParentIndices=plan.parents,
        linkJointTypes=plan.types,
        linkJointAxis=plan.directions,
        flags=pybullet.URDF_USE_SELF_COLLISION | pybullet.URDF_MAINTAIN_LINK_ORDER,
        **at,
    )
    tree = Tree(uid, uid if stand is None else stand, root.index, link_of, axes, root.static, plan.frames())
    _set_dynamics(client, tree, plan, bodies)
    return tree


def _append(
    plan: _Plan,
    client: int,
    cache: CollisionCache,
    outer: Body,
    joint: Joint,
    inner: Body,
    link_of: dict[int, int],
    T_link_inertial: dict[int, Array],
    axes: list[tuple[int, int, Axis, float]],
    dt: float,
) -> None:
    """Add the links of one joint and the body it carries away from the root."""
    forward = joint.parent == inner.index
    T_inner_frame = joint.T_parent_a if forward else joint.T_child_b
    T_outer_frame = joint.T_child_b if forward else joint.T_parent_a
    free = axes_of(joint) or ()
    steps = tuple(free) if forward else tuple(axis.reversed() for axis in reversed(free))
    T_parent_link = T_link_inertial[inner.index] @ T_inner_frame
    parent = link_of[inner.index]
    inertia = _inertia_on(outer, steps, dt)

    def moved(axis: Axis) -> float:
        if inner.static or outer.static or not axis.sprung:
            return _effective(outer, inertia, axis, T_outer_frame)
        frames = (T_inner_frame, T_outer_frame)
        return moved_inertia((inner.mass, outer.mass), (inertia_of(inner), inertia), frames, steps, steps.index(axis))

    for axis in steps[:-1]:
        plan.masses.append(LIGHT * max(outer.mass, 1e-6))
        plan.inertias.append(np.full(3, LIGHT * max(float(inertia.max()), LEAST_INERTIA)))
        plan.shapes.append(shapes.NO_SHAPE)
        plan.add(parent, _joint_type(axis), axis.direction, T_parent_link, np.eye(4))
        parent = len(plan.masses) - 1
        axes.append((parent, joint.index, axis, moved(axis)))
        T_parent_link = np.eye(4)
    T_own = inverse(T_outer_frame)
    plan.masses.append(outer.mass)
    plan.inertias.append(inertia)
    T_link_body = T_own @ inverse(outer.T_body_inertial)
    plan.shapes.append(shapes.create(client, cache, outer.colliders, T_link_body, True, outer.collision_margin))
    last = steps[-1] if steps else None
    type_ = pybullet.JOINT_FIXED if last is None else _joint_type(last)
    direction = np.array([0.0, 0.0, 1.0]) if last is None else last.direction
    plan.add(parent, type_, direction, T_parent_link, T_own)
    link_of[outer.index] = len(plan.masses) - 1
    T_link_inertial[outer.index] = T_own
    if last is not None:
        axes.append((link_of[outer.index], joint.index, last, moved(last)))


def inertia_of(body: Body) -> Array:
    """Principal moments (3,) that Bullet can invert: those given, or a 1 cm ball's where they are zero."""
    ball = 0.4 * max(body.mass, 1e-6) * 0.01**2
    return np.where(body.inertia > LEAST_INERTIA, body.inertia, ball) if body.mass > 0 else np.zeros(3)


def _inertia_on(body: Body, steps: Sequence[Axis], dt: float) -> Array:
    """`inertia_of` a body on the axes of its joint.

    Where the file leaves the inertia open it is large enough for the springs and dampers to act in full in
    ticks of ``dt``; else they are capped (§15.4), and a tissue hole swings where its file says it is stiff.
    """
    turning = [axis for axis in steps if not axis.prismatic]
    if not body.inertia_estimated or body.mass == 0.0 or not turning:
        return inertia_of(body)
    needed = max(max(STIFFEST * dt * dt * axis.stiffness, dt * axis.damping / MOST_DAMPED) for axis in turning)
    return np.maximum(inertia_of(body), needed)


def _effective(body: Body, inertia: Array, axis: Axis, T_inertial_frame: Array) -> float:
    """Mass, or moment of inertia about the axis, that a spring on this axis moves."""
    if axis.prismatic:
        return body.mass
    direction = T_inertial_frame[:3, :3] @ axis.direction
    arm = np.cross(T_inertial_frame[:3, 3], direction)
    return float(inertia @ direction**2 + body.mass * (arm @ arm))


def _joint_type(axis: Axis) -> int:
    return int(pybullet.JOINT_PRISMATIC if axis.prismatic else pybullet.JOINT_REVOLUTE)


def decay_rate(damping: float) -> float:
    """Rate in 1/s of the velocity decay (1 − damping)^t (ADF specification §12.1)."""
    return float(-np.log1p(-min(damping, 1.0 - 1e-9)))


def is_alone(tree: Tree, bodies: tuple[Body, ...]) -> bool:
    """Whether a tree is one moving body: its damping is applied exactly (`World`), not by Bullet.

    Bullet's damping of multibodies has a quadratic part besides the linear one.
    """
    return len(tree.link_of) == 1 and not bodies[tree.root].static


def _set_dynamics(client: int, tree: Tree, plan: _Plan, bodies: tuple[Body, ...]) -> None:
    root = bodies[tree.root]
    members = [bodies[index] for index in tree.link_of if not bodies[index].static]
    alone = len(tree.link_of) == 1
    linear = 0.0 if alone else max((decay_rate(b.linear_damping) for b in members), default=0.0)
    angular = 0.0 if alone else max((decay_rate(b.angular_damping) for b in members), default=0.0)
    pybullet.changeDynamics(tree.uid, -1, linearDamping=linear, angularDamping=angular, physicsClientId=client)
    for link, (mass, inertia) in enumerate(zip(plan.masses, plan.inertias, strict=True)):
        pybullet.changeDynamics(
            tree.uid,
            link,
            mass=mass,
            localInertiaDiagonal=inertia.tolist(),
            jointDamping=0.0,
            physicsClientId=client,
        )
    if not root.static:
        pybullet.changeDynamics(
            tree.uid,
            -1,
            mass=root.mass,
            localInertiaDiagonal=inertia_of(root).tolist(),
            physicsClientId=client,
        )
    for index in tree.link_of:
        body = bodies[index]
        pybullet.changeDynamics(
            *tree.place(index), lateralFriction=body.friction, rollingFriction=body.rolling_friction,
            restitution=body.restitution, physicsClientId=client,
        )  # fmt: skip
    links = [link for link, *_ in tree.axes]
    if links:
        pybullet.setJointMotorControlArray(
            tree.uid, links, pybullet.VELOCITY_CONTROL, forces=[0.0] * len(links), physicsClientId=client
        )
    for link, _, axis, _ in tree.axes:
        if axis.low is not None and axis.high is not None:
            pybullet.changeDynamics(
                tree.uid, link, jointLowerLimit=axis.low - LIMIT_SLACK,
                jointUpperLimit=axis.high + LIMIT_SLACK, jointLimitForce=1e5,
                physicsClientId=client,
            )  # fmt: skip
