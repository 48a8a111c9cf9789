"""Moves of a group of joints under velocity and acceleration limits, by ruckig; radians and metres, seconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Result, Ruckig, Trajectory

Array = NDArray[np.float64]


class JointTrajectory:
    """A move from a state of motion to a goal at rest; all joints arrive together.

    Parameters
    ----------
    position, velocity
        State of motion (n,) at the start.
    goal
        Where to end at rest (n,).
    fastest, hardest
        Limits of velocity and acceleration (n,).
    """

    def __init__(self, position: Array, velocity: Array, goal: Array, fastest: Array, hardest: Array) -> None:
        self._asked = position.copy(), velocity.copy(), goal.copy(), fastest.copy(), hardest.copy()
        n = len(goal)
        request = InputParameter(n)
        request.current_position, request.current_velocity = position.tolist(), velocity.tolist()
        request.current_acceleration = [0.0] * n
        request.target_position = goal.tolist()
        request.target_velocity = request.target_acceleration = [0.0] * n
        request.max_velocity, request.max_acceleration = fastest.tolist(), hardest.tolist()
        request.max_jerk = [float("inf")] * n
        self._trajectory = Trajectory(n)
        result = Ruckig(n).calculate(request, self._trajectory)
        if result not in (Result.Working, Result.Finished):
            raise ValueError(f"no trajectory from {position} to {goal}: {result}")
        self.goal = goal

    def __reduce__(self) -> tuple[type[JointTrajectory], tuple[Array, ...]]:
        """Planned again in another process: the same request has the same trajectory."""
        return JointTrajectory, self._asked

    def __deepcopy__(self, memo: object) -> JointTrajectory:
        """Itself: a trajectory never changes."""
        return self

    @property
    def duration(self) -> float:
        """Seconds from start to end."""
        return float(self._trajectory.duration)

    def at(self, time: float) -> tuple[Array, Array]:
        """Positions and velocities (n,) ``time`` seconds after the start; the goal at rest afterwards."""
        if time >= self.duration:
            return self.goal, np.zeros(len(self.goal))
        position, velocity, _ = self._trajectory.at_time(time)
        return np.array(position), np.array(velocity)
