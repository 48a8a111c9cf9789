"""Builds the Bullet multibody of one articulation of the scene.

Link frames sit at the joints' constraint frames; the inertial frame of each link is the ADF
inertial frame I of its body, so that Bullet's centre-of-mass pose is the pose of I. A static root with
links below it stands as a body of its own beside a base without shape: for what touches the root
Bullet would otherwise work through all links, in three rows a contact point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.mesh import CollisionCache
from ligature.model.axis import Axis
from ligature.model.frames import inverse, matrix_quaternion
from ligature.model.mechanism import Chain, chain_of
from ligature.model.scene import Articulation, Body, Closure, JointType, Scene
from ligature.physics import shapes
from ligature.physics.inertias import LEAST_INERTIA, inertia_of
from ligature.physics.response import moved_inertias

Array = NDArray[np.float64]

LIGHT = 1e-3
"""Mass and inertia of a link between two axes of one joint, as a part of the body it carries."""

POINT = 1e-3
"""Mass of the end of a point-to-point joint that slides along what the other joints hold, as a part of its body's."""

LIMIT_SLACK = 1e-9
"""Travel in metres or radians beyond a limit: a joint at rest exactly on it would cost Bullet a constraint row."""


STIFFEST, MOST_DAMPED = 16.0, 0.8
"""A spring acts in full up to m / (16 dt²), a damper up to 0.8 m / dt (as in Bullet's
`btGeneric6DofSpring2Constraint`)."""


@dataclass
class _Plan:
    """Columns of pybullet.createMultiBody, one entry a link; the link of each body, and the axis of each link.

    ``start`` has the position of every degree of freedom as the scene starts.
    """

    dt: float
    link_of: dict[int, int]
    T_link_inertial: dict[int, Array]
    axes: list[tuple[int, int, Axis, float]] = field(default_factory=list)
    start: list[float] = field(default_factory=list)
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

    def append(self, outer: Body, inner: Body, chain: Chain, shape: int) -> int:
        """Add the links of one joint and of the body ``outer`` that it carries; the last of them."""
        T_parent_link = self.T_link_inertial[chain.inner] @ chain.T_inner
        parent = self.link_of[chain.inner]
        inertia = _inertia_on(outer, inner, chain.axes, self.dt)
        moved = [_effective(outer, inertia, axis, chain.T_outer) for axis in chain.axes]
        if any(axis.sprung for axis in chain.axes):
            frames = (chain.T_inner, chain.T_outer)
            least = moved_inertias((inner.mass, outer.mass), (inertia_of(inner), inertia), frames, chain.axes)
            moved = [float(m) if axis.sprung else e for axis, e, m in zip(chain.axes, moved, least, strict=True)]
        for axis, mass in zip(chain.axes[:-1], moved, strict=False):
            self.masses.append(LIGHT * max(outer.mass, 1e-6))
            self.inertias.append(np.full(3, LIGHT * max(float(inertia.max()), LEAST_INERTIA)))
            self.shapes.append(shapes.NO_SHAPE)
            self._add(parent, _joint_type(axis), axis.direction, T_parent_link, np.eye(4))
            parent = len(self.masses) - 1
            self.axes.append((parent, chain.joint, axis, mass))
            T_parent_link = np.eye(4)
        self.masses.append(outer.mass)
        self.inertias.append(inertia)
        self.shapes.append(shape)
        last = chain.axes[-1] if chain.axes else None
        type_ = pybullet.JOINT_FIXED if last is None else _joint_type(last)
        direction = np.array([0.0, 0.0, 1.0]) if last is None else last.direction
        self._add(parent, type_, direction, T_parent_link, inverse(chain.T_outer))
        link = len(self.masses) - 1
        if last is not None:
            self.axes.append((link, chain.joint, last, moved[-1]))
        return link

    def _add(self, parent: int, type_: int, axis: Array, T_parent_link: Array, T_link_inertial: Array) -> None:
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
    start: list[float]
    """Position of every degree of freedom as the scene starts."""
    ends: dict[int, int]
    """Link at the end of each closing joint that starts from this tree."""
    masses: list[float]
    inertias: list[Array]
    """Mass and principal moments (3,) of the base and of each link."""
    damping: tuple[float, float] = (0.0, 0.0)
    """Linear and angular damping by Bullet, in 1/s."""

    def place(self, body: int) -> tuple[int, int]:
        """Bullet's id and link of a body."""
        link = self.link_of[body]
        return (self.stand, -1) if link < 0 else (self.uid, link)

    def put_joints(self, client: int) -> None:
        """Put all joints where they start, at rest."""
        for (link, *_), position in zip(self.axes, self.start, strict=True):
            pybullet.resetJointState(self.uid, link, position, 0.0, physicsClientId=client)

    @property
    def ways_to_middle(self) -> list[int]:
        """For every axis, how many axes on the middle one of three turning axes is; 0 but for the two others."""
        ways = [0] * len(self.axes)
        turning: dict[int, list[int]] = {}
        for row, (_, joint, axis, _) in enumerate(self.axes):
            if not axis.prismatic:
                turning.setdefault(joint, []).append(row)
        for rows in turning.values():
            if len(rows) >= 3:
                outer, middle, inner = rows[-3:]
                ways[outer], ways[inner] = middle - outer, middle - inner
        return ways

    @property
    def bases(self) -> tuple[int, ...]:
        """The ids that move when the root is put elsewhere."""
        return (self.uid,) if self.stand == self.uid else (self.stand, self.uid)


