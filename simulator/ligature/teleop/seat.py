"""The pairs of a teleoperation: which leader drives which follower, pedals, and changes of followers during a run.

Names are those of the arms and devices (``MTMR``, ``PSM1``). Any leader may be paired with several followers, of which
it drives one at a time; a follower obeys one leader only. Seconds, metres, radians.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ligature.teleop.camera import CameraDrive
from ligature.teleop.pairing import HOLDING, Hand, Pairing, Settings, Status, Tip, is_pose

Array = NDArray[np.float64]


class Conflict(ValueError):
    """A pairing that cannot be: the message names who is in the way."""


@dataclass
class Leader:
    """A device: the followers it may drive, the one that it drives, and its newest sample.

    ``clutched``: whether its own clutch is pressed, ``allowed`` whether it may drive (its arms are ready),
    ``used`` is the sample that it drove with last.
    """

    name: str
    followers: tuple[str, ...]
    selected: str | None = None
    hand: Hand | None = None
    pairing: Pairing = field(default_factory=Pairing)
    clutched: bool = False
    allowed: bool = True
    used: Hand | None = None


@dataclass(frozen=True, eq=False)
class Orders:
    """What `Seat.update` asks of the arms: goals of followers by name, and of the camera in the world (4, 4)."""

    tips: Mapping[str, Tip]
    camera: Array | None = None


class Seat:
    """Leaders, followers and pedals.

    Parameters
    ----------
    pairs
        Followers that each leader may drive, the first is selected; of those ``waiting`` none is.
    settings
        Of all pairings.
    camera_scale
        See `CameraDrive`.

    Raises
    ------
    Conflict
        When two leaders would begin with the same follower.
    """

    def __init__(
        self, pairs: Mapping[str, Sequence[str]], settings: Settings | None = None, camera_scale: float = 1.0,
        waiting: Collection[str] = (),
    ) -> None:  # fmt: skip
        self._leaders = {
            name: Leader(name, tuple(followers), pairing=Pairing(settings)) for name, followers in pairs.items()
        }
        self._enabled = False
        self._clutched = False
        self._camera = CameraDrive(camera_scale)
        self._camera_hands: list[str] = []
        self._camera_last: list[Array] = []
        for name, followers in pairs.items():
            if followers and name not in waiting:
                self.select(name, followers[0])

    @property
    def camera_scale(self) -> float:
        """Metres of the camera for a metre of the hands."""
        return self._camera.scale

    @camera_scale.setter
    def camera_scale(self, scale: float) -> None:
        self._camera.release()
        self._camera.scale = scale

    @property
    def drives_camera(self) -> tuple[str, ...]:
        """The leaders that have the camera in hand."""
        return tuple(self._camera_hands)

    @property
    def leaders(self) -> Mapping[str, Leader]:
        """Devices by name."""
        return self._leaders

    def status(self, leader: str) -> Status:
        """What a leader does."""
        return self._leader(leader).pairing.status

    def _leader(self, name: str) -> Leader:
        if name not in self._leaders:
            raise Conflict(f"unknown leader '{name}'; choose one of {', '.join(self._leaders)}")
        return self._leaders[name]

    # --- pairing ----------------------------------------------------------------------------

    def select(self, leader: str, follower: str | None) -> None:
        """Have a leader drive another follower, or none; it begins where both are at the next `update`.

        Raises `Conflict` for a follower that the leader may not drive, or that another leader drives.
        """
        chosen = self._leader(leader)
        if follower is not None:
            if follower not in chosen.followers:
                raise Conflict(f"{leader} may drive {', '.join(chosen.followers)}, not {follower}")
            other = next((each for each in self._leaders.values() if each.selected == follower), None)
            if other is not None and other is not chosen:
                raise Conflict(f"{follower} follows {other.name}; unselect it there first")
        chosen.pairing.release()
        chosen.selected = follower

    def next_follower(self, leader: str, step: int = 1) -> str | None:
        """Select the next follower of a leader that is free, or with a ``step`` of -1 the one before; returns it."""
        chosen = self._leader(leader)
        taken = {each.selected for each in self._leaders.values() if each is not chosen}
        free = [name for name in chosen.followers if name not in taken]
        if not free:
            return chosen.selected
        at = free.index(chosen.selected) if chosen.selected in free else -max(step, 0)
        self.select(leader, free[(at + step) % len(free)])
        return chosen.selected

    def change(self, leader: str | None = None, **values: object) -> None:
        """Change `Settings` of a leader, or of all; followers do not jump."""
        for chosen in [self._leader(leader)] if leader is not None else self._leaders.values():
            settings: Settings = replace(chosen.pairing.settings, **values)  # type: ignore[arg-type]
            chosen.pairing.change(settings)

    def allow(self, leader: str, on: bool) -> None:
        """Whether a leader may drive its follower; it begins where both are then."""
        chosen = self._leader(leader)
        chosen.allowed = on
        if not on and chosen.pairing.status not in HOLDING:
            chosen.pairing.release()

    # --- pedals -----------------------------------------------------------------------------

    def enable(self, on: bool) -> None:
        """Whether hands drive at all."""
        self._enabled = on
        if not on:
            for leader in self._leaders.values():
                leader.pairing.release()
            self._camera.release()

    def clutch(self, pressed: bool, leader: str | None = None) -> None:
        """The clutch pedal, or the clutch of one leader: hands move without followers while it is pressed.

        A leader that is not trusted any more (`HOLDING`) drives again after its clutch was pressed and released.
        """
        if leader is None:
            self._clutched = pressed
        for chosen in [self._leader(leader)] if leader is not None else self._leaders.values():
            if leader is not None:
                chosen.clutched = pressed
            if pressed:
                chosen.pairing.clutch()
            elif not self.is_clutched(chosen.name) and chosen.pairing.status in (Status.CLUTCHED, *HOLDING):
                chosen.pairing.release()

    def is_clutched(self, leader: str) -> bool:
        """Whether the pedal or the leader's own clutch is pressed."""
        return self._clutched or self._leader(leader).clutched

    def camera(self, pressed: bool, hands: Sequence[str] = ()) -> None:
        """The camera pedal: ``hands`` (all leaders, at most two, when empty) drive the camera instead of followers."""
        self._camera.release()
        self._camera_hands = [self._leader(name).name for name in hands or list(self._leaders)[:2]] if pressed else []
        for leader in self._leaders.values():
            leader.pairing.release()

    def rearm(self, leader: str) -> None:
        """Let a leader that fell silent, leapt or was broken drive again."""
        self._leader(leader).pairing.release()

    # --- time -------------------------------------------------------------------------------

    def sample(self, leader: str, hand: Hand) -> None:
        """Take a sample of a device."""
        self._leader(leader).hand = hand

    def update(self, now: float, tips: Mapping[str, Tip], T_world_camera: Array) -> Orders:
        """Goals for ``now``, from new samples, the followers' set-points, and the camera's pose (4, 4)."""
        if not self._enabled:
            return Orders({})
        if self._camera_hands:
            return Orders({}, self._drive_camera(now, T_world_camera))
        goals = {}
        for leader in self._leaders.values():
            goal = self._drive(leader, now, tips)
            if goal is not None and leader.selected is not None:
                goals[leader.selected] = goal
        return Orders(goals)

    def _drive(self, leader: Leader, now: float, tips: Mapping[str, Tip]) -> Tip | None:
        if leader.hand is None or leader.selected is None or leader.selected not in tips:
            return None
        pairing = leader.pairing
        if pairing.status is Status.IDLE:
            ready = leader.allowed and not self.is_clutched(leader.name)
            if ready and now - leader.hand.time <= pairing.settings.timeout:
                pairing.engage(leader.hand, tips[leader.selected])
            return None
        goal = pairing.update(leader.hand)
        new, leader.used = leader.hand is not leader.used, leader.hand
        if not pairing.watch(now) or pairing.status is not Status.FOLLOWING or not new:
            return None
        return goal

    def _drive_camera(self, now: float, T_world_camera: Array) -> Array | None:
        """Goal of the camera; None, which restarts the motion, while a hand is missing, timed out or invalid."""
        poses = []
        for name in self._camera_hands:
            leader = self._leaders[name]
            hand, timeout = leader.hand, leader.pairing.settings.timeout
            if hand is not None and now - hand.time <= timeout and is_pose(hand.T_view_hand):
                poses.append(hand.T_view_hand)
        if len(poses) != len(self._camera_hands):
            self._camera.release()
            return None
        if not self._camera.engaged:
            self._camera.engage(poses, T_world_camera)
        elif leapt := self._leapt(poses):
            self._camera.release()
            self._camera_hands = []
            self._leaders[leapt].pairing.status = Status.LEAPT
            return None
        self._camera_last = poses
        return self._camera.update(poses)

    def _leapt(self, poses: Sequence[Array]) -> str:
        """A leader whose hand moved too far since the last reading for the camera to follow, or an empty text."""
        for name, now, then in zip(self._camera_hands, poses, self._camera_last, strict=True):
            if np.linalg.norm(now[:3, 3] - then[:3, 3]) > self._leaders[name].pairing.settings.leap:
                return name
        return ""
