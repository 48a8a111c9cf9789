"""Joint controllers of one tree: which commands its axes follow, and how. Radians, metres, N·m, N.

The laws themselves are in `ligature.physics.axes`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.kernels import compiled
from ligature.model.commands import CommandType
from ligature.model.scene import Joint, JointType, OutputType
from ligature.physics.articulation import MOST_DAMPED, STIFFEST, Tree
from ligature.physics.axes import FORCE, FREE, POSITION, SERVO, VELOCITY, Axes
from ligature.physics.motions import Motions

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

KICK_SECONDS = 0.01
"""Time over which the derivative answers a jump of the target: two updates of a usual AMBF session."""


@compiled
def _follow(
    owned: Flags, target: Array, pace: Array, mode: Integers, rows: Integers, position: Array, velocity: Array
) -> bool:
    """Give the axes ``rows`` (k,) to an arm with set-points that move; whether all follow such in their ``mode``."""
    follow = True
    for k in range(rows.shape[0]):
        row = rows[k]
        owned[row], target[row], pace[row] = True, position[k], velocity[k]
        follow = follow and mode[row] == SERVO
    return follow


MOTORISED = (JointType.REVOLUTE, JointType.PRISMATIC)
PUSHED = (*MOTORISED, JointType.LINEAR_SPRING, JointType.TORSION_SPRING)


class TreeControl:
    """The single axes of one tree, in the order of ``tree.axes``.

    Parameters
    ----------
    everything
        The axes of all trees; this object works on its own rows of them.
    index
        Of the tree.

    Attributes
    ----------
    axes
        The rows of this tree.
    first_axis
        Number of the first of them among those of all trees.
    """

    def __init__(
        self, client: int, tree: Tree, joints: tuple[Joint, ...], dt: float, motions: Motions, everything: Axes,
        index: int,
    ) -> None:  # fmt: skip
        self._client, self.tree, self._dt = client, tree, dt
        self._motions, self._index = motions, index
        self._anchor = tree.root if tree.static else -1
        owners = [joints[joint] for _, joint, _, _ in tree.axes]
        self.links = [link for link, *_ in tree.axes]
        self.row = {joint: i for i, (_, joint, _, _) in enumerate(tree.axes)}
        self._laden, self._steered = (flags[index : index + 1] for flags in (everything.laden, everything.steered))
        rows = motions.slices[index]
        self.first_axis = rows.start
        own = self.axes = Axes._make([self._laden, self._steered, *(array[rows] for array in everything[2:])])
        own.p[:] = [j.controller.p for j in owners]
        own.i[:] = [j.controller.i for j in owners]
        own.d[:] = [j.controller.d for j in owners]
        own.strength[:] = [1000.0 * j.max_motor_impulse for j in owners]
        own.force_output[:] = [j.output is OutputType.FORCE for j in owners]
        own.low[:] = [-np.inf if a.low is None else a.low for _, _, a, _ in tree.axes]
        own.high[:] = [np.inf if a.high is None else a.high for _, _, a, _ in tree.axes]
        own.turns[:] = [
            j.type is JointType.REVOLUTE and a.low is None for j, (_, _, a, _) in zip(owners, tree.axes, strict=True)
        ]
        self._spring_setup(owners)
        self.mode, self.target, self.owned = own.mode, own.target, own.owned
        self._position = motions.position[rows]
        self.sort()

    def _spring_setup(self, owners: list[Joint]) -> None:
        """Spring constants with Bullet's caps: sampled at a quarter period, damped within a tick."""
        axes, own = [axis for _, _, axis, _ in self.tree.axes], self.axes
        moved = np.array([m for *_, m in self.tree.axes])
        crowd = self._dampers_on_a_body(owners)
        own.most_stiffness[:] = moved / (STIFFEST * self._dt**2)
        own.most_damping[:] = MOST_DAMPED * moved / (crowd * self._dt)
        own.stiffness[:] = np.minimum([a.stiffness for a in axes], own.most_stiffness)
        own.damping[:] = np.minimum([a.damping for a in axes], own.most_damping)
        own.rest[:] = [a.rest for a in axes]
        own.sprung[:] = [a.sprung for a in axes]

    def _dampers_on_a_body(self, owners: list[Joint]) -> Array:
        """Number (n,) of sprung joints that share a body with that of each axis: their dampers act together."""
        sprung = {j.index: j for j, (_, _, axis, _) in zip(owners, self.tree.axes, strict=True) if axis.sprung}
        at = Counter(body for j in sprung.values() for body in {j.parent, j.child} - {self._anchor})
        return np.array([max(1, at[j.parent], at[j.child]) for j in owners], dtype=float)

    @property
    def commanded(self) -> bool:
        """Whether a client commands a joint: an arm has its own limits of speed."""
        pushed = (self.mode == FORCE) & (self.target != 0.0)
        return bool((pushed | (self.mode == POSITION) | (self.mode == VELOCITY)).any())

    def command(self, joint: Joint, type_: CommandType, value: float) -> None:
        """Take a command for one joint; a position command of a sprung or disabled joint has no effect.

        Nor has one for a joint that an enabled arm owns.
        """
        row = self.row[joint.index]
        if self.owned[row]:
            return
        if type_ is CommandType.FORCE:
            if joint.type in PUSHED:
                self._switch(row, FORCE, value)
            return
        if joint.type not in MOTORISED or (type_ is CommandType.POSITION and not joint.motor_enabled):
            return
        if type_ is CommandType.VELOCITY:
            self._switch(row, VELOCITY, value)
            return
        self._aim(row, value)

    def _aim(self, row: int, value: float) -> None:
        """Take a position command for one axis."""
        value = min(max(value, self.axes.low[row]), self.axes.high[row])
        if self.mode[row] != POSITION:
            self._motions.joints(self._index)
            self.axes.integral[row] = 0.0
            # the reference's first derivative of a force is zero, that of a velocity the whole way
            previous = value if self.axes.force_output[row] else self._position[row]
        else:
            previous = self.target[row]
        self._switch(row, POSITION, value)
        jump = self._way(row, value - previous)
        if jump != 0.0:
            ticks = max(1, round(KICK_SECONDS / self._dt))
            left = self.axes.kick[row] * self.axes.kick_ticks[row]
            self.axes.kick[row] = (left + jump / self._dt) / ticks
            self.axes.kick_ticks[row] = ticks

    def servo(
        self,
        rows: Integers,
        position: Array,
        velocity: Array,
        max_velocity: Array,
        max_deceleration: Array,
        yield_stiffness: Array,
    ) -> None:
        """Have the axes ``rows`` (k,) follow set-points that move with ``velocity``.

        They do so at most at the speed ``max_velocity``, and brake with ``max_deceleration``, so that a step does not
        overshoot. ``yield_stiffness`` (k,) is the stiffness (N·m/rad, N/m) with which a motor yields to a load; 0 is
        as strong as the motor.
        """
        if not _follow(self.owned, self.target, self.axes.pace, self.mode, rows, position, velocity):
            self.axes.max_velocity[rows], self.axes.max_deceleration[rows] = max_velocity, max_deceleration
            self.axes.yield_stiffness[rows] = yield_stiffness
            self._enter(rows, SERVO)

    def push(self, rows: Integers, effort: Array) -> None:
        """Drive the axes ``rows`` (k,) with efforts; 0 lets one move freely."""
        self.owned[rows] = True
        self.target[rows] = effort
        if (self.mode[rows] != FORCE).any():
            self._enter(rows, FORCE)

    def release_rows(self, rows: Integers) -> None:
        """Let the axes ``rows`` (k,) go limp."""
        self.owned[rows] = False
        self.target[rows] = 0.0
        self._enter(rows, FREE)

    def _enter(self, rows: Integers, mode: int) -> None:
        self.mode[rows] = mode
        self.axes.kick[rows] = 0.0
        self.axes.kick_ticks[rows] = 0
        self.sort()

    def release(self, joint: int) -> None:
        """Let one joint go limp, unless an arm owns it."""
        if not self.owned[self.row[joint]]:
            self._switch(self.row[joint], FREE, 0.0)

    def limit_velocity(self, joint: int, low: float, high: float, strength: float) -> None:
        """Keep the velocity of one motor within ``low`` and ``high``, its effort below ``strength``, until `resume`."""
        row, own = self.row[joint], self.axes
        fresh = not own.slowed[row]
        own.slowed[row] = True
        own.lower_speed[row], own.upper_speed[row], own.upper_effort[row] = low, high, strength
        if fresh:
            self.sort()

    def resume(self, joint: int) -> None:
        """End `Joints.stop` and `limit_velocity`."""
        row, own = self.row[joint], self.axes
        self._motions.send(self.first_axis + row, None)
        if own.slowed[row] or own.stopped[row]:
            self._clear_bounds(row)
            self.sort()

    def _clear_bounds(self, rows: int | slice) -> None:
        """Remove all stops and speed limits of axes."""
        own = self.axes
        own.stopped[rows], own.slowed[rows] = False, False
        for array in (own.stop, own.lower_speed, own.upper_speed, own.upper_effort):
            array[rows] = 0.0

    def _switch(self, row: int, mode: int, target: float) -> None:
        before = self.mode[row]
        self.mode[row] = mode
        self.target[row] = target
        if mode != POSITION:
            self.axes.kick[row] = 0.0
            self.axes.kick_ticks[row] = 0
        if mode != before:
            self.sort()

    def _way(self, row: int, error: float) -> float:
        """``error``, wrapped to the shorter direction for a joint that turns without limits."""
        return float((error + np.pi) % (2 * np.pi) - np.pi) if self.axes.turns.item(row) else float(error)

    def read(self, rows: Integers) -> Array:
        """Positions, velocities and motor efforts (3, k) of the axes ``rows`` (k,) now."""
        return self._motions.joints(self._index)[:, rows]

    def set_state(self, rows: Iterable[int], positions: Iterable[float], velocity: float = 0.0) -> None:
        """Set axes to positions and a velocity at once, without dynamics."""
        for row, position in zip(rows, positions, strict=True):
            pybullet.resetJointState(self.tree.uid, self.links[row], position, velocity, physicsClientId=self._client)
        self._motions.forget(self._index)

    def carry(self) -> None:
        """From now on the joints bear `Motions.force` of their tree's links, too."""
        self._laden[0] = True
        self.sort()

    def send(self) -> None:
        """Have PyBullet take motors and efforts of this tick, where compiled code cannot."""
        acted = self.axes.pushed | (self._motions.trees.foreseen[self._motions.slices[self._index]] != 0.0)
        own, uid, motors, efforts = self.axes, self.tree.uid, *map(np.flatnonzero, (self.axes.driven, acted))
        links = np.array(self.links)
        if len(motors):
            pybullet.setJointMotorControlArray(
                uid, links[motors].tolist(), pybullet.VELOCITY_CONTROL, targetVelocities=own.motor[motors].tolist(),
                forces=own.limit[motors].tolist(), physicsClientId=self._client,
            )  # fmt: skip
        if len(efforts):
            push = self._motions.push[self._motions.slices[self._index]]
            pybullet.setJointMotorControlArray(
                uid, links[efforts].tolist(), pybullet.TORQUE_CONTROL, forces=push[efforts].tolist(),
                physicsClientId=self._client,
            )  # fmt: skip

    def sort(self) -> None:
        """Sort the axes into those that a motor drives and those that an effort pushes; stop idle motors."""
        own = self.axes
        by_motor = (own.mode == VELOCITY) | (own.mode == SERVO) | (own.mode == POSITION)
        by_effort = self._laden | own.sprung | (own.mode == FORCE)
        # An effort whose speed is bounded is a motor of that strength.
        stopped = own.stopped | (own.slowed & (own.mode == FORCE))
        by_motor, by_effort = by_motor | stopped, by_effort & ~stopped
        idle = [self.links[row] for row in np.flatnonzero(own.driven & ~by_motor)]
        if idle:
            pybullet.setJointMotorControlArray(
                self.tree.uid, idle, pybullet.VELOCITY_CONTROL, forces=[0.0] * len(idle), physicsClientId=self._client
            )
        own.driven[:], own.pushed[:] = by_motor, by_effort
        self._steered[0] = self.tree.static and by_motor.all()
        self._motions.drive(self._index, by_motor)

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return {name: getattr(self.axes, name) for name in _KEPT}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for name, values in snapshot.items():
            getattr(self.axes, name)[:] = values
        self.sort()

    def held(self) -> dict[str, Any]:
        """The commands now, for `follow`."""
        return {name: getattr(self.axes, name).copy() for name in ("mode", *_COMMANDED)}

    def follow(self, held: dict[str, Any]) -> None:
        """Begin anew with commands that `held` gave, as if they came now."""
        own = self.axes
        own.mode[:] = FREE
        for array in (own.integral, own.kick, own.kick_ticks, own.asked):
            array[:] = 0
        self._clear_bounds(slice(None))
        for name in _COMMANDED:
            getattr(own, name)[:] = held[name]
        aimed = held["mode"] == POSITION
        own.mode[~aimed] = held["mode"][~aimed]
        for row in np.flatnonzero(aimed).tolist():
            self._aim(row, float(held["target"][row]))
        self.sort()


_COMMANDED = ("target", "pace", "max_velocity", "max_deceleration", "yield_stiffness", "owned")
"""Arrays of `Axes`, beside the modes, that commands set."""

_KEPT = (
    "mode", "target", "integral", "kick", "kick_ticks", "pace", "max_velocity", "max_deceleration", "yield_stiffness",
    "owned", "stopped", "stop", "slowed", "lower_speed", "upper_speed", "upper_effort", "asked",
)  # fmt: skip
"""Arrays of `Axes` that last from tick to tick."""
