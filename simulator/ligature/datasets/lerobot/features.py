"""What a sample of an HDF5 dataset is called in LeRobot: columns of numbers with names for each of them.

Joints in radians and metres, poses x y z qx qy qz qw in the base of the arm (``ground_truth``: in the world), newtons.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.robots.poses import rotation_vector

EXTRA = "extra."
"""What names of features begin with that are the caller's arrays."""

POSE, TURN = ("x", "y", "z", "qx", "qy", "qz", "qw"), ("x", "y", "z", "rx", "ry", "rz")
STATE = "environment_state"
"""The caller's array that LeRobot knows: an input of policies, of single precision as the others."""

WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")


@dataclass(frozen=True, eq=False)
class Column:
    """A feature of all samples of one episode: ``values`` (n, k) with ``names`` (k), of the numpy type ``dtype``.

    Texts have the type ``string`` and the shape (n, 1).
    """

    name: str
    names: tuple[str, ...]
    values: NDArray[Any]
    dtype: str = "float32"


@dataclass(frozen=True)
class Robot:
    """The arms whose motion is state and action: names and joint names of the arms with a jaw, and their tools."""

    arms: tuple[str, ...]
    joints: tuple[tuple[str, ...], ...]
    tools: tuple[str, ...]

    @classmethod
    def of(cls, file: h5py.File) -> Robot:
        """The arms of a dataset."""
        found = [(name, arm) for name, arm in sorted(file.get("arms", {}).items()) if arm.attrs["kind"] == "psm"]
        joints = tuple(tuple(map(str, arm.attrs["joint_names"])) for _, arm in found)
        return cls(tuple(name for name, _ in found), joints, tuple(str(arm.attrs["tool"]) for _, arm in found))

    def motors(self) -> tuple[str, ...]:
        """Names of all joints, the jaw after those of its arm."""
        each = zip(self.arms, self.joints, strict=True)
        return tuple(f"{arm}_{joint}" for arm, joints in each for joint in (*joints, "jaw"))

    def each(self, parts: Sequence[str]) -> tuple[str, ...]:
        """``parts`` for each arm."""
        return tuple(f"{arm}_{part}" for arm in self.arms for part in parts)


def types_of_extras(episodes: Sequence[h5py.Group]) -> dict[str, str]:
    """Types of the caller's arrays, by their names, that hold the numbers of all ``episodes``."""
    found: dict[str, list[Any]] = {}
    for episode in episodes:
        for name, array in episode.get("extra", {}).items():
            found.setdefault(name, []).append(array.dtype)
    return {name: "float32" if name == STATE else _type(np.result_type(*each)) for name, each in found.items()}


def _type(dtype: np.dtype[Any]) -> str:
    """The type of a feature for numbers of a type."""
    if dtype.kind == "f":
        return "float64" if dtype.itemsize > np.dtype(np.float32).itemsize else "float32"
    return "bool" if dtype.kind == "b" else "int64"


def columns(file: h5py.File, episode: h5py.Group, texts: bool, types: Mapping[str, str]) -> Iterator[Column]:
    """The features of an episode in LeRobot's terms.

    ``texts`` adds those of words, for each sample; ``types`` are those of the caller's arrays, by their names.
    """
    robot = Robot.of(file)
    arms = [episode[f"arms/{name}"] for name in robot.arms]
    n = int(episode.attrs["samples"])
    yield from _core(robot, arms)
    yield from _more(robot, arms)
    yield from _ground_truth(episode)
    yield from _extra(episode, types)
    yield Column("label.phase", ("phase",), episode["phase"][:][:, None], "int64")
    for what in ("phase", "activity"):
        values = np.stack([arm[what][:] for arm in arms], axis=1)
        yield Column(f"label.arm_{what}", robot.arms, values, "int64")
    last = np.arange(n) == n - 1
    yield Column("next.done", ("done",), last[:, None], "bool")
    yield Column("next.success", ("success",), (last & bool(episode.attrs["success"]))[:, None], "bool")
    yield Column("observation.meta.sim_time", ("seconds",), (episode["time"][:] - episode["time"][0])[:, None])
    if texts:
        yield Column("observation.meta.tool", ("tool",), np.full((n, 1), ", ".join(robot.tools), object), "string")
        yield Column("instruction.text", ("text",), _instructions(file, episode), "string")


def _core(robot: Robot, arms: Sequence[h5py.Group]) -> Iterator[Column]:
    """State and action; the action is the set-point that the next sample has.

    Names of its other forms do not begin with ``action``: LeRobot takes what does for outputs of a policy.
    """
    motors = robot.motors()
    yield Column("observation.state", motors, _motors(arms, "measured_js", 0))
    action, now = _joined(arms, "action_js", "jaw/action_js"), _motors(arms, "setpoint_js", 0)
    yield Column("action", motors, action)
    yield Column("delta_action", motors, action - now)
    poses = [(arm["local_setpoint_cp"][:], arm["local_action_cp"][:], arm["jaw/action_js"][:][:, None]) for arm in arms]
    begin = [one_sign(arm["local_measured_cp"][:1])[0] for arm in arms]
    absolute = np.concatenate(
        [np.hstack([one_sign(after, tip), jaw]) for (_, after, jaw), tip in zip(poses, begin, strict=True)], axis=1
    )
    yield Column("cartesian_action", robot.each((*POSE, "jaw")), absolute)
    steps = [_step(before, after) for before, after, _ in poses]
    yield Column("cartesian_delta_action", robot.each(TURN), np.concatenate(steps, axis=1))


