"""One leader that moves one follower: increments of position, absolute orientation, gripper to jaw.

Both sides are seen as the operator sees them: the leader's hand in the frame of the view before the operator's eyes,
the follower's tip in the frame of the camera that makes the view, as in the dVRK. Poses are
matrices (4, 4), metres and radians; times are seconds. A grip is 0 when closed and 1 when open.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import axis_rotation
from ligature.robots.poses import rotation_vector

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """How a leader moves its follower.

    ``scale`` is follower metres for a leader metre. ``align``: whether the leader is brought to the follower's
    orientation before it drives; otherwise the difference at the start is kept. ``max_velocity`` (m/s) and
    ``max_angular_velocity`` (rad/s) bound the follower's goal, ``workspace`` two opposite corners of where it may be
    in the camera's frame. ``jaw`` are the angles of a closed and of an open grip. A leader that is silent for
    ``timeout`` or leaps by more than ``leap`` between two samples stops driving. The operator counts as present after
    the grip changed by ``presence_grip`` or the hand rolled by ``presence_roll``.
    """

    scale: float = 0.2
    align: bool = True
    lock_translation: bool = False
    lock_rotation: bool = False
    max_velocity: float = 0.5
    max_angular_velocity: float = 12.0
    workspace: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    jaw: tuple[float, float] = (-0.35, 1.05)
    jaw_speed: float = 4 * np.pi
    jaw_speed_at_first: float = 0.2 * np.pi
    timeout: float = 0.1
    leap: float = 0.05
    presence_grip: float = 0.0
    presence_roll: float = 0.0


@dataclass(frozen=True, eq=False)
class Hand:
    """A sample of a leader: ``T_view_hand`` (4, 4) and ``grip``, None for a device that has none, at ``time``."""

    time: float
    T_view_hand: Array
    grip: float | None = None


@dataclass(frozen=True, eq=False)
class Tip:
    """The follower: ``T_camera_tip`` (4, 4) and ``jaw`` angle, as set points."""

    T_camera_tip: Array
    jaw: float = 0.0


class Status(enum.Enum):
    """What a pairing does; the values are shown to the user."""

    IDLE = "not driving"
    WAITING = "waiting for the operator's fingers"
    FOLLOWING = "following"
    CLUTCHED = "clutched"
    SILENT = "the leader is silent"
    LEAPT = "the leader leapt"
    BROKEN = "the leader sends invalid poses"
    CONTESTED = "another leader claims the follower"


HOLDING = (Status.SILENT, Status.LEAPT, Status.BROKEN, Status.CONTESTED)
"""The follower stays where it is, until the pairing is engaged again."""


class Pairing:
    """A leader and its follower; `update` turns each sample of the hand into a goal for the tip."""

    def __init__(self, settings: Settings | None = None) -> None:
        self.settings = settings or Settings()
        self.status = Status.IDLE
        self._anchor_hand = self._anchor_tip = np.eye(4)
        self._R_hand_tip = np.eye(3)
        self._goal = Tip(np.eye(4))
        self._last: Hand | None = None
        self._jaw_caught = False
        self._first: Hand | None = None

    @property
    def goal(self) -> Tip:
        """The newest goal of the follower."""
        return self._goal

    @property
    def alignment_offset(self) -> Array:
        """Rotation (3, 3) of the tip in the hand, as it was when the pairing was engaged."""
        return self._R_hand_tip

    def engage(self, hand: Hand, tip: Tip) -> None:
        """Begin to drive from where both are now; the follower does not jump."""
        if not is_pose(hand.T_view_hand):
            self.status = Status.BROKEN
            return
        self._anchor(hand, tip)
        self._goal, self._last, self._first = tip, hand, hand
        self._jaw_caught = False
        waits = self.settings.presence_grip > 0.0 or self.settings.presence_roll > 0.0
        self.status = Status.WAITING if waits else Status.FOLLOWING

    def clutch(self) -> None:
        """Let the hand move without the follower, which stays."""
        if self.status in (Status.FOLLOWING, Status.WAITING):
            self.status = Status.CLUTCHED

    def release(self) -> None:
        """Stop driving."""
        self.status = Status.IDLE

    def contest(self) -> None:
        """Stop because another node commands the follower, until the pairing is engaged again."""
        self.status = Status.CONTESTED

    def change(self, settings: Settings) -> None:
        """Go on from here with other settings; the follower does not jump."""
        self.settings = settings
        if self.status is Status.FOLLOWING and self._last is not None:
            self._anchor(self._last, self._goal)

    def _anchor(self, hand: Hand, tip: Tip) -> None:
        self._anchor_hand, self._anchor_tip = hand.T_view_hand.copy(), tip.T_camera_tip.copy()
        self._R_hand_tip = hand.T_view_hand[:3, :3].T @ tip.T_camera_tip[:3, :3]

    def update(self, hand: Hand) -> Tip:
        """Goal of the follower for a new sample of the leader; the last one while it does not drive."""
        if self.status not in (Status.FOLLOWING, Status.WAITING, Status.CLUTCHED):
            return self._goal
        problem = self._problem(hand)
        if problem is not None:
            self.status = problem
            return self._goal
        last, self._last = self._last, hand
        assert last is not None
        if self.status is Status.WAITING and self._present(hand):
            self._anchor(hand, self._goal)
            self.status = Status.FOLLOWING
        if self.status is Status.FOLLOWING:
            self._follow(hand, max(hand.time - last.time, 0.0))
        return self._goal

    def watch(self, now: float) -> bool:
        """Whether the leader is alive at ``now``; a silent one stops driving."""
        active = self.status in (Status.FOLLOWING, Status.WAITING)
        if active and self._last is not None and now - self._last.time > self.settings.timeout:
            self.status = Status.SILENT
        return self.status not in HOLDING

    def _problem(self, hand: Hand) -> Status | None:
        if not is_pose(hand.T_view_hand) or (hand.grip is not None and not np.isfinite(hand.grip)):
            return Status.BROKEN
        assert self._last is not None
        moved = float(np.linalg.norm(hand.T_view_hand[:3, 3] - self._last.T_view_hand[:3, 3]))
        return Status.LEAPT if moved > self.settings.leap else None

    def _present(self, hand: Hand) -> bool:
        """Whether the operator is present: grip or handle were moved since the start."""
        first = self._first
        assert first is not None
        settings = self.settings
        both = first.grip is not None and hand.grip is not None
        if both and settings.presence_grip > 0.0 and abs(hand.grip - first.grip) >= settings.presence_grip:  # type: ignore[operator]
            return True
        if settings.presence_roll <= 0.0:
            return False
        turned = rotation_vector(first.T_view_hand[:3, :3].T @ hand.T_view_hand[:3, :3])
        return bool(abs(turned[2]) >= settings.presence_roll)

    def _follow(self, hand: Hand, dt: float) -> None:
        settings, wanted = self.settings, self._anchor_tip.copy()
        if not settings.lock_translation:
            wanted[:3, 3] += settings.scale * (hand.T_view_hand[:3, 3] - self._anchor_hand[:3, 3])
        if not settings.lock_rotation:
            wanted[:3, :3] = hand.T_view_hand[:3, :3] @ self._R_hand_tip
        if settings.workspace is not None:
            wanted[:3, 3] = np.clip(wanted[:3, 3], *settings.workspace)
        pose = _approach(
            self._goal.T_camera_tip, wanted, settings.max_velocity * dt, settings.max_angular_velocity * dt
        )
        self._goal = Tip(pose, self._jaw(hand, dt))

    def _jaw(self, hand: Hand, dt: float) -> float:
        """Jaw angle that follows the grip: slowly until it has reached it, so that nothing is dropped."""
        if hand.grip is None:
            return self._goal.jaw
        closed, opened = self.settings.jaw
        wanted = closed + (opened - closed) * float(np.clip(hand.grip, 0.0, 1.0))
        speed = self.settings.jaw_speed if self._jaw_caught else self.settings.jaw_speed_at_first
        step = float(np.clip(wanted - self._goal.jaw, -speed * dt, speed * dt))
        jaw = self._goal.jaw + step
        self._jaw_caught = self._jaw_caught or abs(jaw - wanted) < 1e-9
        return jaw


def is_pose(T: Array) -> bool:
    """Whether a matrix (4, 4) is finite and its rotation is one."""
    R = T[:3, :3]
    return bool(np.isfinite(T).all() and np.abs(R.T @ R - np.eye(3)).max() < 1e-3 and np.linalg.det(R) > 0.0)


def _approach(start: Array, goal: Array, step: float, angle: float) -> Array:
    """``goal``, or the pose on the way to it that is ``step`` metres and ``angle`` radians from ``start`` at most."""
    T = goal.copy()
    way = goal[:3, 3] - start[:3, 3]
    length = float(np.linalg.norm(way))
    if length > step:
        T[:3, 3] = start[:3, 3] + way * (step / length)
    turn = rotation_vector(start[:3, :3].T @ goal[:3, :3])
    size = float(np.linalg.norm(turn))
    if size > angle:
        T[:3, :3] = start[:3, :3] @ axis_rotation(turn / size, angle)
    return T
