"""Single bodies in Bullet: poses, forces, and Cartesian control (as in AMBF).

Poses are those of the body frame B in world axes. Bullet has poses of the inertial frame I.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.commands import CommandType
from ligature.model.frames import inverse, matrix_pose7, matrix_quaternion, pose7_matrix
from ligature.model.poses import compose
from ligature.model.scene import Body, OutputType
from ligature.physics.articulation import Tree
from ligature.physics.control import KICK_SECONDS
from ligature.physics.motions import Motions

Array = NDArray[np.float64]

SMALLEST_MOVE, SMALLEST_TURN = 1e-5, 1e-4
"""A static body is not moved by less than both of these (metres, radians), as in the reference."""

REST = [0.0] * 6


class Placement:
    """The multibody ``uid`` and ``link`` (-1 for the base) that stand for a body in Bullet."""

    def __init__(self, client: int, tree: Tree, body: Body, motions: Motions, index: int) -> None:
        self.client, self.body = client, body
        self.motions, self.tree = motions, index
        self.row = motions.row(index, tree.link_of[body.index])
        self.uid, self.link = tree.place(body.index)
        self._bases = tree.bases
        self.inertial_to_body = matrix_pose7(inverse(body.T_body_inertial))

    def read(self, pose: Array, twist: Array) -> None:
        """Fill ``pose`` (7,) of the body frame B and ``twist`` (6,)."""
        self.read_inertial(pose, twist)
        compose(pose, self.inertial_to_body, pose)

    def read_inertial(self, pose: Array, twist: Array) -> None:
        """Fill ``pose`` (7,) of the inertial frame I and ``twist`` (6,)."""
        self._refresh()
        pose[:], twist[:] = self.motions.pose[self.row], self.motions.twist[self.row]

    def _refresh(self) -> None:
        if self.link < 0:
            self.motions.base(self.tree)
        else:
            self.motions.links(self.tree)

    def set_pose(self, pose: Array) -> None:
        """Set the pose (7,) of B of the base, at rest."""
        T = pose7_matrix(pose) @ self.body.T_body_inertial
        self.set_inertial_pose(T[:3, 3].tolist(), matrix_quaternion(T[:3, :3]).tolist())

    def set_inertial_pose(self, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """Set position (3,) and quaternion (4,) of the base's inertial frame I, at rest."""
        for uid in self._bases:
            pybullet.resetBasePositionAndOrientation(uid, position, quaternion, physicsClientId=self.client)
            pybullet.resetBaseVelocity(uid, [0.0] * 3, [0.0] * 3, physicsClientId=self.client)
        self.motions.forget(self.tree)

    def set_twist(self, linear: Array, angular: Array) -> None:
        """Set the velocity of the base."""
        pybullet.resetBaseVelocity(self.uid, linear.tolist(), angular.tolist(), physicsClientId=self.client)
        self.motions.forget(self.tree)

    def slow_down(self, linear: float, angular: float) -> None:
        """Multiply the velocity of a base without links by two factors."""
        self.motions.base(self.tree)
        twist = self.motions.twist[self.row]
        before = twist.tolist()
        if before != REST:
            x, y, z, a, b, c = before
            slow = (linear * x, linear * y, linear * z, angular * a, angular * b, angular * c)
            twist[:] = slow
            pybullet.resetBaseVelocity(self.uid, slow[:3], slow[3:], physicsClientId=self.client)

    def centre(self) -> Array:
        """Centre of mass (3,)."""
        self._refresh()
        centre: Array = self.motions.pose[self.row, :3]
        return centre

    def apply_force(self, force: Array, point: Array | None = None) -> None:
        """Apply ``force`` (3,) at ``point`` (3,), default the centre of mass, for one tick."""
        self.motions.rouse(self.tree)
        at = self.centre() if point is None else point
        pybullet.applyExternalForce(
            self.uid,
            self.link,
            force.tolist(),
            at.tolist(),
            pybullet.WORLD_FRAME,
            physicsClientId=self.client,
        )

    def apply_wrench(self, wrench: list[float]) -> None:
        """Apply force and torque (6,) at the centre of mass for one tick."""
        self.motions.rouse(self.tree)
        at, uid, link, client = self.centre().tolist(), self.uid, self.link, self.client
        pybullet.applyExternalForce(uid, link, wrench[:3], at, pybullet.WORLD_FRAME, physicsClientId=client)
        pybullet.applyExternalTorque(uid, link, wrench[3:], pybullet.WORLD_FRAME, physicsClientId=client)

    def apply_torque(self, torque: Array) -> None:
        """Apply ``torque`` (3,) for one tick."""
        self.motions.rouse(self.tree)
        pybullet.applyExternalTorque(
            self.uid, self.link, torque.tolist(), pybullet.WORLD_FRAME, physicsClientId=self.client
        )


