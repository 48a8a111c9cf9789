"""The window's mouse on an arm: drags become steps of its tip as the picture shows them. Metres, radians."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ligature.bus.codec import Message
from ligature.model.frames import axis_rotation, frame, inverse, matrix_pose7, pose7_matrix
from ligature.model.scene import ArmKind, Scene
from ligature.render.camera import CameraView
from ligature.robots.commands import JawMoveJp, ServoCr, StateCommand
from ligature.robots.fitting import base_pose
from ligature.robots.operating_state import State

Array = NDArray[np.float64]

TURN_RATE = 0.005
"""Radians per pixel of the mouse."""

NOTCH = 0.002
"""Metres per notch of the wheel."""

MOST_STEP = 0.005
"""Maximum displacement of a tip in a step, in metres, so that a jump of the mouse causes no jump of the tip."""

JAW = (np.deg2rad(60.0), np.deg2rad(-20.0))
"""An open jaw and a closed one that presses, as the dVRK's client has them."""


class ArmDrive:
    """The arm that the mouse has, and the commands to it; ``send`` takes them."""

    def __init__(self, scene: Scene, send: Callable[[Message], None]) -> None:
        self._scene, self._send = scene, send
        self._arms = [index for index, arm in enumerate(scene.arms) if arm.kind is ArmKind.PSM]
        self.selected: int | None = None
        self._closed = False

    @property
    def name(self) -> str:
        """Of the arm that is driven; empty for none."""
        return "" if self.selected is None else self._scene.arms[self.selected].name

    def next(self) -> None:
        """Take the next arm, and after the last one none."""
        turn = [*self._arms, None]
        self.selected = turn[(turn.index(self.selected) + 1) % len(turn)]

    def make_ready(self, state: NDArray[np.void]) -> bool:
        """Whether the arm takes motion; else it is asked for power and homing."""
        if self.selected is None:
            return False
        record = state["arm"][0, self.selected]
        ready = int(record["operating"]) == State.ENABLED and bool(record["homed"])
        if not ready and not record["busy"]:
            self._send(StateCommand(self.selected, "home"))
        return ready

    def move(self, state: NDArray[np.void], view: CameraView, right: float, down: float) -> None:
        """Move the tip with the mouse, in pixels: it stays below the mouse."""
        if self.selected is None:
            return
        seen = (view.view @ np.append(self._tip(state)[:3, 3], 1.0))[:3]
        depth = -float(seen[2])  # a tip behind the eye goes as one does that is as far before it
        reach = 1.0 if view.orthographic else depth if depth > view.near else float(np.linalg.norm(seen))
        fx, fy = view.intrinsics[0, 0], view.intrinsics[1, 1]
        self._step(state, view, np.array([right * reach / fx, -down * reach / fy, 0.0]), np.zeros(3))

    def advance(self, state: NDArray[np.void], view: CameraView, notches: float) -> None:
        """Move the tip away from the eye by notches of the wheel."""
        self._step(state, view, np.array([0.0, 0.0, -NOTCH * notches]), np.zeros(3))

    def turn(self, state: NDArray[np.void], view: CameraView, right: float, down: float) -> None:
        """Turn the tip as if it were rolled below the mouse."""
        self._step(state, view, np.zeros(3), TURN_RATE * np.array([down, right, 0.0]))

    def toggle_jaw(self, state: NDArray[np.void]) -> None:
        """Open a closed jaw, close an open one."""
        if self.selected is not None and self.make_ready(state):
            self._closed = not self._closed
            self._send(JawMoveJp(self.selected, (float(JAW[self._closed]),)))

    def _step(self, state: NDArray[np.void], view: CameraView, way: Array, turn: Array) -> None:
        """Send a step; ``way`` (3,) and ``turn`` (3,) are in axes of the eye: right, up, towards it."""
        if self.selected is None or not self.make_ready(state):
            return
        record = state["arm"][0, self.selected]
        T_reference_base = pose7_matrix(record["setpoint_cp"]) @ inverse(pose7_matrix(record["local_setpoint_cp"]))
        R = (T_reference_base @ inverse(self._base(state)))[:3, :3] @ view.view[:3, :3].T
        size, angle = float(np.linalg.norm(way)), float(np.linalg.norm(turn))
        way = R @ way * min(1.0, MOST_STEP / max(size, 1e-12))
        step = frame(axis_rotation(R @ turn / angle, angle) if angle > 0.0 else np.eye(3), way)
        self._send(ServoCr(self.selected, tuple(matrix_pose7(step).tolist())))

    def _base(self, state: NDArray[np.void]) -> Array:
        assert self.selected is not None
        description = self._scene.arms[self.selected]
        if description.base < 0:
            return base_pose(self._scene, description)
        return pose7_matrix(state["body_pose"][0, description.base])

    def _tip(self, state: NDArray[np.void]) -> Array:
        """The tip that is asked for, in the world (4, 4)."""
        return self._base(state) @ pose7_matrix(state["arm"][0, self.selected]["local_setpoint_cp"])
