"""Moves of a group of joints under velocity and acceleration limits, by ruckig; radians and metres, seconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Result, Ruckig, RuckigError, Trajectory

from ligature.robots.operating_state import Rejected

Array = NDArray[np.float64]

LONGEST = 7000.0
"""Seconds of the longest trajectory that ruckig calculates reliably (its documentation, "Numerical Stability")."""


class JointTrajectory:
    """A move from a state of motion to a goal at rest; all joints arrive together.

    Parameters
    ----------
    position, velocity
        State of motion (n,) at the start.
    goal
        Where to end at rest (n,).
    max_velocity, max_acceleration
        Limits of velocity and acceleration (n,).

    Raises
    ------
    Rejected
        When ruckig finds no trajectory: for several joints it calculates none of more than `LONGEST` seconds.
    """

    def __init__(
        self, position: Array, velocity: Array, goal: Array, max_velocity: Array, max_acceleration: Array
    ) -> None:
        self._asked = position.copy(), velocity.copy(), goal.copy(), max_velocity.copy(), max_acceleration.copy()
        n = len(goal)
        request = InputParameter(n)
        request.current_position, request.current_velocity = position.tolist(), velocity.tolist()
        request.target_position = goal.tolist()
        request.target_velocity = request.target_acceleration = [0.0] * n
        request.max_velocity, request.max_acceleration = max_velocity.tolist(), max_acceleration.tolist()
        request.max_jerk = [float("inf")] * n
        self._trajectory = Trajectory(n)
        try:
            result = Ruckig(n).calculate(request, self._trajectory)
        except (RuckigError, ValueError):  # arithmetic that fails; a result that its Python enumeration lacks
            result = Result.Error
        if result not in (Result.Working, Result.Finished):
            raise Rejected(
                f"ruckig finds no trajectory within {LONGEST:g} s from {np.round(position, 4).tolist()} to"
                f" {np.round(goal, 4).tolist()}; raise 'trajectory_j/set_ratio'"
            )
        self.goal = goal

    def __reduce__(self) -> tuple[type[JointTrajectory], tuple[Array, ...]]:
        """Pickle the request alone: planned again, it gives the same trajectory."""
        return JointTrajectory, self._asked

    def __deepcopy__(self, memo: object) -> JointTrajectory:
        """The trajectory itself, since it is immutable."""
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
