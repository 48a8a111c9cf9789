"""Joint controllers of one tree: PID, velocity and effort commands, and springs, once a tick.

Positions are radians or metres, efforts N·m or N. The PID follows ADF specification §15.6 with its
derivative taken implicitly: with velocity output ``v = P e + I ∫e + D ė`` and ``ė = ṫ − v`` the
joint's velocity is ``v = (P e + I ∫e + D ṫ) / (1 + D)``. Evaluated explicitly, as the reference
does, a D near 1 chatters at the rate of the loop; the implicit form is the same law without it.

With force output the effort is ``P e + I ∫e + D (ṫ − v)``. It goes to a motor of that strength, whose velocity is the
one at which the effort vanishes: Bullet's solver finds the effort along with all contacts and loops, so that it is
the law's where the joint is heavy enough for it to act in full over a tick, and less where it would overshoot.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.kernels import compiled
from ligature.model.commands import CommandType
from ligature.model.scene import Joint, JointType, OutputType
from ligature.model.subsystem import kept, put_back
from ligature.physics.articulation import MOST_DAMPED, STIFFEST, Tree
from ligature.physics.motions import Motions
from ligature.tables import opener, table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

GIVING_FRICTION = 0.005
"""Effort (N·m or N) that a motor which gives always has, so that it arrives at its set-point."""

KICK_SECONDS = 0.01
"""Time over which the derivative answers a jump of the target: two updates of a usual AMBF session."""

FREE, FORCE, POSITION, VELOCITY = (
    -1,
    int(CommandType.FORCE),
    int(CommandType.POSITION),
    int(CommandType.VELOCITY),
)
SERVO = 3
"""Mode of a joint that an arm of a robot drives: it follows a set-point and its velocity."""

FREE_SPEED = 1e3
"""Speed in rad/s or m/s that an effort alone would reach, were it not bounded otherwise."""

STOP_GAIN = 0.2
"""Share of its way back that a stopped joint goes in a tick."""

SERVO_GAIN = 200.0
"""Closing speed over following error in 1/s: the set-point is reached with a time constant of 5 ms."""

MOTORISED = (JointType.REVOLUTE, JointType.PRISMATIC)
PUSHED = (*MOTORISED, JointType.LINEAR_SPRING, JointType.TORSION_SPRING)


class Axes(NamedTuple):
    """The single axes of one tree for compiled code, all arrays (n,)."""

    mode: Integers
    force_output: Flags
    turns: Flags
    sprung: Flags
    p: Array
    i: Array
    d: Array
    stiffness: Array
    damping: Array
    rest: Array
    target: Array
    pace: Array  # of the target
    max_velocity: Array
    max_deceleration: Array
    position: Array
    velocity: Array
    integral: Array
    kick: Array
    kick_ticks: Integers
    motor: Array  # velocities of motors
    asked: Array  # what a motor with force output exerts at most
    effort: Array  # what acts beside motors


def _no_axes() -> Axes:
    z, whole, flag = np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.bool_)
    return Axes(
        mode=whole, force_output=flag, turns=flag, sprung=flag, p=z, i=z, d=z, stiffness=z, damping=z, rest=z,
        target=z, pace=z, max_velocity=z, max_deceleration=z, position=z, velocity=z, integral=z, kick=z,
        kick_ticks=whole, motor=z, asked=z, effort=z,
    )  # fmt: skip


open_axes = opener(_no_axes())


@compiled
def outputs(table: Integers, dt: float) -> None:
    """Motor velocities and efforts of one tick for the axes of a table of `Axes`.

    What it keeps, and the last three arrays change.
    """
    axes = open_axes(table)
    for k in range(axes.mode.shape[0]):
        axes.motor[k] = axes.asked[k] = axes.effort[k] = 0.0
        if axes.mode[k] == POSITION:
            error = axes.target[k] - axes.position[k]
            if axes.turns[k]:
                error = (error + np.pi) % (2 * np.pi) - np.pi
            axes.integral[k] += error * dt
            pull = axes.p[k] * error + axes.i[k] * axes.integral[k]
            jump = 0.0
            if axes.kick_ticks[k] > 0:
                jump = axes.kick[k]
                axes.kick_ticks[k] -= 1
            if axes.force_output[k]:
                axes.asked[k] = pull + axes.d[k] * (jump - axes.velocity[k])
                axes.motor[k] = jump + _vanishing(pull, axes.d[k], STOP_GAIN / dt * abs(error))
            else:
                axes.motor[k] = (pull + axes.d[k] * jump) / (1.0 + axes.d[k])
        elif axes.mode[k] == SERVO:
            error = axes.target[k] - axes.position[k]
            closing = min(SERVO_GAIN * abs(error), np.sqrt(2.0 * axes.max_deceleration[k] * abs(error)))
            axes.motor[k] = min(
                max(axes.pace[k] + np.copysign(closing, error), -axes.max_velocity[k]), axes.max_velocity[k]
            )
        elif axes.mode[k] == VELOCITY:
            axes.motor[k] = axes.target[k]
        elif axes.mode[k] == FORCE:
            axes.effort[k] = axes.target[k]
        if axes.sprung[k]:
            axes.effort[k] += axes.stiffness[k] * (axes.rest[k] - axes.position[k]) - axes.damping[k] * axes.velocity[k]


@compiled
def _vanishing(pull: float, damping: float, most: float) -> float:
    """Velocity at which a damper takes up ``pull``, at most ``most``."""
    if abs(pull) > damping * most:
        return np.copysign(most, pull)
    return pull / damping if damping > 0.0 else 0.0


class TreeControl:
    """State of all single axes of one tree, as arrays in the order of ``tree.axes``."""

    def __init__(
        self, client: int, tree: Tree, joints: tuple[Joint, ...], dt: float, motions: Motions, index: int
    ) -> None:
        self._client, self.tree, self._dt = client, tree, dt
        self._motions, self._index = motions, index
        self._anchor = tree.root if tree.static else -1
        owners = [joints[joint] for _, joint, _, _ in tree.axes]
        self.links = [link for link, *_ in tree.axes]
        self.row = {joint: i for i, (_, joint, _, _) in enumerate(tree.axes)}
        n = len(self.links)
        self._p = np.array([j.controller.p for j in owners])
        self._i = np.array([j.controller.i for j in owners])
        self._d = np.array([j.controller.d for j in owners])
        self._strength = np.array([1000.0 * j.max_motor_impulse for j in owners])
        self._force_output = np.array([j.output is OutputType.FORCE for j in owners], dtype=bool)
        self._low = np.array([-np.inf if a.low is None else a.low for _, _, a, _ in tree.axes])
        self._high = np.array([np.inf if a.high is None else a.high for _, _, a, _ in tree.axes])
        self._turns = np.array(
            [j.type is JointType.REVOLUTE and a.low is None for j, (_, _, a, _) in zip(owners, tree.axes, strict=True)],
            dtype=bool,
        )
        self._spring_setup(owners)
        self.mode = np.full(n, FREE)
        self.target = np.zeros(n)
        self._pace = np.zeros(n)
        self._max_velocity = np.full(n, np.inf)
        self._max_deceleration = np.full(n, np.inf)
        self._yield_stiffness = np.zeros(n)
        self.owned = np.zeros(n, dtype=bool)
        self._integral = np.zeros(n)
        self._kick = np.zeros(n)
        self._kick_ticks = np.zeros(n, dtype=np.int64)
        self._motor, self._asked, self._effort = np.zeros(n), np.zeros(n), motions.push[motions.slices[index]]
        self._laden = False
        self._driven: list[int] = []
        self._stops: dict[int, float] = {}
        self._slowed: dict[int, tuple[float, float, float]] = {}
        rows = motions.slices[index]
        self.position, self.velocity = motions.position[rows], motions.velocity[rows]
        self._table = table_of(
            Axes(
                self.mode, self._force_output, self._turns, self._sprung, self._p, self._i, self._d, self._stiffness,
                self._damping, self._rest, self.target, self._pace, self._max_velocity, self._max_deceleration,
                self.position, self.velocity, self._integral, self._kick, self._kick_ticks, self._motor, self._asked,
                self._effort,
            )
        )  # fmt: skip
        self._sort()

    def _spring_setup(self, owners: list[Joint]) -> None:
        """Spring constants with the reference's caps: sampled at a quarter period, damped within a tick (§15.4)."""
        axes = [axis for _, _, axis, _ in self.tree.axes]
        moved = np.array([m for *_, m in self.tree.axes])
        crowd = self._crowding(owners)
        self._stiffness = np.minimum([a.stiffness for a in axes], moved / (STIFFEST * self._dt**2))
        self._damping = np.minimum([a.damping for a in axes], MOST_DAMPED * moved / (crowd * self._dt))
        self._rest = np.array([a.rest for a in axes])
        self._sprung = np.array([a.sprung for a in axes], dtype=bool)

    def _crowding(self, owners: list[Joint]) -> Array:
        """Number (n,) of sprung joints that share a body with that of each axis: their dampers act together."""
        sprung = {j.index: j for j, (_, _, axis, _) in zip(owners, self.tree.axes, strict=True) if axis.sprung}
        at = Counter(body for j in sprung.values() for body in {j.parent, j.child} - {self._anchor})
        return np.array([max(1, at[j.parent], at[j.child]) for j in owners], dtype=float)

    @property
    def active(self) -> bool:
        """Whether anything has to be done each tick."""
        return bool(self._driven or self._pushed)

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
        value = min(max(value, self._low[row]), self._high[row])
        if self.mode[row] != POSITION:
            self._motions.joints(self._index)
            self._integral[row] = 0.0
            # the reference's first derivative of a force is zero, that of a velocity the whole way
            previous = value if self._force_output[row] else self.position[row]
        else:
            previous = self.target[row]
        self._switch(row, POSITION, value)
        jump = self._way(row, value - previous)
        if jump != 0.0:
            ticks = max(1, round(KICK_SECONDS / self._dt))
            left = self._kick[row] * self._kick_ticks[row]
            self._kick[row] = (left + jump / self._dt) / ticks
            self._kick_ticks[row] = ticks

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
        self.owned[rows] = True
        self.target[rows] = position
        self._pace[rows] = velocity
        if (self.mode[rows] != SERVO).any():
            self._max_velocity[rows], self._max_deceleration[rows], self._yield_stiffness[rows] = (
                max_velocity,
                max_deceleration,
                yield_stiffness,
            )
            self._enter(rows, SERVO)

    def push(self, rows: Integers, effort: Array) -> None:
        """Drive the axes ``rows`` (k,) with efforts; 0 lets one move freely."""
        self.owned[rows] = True
        self.target[rows] = effort
        if (self.mode[rows] != FORCE).any():
            self._enter(rows, FORCE)

    def let_go(self, rows: Integers) -> None:
        """Let the axes ``rows`` (k,) go limp."""
        self.owned[rows] = False
        self.target[rows] = 0.0
        self._enter(rows, FREE)

    def _enter(self, rows: Integers, mode: int) -> None:
        self.mode[rows] = mode
        self._kick[rows] = 0.0
        self._kick_ticks[rows] = 0
        self._sort()

    def release(self, joint: int) -> None:
        """Let one joint go limp, unless an arm owns it."""
        if not self.owned[self.row[joint]]:
            self._switch(self.row[joint], FREE, 0.0)

    def stop(self, joint: int, position: float, effort: float) -> None:
        """Keep one joint at ``position``, whatever it is commanded to do, until `let`; it reports ``effort``."""
        row = self.row[joint]
        fresh = row not in self._stops
        self._stops[row] = position
        self._motions.sent[self._motions.slices[self._index].start + row] = effort
        self._slowed.pop(row, None)
        if fresh:
            self._sort()

    def slow(self, joint: int, low: float, high: float, strength: float) -> None:
        """Keep the velocity of one motor between ``low`` and ``high``, its effort below ``strength``, until `let`."""
        row = self.row[joint]
        fresh = row not in self._slowed
        self._slowed[row] = low, high, strength
        if fresh:
            self._sort()

    def let(self, joint: int) -> None:
        """End `stop` and `slow`."""
        row = self.row[joint]
        self._motions.sent.pop(self._motions.slices[self._index].start + row, None)
        if (self._slowed.pop(row, None) or self._stops.pop(row, None)) is not None:
            self._sort()

    def pull(self, joint: int, stiffness: float) -> float:
        """Effort that the command of one joint asks for, were the joint stopped where it is.

        A motor with a set-point pulls in proportion to its following error, with ``stiffness`` (N·m/rad, N/m)
        unless it has a yield stiffness; one with a velocity pulls with all its strength.
        """
        row = self.row[joint]
        mode, behind = self.mode[row], self._way(row, self.target[row] - self.position[row])
        if mode == FORCE:
            return float(self.target[row])
        if mode == VELOCITY:
            return float(np.sign(self.target[row]) * self._strength[row])
        if mode == SERVO:
            return float((self._yield_stiffness[row] or stiffness) * behind)
        if mode == POSITION:
            return float(self._asked[row] if self._force_output[row] else stiffness * behind)
        return 0.0

    def _switch(self, row: int, mode: int, target: float) -> None:
        before = self.mode[row]
        self.mode[row] = mode
        self.target[row] = target
        if mode != POSITION:
            self._kick[row] = 0.0
            self._kick_ticks[row] = 0
        if mode != before:
            self._sort()

    def _way(self, row: int, error: float) -> float:
        """``error``, the shorter way round for a joint that turns without limits."""
        return float((error + np.pi) % (2 * np.pi) - np.pi) if self._turns[row] else float(error)

    def read(self, rows: Integers) -> Array:
        """Positions, velocities and motor efforts (3, k) of the axes ``rows`` (k,) now."""
        return self._motions.joints(self._index)[:, rows]

    def put(self, rows: Iterable[int], positions: Iterable[float], velocity: float = 0.0) -> None:
        """Set axes to positions and a velocity at once, without dynamics."""
        for row, position in zip(rows, positions, strict=True):
            pybullet.resetJointState(self.tree.uid, self.links[row], position, velocity, physicsClientId=self._client)
        self._motions.forget(self._index)

    def carry(self) -> None:
        """From now on the joints bear `Motions.force` of their tree's links, too."""
        self._laden = True
        self._sort()

    def apply(self) -> None:
        """Set motors and torques of this tick."""
        self._motions.joints(self._index)
        outputs(self._table, self._dt)
        if self._laden:
            self._motions.apply_gravity(self._index)
        for row, (low, high, _) in self._slowed.items():
            wanted = np.sign(self.target[row]) * FREE_SPEED if self.mode[row] == FORCE else self._motor[row]
            self._motor[row] = min(max(wanted, low), high)
        for row, position in self._stops.items():
            self._motor[row] = STOP_GAIN / self._dt * (position - self.position[row])
        if self._driven:
            pybullet.setJointMotorControlArray(
                self.tree.uid,
                self._driven_links,
                pybullet.VELOCITY_CONTROL,
                targetVelocities=self._motor[self._driven].tolist(),
                forces=self._strengths(),
                physicsClientId=self._client,
            )
        if self._pushed:
            pybullet.setJointMotorControlArray(
                self.tree.uid,
                self._pushed_links,
                pybullet.TORQUE_CONTROL,
                forces=self._effort[self._pushed].tolist(),
                physicsClientId=self._client,
            )

    def _strengths(self) -> list[float]:
        """Largest effort of each driven motor; one that yields pulls in proportion to its following error."""
        if not (self._varies or self._slowed):
            return self._driven_strength
        rows = self._driven
        spring = self._yield_stiffness[rows] * np.abs(self.target[rows] - self.position[rows])
        strength = self._strength[rows]
        yielding = np.minimum(spring + GIVING_FRICTION, strength)
        limits = np.where(self._yield_stiffness[rows] > 0.0, yielding, strength)
        limits = np.where(self._by_force(rows), np.abs(self._asked[rows]), limits)
        for i, row in enumerate(rows):
            if row in self._slowed:
                low, high, most = self._slowed[row]
                effort = abs(self.target[row]) if self.mode[row] == FORCE else limits[i]
                limits[i] = min(effort, most) if low <= self.velocity[row] <= high else strength[i]
            elif row in self._stops:
                limits[i] = strength[i]
        efforts: list[float] = limits.tolist()
        return efforts

    def _by_force(self, rows: Sequence[int]) -> Flags:
        """Whether the axes ``rows`` (k,) follow a position by an effort."""
        return np.asarray((self.mode[rows] == POSITION) & self._force_output[rows], dtype=bool)

    def _sort(self) -> None:
        """Sort the axes into those that a motor drives and those that an effort pushes; stop idle motors."""
        by_motor = (self.mode == VELOCITY) | (self.mode == SERVO) | (self.mode == POSITION)
        by_effort = self._laden | self._sprung | (self.mode == FORCE)
        # An effort whose speed is bounded is a motor of that strength.
        stopped = [*self._stops, *(row for row in self._slowed if self.mode[row] == FORCE)]
        by_motor[stopped], by_effort[stopped] = True, False
        idle = [self.links[row] for row in self._driven if not by_motor[row]]
        if idle:
            pybullet.setJointMotorControlArray(
                self.tree.uid, idle, pybullet.VELOCITY_CONTROL, forces=[0.0] * len(idle), physicsClientId=self._client
            )
        if self.links:
            self._motions.drive(self._index, np.flatnonzero(by_motor).tolist())
        self._driven, self._pushed = np.flatnonzero(by_motor).tolist(), np.flatnonzero(by_effort).tolist()
        self._driven_links = [self.links[row] for row in self._driven]
        self._driven_strength = self._strength[self._driven].tolist()
        self._pushed_links = [self.links[row] for row in self._pushed]
        self._varies = bool((self._yield_stiffness[self._driven] > 0.0).any() or self._by_force(self._driven).any())

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return kept(self, _KEPT)

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        put_back(self, snapshot)
        self._sort()

    def held(self) -> dict[str, Any]:
        """The commands now, for `follow`."""
        return {name: getattr(self, name).copy() for name in ("mode", *_COMMANDED)}

    def follow(self, held: dict[str, Any]) -> None:
        """Begin anew with commands that `held` gave, as if they came now."""
        self.mode[:] = FREE
        for array in (self._integral, self._kick, self._kick_ticks, self._asked):
            array[:] = 0
        self._stops, self._slowed = {}, {}
        for name in _COMMANDED:
            getattr(self, name)[:] = held[name]
        aimed = held["mode"] == POSITION
        self.mode[~aimed] = held["mode"][~aimed]
        for row in np.flatnonzero(aimed).tolist():
            self._aim(row, float(held["target"][row]))
        self._sort()


_COMMANDED = ("target", "_pace", "_max_velocity", "_max_deceleration", "_yield_stiffness", "owned")
"""Attributes of a `TreeControl`, beside the modes, that commands set."""

_KEPT = (
    "mode", "target", "_integral", "_kick", "_kick_ticks", "_pace", "_max_velocity", "_max_deceleration",
    "_yield_stiffness", "owned", "_stops", "_slowed", "_asked",
)  # fmt: skip
"""Attributes of a `TreeControl` that last from tick to tick."""
