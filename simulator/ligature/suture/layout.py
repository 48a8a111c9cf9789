"""The arrays of a rod, grouped for compiled code; poses are of inertial frames I in world axes, SI units.

A rod is a chain of n nodes: its elements in order and, at either end, the body attached there. The other
bodies that it may touch follow the chain, N nodes in all. Joint j is between nodes j and
j + 1. Multipliers and their rows are scaled by dt²: a force f appears as f dt² (kg m).
"""

from __future__ import annotations

import enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class FrictionMode(enum.IntEnum):
    """What friction is in a solve."""

    SLIPS = 0
    """A constant force, the Coulomb limit."""
    STICKS = 1
    """A spring."""
    YIELDS = 2
    """A spring as stiff as the Coulomb limit allows."""


class Nodes(NamedTuple):
    """What moves: N nodes."""

    mass: Array  # (N,)
    inertia: Array  # (N, 3) principal moments
    fixed: NDArray[np.bool_]  # (N,) kinematically controlled: no force moves it
    met: NDArray[np.bool_]  # (N,) whether it takes part: bodies far from the rod do not
    gravity: Array  # (N, 3)
    keep: Array  # (N, 2) fraction of linear and angular speed that damping leaves after a tick
    x: Array  # (N, 3) centre of mass
    q: Array  # (N, 4)
    v: Array  # (N, 3)
    w: Array  # (N, 3) angular velocity
    radius: Array  # (N,) of the elements' capsules
    friction: Array  # (N,) Coulomb coefficient; that of a contact is the product of both sides'
    axis: Array  # (N, 2, 3) ends of the capsule's segment in I


class Joints(NamedTuple):
    """What holds the chain together: n - 1 joints."""

    pivot: Array  # (n - 1, 2, 3) in I of nodes j, j + 1
    frame: Array  # (n - 1, 2, 4) orientation of the joint frame in I of nodes j, j + 1
    compliance: Array  # (n - 1,) of the translation, m/N
    stiffness: Array  # (n - 1, 3) N m/rad about the axes of the joint frame
    damping: Array  # (n - 1, 3) N m s/rad
    rest: Array  # (n - 1, 3) rad
    low: Array  # (n - 1, 3) rad
    high: Array  # (n - 1, 3) rad
    stop: Array  # (n - 1,) stiffness beyond the limits, N m/rad
    yields: Array  # (n - 1,) moment from which a bend stays, N m; infinite where none does
    angle: Array  # (n - 1, 3) rotation vector of the joint, rad
    load: Array  # (n - 1, 6) force and moment on node j, times dt²


class Touches(NamedTuple):
    """Contact points; element ``node[:, 0]`` is pushed along ``normal`` off the node ``node[:, 1]``."""

    count: NDArray[np.int64]  # type: ignore[assignment]  # (1,)
    node: NDArray[np.int64]  # (C, 2)
    key: NDArray[np.int64]  # (C,) names the touched part; the same contact keeps its key
    local: Array  # (C, 2, 3) point in I of both nodes: on the axis of a capsule, on the skin of a body
    arm: Array  # (C, 2) from there to the skin, along the normal
    start: Array  # (C, 2, 3) that point at the start of the tick, world
    normal: Array  # (C, 3)
    gap: Array  # (C,) at the start of the tick
    target: Array  # (C,) gap to recover to within this tick, 0 or less
    friction: Array  # (C,) Coulomb coefficient
    slip: Array  # (C, 3) tangential displacement that friction resists
    press: Array  # (C,) normal force, N
    closed: NDArray[np.bool_]  # (C,)
    mode: NDArray[np.int64]  # (C,) a `FrictionMode`
    switches: NDArray[np.int64]  # (C,) of the mode in this tick
    room: Array  # (C,) gap beyond the target at which the last solve began
    begun: Array  # (C, 3) slip there
    ended: Array  # (C, 3) slip at its end
    push: Array  # (C, 3) force on the element where it began, times dt²
    bilateral: NDArray[np.bool_]  # (C,) a point constraint or a grasp: acts whatever the gap
    force: Array  # (C, 3) on the element, N


class Shapes(NamedTuple):
    """The convex parts of bodies around a rod."""

    node: NDArray[np.int64]  # (S,) of the body; -1 while it is far away
    kind: NDArray[np.int64]  # (S,) as in `ligature.mesh.distance`
    size: Array  # (S, 3)
    planes: Array  # (P, 4) of all hulls
    plane_range: NDArray[np.int64]  # (S, 2)
    pose: Array  # (S, 7) at the start of the tick
    box: Array  # (S, 2, 3) around the shape, world
    sweep: Array  # (S,) how far its surface may move in the tick
    friction: Array  # (S,)
    skip: NDArray[np.bool_]  # (S, n) elements that do not touch it


