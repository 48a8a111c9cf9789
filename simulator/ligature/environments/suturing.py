"""An environment over the simulation in process: one arm learns to reach, to pick up a needle and to drive it.

Metres, radians, world axes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ligature.bundle import SCENES
from ligature.camera_simulation import Simulation
from ligature.environments.goals import GOALS, Goal, Progress
from ligature.environments.reading import ArmReading
from ligature.model.frames import axis_rotation, pose7_matrix
from ligature.model.load import load
from ligature.model.scene import Scene
from ligature.robots.operating_state import Rejected
from ligature.robots.poses import rotation_vector
from ligature.robots.psm_arm import PsmArm
from ligature.simulation import Snapshot
from ligature.tasks.scenery import Scenery

Array = NDArray[np.float64]

CONTROL = 0.02
"""Seconds of an action."""

STEP_LENGTH, STEP_ANGLE, STEP_JAW = 0.001, 0.05, 0.1
"""Metres, radians and radians of jaw that an action of 1 means."""

STEP_JOINTS = np.array([0.01, 0.01, 0.001, 0.08, 0.06, 0.06])
SUCCESS_REWARD = 1.0

AHEAD_LENGTH, AHEAD_ANGLE, AHEAD_JOINTS = 0.005, 0.25, 5.0 * STEP_JOINTS
"""How far a set-point may be ahead of what is measured: an arm that something stops does not wind up."""

LEAP = 0.5
"""Radians and metres that a joint's set-point may go in an action: a step of the tip takes a tenth of that."""

NEAR_COSINE = math.cos(AHEAD_ANGLE)

STATE = 52
"""Numbers of a state observation."""


@dataclass(frozen=True, eq=False)
class EnvState:
    """Where an environment is in an episode: opaque, made by `SuturingEnv.save`; for the same task and options."""

    options: Mapping[str, Any]
    snapshot: Snapshot
    goal: Mapping[str, Any]
    progress: Progress
    count: int
    random: Mapping[str, Any]


