"""A group of joints that moves together: its set-point, its mode and its moves. Radians, metres, seconds."""

from __future__ import annotations

import enum
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.robots.operating_state import Rejected
from ligature.robots.plant import Plant
from ligature.robots.poses import numbers_of
from ligature.robots.trajectory import JointTrajectory

Array = NDArray[np.float64]

STREAM_SECONDS = 0.1
"""Seconds without a command after which a streamed velocity ends and a set-point is at rest."""


class Mode(enum.Enum):
    """What drives the joints."""

    OFF = "off"
    POSITION = "position"
    MOVE = "move"
    VELOCITY = "velocity"
    EFFORT = "effort"


class Axes:
    """Joints of an arm, its jaw or its gripper.

    Parameters
    ----------
    names
        Of the n joints, as clients see them.
    limits
        Lower and upper ends (2, n).
    max_velocity, max_acceleration
        Limits (n,) of moves at ratio 1, in rad/s or m/s and rad/s² or m/s².
    plant
        What is driven.
    """

    def __init__(
        self, names: Sequence[str], limits: Array, max_velocity: ArrayLike, max_acceleration: ArrayLike, plant: Plant
    ) -> None:
        self.names = tuple(names)
        self.n = len(self.names)
        self.limits = limits
        self.max_velocity = np.asarray(max_velocity, dtype=float)
        self.max_acceleration = np.asarray(max_acceleration, dtype=float)
        self.plant = plant
        self.mode = Mode.OFF
        self.ratio_v = self.ratio_a = 1.0
        self._setpoint = np.zeros((3, self.n))
        self._trajectory: JointTrajectory | None = None
        self._since = 0.0
        self._streaming = False

    @property
    def moving(self) -> bool:
        """Whether a move is under way."""
        return self.mode is Mode.MOVE

    @property
    def is_idle(self) -> bool:
        """Whether `tick` does nothing until the next command."""
        return self.mode is not Mode.MOVE and self.mode is not Mode.VELOCITY and not self._streaming

    def measured(self) -> Array:
        """Positions, velocities and efforts now, (3, n)."""
        return self.plant.read()

    @property
    def setpoint(self) -> Array:
        """Positions, velocities and efforts that are asked for, (3, n); those measured while nothing is."""
        if self.mode in (Mode.OFF, Mode.EFFORT):
            self._setpoint[:2] = self.plant.read()[:2]
        return self._setpoint

    def readings(self) -> tuple[Array, Array]:
        """`measured` and `setpoint` with one look at what is driven."""
        measured = self.plant.read()
        if self.mode in (Mode.OFF, Mode.EFFORT):
            self._setpoint[:2] = measured[:2]
        return measured, self._setpoint

    @property
    def goal(self) -> Array:
        """Where the running move ends, or the set-point (n,)."""
        return self.setpoint[0] if self._trajectory is None else self._trajectory.goal

    def clipped(self, position: Array) -> Array:
        """``position`` (n,) within the limits."""
        return np.minimum(np.maximum(position, self.limits[0]), self.limits[1])  # np.clip takes three times as long

    def checked(self, values: ArrayLike, what: str) -> Array:
        """``values`` as n numbers; raises `Rejected` when they are not."""
        numbers = numbers_of(values, what).reshape(-1)
        if len(numbers) != self.n:
            raise Rejected(f"{what} takes {_numbers(self.n)} ({', '.join(self.names)}), not {len(numbers)}")
        if not np.isfinite(numbers).all():
            raise Rejected(f"{what} takes finite numbers, not {numbers.tolist()}")
        return numbers

    # --- modes ------------------------------------------------------------------------------

    def servo(self, position: Array, velocity: Array | None = None) -> None:
        """Follow a stream of set-points; ends a move."""
        self._enter(Mode.POSITION)
        self._setpoint[0] = self.clipped(position)
        self._setpoint[1] = 0.0 if velocity is None else velocity
        self._setpoint[2] = 0.0
        self._streaming, self._since = velocity is not None, 0.0
        self.plant.servo(self._setpoint[0], self._setpoint[1])

    def stream_velocity(self, velocity: Array) -> None:
        """Move with a streamed velocity until the stream ends; ends a move."""
        setpoint = self.setpoint
        self._enter(Mode.VELOCITY)
        setpoint[1], setpoint[2] = velocity, 0.0
        self._since = 0.0

    def move(self, goal: Array) -> None:
        """Start a move from the set-point to ``goal`` (n,), which is clipped to the limits."""
        position, velocity, _ = self.setpoint
        max_velocity, max_acceleration = self.max_velocity * self.ratio_v, self.max_acceleration * self.ratio_a
        trajectory = JointTrajectory(position, velocity, self.clipped(goal), max_velocity, max_acceleration)
        self._enter(Mode.MOVE)
        self._trajectory, self._since = trajectory, 0.0

    def push(self, effort: Array) -> None:
        """Drive the joints with efforts."""
        self._enter(Mode.EFFORT)
        self._setpoint[2] = effort
        self.plant.push(effort)

    def hold(self) -> None:
        """Stay at the set-point, or where the joints are when there is none."""
        self.servo(self.setpoint[0].copy())

    def settle(self) -> None:
        """The joints were put elsewhere: the set-point is where they are now."""
        self.plant.reset()
        if self.mode is not Mode.OFF:
            self.servo(self.plant.read()[0].copy())

    def off(self) -> None:
        """Switch the drives off."""
        self._enter(Mode.OFF)
        self._setpoint[1:] = 0.0
        self.plant.free()

    def place(self, position: Array) -> None:
        """Put the joints somewhere at once, in whatever mode they are."""
        position = self.clipped(position)
        self.plant.place(position)
        if self.mode is not Mode.OFF:
            self.servo(position)

    def _enter(self, mode: Mode) -> None:
        self.mode = mode
        self._trajectory = None
        self._streaming = False

    def tick(self, dt: float) -> bool:
        """Advance by ``dt`` seconds; True when a move ended with this tick."""
        if self.mode is Mode.MOVE:
            return self._follow(dt)
        if self.mode is Mode.VELOCITY:
            self._integrate(dt)
        elif self._streaming:
            self._since += dt
            if self._since > STREAM_SECONDS:
                self.servo(self._setpoint[0].copy())
        return False

    def _follow(self, dt: float) -> bool:
        trajectory = self._trajectory
        assert trajectory is not None
        self._since += dt
        self._setpoint[0], self._setpoint[1] = trajectory.at(self._since)
        self.plant.servo(self._setpoint[0], self._setpoint[1])
        if self._since < trajectory.duration:
            return False
        self._enter(Mode.POSITION)
        return True

    def _integrate(self, dt: float) -> None:
        self._since += dt
        if self._since > STREAM_SECONDS:
            self.hold()
            return
        position = self._setpoint[0] + dt * self._setpoint[1]
        clipped = self.clipped(position)
        self._setpoint[1, clipped != position] = 0.0
        self._setpoint[0] = clipped
        self.plant.servo(self._setpoint[0], self._setpoint[1])

    # --- snapshots --------------------------------------------------------------------------

    def snapshot(self) -> dict[str, object]:
        """Everything that lasts from tick to tick but the plant's own."""
        names = ("mode", "ratio_v", "ratio_a", "_setpoint", "_trajectory", "_since", "_streaming", "limits")
        return {**{name: getattr(self, name) for name in names}, "plant": self.plant.snapshot()}

    def restore(self, snapshot: dict[str, object]) -> None:
        """Continue from `snapshot`."""
        for name, value in snapshot.items():
            if name == "plant":
                self.plant.restore(value)
            else:
                setattr(self, name, value)


def _numbers(n: int) -> str:
    return "1 number" if n == 1 else f"{n} numbers"