def build(client: int, cache: CollisionCache, scene: Scene, articulation: Articulation, dt: float) -> Tree:
    """Create the multibody of ``articulation`` at the poses of the scene's files, for ticks of ``dt``."""
    bodies, joints = _shared_out(scene), scene.joints
    root = bodies[articulation.links[0].body]
    plan = _Plan(dt, {root.index: -1}, {root.index: np.eye(4)})
    for link in articulation.links[1:]:
        assert link.joint is not None
        outer = bodies[link.body]
        chain = chain_of(joints[link.joint], joints[link.joint].child == outer.index)
        T_link_body = inverse(outer.T_body_inertial @ chain.T_outer)
        shape = shapes.create(client, cache, outer.colliders, T_link_body, True, outer.collision_margin)
        plan.link_of[outer.index] = plan.append(outer, bodies[chain.inner], chain, shape)
        plan.T_link_inertial[outer.index] = inverse(chain.T_outer)
        plan.start += _positions(scene, chain)
    ends = _append_ends(scene, bodies, plan)
    uid, stand = _create(client, cache, scene, root, plan)
    tree = Tree(
        uid, stand, root.index, plan.link_of, plan.axes, root.static, plan.frames(), plan.start, ends,
        [root.mass, *plan.masses], [inertia_of(root), *plan.inertias],
    )  # fmt: skip
    _set_dynamics(client, tree, plan, bodies)
    tree.put_joints(client)
    return tree


def _append_ends(scene: Scene, bodies: list[Body], plan: _Plan) -> dict[int, int]:
    """Append a link for each closing joint that starts from this tree and needs one; the links by joint."""
    ends = {}
    for closure in scene.closures:
        if closure.inner in plan.link_of and needs_link(scene, closure):
            end, chain = _end(scene, bodies, closure)
            ends[closure.joint] = plan.append(end, bodies[chain.inner], chain, shapes.NO_SHAPE)
            plan.start += [0.0] * len(closure.free) + _positions(scene, chain)
    return ends


def _create(client: int, cache: CollisionCache, scene: Scene, root: Body, plan: _Plan) -> tuple[int, int]:
    """Create the multibody of a plan: its id, and that under which the shapes of its ``root`` stand.

    The shapes of a static root with links are a static body of their own.
    """
    T_world_inertial = scene.start.roots[root.index] @ root.T_body_inertial
    at = {
        "basePosition": T_world_inertial[:3, 3].tolist(),
        "baseOrientation": matrix_quaternion(T_world_inertial[:3, :3]).tolist(),
        "physicsClientId": client,
    }
    T_own = inverse(root.T_body_inertial)
    colliders = () if any(volume.body == root.index for volume in scene.volumes) else root.colliders
    shape = shapes.create(client, cache, colliders, T_own, not root.static, root.collision_margin)
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
    return uid, uid if stand is None else stand