class SuturingEnv(gymnasium.Env[Any, NDArray[np.float32]]):
    """One PSM before a pad with a needle.

    **Actions**, `Box(-1, 1, (7,))`, for 20 ms each:

    | number | ``action="cartesian"`` | ``action="joint"`` |
    |---|---|---|
    | 0 to 2 | step of the tip along the base's axes, 1 is 1 mm | yaw, pitch (1 is 0.01 rad), insertion (1 is 1 mm) |
    | 3 to 5 | rotation vector about the tip's axes, 1 is 0.05 rad | roll (0.08 rad), wrist pitch, yaw (0.06 rad) |
    | 6 | jaw, 1 opens by 0.1 rad | the same |

    An action moves the set-point, which stays within 5 mm and 0.25 rad of what is measured (joints: five actions): an
    arm that something stops does not wind up.

    **Observations** with ``observation="state"``, `Box(-inf, inf, (52,))`:

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
    | 34 to 40 | joint velocities, that of the jaw last | rad/s, m/s |
    | 41 to 47 | set-point of the tip in the arm's base | m |
    | 48 | set-point of the jaw | rad |
    | 49 | 1 while the arm's jaws hold the needle | |
    | 50 | share of the time for which something must be so until the task is done | |
    | 51 | stage: the needle was lifted by half (``pick``), share of the holes passed (``insert``, ``puncture``) | |

    Quaternions have the sign that is nearer to where tip and needle begin: they do not leap from one to the other.
    What the next state and reward depend on is among these but for the shapes of thread and tissue.

    With ``observation="image"`` they are pictures of ``camera``, `Box(0, 255, (height, width, 3), uint8)`; with
    ``"both"``, a `Dict` of ``image`` and ``state``.

    **Reward** ``"dense"``: metres gained in an action, times 100, and 1 at the end; ``"sparse"``: 1 at the end, else 0.

    **Episodes** end when the task is done or the needle is dropped (``info["lost"]`` has the reason), and are cut after
    ``max_steps`` actions. The same seed and actions give the same bits.

    `save` and `restore` keep and take up any moment; copies (``copy.deepcopy``) and pickles go on alike.

    Parameters
    ----------
    task
        ``reach``, ``pick``, ``insert`` or ``puncture`` (`ligature.environments.goals`).
    scene
        A launch file with a PSM and a needle, holes for ``insert`` and soft tissue for ``puncture``; by default what
        the task needs of a scene of ours, without the other arms, and for ``reach`` without the thread and with the
        needle fixed.
    arm
        Name of the arm; by default the one that does the task. Another one brings the whole scene.
    action, observation, reward
        As above.
    camera, size
        Name of the camera, and width and height of its pictures in pixels.
    max_steps
        Actions until an episode is cut, None for no end; ``gymnasium.make`` has ``max_episode_steps`` for this.
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
        max_steps: int | None = 200,
        render_mode: str | None = None,
    ) -> None:
        self._options = {name: value for name, value in locals().items() if name not in ("self", "__class__")}
        for name, value, allowed in (
            ("task", task, tuple(GOALS)), ("action", action, ("cartesian", "joint")),
            ("observation", observation, ("state", "image", "both")), ("reward", reward, ("dense", "sparse")),
        ):  # fmt: skip
            if value not in allowed:
                raise ValueError(f"{name} must be one of {', '.join(allowed)}, not '{value}'")
        self._goal: Goal = GOALS[task]()
        arm = arm or self._goal.arm
        self._simulation = Simulation(_scene(task, arm) if scene is None else load(scene))
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
        state = spaces.Box(-np.inf, np.inf, (STATE,), np.float64)
        both = spaces.Dict({"image": image, "state": state})
        self.observation_space: spaces.Space[Any] = {"image": image, "state": state, "both": both}[observation]
        self._reading = ArmReading(self._simulation, found)
        self._needle_pose, self._needle_twist = (
            self._simulation.state[name][0, self._scenery.needle] for name in ("body_pose", "body_twist")
        )
        self._ticks = round(CONTROL / self._simulation.dt)
        self._goal.prepare(self._simulation, self._scenery, self._arm)
        self._settled = self._start()
        self._tip_side = self._arm.local_measured_cp()[3:]
        self._needle_side = self._simulation.state["body_pose"][0, self.needle, 3:].copy()
        self._count, self._closed = 0, False
        self._progress: Progress | None = None

    def _start(self) -> Snapshot:
        """Where all episodes begin from: it follows from scene, task and arm, and is simulated once in a process."""
        known = _STARTS.setdefault(self._simulation.scene, {})
        which = type(self._goal), self._arm.name
        if which in known:
            self._simulation.restore(known[which])
        else:
            self._goal.settle(self._simulation, self._arm)
            known[which] = self._simulation.snapshot()
        return known[which]

    @property
    def goal(self) -> Goal:
        """What is to be done."""
        return self._goal

    @property
    def simulation(self) -> Simulation:
        """The simulation, which is the ground truth for scripted experts and for datasets."""
        return self._simulation

    @property
    def arm(self) -> PsmArm:
        """The arm that acts."""
        return self._arm

    @property
    def needle(self) -> int:
        """The body of the needle."""
        return self._scenery.needle

    @property
    def task(self) -> str:
        """Name of what is to be done."""
        return str(self._options["task"])

    @property
    def action(self) -> str:
        """What actions are, ``cartesian`` or ``joint``."""
        return self._action

    @property
    def tool_position(self) -> Array:
        """The tool's control point (3,), world axes."""
        return self._reading.tip_position()

    @property
    def needle_force(self) -> Array:
        """What tissue, or holes in it, exert on the needle (3,), N, world axes."""
        state = self._simulation.state[0]
        n = int(state["insertion_count"])
        return np.asarray(state["insertion_force"][:n][state["insertion_body"][:n] == self.needle].sum(axis=0))

    @property
    def base_rotation(self) -> Array:
        """Rotation (3, 3) of the arm's base in the world; actions are along the base's axes, targets in the world's."""
        return pose7_matrix(self._reading.base)[:3, :3]

    @property
    def base_position(self) -> Array:
        """Where the arm's base is (3,), world axes."""
        return np.array(self._reading.base[:3])

    @property
    def setpoint(self) -> Array:
        """Pose (7,) of the tip in the arm's base that is asked for; Cartesian actions are added to it."""
        return np.array(self._reading.setpoint)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; ``seed`` begins another series of random starts.

        Raises ValueError for any of ``options``: there are none.
        """
        if options:
            raise ValueError(
                f"reset takes no options, but got {', '.join(map(repr, options))}; pass options to the class"
            )
        super().reset(seed=seed)
        self._simulation.restore(self._settled)
        self._goal.begin(self._simulation, self._scenery, self._arm, self.np_random)
        self._count = 0
        self._progress = self._goal.observe(self._simulation, self._arm)
        return self._observe(), self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Act for 20 ms."""
        if self._progress is None:
            raise RuntimeError("no episode has begun: call reset() before step()")
        wanted = np.array(action, dtype=float)
        wanted[np.isnan(wanted)] = 0.0
        wanted = np.minimum(np.maximum(wanted, -1.0), 1.0)
        rejected, bounded = self._act(wanted)
        self._simulation.step(self._ticks)
        self._count += 1
        before, self._progress = self._progress, self._goal.observe(self._simulation, self._arm)
        left, done, lost = self._progress
        reward = SUCCESS_REWARD * done + (100.0 * (before.left - left) if self._dense else 0.0)
        cut = self._most is not None and self._count >= self._most
        return self._observe(), float(reward), done or bool(lost), cut, {
            **self._info(), "refused": rejected, "bounded": bounded,
        }  # fmt: skip

    def _act(self, action: Array) -> tuple[str, bool]:
        """Command the arm; what it rejects is logged, and it stays. Also whether the set-point was held back."""
        arm, bounded = self._arm, False
        try:
            if self._action == "joint":
                bounded = self._act_on_joints(action[:6] * STEP_JOINTS)
            else:
                bounded = self._act_on_tip(action)
            if arm.jaw is not None:
                arm.jaw.servo_jp(self._reading.jaw_setpoint[:1] + STEP_JAW * action[6])
        except Rejected as rejection:
            return str(rejection), bounded
        return "", bounded

    def _act_on_tip(self, action: Array) -> bool:
        """Move the set-point by an action, near the tip; whether it was held back for that."""
        forward, reading = self._arm.kinematics.forward, self._reading
        before = reading.joint_setpoints.copy()
        T, bounded = _bounded(forward(reading.joints), _stepped(forward(before), action))
        self._arm.servo_cp(T)
        if np.abs(self._arm.setpoint_js().position - before).max() <= LEAP:
            return bounded
        # beyond the limits of the wrist the same pose has other joints, and on the way there the tip is elsewhere
        self._arm.servo_jp(before)
        return True

    def _act_on_joints(self, step: Array) -> bool:
        measured, wanted = self._reading.joints, self._reading.joint_setpoints + step
        near = np.clip(wanted, measured - AHEAD_JOINTS, measured + AHEAD_JOINTS)
        self._arm.servo_jp(near)
        return bool((near != wanted).any())

    # --- keeping a moment -------------------------------------------------------------------

    def save(self) -> EnvState:
        """Where the environment is, with its random numbers, for `restore` here or in another one like it.

        Bullet keeps contacts that nobody can read; this drops them here too, so that an episode goes on with the same
        last bits as all that are restored from it, and with others than one that was never saved.
        """
        if self._progress is None:
            raise RuntimeError("no episode has begun: call reset() before save()")
        return EnvState(
            self._options, self._simulation.snapshot(), self._goal.snapshot(), self._progress, self._count,
            deepcopy(self.np_random.bit_generator.state),
        )  # fmt: skip

    def restore(self, state: EnvState) -> Any:
        """Go on from where `save` was called; returns the observation there.

        Raises ValueError for a state of another task, scene or arm.
        """
        for name in ("task", "scene", "arm"):
            if state.options[name] != self._options[name]:
                raise ValueError(f"the state has {name}={state.options[name]!r}, not {self._options[name]!r}")
        self._simulation.restore(state.snapshot)
        self._goal.restore(dict(state.goal))
        self._progress, self._count = state.progress, state.count
        self.np_random.bit_generator.state = deepcopy(dict(state.random))
        return self._observe()

    def __deepcopy__(self, memo: dict[int, Any]) -> SuturingEnv:
        """Another simulation that goes on as this one does."""
        return _made(self._options, None if self._progress is None else self.save())

    def __copy__(self) -> SuturingEnv:
        raise TypeError("two environments cannot share one simulation: use copy.deepcopy, or save and restore")

    def __reduce__(self) -> tuple[Any, ...]:
        return _made, (self._options, None if self._progress is None else self.save())

    def _observe(self) -> Any:
        if self._observation == "both":
            return {"image": self._picture(self._size), "state": self._numbers()}
        return self._numbers() if self._observation == "state" else self._picture(self._size)

    def _numbers(self) -> Array:
        """The state, as the table of the class has it."""
        assert self._progress is not None
        arm = self._reading
        return np.concatenate([
            arm.joints, arm.jaw[:1], _on_side(arm.tip, self._tip_side), _on_side(self._needle_pose, self._needle_side),
            self._needle_twist, arm.tip_position(), self._goal.target(), (self._progress.left,), arm.joint_velocities,
            arm.jaw[1:2], _on_side(arm.setpoint, self._tip_side), arm.jaw_setpoint[:1], self._goal.marks(),
        ])  # fmt: skip

    def _info(self) -> dict[str, Any]:
        assert self._progress is not None
        left, done, lost = self._progress
        info = {"distance": left, "is_success": done, "lost": lost, "sim_time": self._simulation.time}
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