def _more(robot: Robot, arms: Sequence[h5py.Group]) -> Iterator[Column]:
    """Further columns of the arms; those of forces only if all arms have them, since a bag may lack forces."""
    motors = robot.motors()
    yield Column("observation.setpoint", motors, _motors(arms, "setpoint_js", 0))
    yield Column("observation.velocity", motors, _motors(arms, "measured_js", 1))
    yield Column("observation.effort", motors, _motors(arms, "measured_js", 2))
    tips = [one_sign(arm["local_measured_cp"][:]) for arm in arms]
    yield Column("observation.cartesian", robot.each(POSE), np.concatenate(tips, axis=1))
    if all("spatial_measured_cf" in arm for arm in arms):
        forces = np.concatenate([arm["spatial_measured_cf"][:] for arm in arms], axis=1)
        yield Column("observation.meta.force_torque", robot.each(WRENCH), forces)
    if all("jaw/force" in arm for arm in arms):
        pressed = np.stack([arm["jaw/force"][:] for arm in arms], axis=1)
        yield Column("observation.meta.jaw_force", robot.arms, pressed)


def _ground_truth(episode: h5py.Group) -> Iterator[Column]:
    if "needle" in episode:
        needle = episode["needle"]
        yield Column("ground_truth.needle_pose", POSE, one_sign(needle["pose"][:]))
        if "twist" in needle:
            yield Column("ground_truth.needle_twist", ("vx", "vy", "vz", "wx", "wy", "wz"), needle["twist"][:])
        if "tissue_force" in needle:
            yield Column("ground_truth.needle_force", ("fx", "fy", "fz"), needle["tissue_force"][:])
    if "thread" in episode:
        points, tension = episode["thread/points"][:], episode["thread/tension"][:]
        elements = range(points.shape[1])
        names = tuple(f"{k}_{axis}" for k in elements for axis in "xyz")
        yield Column("ground_truth.thread_points", names, points.reshape(len(points), -1))
        yield Column("ground_truth.thread_tension", tuple(map(str, elements)), tension)


def _extra(episode: h5py.Group, types: Mapping[str, str]) -> Iterator[Column]:
    """Columns that the caller added, of which LeRobot knows ``observation.environment_state``."""
    for name, data in sorted(episode.get("extra", {}).items()):
        values = data[:].reshape(len(data), -1).astype(types[name])
        feature = f"observation.{STATE}" if name == STATE else f"{EXTRA}{name}"
        yield Column(feature, tuple(map(str, range(values.shape[1]))), values, types[name])


def _motors(arms: Sequence[h5py.Group], name: str, row: int) -> NDArray[Any]:
    """One row (position, velocity or effort) of the joints and the jaw of all arms, (n, motors)."""
    parts = [part for arm in arms for part in (arm[name][:, row], arm[f"jaw/{name}"][:, row][:, None])]
    return np.concatenate(parts, axis=1)


def _joined(arms: Sequence[h5py.Group], name: str, jaw: str) -> NDArray[Any]:
    return np.concatenate([part for arm in arms for part in (arm[name][:], arm[jaw][:][:, None])], axis=1)


def one_sign(poses: NDArray[Any], near: NDArray[Any] | None = None) -> NDArray[Any]:
    """Poses (n, 7) whose quaternions do not leap between their two signs, which mean the same turn.

    The first has the sign nearer to the pose ``near`` (7,), or without one that with its largest number positive.
    """
    q = poses[:, 3:]
    first = q[0] @ near[3:] if near is not None else q[0, np.argmax(np.abs(q[0]))]
    along = np.concatenate([[first], np.sum(q[1:] * q[:-1], axis=1)])
    out = poses.copy()
    out[:, 3:] *= np.cumprod(np.where(along < 0.0, -1.0, 1.0))[:, None]
    return out


def _step(before: NDArray[Any], after: NDArray[Any]) -> NDArray[Any]:
    """Steps (n, 6) between poses (n, 7): along the base's axes, and rotation vectors about the tip's own."""
    found = np.zeros((len(before), 6))
    found[:, :3] = after[:, :3] - before[:, :3]
    for k, (one, other) in enumerate(zip(before, after, strict=True)):
        R, then = pose7_matrix(one.astype(float))[:3, :3], pose7_matrix(other.astype(float))[:3, :3]
        found[k, 3:] = rotation_vector(R.T @ then)
    return found


def _instructions(file: h5py.File, episode: h5py.Group) -> NDArray[Any]:
    """The task, and the phase in which it is, for each sample (n, 1)."""
    task = str(episode.attrs["task"])
    names = [f"{task}: {phase.replace('_', ' ')}" if phase else task for phase in map(str, file.attrs["phases"])]
    return np.array([names[k] for k in episode["phase"][:]], dtype=object)[:, None]
