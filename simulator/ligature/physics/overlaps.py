"""Bodies that start inside each other and that joints keep there, so that no contact can part them.

Bullet's contacts and joints would fight with meganewtons; or, where joints give way nearly across the contact alone,
what is to be parted at 1 m/s would move at hundreds. World axes, metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.adf.diagnostics import length
from ligature.model.frames import inverse, pose7_matrix
from ligature.model.scene import Scene
from ligature.physics.engine import Engine

Array = NDArray[np.float64]

DEEP = 0.005
"""Overlap in metres that is a mistake of the scene rather than a rounding error or a press fit."""

DETOUR = 10.0
"""Speed of a body over that at which a contact parts it from another, from which joints count as holding it there."""


@dataclass(frozen=True)
class Overlap:
    """How deep ``body`` and ``other`` overlap."""

    body: int
    other: int
    depth: float

    def finding(self, scene: Scene) -> Diagnostic:
        """The overlap for the author of the scene."""
        one, other = (scene.bodies[i].identity for i in (self.body, self.other))
        message = (
            f"'{one.identifier}' starts {length(self.depth)} inside '{other.identifier}', where joints hold it; "
            "they do not collide until they have separated"
        )
        return Diagnostic(Severity.WARNING, message, one.mark, "move them apart, or disable their collision", "overlap")


def findings(engine: Engine) -> list[Diagnostic]:
    """A warning for each of `held_overlaps` where the scene of ``engine`` starts."""
    return [found.finding(engine.scene) for found in held_overlaps(engine)]


def held_overlaps(engine: Engine) -> list[Overlap]:
    """Overlaps beyond `DEEP` between links of trees with a fixed base, static bodies, and links of one tree.

    A free body or tree is left out: contacts part it from others. Call it while bodies are where the scene starts.
    """
    links = [(body, k) for k, tree in enumerate(engine.trees) for body in tree.link_of]
    if not links:
        return []
    body, tree = (np.array(column) for column in zip(*links, strict=True))
    static = np.array([engine.scene.bodies[b].static for b in body])
    held = np.array([engine.trees[k].static for k in tree])
    places = [engine.place_of[b] for b in body]
    boxes = np.array([pybullet.getAABB(p.uid, p.link, physicsClientId=engine.client) for p in places])
    low, high = boxes[:, 0], boxes[:, 1]
    found = []
    for i in np.flatnonzero(~static):
        near = ((low <= high[i]) & (high >= low[i])).all(axis=1)
        near &= (tree == tree[i]) | (held & held[i])
        near[: i + 1] &= static[: i + 1]
        near[i] = False
        for j in np.flatnonzero(near):
            if body[j] not in engine.scene.bodies[body[i]].no_collision_with:
                one, other = int(body[i]), int(body[j])
                depth = overlap(engine, one, other)
                if depth > DEEP or (depth > 0.0 and _detour(engine, one, other) > DETOUR):
                    found.append(Overlap(one, other, depth))
    return found


def overlap(engine: Engine, body: int, other: int) -> float:
    """How deep two bodies overlap; 0 when they do not."""
    return max((-float(point[8]) for point in _points(engine, body, other)), default=0.0)


def _points(engine: Engine, body: int, other: int) -> tuple[tuple[Any, ...], ...]:
    a, b = engine.place_of[body], engine.place_of[other]
    return pybullet.getClosestPoints(a.uid, b.uid, 0.0, a.link, b.link, physicsClientId=engine.client) or ()


# --- how joints give way to a contact -----------------------------------------------------------


def _detour(engine: Engine, body: int, other: int) -> float:
    """Largest speed of a body while a contact parts two overlapping ones at 1 m/s; infinite where joints forbid it."""
    trees = sorted({engine.place_of[b].tree for b in (body, other)})
    parts = [_Mechanics(engine, k) for k in trees]
    worst = 0.0
    for point in _points(engine, body, other):
        if point[8] >= 0.0:
            continue
        rows = []
        for k, part in zip(trees, parts, strict=True):
            row = np.zeros(part.dofs)
            for which, at, sign in ((body, point[5], 1.0), (other, point[6], -1.0)):
                place = engine.place_of[which]
                if place.tree == k and place.uid == part.uid:
                    row += sign * np.array(point[7]) @ part.moved(place.link, np.array(at))
            rows.append(row)
        yields = [part.response(row) for part, row in zip(parts, rows, strict=True)]
        given = sum(float(row @ rate) for row, rate in zip(rows, yields, strict=True))
        speeds = [part.speed(rate) for part, rate in zip(parts, yields, strict=True)]
        worst = max(worst, np.inf if given <= 0.0 else max(speeds) / given)
    return worst


class _Mechanics:
    """Velocities and masses of one tree by its degrees of freedom: those of a base that moves, then its joints."""

    def __init__(self, engine: Engine, index: int) -> None:
        tree, motions = engine.trees[index], engine.motions
        self.uid = tree.uid
        motions.links(index)
        base = 0 if tree.static else 6
        self.dofs = base + len(tree.axes)
        self._poses = [pose7_matrix(motions.pose[motions.row(index, k)]) for k in range(-1, len(tree.frames))]
        self._twists = [np.zeros((6, self.dofs))]
        if base:
            self._twists[0][:, :6] = np.eye(6)
        column = {link: base + i for i, (link, *_) in enumerate(tree.axes)}
        for link, frame in enumerate(tree.frames):
            at = self._poses[link + 1][:3, 3]
            twist = self._twists[frame.parent].copy()
            twist[:3] = _shifted(twist, at - self._poses[frame.parent][:3, 3])
            if link in column:
                T = self._poses[link + 1] @ inverse(pose7_matrix(frame.link_inertial))
                axis = T[:3, :3] @ frame.axis
                prismatic = frame.type == pybullet.JOINT_PRISMATIC
                twist[:, column[link]] = (
                    np.r_[axis, np.zeros(3)] if prismatic else np.r_[np.cross(axis, at - T[:3, 3]), axis]
                )
            self._twists.append(twist)
        self._inverse_mass = np.linalg.pinv(self._mass(engine), hermitian=True)

    def _mass(self, engine: Engine) -> Array:
        mass = np.zeros((self.dofs, self.dofs))
        for link, (T, twist) in enumerate(zip(self._poses, self._twists, strict=True), start=-1):
            weight, _, principal, *_ = pybullet.getDynamicsInfo(self.uid, link, physicsClientId=engine.client)
            turned = T[:3, :3].T @ twist[3:]
            mass += weight * twist[:3].T @ twist[:3] + turned.T @ (np.array(principal)[:, None] * turned)
        return mass

    def moved(self, link: int, point: Array) -> Array:
        """Velocity (3, dofs) of a point of a link by the degrees of freedom."""
        return _shifted(self._twists[link + 1], point - self._poses[link + 1][:3, 3])

    def response(self, row: Array) -> Array:
        """Rates (dofs,) that an impulse along ``row`` (dofs,) gives."""
        return np.asarray(self._inverse_mass @ row)

    def speed(self, rates: Array) -> float:
        """Largest speed of a link's centre of mass at ``rates`` (dofs,)."""
        return max(float(np.linalg.norm(twist[:3] @ rates)) for twist in self._twists)


def _shifted(twist: Array, arm: Array) -> Array:
    """Velocity (3, n) of a point that is ``arm`` (3,) from the one whose ``twist`` (6, n) is given."""
    return np.asarray(twist[:3] + np.cross(twist[3:], arm, axis=0))