_STARTS: WeakKeyDictionary[Scene, dict[tuple[type[Goal], str], Snapshot]] = WeakKeyDictionary()
"""Starts that were simulated, by scene, task and arm; the processes of a vector have them from the one that forks."""


@cache
def _scene(task: str, arm: str) -> Scene:
    """What a task needs of its scene; all of it when another arm than the task's own is asked for."""
    goal = GOALS[task]
    path = SCENES / goal.scene / "launch.yaml"
    if arm != goal.arm:
        return load(path)
    scene = load(path, goal.models)
    scene = replace(scene, arms=tuple(found for found in scene.arms if found.name == arm))
    if goal.thread:
        return scene
    fixed = {needle.body for needle in scene.needles}
    bodies = tuple(replace(body, mass=0.0) if body.index in fixed else body for body in scene.bodies)
    return replace(scene, bodies=bodies, rods=())


def _on_side(pose: Array, side: Array) -> Array:
    """A pose (7,) whose quaternion has the sign that is nearer to ``side`` (4,): it has no leaps near there."""
    return pose if pose[3:] @ side >= 0.0 else np.concatenate([pose[:3], -pose[3:]])


def _stepped(T: Array, action: Array) -> Array:
    """The set-point ``T`` (4, 4) moved by an action, in place."""
    T[:3, 3] += STEP_LENGTH * action[:3]
    turn = STEP_ANGLE * action[3:6]
    angle = _length(turn)
    if angle > 0.0:
        T[:3, :3] = T[:3, :3] @ axis_rotation(turn / angle, angle)
    return T


