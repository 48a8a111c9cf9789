"""Tasks of one arm above a pad: reach a place, pick the needle up. World axes, metres, radians, simulated seconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals.base import EARLY, HOLD, LOST, UNDONE, Dwell, Goal, Progress
from ligature.model.frames import axis_rotation, frame, matrix_pose7, pose7_matrix

Array = NDArray[np.float64]

REST = 0.2
"""Seconds for which a tool must stay at a place to have reached it."""


class Reach(Goal):
    """Bring the tool's control point to within 2 mm of a random place above the work, and keep it there for 0.2 s."""

    scene, arms, models, thread = "suturing_small", ("PSM1",), (0, 1, 2), False
    text = "move the tip of the instrument to the target and stop there"
    WITHIN = 0.002
    REACH = np.array([0.025, 0.025, 0.012])
    _KEPT = ("_target", "_there", "_rested")

    def begin(self, rng: np.random.Generator) -> None:
        """A target in a box around where the tool is."""
        self._target = self._tip() + rng.uniform(-1.0, 1.0, 3) * self.REACH
        self._there, self._rested = Dwell(), 0.0

    def target(self) -> Array:
        """The place."""
        return self._target

    def observe(self) -> Progress:
        """Distance beyond `WITHIN`."""
        distance = float(np.linalg.norm(self._tip() - self._target)) - self.WITHIN
        self._rested = self._there.observe(distance <= 0.0, self._simulation.time)
        done = self._rested >= REST - EARLY
        return Progress(0.0 if done else max(distance, 0.0) + UNDONE, done)

    def marks(self) -> Array:
        """No grasp, the share of the rest, no stage."""
        return np.array([0.0, min(self._rested / REST, 1.0), 0.0])


class Pick(Goal):
    """Grasp the needle, which lies somewhere on the pad, lift all of it by 20 mm, and hold it there for 0.5 s.

    Height counts while the arm's own jaws hold the needle. The episode is lost when the needle falls after it was
    lifted by half of that, or off the pad.
    """

    scene, arms, models = "suturing_small", ("PSM1",), (0, 1, 2)
    text = "pick up the needle and hold it above the pad"
    HEIGHT = 0.02
    SPREAD = 0.012
    _KEPT = ("_rest", "_at", "_held", "_high", "_up", "_lifted", "_free")

    def begin(self, rng: np.random.Generator) -> None:
        """The needle near its place, turned any way about the vertical, at rest as it came to rest there."""
        T = pose7_matrix(self._poses()[self.body])
        shift = np.append(rng.uniform(-self.SPREAD, self.SPREAD, 2), 0.0)
        turn = axis_rotation((0.0, 0.0, 1.0), float(rng.uniform(-np.pi, np.pi)))
        middle = T[:3, :3] @ self.scenery.points.mean(axis=0) + T[:3, 3]
        placed = frame(turn @ T[:3, :3], turn @ (T[:3, 3] - middle) + middle + shift)
        self._simulation.set_pose(self.body, matrix_pose7(placed))
        points = self._points()
        self._rest, self._at = float(points[:, 2].min()), points[1]
        self._held, self._high = False, False
        self._up, self._lifted, self._free = Dwell(), 0.0, Dwell()

    def target(self) -> Array:
        """The needle's place at the height wanted."""
        return np.append(self._at[:2], self._rest + self.HEIGHT)

    def observe(self) -> Progress:
        """How much higher the needle must be; before it is held, how far the tool is from it too."""
        points, now = self._points(), self._simulation.time
        self._at, height = points[1], float(points[:, 2].min()) - self._rest
        self._held = self.holds()
        self._high = self._high or (self._held and height >= 0.5 * self.HEIGHT)
        self._lifted = self._up.observe(self._held and height >= self.HEIGHT, now)
        free = self._free.observe(not self._held, now)
        if self._lifted >= HOLD - EARLY:
            return Progress(0.0, True)
        if self._held:
            return Progress(max(self.HEIGHT - height, 0.0) + UNDONE)
        left = self.HEIGHT + 0.2 * float(np.linalg.norm(self._tip() - self._at)) + UNDONE
        if self._high and free >= LOST - EARLY:
            return Progress(left, lost="the needle was dropped")
        return Progress(left, lost="the needle fell off the pad" if height < -self.HEIGHT else "")

    def marks(self) -> Array:
        """Whether the needle is held, the share of the time that it is up, whether a fall ends the episode."""
        return np.array([self._held, min(self._lifted / HOLD, 1.0), self._high], dtype=float)
