"""One attempt at a task of the suturing challenge: watched from its start, judged when its end is reported.

SI units, world axes; times are simulated seconds since the attempt began.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.model.scene import Scene
from ligature.tasks.monitor import Monitor
from ligature.tasks.scenery import MissingBodies, Scenery
from ligature.tasks.scores import (
    SUTURE_PAIRS,
    EstimationScore,
    InsertionScore,
    SutureScore,
    holes_of,
    judge_estimate,
    judge_insertion,
    judge_suture,
    passed_in_order,
)

Array = NDArray[np.float64]
Score = EstimationScore | InsertionScore | SutureScore

TASKS = {"pose_estimation": 1, "insertion": 2, "suture": 3}
"""Names of the tasks, with the numbers that the challenge gives them."""

CAMERA = "CameraFrame"
"""Name of the body in whose frame needle poses are reported."""


class Attempt:
    """Watches ``task`` in ``scene``, of a suture ``pairs`` of holes; begins anew when the scene is reset.

    Raises ValueError for an unknown task, `MissingBodies` for a scene in which it cannot be done.
    """

    def __init__(self, scene: Scene, task: str, pairs: int = SUTURE_PAIRS) -> None:
        if task not in TASKS:
            raise ValueError(f"unknown task '{task}'; choose one of {', '.join(TASKS)}")
        self.task, self._scene, self._pairs = task, scene, pairs
        needed = {"pose_estimation": 0, "insertion": 1, "suture": pairs}[task]
        self._scenery = Scenery.of(scene, needed)
        cameras = [body.index for body in scene.bodies if body.identity.name == CAMERA]
        if task == "pose_estimation" and not cameras:
            raise MissingBodies(
                f"the scene '{scene.name}' has no body '{CAMERA}'; add one: poses are reported in its frame"
            )
        self._camera = cameras[0] if cameras else -1
        self.restart()

    @property
    def needed(self) -> tuple[int, ...]:
        """The bodies that the score depends on, the needle and the camera's body or the holes."""
        if self.task == "pose_estimation":
            return self._scenery.needle, self._camera
        return self._scenery.needle, *self._scenery.entries, *self._scenery.exits

    def restart(self) -> None:
        """Begin anew with the next state."""
        self.monitor = Monitor(self._scene, self._scenery)
        self._resets: int | None = None
        self._begin = self._now = 0.0
        self._poses: Array | None = None

    @property
    def time(self) -> float:
        """Simulated seconds since the attempt began."""
        return self._now - self._begin

    @property
    def progress(self) -> float:
        """Share of the task's holes that the tip has passed in their order, 0 to 1; a pose estimation has none."""
        if self.task == "pose_estimation":
            return 0.0
        pairs, passages = list(range(1, len(self._scenery.entries) + 1)), self.monitor.passages
        throws = [[pair] for pair in pairs] if self.task == "insertion" else [pairs[: self._pairs]]
        return max(passed_in_order(passages, wanted) / len(wanted) for wanted in map(holes_of, throws))

    def observe(self, state: Any) -> None:
        """Take a state record (`ligature.model.state`), one element of it; call it at 100 Hz or more."""
        resets, now = int(state["resets"]), float(state["sim_time"])
        if self._resets is not None and resets != self._resets:
            self.restart()
        if self._resets is None:
            self._resets, self._begin = resets, now
        self._now, self._poses = now, np.array(state["body_pose"])
        self.monitor.observe(state)

    def judge(self, T_camera_needle: Array | None = None) -> Score:
        """The score for ending now; a pose estimation needs the reported pose (4, 4) of the needle's body.

        Raises ValueError before the first state, and without a pose where one is needed.
        """
        if self._poses is None:
            raise ValueError("cannot judge the task before its first state")
        scenery, poses = self._scenery, self._poses
        if self.task == "insertion":
            return judge_insertion(scenery, poses, self.monitor.passages, self.time)
        if self.task == "suture":
            return judge_suture(scenery, poses, self.monitor.passages, self.time, self._pairs)
        if T_camera_needle is None:
            raise ValueError("pose_estimation needs the reported pose")
        return judge_estimate(scenery, poses, pose7_matrix(poses[self._camera]), T_camera_needle, self.time)
