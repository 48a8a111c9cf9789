"""Kinematics of trees whose ends loops join: poses, gaps, Jacobians, and steps that close them.

Coordinates are those of the joints' axes, and six of each free base (translation, rotation vector, world axes).
In all that is compared, lengths are divided by the size of the mechanism. I is a body's inertial frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.axes import axes_of
from ligature.model.axis import Axis
from ligature.model.frames import axis_rotation, frame, inverse, matrix_quaternion
from ligature.model.scene import Articulation, Body, Joint, JointType

Array = NDArray[np.float64]

ROUNDED_M, ROUNDED_RAD = 1e-3, 2e-3
"""What the frames of joints are off where a file has three digits; only their ratio matters."""

LEAST_SIZE = 1e-3
"""Size in metres that the smallest mechanism counts as."""


@dataclass(frozen=True, eq=False)
class Chain:
    """A joint seen from body ``inner``: its frames in both bodies' inertial frames, and axes in that order.

    ``point`` is whether it holds a point only.
    """

    joint: int
    inner: int
    outer: int
    T_inner: Array
    T_outer: Array
    axes: tuple[Axis, ...]
    order: tuple[int, ...]
    point: bool = False


def chain_of(joint: Joint, forward: bool) -> Chain:
    """A joint seen from its parent, or else from its child; ``order`` maps axes to those of the joint."""
    axes = axes_of(joint) or ()
    point, n = joint.type is JointType.P2P, len(axes)
    if forward:
        return Chain(
            joint.index, joint.parent, joint.child, joint.T_parent_a, joint.T_child_b, axes, tuple(range(n)), point
        )
    turned = tuple(axis.reversed() for axis in reversed(axes))
    return Chain(
        joint.index,
        joint.child,
        joint.parent,
        joint.T_child_b,
        joint.T_parent_a,
        turned,
        tuple(reversed(range(n))),
        point,
    )


class Mechanism:
    """Trees and the loops that join them.

    Attributes
    ----------
    chains
        The joints that close loops.
    size
        Extent of the mechanism in metres, at least `LEAST_SIZE`.
    """

    def __init__(
        self, bodies: Sequence[Body], joints: Sequence[Joint], trees: Sequence[Articulation], chains: Sequence[Chain]
    ) -> None:
        self.bodies, self.chains = bodies, list(chains)
        self._trees = []
        self._column: dict[int, int] = {}
        self._axes: dict[int, int] = {}
        self._base: dict[int, int] = {}
        self._low: list[float] = []
        self._high: list[float] = []
        self._units: list[float] = []
        needed = self._needed(trees)
        for tree in trees:
            root = tree.links[0].body
            if not bodies[root].static:
                self._base[root] = len(self._units)
                self._add([(-np.inf, np.inf, True)] * 3 + [(-np.inf, np.inf, False)] * 3)
            steps = []
            for link in tree.links[1:]:
                assert link.joint is not None
                joint = joints[link.joint]
                chain = chain_of(joint, forward=joint.parent == tree.links[link.parent_link].body)
                if chain.outer in needed:
                    steps.append(chain)
                    self._open(chain)
            self._trees.append((root, steps))
        for chain in self.chains:
            self._open(chain)
        self.low, self.high = np.array(self._low), np.array(self._high)
        places = np.array([bodies[c.inner].T_world_body[:3, 3] for _, steps in self._trees for c in steps]
                          + [bodies[c.outer].T_world_body[:3, 3] for c in self.chains])  # fmt: skip
        arms = [np.linalg.norm(T[:3, 3]) for _, steps in self._trees for c in steps for T in (c.T_inner, c.T_outer)]
        self.size = float(max(np.ptp(places, axis=0).max(), max(arms, default=0.0), LEAST_SIZE))
        self._unit = np.where(self._units, self.size, 1.0)

    def _needed(self, trees: Sequence[Articulation]) -> set[int]:
        """Bodies between the loops' ends and the roots: only their joints take part."""
        ends = {body for chain in self.chains for body in (chain.inner, chain.outer)}
        needed: set[int] = set()
        for tree in trees:
            for place, link in enumerate(tree.links):
                if link.body in ends:
                    at = place
                    while at >= 0 and tree.links[at].body not in needed:
                        needed.add(tree.links[at].body)
                        at = tree.links[at].parent_link
        return needed

    def _open(self, chain: Chain) -> None:
        self._column[chain.joint], self._axes[chain.joint] = len(self._units), len(chain.axes)
        self._add([
            (-np.inf if a.low is None else a.low, np.inf if a.high is None else a.high, a.prismatic) for a in chain.axes
        ])  # fmt: skip

    def _add(self, entries: Sequence[tuple[float, float, bool]]) -> None:
        for low, high, prismatic in entries:
            self._low.append(low)
            self._high.append(high)
            self._units.append(prismatic)

    # --- coordinates ------------------------------------------------------------------------

    def gather(self, coordinates: Mapping[int, Array], roots: Mapping[int, Array]) -> Array:
        """Coordinates of the mechanism from those of joints by index; bases count from ``roots`` (4, 4) by body."""
        self._roots = {root: roots[root] for root, _ in self._trees}
        x = np.zeros(len(self._units))
        for chain in self._all_chains():
            at = self._column[chain.joint]
            x[at : at + len(chain.axes)] = coordinates[chain.joint][list(chain.order)]
        return x

    def scatter(self, x: Array, coordinates: dict[int, Array], roots: dict[int, Array]) -> None:
        """Write coordinates ``x`` back to joints and roots by index."""
        poses = self.poses(x)
        for root, _ in self._trees:
            if root in self._base:
                roots[root] = poses[root] @ inverse(self.bodies[root].T_body_inertial)
        for chain in self._all_chains():
            at = self._column[chain.joint]
            values = np.empty(len(chain.axes))
            values[list(chain.order)] = x[at : at + len(chain.axes)]
            coordinates[chain.joint] = values

    def _all_chains(self) -> list[Chain]:
        return [chain for _, steps in self._trees for chain in steps] + self.chains

    def inner_of(self) -> dict[int, int]:
        """The body that each joint starts from."""
        return {chain.joint: chain.inner for chain in self._all_chains()}

    def column(self, joint: int) -> int:
        """Where the coordinates of a joint begin."""
        return self._column[joint]

    def columns(self, joint: int) -> slice:
        """The coordinates of a joint."""
        return slice(self._column[joint], self._column[joint] + self._axes[joint])

    # --- kinematics -------------------------------------------------------------------------

    def poses(self, x: Array) -> dict[int, Array]:
        """Inertial frames (4, 4) in the world by body."""
        return self._forward(x)[0]

    def gaps(self, x: Array) -> Array:
        """Open metres and radians (k, 2) of each loop."""
        residual = self.residual(x).reshape(-1, 6)
        return np.stack(
            [np.linalg.norm(residual[:, :3], axis=1) * self.size, np.linalg.norm(residual[:, 3:], axis=1)], 1
        )

    def residual(self, x: Array) -> Array:
        """Open lengths and rotation vectors (6 k,), lengths per size, in the joints' frames on the inner bodies."""
        poses, direction, origin, _ = self._forward(x)
        residual = np.zeros(6 * len(self.chains))
        for k, chain in enumerate(self.chains):
            T_end, _ = self._along(chain, poses, x, direction, origin)
            residual[6 * k : 6 * k + 6] = self._open_by(chain, *self._ends(chain, poses), T_end)
        return residual

    def _ends(self, chain: Chain, poses: Mapping[int, Array]) -> tuple[Array, Array]:
        """Rotation (3, 3) from the world to a loop's joint, and the frame (4, 4) where the loop closes."""
        return (poses[chain.inner] @ chain.T_inner)[:3, :3].T, poses[chain.outer] @ chain.T_outer

    def _open_by(self, chain: Chain, R: Array, T_outer: Array, T_end: Array) -> Array:
        """Open length and rotation vector (6,) of one loop, from where its chain ends to where it closes (`_ends`)."""
        residual = np.zeros(6)
        residual[:3] = R @ (T_outer[:3, 3] - T_end[:3, 3]) / self.size
        if not chain.point:
            residual[3:] = R @ _rotation_vector(T_outer[:3, :3] @ T_end[:3, :3].T)
        return residual

    def _forward(self, x: Array) -> tuple[dict[int, Array], Array, Array, dict[int, list[int]]]:
        """Poses; direction (n, 3) and origin (n, 3) of each coordinate in the world; coordinates that move a body."""
        n = len(x)
        direction, origin = np.zeros((n, 3)), np.zeros((n, 3))
        poses: dict[int, Array] = {}
        moves: dict[int, list[int]] = {}
        for root, steps in self._trees:
            T = self._roots[root] @ self.bodies[root].T_body_inertial
            moves[root] = []
            if root in self._base:
                at = self._base[root]
                T = frame(rotation(x[at + 3 : at + 6]) @ T[:3, :3], T[:3, 3] + x[at : at + 3])
                direction[at : at + 6] = np.tile(np.eye(3), (2, 1))
                origin[at : at + 6] = T[:3, 3]
                moves[root] = list(range(at, at + 6))
            poses[root] = T
            for chain in steps:
                T, own = self._along(chain, poses, x, direction, origin)
                poses[chain.outer] = T @ inverse(chain.T_outer)
                moves[chain.outer] = moves[chain.inner] + own
        return poses, direction, origin, moves

    def _along(
        self, chain: Chain, poses: Mapping[int, Array], x: Array, direction: Array, origin: Array
    ) -> tuple[Array, list[int]]:
        """Where the chain ends, and its coordinates, whose direction and origin are written."""
        T = poses[chain.inner] @ chain.T_inner
        at = self._column[chain.joint]
        for i, axis in enumerate(chain.axes, at):
            direction[i], origin[i] = T[:3, :3] @ axis.direction, T[:3, 3]
            if axis.prismatic:
                T = frame(T[:3, :3], T[:3, 3] + x[i] * direction[i])
            else:
                T = frame(T[:3, :3] @ axis_rotation(axis.direction, x[i]), T[:3, 3])
        return T, list(range(at, at + len(chain.axes)))

    def _evaluate(self, x: Array) -> tuple[Array, Array]:
        """Residual (6 k,) and Jacobian (6 k, n), both without units."""
        poses, direction, origin, moves = self._forward(x)
        linear = self._linear_columns()
        residual, J = np.zeros(6 * len(self.chains)), np.zeros((6 * len(self.chains), len(x)))
        for k, chain in enumerate(self.chains):
            T_end, own = self._along(chain, poses, x, direction, origin)
            R, T_outer = self._ends(chain, poses)
            residual[6 * k : 6 * k + 6] = self._open_by(chain, R, T_outer, T_end)
            for sign, at, columns in ((1.0, T_outer, moves[chain.outer]), (-1.0, T_end, moves[chain.inner] + own)):
                c = np.array(columns, dtype=int)
                slides = linear[c]
                arm = _cross(direction[c], at[:3, 3] - origin[c])
                shift = np.where(slides[:, None], direction[c], arm) / self.size
                turn = np.where(slides[:, None], 0.0, direction[c])
                J[6 * k : 6 * k + 3, c] += sign * (R @ shift.T)
                if not chain.point:
                    J[6 * k + 3 : 6 * k + 6, c] += sign * (R @ turn.T)
        return residual, J * self._unit

    def _linear_columns(self) -> NDArray[np.bool_]:
        return np.array(self._units, dtype=bool)

    # --- closing ----------------------------------------------------------------------------

    def corrections(self, places: Sequence[Array], rcond: float) -> dict[int, Array]:
        """What joints' frames are to be moved by so that the loops close at ``places``, by joint.

        A row (4, 3) holds translation and rotation vector of the frame on the inner body, in that body's axes, then
        those on the outer one. The least squares of all joints, metres and radians weighed as files round them: what
        many roundings add up to is shared out. Only directions that the mechanism cannot close itself are looked at.
        """
        joints = self._all_chains()
        column = {chain.joint: 12 * i for i, chain in enumerate(joints)}
        rows, wanted = [], []
        for x in places:
            residual, J = self._evaluate(x)
            u, s, _ = np.linalg.svd(J, full_matrices=True)
            weak = u[:, int((s > rcond).sum()) :].T
            rows.append(weak @ self._frame_columns(x, column))
            wanted.append(-weak @ residual)
        scale = np.tile(np.repeat([ROUNDED_M, ROUNDED_RAD], 3), 2 * len(joints))
        moved = scale * np.linalg.lstsq(np.concatenate(rows) * scale, np.concatenate(wanted), rcond=1e-6)[0]
        return {joint: moved[at : at + 12].reshape(4, 3) for joint, at in column.items()}

    def _frame_columns(self, x: Array, column: Mapping[int, int]) -> Array:
        """Derivative (6 k, 12 n) of the residual for moves of the joints' frames, as `corrections` numbers them."""
        poses, direction, origin, _ = self._forward(x)
        paths: dict[int, list[Chain]] = {root: [] for root, _ in self._trees}
        for _, steps in self._trees:
            for chain in steps:
                paths[chain.outer] = [*paths[chain.inner], chain]
        D = np.zeros((6 * len(self.chains), 12 * len(column)))
        for k, closing in enumerate(self.chains):
            T_end, _ = self._along(closing, poses, x, direction, origin)
            R, T_outer = self._ends(closing, poses)
            ways = ((1.0, T_outer[:3, 3], paths[closing.outer]), (-1.0, T_end[:3, 3], [*paths[closing.inner], closing]))
            for sign, end, way in ways:
                for chain in way:
                    before = (poses[chain.inner] @ chain.T_inner)[:3, 3]
                    after = T_end[:3, 3] if chain is closing else (poses[chain.outer] @ chain.T_outer)[:3, 3]
                    at = column[chain.joint]
                    for side, body, around in ((sign, chain.inner, before), (-sign, chain.outer, after)):
                        axes = poses[body][:3, :3]
                        D[6 * k : 6 * k + 3, at : at + 3] += side * R @ axes / self.size
                        D[6 * k : 6 * k + 3, at + 3 : at + 6] += side * R @ _cross(axes.T, end - around).T / self.size
                        if not closing.point:
                            D[6 * k + 3 : 6 * k + 6, at + 3 : at + 6] += side * R @ axes
                        at += 6
        return D

    def solve(
        self, x: Array, steps: int, closed: float, rcond: float, limited: bool = True, kept: Sequence[int] = ()
    ) -> Array:
        """Coordinates near ``x`` (n,) that close the loops: Gauss-Newton, each step of least change.

        Directions that move the loops' ends by less than ``rcond`` are left alone, as are the coordinates ``kept``;
        with ``limited`` joints stay within their limits. Ends at a gap below ``closed`` metres or after ``steps``.
        """
        x = x.copy()
        fixed = np.zeros(len(x), dtype=bool)
        fixed[list(kept)] = True
        for _ in range(steps):
            residual, J = self._evaluate(x)
            free = ~fixed
            step = np.zeros(len(x))
            for _ in range(8):
                u, s, v = np.linalg.svd(J[:, free], full_matrices=False)
                strong = s > rcond
                wanted = u[:, strong].T @ residual
                step[:] = 0.0
                step[free] = -(v[strong].T @ (wanted / s[strong]))
                step *= min(1.0, 0.5 / max(np.abs(step).max(initial=0.0), 1e-12))
                if not limited:
                    break
                target = x + step * self._unit
                stuck = free & (((target < self.low) & (x <= self.low)) | ((target > self.high) & (x >= self.high)))
                if not stuck.any():
                    break
                free &= ~stuck
            x = x + step * self._unit
            if limited:
                x = np.where(fixed, x, np.clip(x, self.low, self.high))
            if np.abs(step).max(initial=0.0) * self.size < closed:
                break
        return x

    def hard_gap(self, x: Array, rcond: float) -> float:
        """What is open, in metres (radians times size), along directions that the mechanism can close."""
        residual, J = self._evaluate(x)
        u, s, _ = np.linalg.svd(J, full_matrices=False)
        return float(np.linalg.norm(u[:, s > rcond].T @ residual)) * self.size

    def rank(self, x: Array, rcond: float) -> int:
        """Number of directions in which the loops' ends can move."""
        return int((np.linalg.svd(self._evaluate(x)[1], compute_uv=False) > rcond).sum())

    def tangent(self, x: Array, rcond: float) -> Array:
        """Motions (n, m) without units that keep the loops closed."""
        return _null(self._evaluate(x)[1], rcond)

    def wandered(self, x: Array, rng: np.random.Generator, largest: float, rcond: float) -> Array:
        """A random configuration along motions that keep the loops closed, by up to ``largest``."""
        N = self.tangent(x, rcond)
        if not N.shape[1]:
            return x.copy()
        step = N @ rng.standard_normal(N.shape[1])
        return np.asarray(x + largest * step / max(np.abs(step).max(), 1e-12) * self._unit)

    def freedoms(self, x: Array, rcond: float) -> list[Array]:
        """For each loop the Gram matrix (6, 6) of its ends' motions while the loops before it stay closed."""
        J = self._evaluate(x)[1]
        grams = []
        for k in range(len(self.chains)):
            N = _null(J[: 6 * k], rcond)
            moved = J[6 * k : 6 * k + 6] @ N
            grams.append(moved @ moved.T)
        return grams


def _null(J: Array, rcond: float) -> Array:
    """Orthonormal motions (n, m) that move the rows of ``J`` (r, n) by less than ``rcond``."""
    if not len(J):
        return np.eye(J.shape[1])
    _, s, v = np.linalg.svd(J, full_matrices=True)
    return np.asarray(v[int((s > rcond).sum()) :].T)


def _cross(a: Array, b: Array) -> Array:
    """Cross products of the rows of ``a`` (n, 3) and ``b`` (n, 3) or (3,): `numpy.cross` takes five times as long."""
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def rotation(vector: Array) -> Array:
    """Rotation (3, 3) by a rotation vector (3,)."""
    angle = float(np.linalg.norm(vector))
    return np.eye(3) if angle < 1e-12 else axis_rotation(vector / angle, angle)


def _rotation_vector(R: Array) -> Array:
    q = matrix_quaternion(R)
    sine = float(np.linalg.norm(q[:3]))
    return np.zeros(3) if sine < 1e-12 else q[:3] / sine * 2.0 * math.atan2(sine, q[3])
