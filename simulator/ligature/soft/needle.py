"""A needle of the scene in a body of tissue: its shape and its own equations, in the axes of the tissue; SI units."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.model.piercing import Needle
from ligature.model.scene import Body, Scene
from ligature.model.shapes import Box, Capsule, Cone, Cylinder, Sphere
from ligature.rotations import matrix_of, multiply, rotate, rotate_back, rotation_vector
from ligature.soft.frame import Frame, FrameArrays, into, open_frame, turn_six, velocity_at
from ligature.suture.bodies import HeldBodies
from ligature.suture.rod import Rod
from ligature.suture.springs import open_springs
from ligature.suture.tracking import open_nodes
from ligature.tables import opener, table_of
from ligature.tissue.block import TissueBlock
from ligature.tissue.layout import open_tissue
from ligature.tissue.needle import OUTSIDE, NeedleArrays, open_needle

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

THINNEST, THICKEST = 0.05e-3, 1e-3
"""Radii of wire in metres that are taken from collision shapes; thicker shapes are hulls around a thin needle."""

USUAL_RADIUS = 0.25e-3
"""Radius of the wire of a needle whose shapes do not show it, m."""

NEAR = 0.01
"""Distance in metres from the box around the tissue within which it is known where a needle's tip is."""

FAR, BESIDE, MEETS = 0, 1, 2
"""Where a needle is: far from the tissue, its tip outside of the box around it, or one that may touch it."""


def wire_radius(body: Body) -> float:
    """Radius of a needle's wire: the least of its round shapes and boxes, in metres."""
    radii = []
    for part in body.colliders:
        shape = part.shape
        if isinstance(shape, Sphere | Capsule | Cylinder | Cone):
            radii.append(shape.radius)
        elif isinstance(shape, Box):
            radii.append(0.5 * float(shape.size.min()))
    fitting = [r for r in radii if THINNEST <= r <= THICKEST]
    return min(fitting) if fitting else USUAL_RADIUS


class Mount(NamedTuple):
    """A needle as a rigid body, as it was last read; world axes where nothing else is said."""

    local: Array  # (3, 3) tip, tangent and normal of the arc as columns, in its inertial frame
    pose: Array  # (7,)
    twist: Array  # (6,)
    mass: Array  # (1,) kg, with what holds it
    inertia: Array  # (3,) principal moments, with what holds it
    pull: Array  # (6,) force and moment on it
    drift: Array  # (6,) motion in a tick of what moves with the tissue's frame where the needle is, in B
    tip: Array  # (3,) in B
    wrench: Array  # (6,) of the tissue on it
    turn: Array  # (2, 3, 3) scratch
    six: Array  # (6,)
    motion: Array  # (1, 13) pose and twist


def _mount(local: Array) -> Mount:
    z = np.zeros
    return Mount(
        np.ascontiguousarray(local), z(7), z(6), z(1), z(3), z(6), z(6), np.full(3, np.inf), z(6), z((2, 3, 3)), z(6),
        z((1, 13)),
    )  # fmt: skip


open_mount = opener(_mount(np.eye(3)))