class Work(NamedTuple):
    """Scratch of a tick; nothing in it outlives the tick."""

    x: Array  # (N, 3) start of the tick
    q: Array  # (N, 4)
    xp: Array  # (N, 3) free motion
    qp: Array  # (N, 4)
    R: Array  # (N + 1, 3, 3)
    lever: Array  # (n - 1, 2, 3)
    B: Array  # (n - 1, 3, 3)
    c: Array  # (n - 1, 6)
    left: Array  # (2, 6) error of the first and last joint that a step leaves to later ones of its tick
    compliance: Array  # (n - 1, 6)
    H: Array  # (N, 6, 6); of H, and of Y and Z of the chain, only the lower half counts
    Y: Array  # (N, 6, 6)
    Z: Array  # (n - 1, 6, 6)
    g: Array  # (N, 6)
    d: Array  # (N, 6)
    load: Array  # (n - 1, 6)
    cg: Array  # (4, N, 6)
    coupled_load: Array  # (n - 1, 6)
    rows: NDArray[np.int64]  # (N,) nodes that contacts couple
    pushed: NDArray[np.bool_]  # (N,) bodies that contacts push
    K: Array  # (C, 3, 3) contact stiffness times dt²
    arms: Array  # (C, 2, 3) levers of each contact on its nodes
    limit: Array  # (C,) Coulomb limit of each contact in a careful step, N
    moved: Array  # (C, 3) displacement of each contact since the step was linearised
    aim: Array  # (C, 3) that of the last solve
    solved: Array  # (C, 3) force on the element by the last solve, N
    own_matrix: Array  # (N, 6, 6) H without contacts
    own_load: Array  # (N, 6)
    taken: Array  # (N, 6) correction so far
    felt: Array  # (2, 6, 6) what the next node feels of those eliminated on either side
    felt_load: Array  # (2, 6)
    sum6: Array  # (6,)
    kept_x: Array  # (N, 3) state at the start of the tick, and so on
    kept_q: Array  # (N, 4)
    kept_v: Array  # (N, 3)
    kept_w: Array  # (N, 3)
    kept_angle: Array  # (n - 1, 3)
    kept_load: Array  # (n - 1, 6)
    three: Array  # (3, 3)
    segment: Array  # (elements, 2, 3) of each capsule, world
    ahead: Array  # (elements, 2, 3) where it would be after the tick
    reach: Array  # (elements,) distance within which contacts are looked for
    clear: Array  # (elements,) distance that counts as touching although nothing moves
    box: Array  # (elements, 2, 3)
    thrown: Array  # (elements,) how far tension may throw it beyond its motion
    group_box: Array  # (elements, 2, 3) of `ligature.suture.contacts.GROUP` elements
    group_thrown: Array  # (elements,)
    pair: Array  # (2, 2, 3) two segments on their way


class Constants(NamedTuple):
    """Numbers of a rod that never change, (1,) each."""

    first: NDArray[np.int64]  # row of the first element among the nodes
    self_skip: NDArray[np.int64]  # elements on either side of one that do not touch it
    stiffness: Array  # of contacts, N/m
    max_speed: Array  # beyond which the rod has diverged, m/s
    dt: Array  # length of a tick, s


class RodArrays(NamedTuple):
    """All that a tick of a rod works on, but contact points, which change places, and constraints."""

    constants: Constants
    nodes: Nodes
    joints: Joints
    shapes: Shapes
    work: Work
    shape_poses: Array  # (S, 7) as `Shapes.pose`, kept over a tick
    impulse: Array  # (N, 6) of the tick
    tension: Array  # (elements,) N
    pushed: NDArray[np.int64]  # (N,) the nodes outside the rod that it pushed
    counts: NDArray[np.int64]  # (6,) what `ligature.suture.substeps.run_tick` returns


def rod_arrays(
    nodes: Nodes, joints: Joints, shapes: Shapes, work: Work, first: int, self_skip: int, stiffness: float,
    max_speed: float, dt: float,
) -> RodArrays:  # fmt: skip
    """The arrays of a rod at rest with these groups and constants."""
    whole, real = (np.array([first]), np.array([self_skip])), (np.array([c]) for c in (stiffness, max_speed, dt))
    return RodArrays(
        constants=Constants(*whole, *real), nodes=nodes, joints=joints, shapes=shapes, work=work,
        shape_poses=np.zeros_like(shapes.pose), impulse=np.zeros((len(nodes.mass), 6)),
        tension=np.zeros(len(work.segment)), pushed=np.zeros(len(nodes.mass), np.int64),
        counts=np.zeros(6, np.int64),
    )  # fmt: skip


