"""An environment over the simulation in process: one arm learns to reach, to pick up a needle and to drive it.

Metres, radians, world axes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ligature.bundle import SCENES
from ligature.camera_simulation import Simulation
from ligature.environments.goals import GOALS, Goal, tip_position
from ligature.model.frames import axis_rotation, pose7_matrix
from ligature.model.load import load
from ligature.model.scene import Scene
from ligature.robots.operating_state import Rejected
from ligature.robots.psm_arm import PsmArm
from ligature.tasks.scenery import Scenery

Array = NDArray[np.float64]

CONTROL = 0.02
"""Seconds of an action."""

STEP_LENGTH, STEP_ANGLE, STEP_JAW = 0.001, 0.05, 0.1
"""Metres, radians and radians of jaw that an action of 1 means."""

STEP_JOINTS = np.array([0.01, 0.01, 0.001, 0.08, 0.06, 0.06])
SUCCESS_REWARD = 1.0


class SuturingEnv(gymnasium.Env[Any, NDArray[np.float32]]):
    """One PSM before a pad with a needle.

    **Actions**, `Box(-1, 1, (7,))`, for 20 ms each:

    | number | ``action="cartesian"`` | ``action="joint"`` |
    |---|---|---|
    | 0 to 2 | step of the tip along the base's axes, 1 is 1 mm | yaw, pitch (1 is 0.01 rad), insertion (1 is 1 mm) |
    | 3 to 5 | rotation vector about the tip's axes, 1 is 0.05 rad | roll (0.08 rad), wrist pitch, yaw (0.06 rad) |
    | 6 | jaw, 1 opens by 0.1 rad | the same |

    **Observations** with ``observation="state"``, `Box(-inf, inf, (34,))`:

    | numbers | what | unit |
    |---|---|---|
    | 0 to 5 | joint values | rad, m |
    | 6 | jaw | rad |
    | 7 to 13 | pose of the tip in the arm's base, x y z qx qy qz qw | m |
    | 14 to 20 | pose of the needle | m |
    | 21 to 26 | twist of the needle | m/s, rad/s |
    | 27 to 29 | the tool's control point | m |
    | 30 to 32 | the target | m |
    | 33 | how far there is to go | m |

    With ``observation="image"`` they are pictures of ``camera``, `Box(0, 255, (height, width, 3), uint8)`; with
    ``"both"``, a `Dict` of ``image`` and ``state``.

    **Reward** ``"dense"``: metres gained in an action, times 100, and 1 at the end; ``"sparse"``: 1 at the end, else 0.

    **Episodes** end when the task is done, and are cut after ``max_steps`` actions. The same seed and actions give the
    same bits.

    Parameters
    ----------
    task
        ``reach``, ``pick``, ``insert`` or ``puncture`` (`ligature.environments.goals`).
    scene
        A launch file with a PSM and a needle, holes for ``insert`` and soft tissue for ``puncture``; by default what
        the task needs of a scene of ours, without the other arms, and for ``reach`` without the thread.
    arm
        Name of the arm; by default the one that does the task. Another one brings the whole scene.
    action, observation, reward
        As above.
    camera, size
        Name of the camera, and width and height of its pictures in pixels.
    max_steps
        Actions until an episode is cut.
    render_mode
        ``rgb_array`` to draw with `render`, or None.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012 (as the base class)

    def __init__(
        self,
        task: str = "reach",
        scene: str | Path | None = None,
        arm: str | None = None,
        action: str = "cartesian",
        observation: str = "state",
        reward: str = "dense",
        camera: str = "cameraL",
        size: tuple[int, int] = (84, 84),
        max_steps: int = 200,
        render_mode: str | None = None,
    ) -> None:
        for name, value, allowed in (
            ("task", task, tuple(GOALS)), ("action", action, ("cartesian", "joint")),
            ("observation", observation, ("state", "image", "both")), ("reward", reward, ("dense", "sparse")),
        ):  # fmt: skip
            if value not in allowed:
                raise ValueError(f"{name} must be one of {', '.join(allowed)}, not '{value}'")
        self._goal: Goal = GOALS[task]()
        arm = arm or self._goal.arm
        self._simulation = Simulation(_scene(self._goal, arm) if scene is None else load(scene))
        found = self._simulation.arms[arm]
        if not isinstance(found, PsmArm):
            raise ValueError(f"'{arm}' is not a PSM")
        self._arm = found
        self._scenery = Scenery.of(self._simulation.scene, self._goal.holes)
        self._action, self._observation, self._dense = action, observation, reward == "dense"
        self._camera, self._size, self._most = camera, size, max_steps
        self.render_mode = render_mode
        self.action_space = spaces.Box(-1.0, 1.0, (7,), np.float32)
        image = spaces.Box(0, 255, (size[1], size[0], 3), np.uint8)
        state = spaces.Box(-np.inf, np.inf, (34,), np.float64)
        both = spaces.Dict({"image": image, "state": state})
        self.observation_space: spaces.Space[Any] = {"image": image, "state": state, "both": both}[observation]
        self._ticks = round(CONTROL / self._simulation.dt)
        self._goal.prepare(self._simulation, self._scenery, self._arm)
        self._settled = self._simulation.snapshot()
        self._count, self._before, self._closed = 0, 0.0, False

    @property
    def goal(self) -> Goal:
        """What is to be done."""
        return self._goal

    @property
    def base_rotation(self) -> Array:
        """Rotation (3, 3) of the arm's base in the world: actions are along the base's axes, targets in the world's."""
        base = next(arm.base for arm in self._simulation.scene.arms if arm.name == self._arm.name)
        return pose7_matrix(self._simulation.state["body_pose"][0, base])[:3, :3]

    @property
    def base_position(self) -> Array:
        """Where the arm's base is (3,), world axes."""
        base = next(arm.base for arm in self._simulation.scene.arms if arm.name == self._arm.name)
        return np.array(self._simulation.state["body_pose"][0, base, :3])

    @property
    def setpoint(self) -> Array:
        """Pose (7,) of the tip in the arm's base that is asked for; Cartesian actions are added to it."""
        return self._arm.local_setpoint_cp()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; ``seed`` begins another series of random starts, ``options`` has no keys."""
        super().reset(seed=seed)
        self._simulation.restore(self._settled)
        self._goal.begin(self._simulation, self._scenery, self._arm, self.np_random)
        self._count = 0
        self._before = self._goal.distance(self._simulation, self._arm)
        return self._observe(), self._info(self._before)

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Act for 20 ms."""
        wanted = np.clip(np.nan_to_num(np.asarray(action, dtype=float)), -1.0, 1.0)
        rejected = self._act(wanted)
        self._simulation.step(self._ticks)
        self._count += 1
        distance = self._goal.distance(self._simulation, self._arm)
        done = distance <= 0.0
        reward = SUCCESS_REWARD * done + (100.0 * (self._before - distance) if self._dense else 0.0)
        self._before = distance
        info = {**self._info(distance), "refused": rejected}
        return self._observe(), float(reward), done, self._count >= self._most, info

    def _act(self, action: Array) -> str:
        """Command the arm; what it rejects is logged, and it stays."""
        arm = self._arm
        try:
            if self._action == "joint":
                arm.servo_jr(action[:6] * STEP_JOINTS)
            else:
                arm.servo_cp(_stepped(arm, action))
            if arm.jaw is not None:
                arm.jaw.servo_jp(arm.jaw.setpoint_js().position + STEP_JAW * action[6])
        except Rejected as rejection:
            return str(rejection)
        return ""

    def _observe(self) -> Any:
        if self._observation == "both":
            return {"image": self._picture(self._size), "state": self._numbers()}
        return self._numbers() if self._observation == "state" else self._picture(self._size)

    def _numbers(self) -> Array:
        """The state, as the table of the class has it."""
        state, arm = self._simulation.state, self._arm
        jaw = np.zeros(1) if arm.jaw is None else arm.jaw.measured_js().position
        needle = self._scenery.needle
        return np.concatenate([
            arm.measured_js().position, jaw, arm.local_measured_cp(), state["body_pose"][0, needle],
            state["body_twist"][0, needle], tip_position(self._simulation, arm), self._goal.target(), [self._before],
        ])  # fmt: skip

    def _info(self, distance: float) -> dict[str, Any]:
        info = {"distance": distance, "is_success": distance <= 0.0, "sim_time": self._simulation.time}
        if self._simulation.scene.tissues:
            state = self._simulation.state
            info["tissue_force"] = float(np.linalg.norm(state["tissue_wrench"][0, 0, :3]))
            info["tissue_peak_force"] = float(state["tissue_peak"][0, 0])
            info["punctures"] = int(state["puncture_count"][0, 0])
        return info

    def render(self) -> Any:
        """A picture (480, 640, 3) of the camera."""
        return self._picture((640, 480)) if self.render_mode == "rgb_array" else None

    def _picture(self, size: tuple[int, int]) -> NDArray[np.uint8]:
        picture = self._simulation.cameras[self._camera].capture(size, passes=("rgb",)).rgb
        assert picture is not None
        return picture

    def close(self) -> None:
        """Give the physics back; a second time does nothing."""
        if not self._closed:
            self._closed = True
            self._simulation.close()


def _scene(goal: Goal, arm: str) -> Scene:
    """What a task needs of its scene; all of it when another arm than the task's own is asked for."""
    path = SCENES / goal.scene / "launch.yaml"
    if arm != goal.arm:
        return load(path)
    scene = load(path, goal.models)
    arms = tuple(found for found in scene.arms if found.name == arm)
    return replace(scene, arms=arms, rods=scene.rods if goal.thread else ())


def _stepped(arm: PsmArm, action: Array) -> Array:
    """The set-point (4, 4) moved by an action."""
    T = pose7_matrix(arm.local_setpoint_cp())
    T[:3, 3] += STEP_LENGTH * action[:3]
    turn = STEP_ANGLE * action[3:6]
    angle = float(np.linalg.norm(turn))
    if angle > 0.0:
        T[:3, :3] = T[:3, :3] @ axis_rotation(turn / angle, angle)
    return T