def _positions(scene: Scene, chain: Chain) -> list[float]:
    """Where the axes of a joint start, in the order of its links."""
    return [scene.start.coordinates[chain.joint][i] for i in chain.order]


# --- the ends of closing joints -----------------------------------------------------------------


def _end(scene: Scene, bodies: Sequence[Body], closure: Closure) -> tuple[Body, Chain]:
    """The body that a closing joint carries, and the joint, free where the rest of its loop constrains it.

    It carries its part of the outer body, which a weld holds to the rest; to a point-to-point joint, a point.
    """
    joint = scene.joints[closure.joint]
    chain = chain_of(joint, joint.child == closure.outer)
    chain = replace(chain, axes=(*closure.free, *chain.axes))
    outer = bodies[closure.outer]
    if not is_point(scene, closure):
        return outer, chain
    mass = POINT * outer.mass
    ball = np.full(3, 0.4 * mass * 0.01**2)
    return replace(outer, mass=mass, inertia=ball), replace(chain, T_outer=np.eye(4))


def _shared_out(scene: Scene) -> list[Body]:
    """The bodies, each without the share of its mass that the ends of closing joints have."""
    parts: dict[int, int] = {}
    for closure in scene.closures:
        if not is_point(scene, closure):
            parts[closure.outer] = parts.get(closure.outer, 1) + 1
    bodies = list(scene.bodies)
    for index, count in parts.items():
        body = bodies[index]
        bodies[index] = replace(body, mass=body.mass / count, inertia=inertia_of(body) / count)
    return bodies


def is_point(scene: Scene, closure: Closure) -> bool:
    """Whether a closing joint holds a point, not a frame."""
    return scene.joints[closure.joint].type is JointType.P2P


def needs_link(scene: Scene, closure: Closure) -> bool:
    """Whether a closing joint moves along axes of its own; a point that is held in all directions does not."""
    return not is_point(scene, closure) or len(closure.free) in (1, 2)


def _inertia_on(body: Body, inner: Body, steps: Sequence[Axis], dt: float) -> Array:
    """`inertia_of` a body on the axes of its joint to an ``inner`` one.

    Where the file leaves the inertia open it is large enough for the springs and dampers to act in full in
    ticks of ``dt``; else they are capped (`STIFFEST`), and a tissue hole swings where its file makes it stiff. It is
    not made larger than that of an inner body that moves, which the Coriolis moments of such a one would throw.
    """
    turning = [axis for axis in steps if not axis.prismatic]
    if not body.inertia_estimated or body.mass == 0.0 or not turning:
        return inertia_of(body)
    needed = max(max(STIFFEST * dt * dt * axis.stiffness, dt * axis.damping / MOST_DAMPED) for axis in turning)
    return np.maximum(inertia_of(body), needed if inner.mass == 0.0 else min(needed, float(inertia_of(inner).min())))


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
    """Rate in 1/s of the velocity decay (1 − damping)^t (Bullet's `btRigidBody`)."""
    return -math.log1p(-min(damping, 1.0 - 1e-9))


def is_alone(tree: Tree, bodies: tuple[Body, ...]) -> bool:
    """Whether a tree is one moving body: its damping is applied exactly (`World`), not by Bullet.

    Bullet's damping of multibodies has a quadratic part besides the linear one.
    """
    return not tree.frames and not bodies[tree.root].static


def _set_dynamics(client: int, tree: Tree, plan: _Plan, bodies: Sequence[Body]) -> None:
    root = bodies[tree.root]
    members = [bodies[index] for index in tree.link_of if not bodies[index].static]
    alone = not tree.frames
    linear = 0.0 if alone else max((decay_rate(b.linear_damping) for b in members), default=0.0)
    angular = 0.0 if alone else max((decay_rate(b.angular_damping) for b in members), default=0.0)
    tree.damping = linear, angular
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