def _is_near(T_measured: Array, T: Array) -> bool:
    """Whether a set-point (4, 4) is within `AHEAD_LENGTH` and `AHEAD_ANGLE` of what is measured."""
    cosine = 0.5 * (float((T_measured[:3, :3] * T[:3, :3]).sum()) - 1.0)
    return _length(T[:3, 3] - T_measured[:3, 3]) <= AHEAD_LENGTH and cosine >= NEAR_COSINE


def _bounded(T_measured: Array, T: Array) -> tuple[Array, bool]:
    """A set-point (4, 4) no farther from what is measured than `AHEAD_LENGTH` and `AHEAD_ANGLE`, and whether it was."""
    if _is_near(T_measured, T):
        return T, False
    ahead, found = T[:3, 3] - T_measured[:3, 3], T.copy()
    length, turn = _length(ahead), rotation_vector(T_measured[:3, :3].T @ T[:3, :3])
    angle = _length(turn)
    if length > AHEAD_LENGTH:
        found[:3, 3] = T_measured[:3, 3] + ahead * (AHEAD_LENGTH / length)
    if angle > AHEAD_ANGLE:
        found[:3, :3] = T_measured[:3, :3] @ axis_rotation(turn / angle, AHEAD_ANGLE)
    return found, True


def _length(vector: Array) -> float:
    """Length of a vector (3,)."""
    x, y, z = vector.tolist()
    return math.sqrt(x * x + y * y + z * z)


def _made(options: Mapping[str, Any], state: EnvState | None) -> SuturingEnv:
    """An environment of ``options`` that goes on from ``state``."""
    env = SuturingEnv(**options)
    if state is not None:
        env.restore(state)
    return env
