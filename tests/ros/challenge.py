"""What the suturing challenge's scripts do through an AMBF client, call by call.

Poses are homogeneous matrices (4, 4) in the world; metres, radians. Waits are in simulated seconds, so that a busy
machine only makes them longer.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion
from ligature.model.frames import matrix_pose7, pose7_matrix

from tests.waiting import until

TASK_3_JOINTS = [-0.4, -0.22, 0.139, -1.64, -0.37, -0.11]
TIP_IN_NEEDLE = np.array([0.006617809, 0.006973457, 0.0, 1.0])
CLOSING = {420006: 0.3, 400006: 0.6}
"""Seconds for which jaws are asked to close. The scripts take 0.3 s; on a 400006 pad the needle lies first beside the
ghost, which names it 0.38 s after the jaws began to close."""

CAMERA_STEP = 0.002
NEEDLE_STEP = 0.01


def turned(axis: int, angle: float) -> np.ndarray:
    """Rotation (4, 4) about x, y or z."""
    T = np.eye(4)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    T[i, i] = T[j, j] = math.cos(angle)
    T[j, i] = math.sin(angle)
    T[i, j] = -T[j, i]
    return T


def at(*position: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = position
    return T


NEEDLE_IN_JAWS = at(0.00997302, -0.00521514, 0.00323717) @ turned(0, -math.pi / 2)


def measured(handle: Any) -> np.ndarray:
    """Pose of an object as its handle reports."""
    p, q = handle.get_pos(), handle.get_rot()
    return pose7_matrix(np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w]))


def message(T: np.ndarray) -> Pose:
    x, y, z, *q = matrix_pose7(T).tolist()
    return Pose(Point(x, y, z), Quaternion(*q))


def within(inner: np.ndarray, outer: np.ndarray) -> np.ndarray:
    """``inner`` as seen from ``outer``."""
    return np.linalg.inv(outer) @ inner


def distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))


def angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.arccos(np.clip((np.trace(a[:3, :3].T @ b[:3, :3]) - 1) / 2, -1, 1)))


@dataclass
class Stage:
    """A connected client and the world's handle."""

    client: Any
    world: Any

    @property
    def sim_time(self) -> float:
        return self.world._state.sim_time

    def sleep(self, seconds: float) -> None:
        """Let simulated time pass; half a minute of the wall's at most."""
        end = self.sim_time + seconds
        until(lambda: self.sim_time >= end, "simulated time goes on", 30.0, every=0.002)

    def until(self, condition: Callable[[], Any], seconds: float) -> None:
        """Wait until ``condition`` holds, ``seconds`` simulated seconds at most."""
        end = self.sim_time + seconds
        while not condition():
            assert self.sim_time < end, f"not within {seconds} simulated seconds"
            self.sleep(0.005)


class Psm:
    """An arm as the scripts drive it: joints of the base link, two ghosts, one actuator."""

    def __init__(self, stage: Stage, name: str) -> None:
        find = stage.client.get_obj_handle
        self._stage = stage
        self.base = find(f"{name}/baselink")
        key = find(f"{name}/tool_id").get_name()
        self.tool_id = int(re.split("[/_]", key)[-1])
        self.virtual_targets = [find(f"{name}_{what}") for what in ("target_ik", "palm_joint_ik", "target_fk")]
        time.sleep(0.5)
        self.ghosts = [find(f"{name}/{side}_finger_ghost") for side in ("left", "right")]
        self.actuator = find(f"{name}/Actuator0")
        self.yaw_link = find(f"{name}/toolyawlink")
        self.grasped = ""
        self.set_jaw_angle(0.5)

    def servo_jp(self, q: list[float]) -> None:
        for index, value in enumerate(q):
            self.base.set_joint_pos(index, value)

    def measured_jp(self) -> list[float]:
        return [self.base.get_joint_pos(index) for index in range(6)]

    def sensed(self) -> list[str]:
        return [name for ghost in self.ghosts for name in ghost.get_all_sensed_obj_names()]

    def set_jaw_angle(self, jaw: float) -> None:
        """Both fingers; closed enough, the actuator takes the first needle or thread that a ghost names."""
        self.base.set_joint_pos(6, jaw)
        self.base.set_joint_pos(7, jaw)
        if jaw >= 0.05:
            self.actuator.deactuate()
            self.grasped = ""
            return
        names = self.sensed()
        found = [name for kind in ("Needle", "Thread", "Puzzle") for name in names if kind in name]
        if found and not self.grasped:
            self.grasped = found[0]
            self.actuator.actuate(found[0])

    def move_jp(self, q: list[float], seconds: float) -> None:
        """Joints along a quintic from the measured to the given positions, streamed."""
        start, begin = self.measured_jp(), self._stage.sim_time
        while (s := (self._stage.sim_time - begin) / seconds) < 1.0:
            f = s**3 * (10 - 15 * s + 6 * s * s)
            self.servo_jp([a + f * (b - a) for a, b in zip(start, q, strict=True)])
            self._stage.sleep(0.01)
        self.servo_jp(q)