class BodyControl:
    """Cartesian command of one body and the controller that follows it."""

    def __init__(self, place: Placement, dt: float) -> None:
        self._place, self._dt = place, dt
        self.type = CommandType.FORCE
        self.target = np.zeros(6)
        self._last: Array | None = None
        self._kick = np.zeros(6)
        self._kick_ticks = 0

    def set(self, type_: CommandType, target: Array) -> None:
        """Set the command. The derivative term spreads a jump of a pose target over `KICK_SECONDS`."""
        if type_ is CommandType.POSITION:
            known = self.target if self.type is CommandType.POSITION else self._pose()
            ticks = max(1, round(KICK_SECONDS / self._dt))
            self._kick = (self._kick * self._kick_ticks + _difference(target, known) / self._dt) / ticks
            self._kick_ticks = ticks
            if self.type is not CommandType.POSITION:
                self._last = None  # the error of an earlier pose command: its slope would be a jolt
        self.type, self.target = type_, target

    def apply(self) -> None:
        """Apply the command to the body for the next tick."""
        if self.type is CommandType.FORCE:
            if np.any(self.target) and not self._place.body.static:
                self._place.apply_force(self.target[:3])
                self._place.apply_torque(self.target[3:])
        elif self._place.body.static:
            self._move_static()
        elif self.type is CommandType.VELOCITY:
            self._drive(self.target[:3], self.target[3:])
        else:
            self._follow()

    @property
    def sets_velocity(self) -> bool:
        """Whether the command sets the velocity of the body, rather than forces on it or nothing."""
        body = self._place.body
        if body.static or self._place.link >= 0:
            return False
        by_pose = self.type is CommandType.POSITION and body.controller.linear_output is not OutputType.FORCE
        return self.type is CommandType.VELOCITY or by_pose

    @property
    def acts(self) -> bool:
        """Whether the command has an effect; a force of zero has none."""
        return self.type is not CommandType.FORCE or bool(np.any(self.target))

    def snapshot(self) -> tuple[int, Array, Array, int, Array | None]:
        """The state that is kept from tick to tick."""
        return int(self.type), self.target.copy(), self._kick.copy(), self._kick_ticks, self._last

    def restore(self, snapshot: tuple[int, Array, Array, int, Array | None]) -> None:
        """Continue from `snapshot`."""
        type_, self.target, self._kick, self._kick_ticks, self._last = snapshot
        self.type = CommandType(type_)

    def _pose(self) -> Array:
        pose, twist = np.empty(7), np.empty(6)
        self._place.read(pose, twist)
        return pose

    def _move_static(self) -> None:
        pose = self._pose()
        if self.type is CommandType.VELOCITY:
            if np.any(self.target):
                self._place.set_pose(_moved(pose, self.target * self._dt))
            return
        error = _difference(self.target, pose)
        if np.linalg.norm(error[:3]) >= SMALLEST_MOVE or np.linalg.norm(error[3:]) >= SMALLEST_TURN:
            self._place.set_pose(self.target)

    def _follow(self) -> None:
        """PID towards a pose; velocity output is evaluated implicitly, as for joints."""
        law = self._place.body.controller
        error = _difference(self.target, self._pose())
        kick = self._kick if self._kick_ticks > 0 else np.zeros(6)
        self._kick_ticks = max(self._kick_ticks - 1, 0)
        slope = np.zeros(6) if self._last is None else (error - self._last) / self._dt
        self._last = error
        halves = []
        for part, gains, output in (
            (slice(0, 3), law.linear, law.linear_output),
            (slice(3, 6), law.angular, law.angular_output),
        ):
            if output is OutputType.FORCE:
                halves.append(gains.p * error[part] + gains.d * slope[part])
            else:
                halves.append((gains.p * error[part] + gains.d * kick[part]) / (1.0 + gains.d))
        if law.linear_output is OutputType.FORCE:
            self._place.apply_force(halves[0])
            self._place.apply_torque(halves[1])
        else:
            self._drive(halves[0], halves[1])

    def _drive(self, linear: Array, angular: Array) -> None:
        """Give the body a twist, minus the velocity that gravity adds within the tick."""
        if self._place.link < 0:
            self._place.set_twist(linear - self._place.body.gravity * self._dt, angular)
            return
        pose, twist = np.empty(7), np.empty(6)
        self._place.read(pose, twist)
        body = self._place.body
        self._place.apply_force(body.mass * (linear - twist[:3]) / self._dt)
        R = pose7_matrix(pose)[:3, :3] @ body.T_body_inertial[:3, :3]
        self._place.apply_torque(R @ (body.inertia * (R.T @ (angular - twist[3:]))) / self._dt)


def _difference(target: Array, pose: Array) -> Array:
    """Translation and rotation vector (6,), world axes, from ``pose`` to ``target`` (7,) each."""
    R = pose7_matrix(target)[:3, :3] @ pose7_matrix(pose)[:3, :3].T
    q = matrix_quaternion(R)
    sine = float(np.linalg.norm(q[:3]))
    angle = 2.0 * math.atan2(sine, q[3])
    turn = np.zeros(3) if sine < 1e-12 else q[:3] / sine * angle
    return np.concatenate([target[:3] - pose[:3], turn])


def _moved(pose: Array, step: Array) -> Array:
    """``pose`` (7,) after the small motion ``step`` (6,) in world axes."""
    x, y, z, w = pose[3:]
    r = 0.5 * step[3:]
    turned = pose[3:] + np.array(
        [
            r[0] * w + r[1] * z - r[2] * y,
            r[1] * w + r[2] * x - r[0] * z,
            r[2] * w + r[0] * y - r[1] * x,
            -(r @ pose[3:6]),
        ]
    )
    return np.concatenate([pose[:3] + step[:3], turned / np.linalg.norm(turned)])
