"""Where the bodies of a world are and how they move, read from Bullet as rarely as possible.

Bases and joints are read when somebody asks, at most once a tick; the links follow from both by
forward kinematics, which costs a tenth of asking Bullet. Poses are x y z qx qy qz qw of inertial
frames I in world axes, twists linear at the centre of mass, then angular; joints in radians or metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.kernels import compiled
from ligature.model.poses import compose
from ligature.physics.articulation import Tree

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

_TURNS, _SLIDES = int(pybullet.JOINT_REVOLUTE), int(pybullet.JOINT_PRISMATIC)


@compiled
def _follow(
    begin: int, end: int, rows: Integers, fixed: Array, joints: Array, frame: Array, speed: Array, pose: Array,
    twist: Array,
) -> None:  # fmt: skip
    """Poses and twists of the links in rows ``begin`` … ``end`` of one tree; row ``begin`` is its base.

    ``rows`` (r, 3) are parent row, joint type and index of the joint; ``fixed`` (r, 17) the axis, the link
    frame in its parent's at zero, and the inertial frame in the link frame; ``frame`` (r, 7) and ``speed`` (r, 6)
    receive pose and velocity of the link frames' origins.
    """
    frame[begin], speed[begin] = pose[begin], twist[begin]
    for r in range(begin + 1, end):
        p, kind, joint = rows[r, 0], rows[r, 1], rows[r, 2]
        f, v = frame[r], speed[r]
        compose(frame[p], fixed[r, 3:10], f)
        ax, ay, az = _turned(f, fixed[r, 0], fixed[r, 1], fixed[r, 2])
        q, qd = 0.0, 0.0
        if joint >= 0:
            q, qd = joints[0, joint], joints[1, joint]
        if kind == _SLIDES:
            f[0], f[1], f[2] = f[0] + q * ax, f[1] + q * ay, f[2] + q * az
        _carried(speed[p], f[0] - frame[p, 0], f[1] - frame[p, 1], f[2] - frame[p, 2], v)
        if kind == _SLIDES:
            v[0], v[1], v[2] = v[0] + qd * ax, v[1] + qd * ay, v[2] + qd * az
        elif kind == _TURNS:
            v[3], v[4], v[5] = v[3] + qd * ax, v[4] + qd * ay, v[5] + qd * az
            s, c = math.sin(0.5 * q), math.cos(0.5 * q)
            x, y, z, w = f[3], f[4], f[5], f[6]
            ax, ay, az = s * ax, s * ay, s * az
            f[3] = c * x + w * ax + ay * z - az * y
            f[4] = c * y + w * ay + az * x - ax * z
            f[5] = c * z + w * az + ax * y - ay * x
            f[6] = c * w - ax * x - ay * y - az * z
        compose(f, fixed[r, 10:17], pose[r])
        _carried(v, pose[r, 0] - f[0], pose[r, 1] - f[1], pose[r, 2] - f[2], twist[r])


@compiled
def _turned(pose: Array, px: float, py: float, pz: float) -> tuple[float, float, float]:
    """The vector p, given in the frame ``pose``, in world axes."""
    x, y, z, w = pose[3], pose[4], pose[5], pose[6]
    cx, cy, cz = y * pz - z * py + w * px, z * px - x * pz + w * py, x * py - y * px + w * pz
    return px + 2.0 * (y * cz - z * cy), py + 2.0 * (z * cx - x * cz), pz + 2.0 * (x * cy - y * cx)


@compiled
def _carried(twist: Array, rx: float, ry: float, rz: float, out: Array) -> None:
    """The velocity ``twist`` (6,) at a point that lies r off."""
    wx, wy, wz = twist[3], twist[4], twist[5]
    out[0] = twist[0] + wy * rz - wz * ry
    out[1] = twist[1] + wz * rx - wx * rz
    out[2] = twist[2] + wx * ry - wy * rx
    out[3], out[4], out[5] = wx, wy, wz


@compiled
def _apply_gravity(
    begin: int, end: int, rows: Integers, fixed: Array, frame: Array, pose: Array, force: Array, load: Array,
    effort: Array,
) -> None:  # fmt: skip
    """Add to ``effort`` what forces (r, 3) at the centres of mass of one tree's links do to its joints.

    The rows are those of `_follow`; ``load`` (r, 6) is scratch: force, and moment about the world's origin.
    """
    for r in range(begin, end):
        x, y, z = force[r, 0], force[r, 1], force[r, 2]
        cx, cy, cz = pose[r, 0], pose[r, 1], pose[r, 2]
        load[r, 0], load[r, 1], load[r, 2] = x, y, z
        load[r, 3], load[r, 4], load[r, 5] = cy * z - cz * y, cz * x - cx * z, cx * y - cy * x
    for r in range(end - 1, begin, -1):
        p, kind, joint = rows[r, 0], rows[r, 1], rows[r, 2]
        if joint >= 0:
            f, at = frame[r], load[r]
            ax, ay, az = _turned(f, fixed[r, 0], fixed[r, 1], fixed[r, 2])
            if kind == _SLIDES:
                effort[joint] += ax * at[0] + ay * at[1] + az * at[2]
            else:
                mx = at[3] - (f[1] * at[2] - f[2] * at[1])
                my = at[4] - (f[2] * at[0] - f[0] * at[2])
                mz = at[5] - (f[0] * at[1] - f[1] * at[0])
                effort[joint] += ax * mx + ay * my + az * mz
        for a in range(6):
            load[p, a] += load[r, a]


@compiled
def _below(twist: Array, rows: Integers, velocity: Array, limit: float) -> bool:
    """Whether ``rows`` of ``twist`` (r, 6) and all of ``velocity`` (a,) are finite and below ``limit``."""
    sound = True
    for row in rows:
        for a in range(6):
            sound = sound and abs(twist[row, a]) < limit
    for a in range(velocity.shape[0]):
        sound = sound and abs(velocity[a]) < limit
    return sound


class Motions:
    """Motion of everything in one Bullet world.

    Every tree has one row for its base and one for each link, in order; call `base`, `pace`,
    `joints` or `links` with the index of a tree before its rows are used.

    Attributes
    ----------
    pose, twist
        (r, 7) and (r, 6) of all rows.
    position, velocity, effort
        (a,) of all single axes of all trees.
    reported
        Efforts of axes, by index, for which Bullet's motor is not the drive: what is reported instead.
    push
        (a,) efforts that the controllers apply in the coming tick.
    force
        (r, 3) forces at the centres of mass, for `apply_gravity`.
    reaction
        (a, 6) force and moment that the joints of these axes carry, where Bullet measures them.
    """

    def __init__(self, client: int, trees: Sequence[Tree]) -> None:
        self._client = client
        counts = [1 + len(tree.frames) for tree in trees]
        self._begin = np.cumsum([0, *counts]).tolist()
        self._bases_at = np.array(self._begin[:-1], dtype=np.int64)
        axes = np.cumsum([0, *(len(tree.axes) for tree in trees)]).tolist()
        self.slices = [slice(a, b) for a, b in zip(axes[:-1], axes[1:], strict=True)]
        self._links = [[link for link, *_ in tree.axes] for tree in trees]
        n = self._begin[-1]
        self._rows = np.full((n, 3), -1, dtype=np.int64)
        self._fixed = np.zeros((n, 17))
        for k, tree in enumerate(trees):
            self._lay_out(k, tree)
        self.pose, self.twist = np.zeros((n, 7)), np.zeros((n, 6))
        self.force, self._load = np.zeros((n, 3)), np.zeros((n, 6))
        self._frame, self._speed = np.zeros((n, 7)), np.zeros((n, 6))
        self._joints = np.zeros((3, axes[-1]))
        self.position, self.velocity, self.effort = self._joints
        self.sent: dict[int, float] = {}
        self.reaction = np.zeros((axes[-1], 6))
        self.push = np.zeros(axes[-1])
        self._uids = [tree.uid for tree in trees]
        self._still = {k for k, tree in enumerate(trees) if tree.static}
        self._rigid = {k for k, tree in enumerate(trees) if not tree.axes}
        self._bare = {k for k, tree in enumerate(trees) if not tree.frames}
        self._going = [k for k in range(len(trees)) if k not in self._still]
        self._turning = [k for k in range(len(trees)) if k not in self._rigid]
        self._bases: set[int] = set()
        self._paces: set[int] = set()
        self._jointed: set[int] = set()
        self._linked: set[int] = set()
        self._measured = [False] * len(trees)
        self._limp: list[Integers] = [np.arange(rows.start, rows.stop) for rows in self.slices]
        self._begun = False

    def _lay_out(self, tree_index: int, tree: Tree) -> None:
        """Fill the rows of one tree's links."""
        begin = self._begin[tree_index]
        joint_of = {link: self.slices[tree_index].start + i for i, link in enumerate(self._links[tree_index])}
        for link, frame in enumerate(tree.frames):
            row = begin + 1 + link
            self._rows[row] = begin + frame.parent, frame.type, joint_of.get(link, -1)
            self._fixed[row] = np.concatenate([frame.axis, frame.parent_link, frame.link_inertial])

    def row(self, tree: int, link: int) -> int:
        """Row of a link; -1 is the base."""
        return int(self._begin[tree] + 1 + link)

    def apply_gravity(self, tree: int) -> None:
        """Add what `force` does to the joints of a tree to `push`."""
        self.links(tree)
        _apply_gravity(self._begin[tree], self._begin[tree + 1], self._rows, self._fixed, self._frame,
            self.pose, self.force,
               self._load, self.push)  # fmt: skip

    def drive(self, tree: int, axes: Sequence[int]) -> None:
        """From now on motors drive ``axes`` of a tree, and no others: Bullet keeps the last effort of a motor."""
        rows = self.slices[tree]
        self._limp[tree] = np.setdiff1d(np.arange(rows.start, rows.stop), rows.start + np.array(axes, dtype=np.int64))

    def measure(self, tree: int) -> None:
        """Fill `reaction` for the axes of a tree from now on."""
        self._measured[tree] = True

    def begin(self) -> None:
        """No tick is over yet, so that no motor has an effort and no joint a reaction: Bullet has those of before."""
        self._begun = True
        self.forget_all()

    def expire(self) -> None:
        """The world moved on: read again when asked."""
        self._begun = False
        self._bases &= self._still
        self._paces &= self._still
        self._jointed &= self._rigid
        self._linked &= self._still & self._rigid

    def forget(self, tree: int) -> None:
        """A tree was put elsewhere."""
        for known in (self._bases, self._paces, self._jointed, self._linked):
            known.discard(tree)
        if tree in self._still:
            self._read_still(tree)

    def _read_still(self, tree: int) -> None:
        """Read a base that stays, now: Bullet turns it by a last bit in every tick."""
        self.base(tree)
        self.pace(tree)

    def forget_all(self) -> None:
        """Everything was put elsewhere."""
        for known in (self._bases, self._paces, self._jointed, self._linked):
            known.clear()
        for tree in sorted(self._still):
            self._read_still(tree)

    def base(self, tree: int) -> None:
        """Bring the pose of the base up to date."""
        if tree not in self._bases:
            self._bases.add(tree)
            at, around = pybullet.getBasePositionAndOrientation(self._uids[tree], physicsClientId=self._client)
            self.pose[self._begin[tree]] = at + around

    def pace(self, tree: int) -> None:
        """Bring the twist of the base up to date."""
        if tree not in self._paces:
            self._paces.add(tree)
            linear, angular = pybullet.getBaseVelocity(self._uids[tree], physicsClientId=self._client)
            self.twist[self._begin[tree]] = linear + angular

    def joints(self, tree: int) -> Array:
        """Bring the joints of a tree up to date; returns position, velocity and effort (3, k) of its axes."""
        if tree not in self._jointed:
            self._jointed.add(tree)
            links, rows = self._links[tree], self.slices[tree]
            if links:
                states = pybullet.getJointStates(self._uids[tree], links, physicsClientId=self._client)
                position, velocity, reaction, effort = zip(*states, strict=True)
                self.position[rows], self.velocity[rows], self.effort[rows] = position, velocity, effort
                if self._begun:
                    self.effort[rows] = 0.0
                elif len(self._limp[tree]):
                    self.effort[self._limp[tree]] = 0.0
                for axis, sent in self.sent.items():
                    self.effort[axis] = sent
                if self._measured[tree]:
                    self.reaction[rows] = 0.0 if self._begun else reaction
        return self._joints[:, self.slices[tree]]

    def links(self, tree: int) -> None:
        """Bring all rows of a tree up to date."""
        if tree not in self._linked:
            self._linked.add(tree)
            self.base(tree)
            self.pace(tree)
            self.joints(tree)
            if tree in self._bare:
                return
            _follow(self._begin[tree], self._begin[tree + 1], self._rows, self._fixed, self._joints, self._frame,
                    self._speed, self.pose, self.twist)  # fmt: skip

    def everything(self) -> None:
        """Bring all rows up to date."""
        for tree in range(len(self._uids)):
            self.links(tree)

    def sound(self, limit: float) -> bool:
        """Whether the velocities of all bases and joints are finite and below ``limit``."""
        for tree in self._going:
            self.pace(tree)
        for tree in self._turning:
            self.joints(tree)
        return bool(_below(self.twist, self._bases_at, self.velocity, limit))

    def speeds(self, tree: int) -> list[float]:
        """Velocities of a tree's base and joints."""
        found: list[float] = self.twist[self._begin[tree]].tolist() + self.velocity[self.slices[tree]].tolist()
        return found