TURNED = 0.05
"""Angle in radians to its goal within which a body that is driven has arrived."""


def drive(stage: Stage, handle: Any, target: Callable[[], np.ndarray], step: float, arrived: float) -> None:
    """Command poses on the way to ``target()``, ``step`` metres ahead at most, until it is ``arrived`` metres near."""
    for _ in range(1000):
        goal, here = target(), measured(handle)
        left = distance(goal, here)
        ahead = goal.copy()
        if left > step:
            ahead[:3, 3] = here[:3, 3] + (goal - here)[:3, 3] * step / left
        handle.set_pose(message(ahead))
        if left < arrived and angle(goal, here) < TURNED:
            return
        stage.sleep(0.01)
    raise AssertionError(f"{left * 1e3:.2f} mm are left")


def set_up_task_3(stage: Stage, psm: Psm, needle: Any) -> None:
    """Put the needle into the jaws, as the third task of the challenge begins."""
    psm.servo_jp(TASK_3_JOINTS)
    psm.set_jaw_angle(0.8)
    stage.until(lambda: np.allclose(psm.measured_jp(), TASK_3_JOINTS, atol=5e-3), 5.0)
    drive(stage, needle, lambda: measured(psm.yaw_link) @ NEEDLE_IN_JAWS, NEEDLE_STEP, 0.0005)
    for _ in range(round(CLOSING[psm.tool_id] / 0.01)):
        psm.set_jaw_angle(0.0)
        stage.sleep(0.01)
    needle.set_force(0.0, 0.0, 0.0)
    needle.set_torque(0.0, 0.0, 0.0)


class Insertions:
    """Crossings of the needle's tip through the holes, as the evaluation notes them: newest first."""

    BOX = 0.005

    def __init__(self, needle: Any, holes: dict[str, Any]) -> None:
        self._needle, self._holes = needle, holes
        self._before: dict[str, float] = {}
        self.events: list[str] = []

    def sample(self) -> None:
        for name, hole in self._holes.items():
            x, y, z, _ = within(measured(self._needle), measured(hole)) @ TIP_IN_NEEDLE
            before, self._before[name] = self._before.get(name, z), z
            inwards = name.startswith("Entry")
            crossed = before > 0 >= z if inwards else before < 0 <= z
            if crossed and max(abs(x), abs(y), abs(z)) <= self.BOX:
                self.events.insert(0, name)


def stitch_path(entry: np.ndarray, exit_: np.ndarray) -> list[np.ndarray]:
    """Needle poses on the circle that runs through both holes, tip ahead, from above the entry to beyond the exit."""
    radius = float(np.linalg.norm(TIP_IN_NEEDLE[:3]))
    own = math.atan2(TIP_IN_NEEDLE[1], TIP_IN_NEEDLE[0])
    half = distance(entry, exit_) / 2
    centre = at(*(entry[:3, 3] + exit_[:3, 3]) / 2) @ at(0, 0, math.sqrt(radius**2 - half**2))
    first, last = math.radians(150), math.radians(20)
    return [
        centre @ turned(0, -math.pi / 2) @ turned(2, where - own) for where in np.linspace(first, last, 30).tolist()
    ]