class ScenePiercer:
    """One needle and one body of tissue.

    ``rod`` is the thread that carries the needle as a node of its own solve, None for a needle without one.
    ``tip`` (3,) is where its tip is in B, infinite while it is far from the tissue; ``wrench`` (6,) what the tissue
    does to it, in world axes; ``met`` whether it could touch the tissue in the last tick.
    """

    def __init__(self, scene: Scene, needle: Needle, block: TissueBlock, rod: Rod | None, dt: float) -> None:
        arc, self.body = needle.arc, scene.bodies[needle.body]
        self.rod, self._dt = rod, dt
        tip, c, s = arc.point(0.0), math.cos(arc.end), math.sin(arc.end)
        self._mount = _mount(np.stack([tip, c * arc.y - s * arc.x, (arc.centre - tip) / arc.radius], axis=1))
        self.tip, self.wrench = self._mount.tip, self._mount.wrench
        self.inside = block.add_needle(1.0 / arc.radius, arc.length, wire_radius(self.body))
        self._tables = (block.interface.table, self.inside.table, table_of(self._mount))
        self._nodes = None if rod is None else table_of(rod.nodes)
        self._reach = NEAR + arc.length + float(np.linalg.norm(tip))
        self._weight = self.body.mass * self.body.gravity
        self._joint_load = np.zeros(6)
        self._index = np.array([self.body.index])
        self.met, self.spring = False, -1

    @property
    def engaged(self) -> bool:
        """Whether the tissue touches the needle."""
        return bool(is_engaged(self._tables[1]))

    def approach(self, bodies: HeldBodies, frame: Frame) -> bool:
        """Fill the needle's shape and equations in B; False while it cannot touch the tissue."""
        m = self._mount
        bodies.read_motions(self._index, m.motion)
        where, engaged = look(*self._tables, frame.table, self.inside.before, self._reach)
        self.met = where == MEETS
        if not self.met:
            return False
        extra, extra_inertia, pull = bodies.attached_load(self.body.index)
        m.mass[0], m.inertia[:] = self.body.mass + extra, self.body.inertia + extra_inertia
        force = pull[:3] + self._weight
        m.pull[:3], m.pull[3:] = force, pull[3:]
        m.pull[:] += self._joint_load
        equations(*self._tables[1:], frame.table, self._dt)
        if self.rod is not None and engaged:
            self.rod.pull_partner(self.body.index, force / m.mass[0], float(m.mass[0]), m.inertia)
        return True

    # --- with a thread ------------------------------------------------------------------------

    def begin(self, bodies: HeldBodies, frame: Frame) -> None:
        """Hand the rod what the tissue does to the needle."""
        self.spring = -1
        assert self.rod is not None
        if not self.approach(bodies, frame):
            return
        self.inside.prepare(self._dt)
        _, needle, mount = self._tables
        self.spring = hand_over(needle, mount, frame.table, self.rod.spring_table, self.rod.node_of[self.body.index])

    def end(self, frame: Frame) -> None:
        """Conclude with the motion that the rod's solve found."""
        assert self.rod is not None and self._nodes is not None
        self.rod.read_joint_load(self.body.index, self._joint_load)
        if self.spring < 0:
            return
        _, needle, mount = self._tables
        take_motion(needle, mount, frame.table, self.rod.spring_table, self._nodes, self.spring)
        self.inside.finish()
        turn_wrench(needle, mount, frame.table)

    # --- alone --------------------------------------------------------------------------------

    def couple(self, bodies: HeldBodies, frame: Frame) -> None:
        """Solve with the tissue alone, and push the needle."""
        if not self.approach(bodies, frame):
            return
        self.inside.solve(self._dt)
        _, needle, mount = self._tables
        if turn_wrench(needle, mount, frame.table):
            bodies.apply_impulse(self.body.index, self._dt * self.wrench[:3], self._dt * self.wrench[3:])

    # --- state --------------------------------------------------------------------------------

    def reset(self) -> None:
        """As at the start; the block resets what is inside."""
        self.wrench[:], self._joint_load[:] = 0.0, 0.0
        self.tip[:] = np.inf

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick, besides what the block keeps."""
        return {name: getattr(self, name).copy() for name in _KEPT}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for name in _KEPT:
            getattr(self, name)[:] = snapshot[name]


_KEPT = ("wrench", "tip", "_joint_load")
"""Attributes that last from tick to tick."""


@inlined
def _engaged(n: NeedleArrays) -> bool:
    engaged = n.held.tip[0] != OUTSIDE
    for i in range(n.held.engaged.shape[0]):
        engaged = engaged or n.held.engaged[i] != 0
    return engaged


@kernel
def is_engaged(needle: Integers) -> bool:
    """Whether the tissue touches a needle."""
    return _engaged(open_needle(needle))


@inlined
def _beside(box: Array, reach: float, x: float, y: float, z: float) -> bool:
    """Whether a place of B is further than ``reach`` from a box (2, 3), or not finite."""
    within = box[0, 0] - reach <= x <= box[1, 0] + reach and box[0, 1] - reach <= y <= box[1, 1] + reach
    return not (within and box[0, 2] - reach <= z <= box[1, 2] + reach)


@kernel
def look(
    tissue: Integers, needle: Integers, mount: Integers, frame: Integers, before: Array, reach: float
) -> tuple[int, bool]:
    """Take a needle's motion, and find its shape: where it is (`FAR`, `BESIDE`, `MEETS`), and whether it is held.

    One that is not held meets the surface with its tip alone, on the way from where it was ``before`` (3,).
    """
    box, n, m, f = open_tissue(tissue).field.box, open_needle(needle), open_mount(mount), open_frame(frame)
    for a in range(7):
        m.pose[a] = m.motion[0, a]
    for a in range(6):
        m.twist[a] = m.motion[0, 7 + a]
    engaged, shape = _engaged(n), n.shape
    x, y, z = into(f, m.pose[0], m.pose[1], m.pose[2])
    far = not engaged and _beside(box, reach, x, y, z)
    if not far:
        _shape(n, m, f)
        if engaged or not (_beside(box, 0.0, shape[0], shape[1], shape[2])
                           and _beside(box, 0.0, before[0], before[1], before[2])):  # fmt: skip
            return MEETS, engaged
    for a in range(3):
        before[a], m.tip[a] = (math.nan, math.inf) if far else (shape[a], shape[a])
        m.wrench[a], m.wrench[3 + a] = 0.0, 0.0
    return FAR if far else BESIDE, False


@inlined
def _shape(n: NeedleArrays, m: Mount, f: FrameArrays) -> None:
    """Compute the shape of a needle in B."""
    Q, R, shape = m.turn[0], m.turn[1], n.shape
    matrix_of(m.pose[3], m.pose[4], m.pose[5], m.pose[6], Q)
    for i in range(3):
        for j in range(3):
            R[i, j] = f.R[0, i] * Q[0, j] + f.R[1, i] * Q[1, j] + f.R[2, i] * Q[2, j]
    shape[11], shape[12], shape[13] = into(f, m.pose[0], m.pose[1], m.pose[2])
    for column in range(3):
        x, y, z = rotate(R, m.local[0, column], m.local[1, column], m.local[2, column])
        shape[3 * column], shape[3 * column + 1], shape[3 * column + 2] = x, y, z
    for a in range(3):
        shape[a] += shape[11 + a]
        m.tip[a] = shape[a]


@kernel
def equations(needle: Integers, mount: Integers, frame: Integers, dt: float) -> None:
    """A needle's own equations H δ = g in B, for its motion relative to the tissue's frame; its shape is known."""
    n, m, f = open_needle(needle), open_mount(mount), open_frame(frame)
    R, shape, H, g = m.turn[1], n.shape, n.H, n.g
    for i in range(6):
        for j in range(6):
            H[i, j] = 0.0
    square = dt * dt
    for i in range(3):
        H[i, i] = m.mass[0] / square
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += R[i, k] * m.inertia[k] * R[j, k]
            H[3 + i, 3 + j] = total / square
    vx, vy, vz = rotate_back(f.R, m.twist[0], m.twist[1], m.twist[2])
    wx, wy, wz = rotate_back(f.R, m.twist[3], m.twist[4], m.twist[5])
    g[0], g[1], g[2] = rotate_back(f.R, m.pull[0], m.pull[1], m.pull[2])
    g[3], g[4], g[5] = rotate_back(f.R, m.pull[3], m.pull[4], m.pull[5])
    x, y, z = velocity_at(f, shape[11], shape[12], shape[13])
    d = m.drift
    d[0], d[1], d[2] = dt * x, dt * y, dt * z
    d[3], d[4], d[5] = dt * f.w[0], dt * f.w[1], dt * f.w[2]
    # What the needle would do by itself, less what the frame does.
    x, y, z = dt * vx - d[0], dt * vy - d[1], dt * vz - d[2]
    g[0], g[1], g[2] = g[0] + H[0, 0] * x, g[1] + H[1, 1] * y, g[2] + H[2, 2] * z
    x, y, z = dt * wx - d[3], dt * wy - d[4], dt * wz - d[5]
    for i in range(3):
        g[3 + i] += H[3 + i, 3] * x + H[3 + i, 4] * y + H[3 + i, 5] * z


@kernel
def turn_wrench(needle: Integers, mount: Integers, frame: Integers) -> bool:
    """Force and moment of the tissue on the needle in world axes; whether there are any."""
    n, m, f = open_needle(needle), open_mount(mount), open_frame(frame)
    w, out = n.wrench, m.wrench
    out[0], out[1], out[2] = rotate(f.R, w[0], w[1], w[2])
    out[3], out[4], out[5] = rotate(f.R, w[3], w[4], w[5])
    any_ = False
    for a in range(6):
        any_ = any_ or w[a] != 0.0
    return any_


@kernel
def hand_over(needle: Integers, mount: Integers, frame: Integers, springs: Integers, node: int) -> int:
    """Make a spring of what the tissue does to a needle that is a node of a rod; its row, -1 where there is no room."""
    n, m, f, s = open_needle(needle), open_mount(mount), open_frame(frame), open_springs(springs)
    row = s.filled[0]
    if row == s.node.shape[0]:
        return -1
    s.filled[0], s.node[row] = row + 1, node
    K, load = n.rows.K, m.six
    turn_six(f.R, K, s.K[row])
    for i in range(6):
        load[i] = n.rows.load[i]
        for j in range(6):
            load[i] += K[i, j] * m.drift[j]
    out = s.load[row]
    out[0], out[1], out[2] = rotate(f.R, load[0], load[1], load[2])
    out[3], out[4], out[5] = rotate(f.R, load[3], load[4], load[5])
    return row


@kernel
def take_motion(
    needle: Integers, mount: Integers, frame: Integers, springs: Integers, nodes: Integers, row: int
) -> None:
    """The needle's motion in B, relative to the frame, as the rod's solve found it."""
    n, m, f, s, nodes_ = (
        open_needle(needle), open_mount(mount), open_frame(frame), open_springs(springs), open_nodes(nodes),
    )  # fmt: skip
    i, d = s.node[row], n.delta
    x, q, b = nodes_.x[i], nodes_.q[i], s.q[row]
    d[0], d[1], d[2] = rotate_back(f.R, x[0] - s.x[row, 0], x[1] - s.x[row, 1], x[2] - s.x[row, 2])
    tx, ty, tz, tw = multiply(q[0], q[1], q[2], q[3], -b[0], -b[1], -b[2], b[3])
    rx, ry, rz = rotation_vector(tx, ty, tz, tw)
    d[3], d[4], d[5] = rotate_back(f.R, rx, ry, rz)
    for a in range(6):
        d[a] -= m.drift[a]
