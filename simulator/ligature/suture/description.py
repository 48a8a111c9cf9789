"""What a rod is made of: elements, the joints between them, and the attachments of its ends; SI units.

An element is a rigid capsule with an inertial frame I; joint j lies between elements j and j + 1. An
attachment holds one element to a body outside the rod. Frames of joints are given in the I of either side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.model.frames import inverse, matrix_quaternion, minimal_rotation
from ligature.model.scene import Joint, JointType, RodChain, Scene

Array = NDArray[np.float64]

LOCKED_STIFFNESS = 4000.0
"""Axial stiffness E A in newtons of a thread whose file locks the translation of its joints: 0.05 % at 2 N."""

FREE = np.array([[1.0] * 3, [-1.0] * 3])
"""Low and high of three free axes: low above high, as the format writes it."""


@dataclass(frozen=True, eq=False)
class Attachment:
    """Holds element ``element`` to body ``body`` of the scene.

    ``T_element_a`` and ``T_body_b`` (4, 4) are the attached frames in the inertial frames of element and
    body; ``stiffness``, ``damping``, ``rest``, ``low``, ``high`` (3,) are those of the rotation, as in
    `RodDescription`. At a pull above ``release`` newtons it lets go.
    """

    element: int
    body: int
    T_element_a: Array
    T_body_b: Array
    stiffness: Array
    damping: Array
    rest: Array
    low: Array
    high: Array
    release: float = np.inf


@dataclass(frozen=True, eq=False)
class RodDescription:
    """A rod of n elements.

    Attributes
    ----------
    name
        For messages.
    T_world_inertial, T_body_inertial
        (n, 4, 4) initial pose of each element's inertial frame, and its place in the body frame B.
    mass, inertia
        (n,) and (n, 3), principal moments.
    ends
        (n, 2, 3) ends of the capsule's segment, in I.
    radius, friction
        (n,) capsule radius, and Coulomb coefficient as in ADF ``friction.static``.
    gravity, damping
        (n, 3) acceleration in world axes; (n, 2) fraction of linear and angular speed lost in a second.
    pivots, frames
        (n - 1, 2, 3) and (n - 1, 2, 3, 3): the joint in I of its two elements.
    compliance
        (n - 1,) compliance of the joint's translation in m/N.
    joint_stiffness, joint_damping, rest, low, high
        (n - 1, 3) about the axes of the joint frame: N m/rad, N m s/rad, rad. ``low > high`` is free.
    yield_moment
        (n - 1,) moment in N m from which a bend stays; infinite for an elastic joint.
    attachments
        Attachments of the rod to bodies.
    bodies
        (n,) body indices of the elements in the scene, empty for a rod outside a scene.
    """

    name: str
    T_world_inertial: Array
    T_body_inertial: Array
    mass: Array
    inertia: Array
    ends: Array
    radius: Array
    friction: Array
    gravity: Array
    damping: Array
    pivots: Array
    frames: Array
    compliance: Array
    joint_stiffness: Array
    joint_damping: Array
    rest: Array
    low: Array
    high: Array
    yield_moment: Array
    attachments: tuple[Attachment, ...] = ()
    bodies: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        lengths = np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)
        if len(self.mass) < 2:
            raise ValueError(f"rod '{self.name}' has {len(self.mass)} elements; it needs at least 2")
        if not np.all(lengths > 0.0):
            i = int(np.argmin(lengths))
            raise ValueError(f"rod '{self.name}': element {i} has length {lengths[i]:g} m; give it a positive one")
        if not (np.all(self.mass > 0.0) and np.all(self.inertia > 0.0)):
            i = int(np.argmin(np.minimum(self.mass, self.inertia.min(axis=1))))
            raise ValueError(
                f"rod '{self.name}': element {i} has mass {self.mass[i]:g} kg and inertia "
                f"{self.inertia[i].tolist()} kg m²; all must be positive"
            )
        if not np.all(np.isfinite(self.T_world_inertial)):
            raise ValueError(f"rod '{self.name}' starts at poses that are not finite")


def from_material(
    points: ArrayLike,
    diameter: float,
    youngs_modulus: float,
    density: float,
    *,
    poisson_ratio: float = 0.4,
    friction: float = 0.5,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    damping: float = 0.0,
    yield_strain: float = np.inf,
    straight: bool = True,
    attachments: Sequence[Attachment] = (),
    name: str = "rod",
) -> RodDescription:
    """A rod of round section through ``points`` (n + 1, 3), one element between neighbours.

    Bending stiffness of a joint is E I over the length between element centres, twist G J over it,
    stretch E A (Kirchhoff rod). The rod is stress-free when ``straight``, or else in the shape of the
    points. ``damping`` is the internal one, in seconds: moment per stiffness and rate of bending.
    Bends stay that stretch the skin by more than ``yield_strain``.

    Raises ValueError for fewer than three points, coinciding points, or material data that are not positive.
    """
    p = np.asarray(points, dtype=float)
    for label, value in (("diameter", diameter), ("Young's modulus", youngs_modulus), ("density", density)):
        if not value > 0.0:
            raise ValueError(f"rod '{name}': {label} is {value:g}; it must be positive")
    edges = np.diff(p, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    if len(lengths) < 2 or not np.all(lengths > 0.0):
        raise ValueError(f"rod '{name}' needs at least three points, no two neighbours alike")
    n, radius = len(lengths), 0.5 * diameter
    area, moment = np.pi * radius**2, np.pi * radius**4 / 4.0
    T = _elements_between(p)
    mass = density * area * lengths
    across = mass * (lengths**2 / 12.0 + radius**2 / 4.0)
    half = np.stack([np.zeros(n), np.zeros(n), 0.5 * lengths], axis=1)
    between = 0.5 * (lengths[:-1] + lengths[1:])
    shear_modulus = youngs_modulus / (2.0 * (1.0 + poisson_ratio))
    bend, twist = youngs_modulus * moment / between, 2.0 * shear_modulus * moment / between
    frames = np.tile(np.eye(3), (n - 1, 2, 1, 1))
    if not straight:
        frames[:, 1] = np.swapaxes(T[1:, :3, :3], 1, 2) @ T[:-1, :3, :3]
    stiffness = np.stack([bend, bend, twist], axis=1)
    free = np.tile(FREE[:, None, :], (1, n - 1, 1))
    return RodDescription(
        name=name,
        T_world_inertial=T,
        T_body_inertial=np.tile(np.eye(4), (n, 1, 1)),
        mass=mass,
        inertia=np.stack([across, across, 0.5 * mass * radius**2], axis=1),
        ends=np.stack([-half, half], axis=1),
        radius=np.full(n, radius),
        friction=np.full(n, friction),
        gravity=np.tile(np.asarray(gravity, dtype=float), (n, 1)),
        damping=np.zeros((n, 2)),
        pivots=np.stack([half[:-1], -half[1:]], axis=1),
        frames=frames,
        compliance=between / (youngs_modulus * area),
        joint_stiffness=stiffness,
        joint_damping=damping * stiffness,
        rest=np.zeros((n - 1, 3)),
        low=free[0],
        high=free[1],
        yield_moment=bend * yield_angle(yield_strain, radius, between),
        attachments=tuple(attachments),
    )


def _elements_between(points: Array) -> Array:
    """Poses (n, 4, 4) of elements between ``points`` (n + 1, 3): z along each, without twist from one to the next."""
    edges = np.diff(points, axis=0)
    along = edges / np.linalg.norm(edges, axis=1)[:, None]
    T = np.tile(np.eye(4), (len(edges), 1, 1))
    R = minimal_rotation(np.array([0.0, 0.0, 1.0]), along[0])
    for i in range(len(edges)):
        if i > 0:
            R = minimal_rotation(along[i - 1], along[i]) @ R
        T[i, :3, :3], T[i, :3, 3] = R, 0.5 * (points[i] + points[i + 1])
    return T


def yield_angle(strain: float, radius: float, length: Array) -> Array:
    """Angle in radians, over a ``length``, at which the skin of a round thread is stretched by ``strain``."""
    return strain / radius * length


def from_chain(scene: Scene, chain: RodChain) -> RodDescription:
    """The rod of a recognised chain: its bodies' masses and shapes, its joints' springs (as in AMBF)."""
    bodies = [scene.bodies[i] for i in chain.bodies]
    joints = [scene.joints[i] for i in chain.joints]
    n = len(bodies)
    sides = [_sides(joint, chain.bodies[j]) for j, joint in enumerate(joints)]
    springs = [_springs(joint, forward) for joint, (_a, _b, forward) in zip(joints, sides, strict=True)]
    attachments = tuple(_attachment(scene.joints[i], chain.bodies) for i in chain.anchors)
    pivots = np.array([[a[:3, 3], b[:3, 3]] for a, b, _ in sides])
    T = np.array([body.T_body_inertial for body in bodies])
    return RodDescription(
        name=chain.name,
        T_world_inertial=np.array([body.T_world_body for body in bodies]) @ T,
        T_body_inertial=T,
        mass=np.array([body.mass for body in bodies]),
        inertia=np.array([body.inertia for body in bodies]),
        ends=_ends(pivots, attachments, chain),
        radius=np.full(n, chain.radius),
        friction=np.array([body.friction for body in bodies]),
        gravity=np.array([body.gravity for body in bodies]),
        damping=np.array([[body.linear_damping, body.angular_damping] for body in bodies]),
        pivots=pivots,
        frames=np.array([[a[:3, :3], b[:3, :3]] for a, b, _ in sides]),
        compliance=0.5 * (chain.lengths[:-1] + chain.lengths[1:]) / LOCKED_STIFFNESS,
        joint_stiffness=np.array([s[0] for s in springs]),
        joint_damping=np.array([s[1] for s in springs]),
        rest=np.array([s[2] for s in springs]),
        low=np.array([s[3] for s in springs]),
        high=np.array([s[4] for s in springs]),
        yield_moment=np.array([j.six_dof.yield_moment if j.six_dof else np.inf for j in joints]),
        attachments=attachments,
        bodies=chain.bodies,
    )


def _sides(joint: Joint, first: int) -> tuple[Array, Array, bool]:
    """Joint frame in the earlier and the later element, and whether the earlier one is the parent."""
    if joint.parent == first:
        return joint.T_parent_a, joint.T_child_b, True
    return joint.T_child_b, joint.T_parent_a, False


def _springs(joint: Joint, forward: bool) -> tuple[Array, Array, Array, Array, Array]:
    """Angular stiffness, damping, rest, low and high as seen from the earlier element.

    The rotation vector of a joint read from its child's side is that from its parent's, negated.
    """
    six = joint.six_dof
    if six is None:
        return np.zeros(3), np.zeros(3), np.zeros(3), *FREE
    k, d, rest, low, high = six.stiffness[3:], six.damping[3:], six.equilibrium[3:], six.low[3:], six.high[3:]
    return (k, d, rest, low, high) if forward else (k, d, -rest, -high, -low)


def _attachment(joint: Joint, elements: tuple[int, ...]) -> Attachment:
    element = elements.index(joint.child if joint.child in elements else joint.parent)
    a, b, forward = _sides(joint, elements[element])
    body = joint.child if forward else joint.parent
    k, d, rest, low, high = _springs(joint, forward)
    if joint.type is JointType.FIXED:
        low = high = np.zeros(3)
    return Attachment(element, body, a, b, k, d, rest, low, high, joint.release)


def _ends(pivots: Array, attachments: tuple[Attachment, ...], chain: RodChain) -> Array:
    """Segment of each element, between its pivots; a free end mirrors the pivot on the other side."""
    n = len(chain.lengths)
    ends = np.empty((n, 2, 3))
    ends[1:, 0], ends[:-1, 1] = pivots[:, 1], pivots[:, 0]
    attached = {attachment.element: attachment.T_element_a[:3, 3] for attachment in attachments}
    for i, end, other in ((0, 0, ends[0, 1]), (n - 1, 1, ends[n - 1, 0])):
        mirrored = other * (1.0 - chain.lengths[i] / max(float(np.linalg.norm(other)), 1e-12))
        near = attached.get(i, mirrored)
        ends[i, end] = near if np.linalg.norm(near - other) > 0.5 * chain.lengths[i] else mirrored
    return ends


def frame_quaternions(frames: Array) -> Array:
    """Quaternions (..., 4) of rotations (..., 3, 3)."""
    flat = frames.reshape(-1, 3, 3)
    return np.array([matrix_quaternion(R) for R in flat]).reshape(*frames.shape[:-2], 4)


def body_pose(T_world_inertial: Array, T_body_inertial: Array) -> Array:
    """Pose of a body frame from that of its inertial frame, both (4, 4)."""
    return T_world_inertial @ inverse(T_body_inertial)