def nodes(total: int) -> Nodes:
    """``total`` nodes of mass 1 at the origin, at rest."""
    z = np.zeros
    return Nodes(
        mass=np.ones(total), inertia=np.ones((total, 3)), fixed=np.zeros(total, np.bool_),
        met=np.ones(total, np.bool_), gravity=z((total, 3)),
        keep=np.ones((total, 2)), x=z((total, 3)), q=np.tile([0.0, 0.0, 0.0, 1.0], (total, 1)), v=z((total, 3)),
        w=z((total, 3)), radius=z(total), friction=np.ones(total), axis=z((total, 2, 3)),
    )  # fmt: skip


def joints(n: int) -> Joints:
    """Arrays for ``n`` joints."""
    z = np.zeros
    return Joints(
        pivot=z((n, 2, 3)), frame=z((n, 2, 4)), compliance=z(n), stiffness=z((n, 3)), damping=z((n, 3)), rest=z((n, 3)),
        low=z((n, 3)), high=z((n, 3)), stop=z(n), yields=np.full(n, np.inf), angle=z((n, 3)), load=z((n, 6)),
    )  # fmt: skip


def no_shapes(elements: int) -> Shapes:
    """The shapes around a rod of ``elements`` elements that touches nothing but itself."""
    z = np.zeros
    return Shapes(
        np.zeros(0, np.int64), np.zeros(0, np.int64), z((0, 3)), z((0, 4)), np.zeros((0, 2), np.int64),
        z((0, 7)), z((0, 2, 3)), z(0), z(0), np.zeros((0, elements), np.bool_),
    )  # fmt: skip


def work(n: int, total: int, elements: int, contacts: int) -> Work:
    """Scratch for ``n`` chain nodes (``elements`` of the rod), ``total`` nodes and ``contacts`` contact points."""
    z = np.zeros
    j = n - 1
    return Work(
        x=z((total, 3)), q=z((total, 4)), xp=z((total, 3)), qp=z((total, 4)), R=z((total + 1, 3, 3)),
        lever=z((j, 2, 3)), B=z((j, 3, 3)), c=z((j, 6)), left=z((2, 6)), compliance=z((j, 6)), H=z((total, 6, 6)),
        Y=z((total, 6, 6)), Z=z((j, 6, 6)), g=z((total, 6)), d=z((total, 6)), load=z((j, 6)),
        cg=z((4, total, 6)), coupled_load=z((j, 6)), rows=np.zeros(total, np.int64),
        pushed=np.zeros(total, np.bool_), K=z((contacts, 3, 3)), arms=z((contacts, 2, 3)),
        limit=z(contacts), moved=z((contacts, 3)), aim=z((contacts, 3)), solved=z((contacts, 3)),
        own_matrix=z((total, 6, 6)), own_load=z((total, 6)), taken=z((total, 6)), felt=z((2, 6, 6)),
        felt_load=z((2, 6)),
        sum6=z(6), kept_x=z((total, 3)), kept_q=z((total, 4)), kept_v=z((total, 3)), kept_w=z((total, 3)),
        kept_angle=z((j, 3)), kept_load=z((j, 6)),
        three=z((3, 3)), segment=z((elements, 2, 3)), ahead=z((elements, 2, 3)), reach=z(elements),
        clear=z(elements), box=z((elements, 2, 3)), thrown=z(elements), group_box=z((elements, 2, 3)),
        group_thrown=z(elements), pair=z((2, 2, 3)),
    )  # fmt: skip


def touches(contacts: int) -> Touches:
    """Arrays for ``contacts`` contact points, none yet."""
    z = np.zeros
    return Touches(
        count=np.zeros(1, np.int64), node=np.zeros((contacts, 2), np.int64), key=np.zeros(contacts, np.int64),
        local=z((contacts, 2, 3)), arm=z((contacts, 2)), start=z((contacts, 2, 3)),
        normal=z((contacts, 3)), gap=z(contacts),
        target=z(contacts), friction=z(contacts), slip=z((contacts, 3)), press=z(contacts),
        closed=np.zeros(contacts, np.bool_), mode=np.zeros(contacts, np.int64),
        switches=np.zeros(contacts, np.int64), room=z(contacts), begun=z((contacts, 3)),
        ended=z((contacts, 3)), push=z((contacts, 3)), bilateral=np.zeros(contacts, np.bool_),
        force=z((contacts, 3)),
    )  # fmt: skip
