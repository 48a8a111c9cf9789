"""One leader and one follower from switched off to following, in the states of the dVRK's teleoperation component.

DISABLED until it is wanted, SETTING_ARMS_STATE until both sides are there and ready, ALIGNING_MTM until the leader has
the follower's orientation, then ENABLED (as in the dVRK). Radians, seconds.
"""

from __future__ import annotations

import numpy as np

from ligature.robots.poses import rotation_vector
from ligature.teleop.component import ALIGNING, DISABLED, ENABLED, SETTING, PairTopics
from ligature.teleop.devices.device import Device
from ligature.teleop.follower import Arm
from ligature.teleop.handset import Handset
from ligature.teleop.pairing import HOLDING, Hand, Status, Tip
from ligature.teleop.proxy import Proxy
from ligature.teleop.seat import Leader, Seat

ALIGNED = np.deg2rad(5.0)
"""How far the leader's orientation may be from the follower's when it begins to drive."""

TURN_AGAIN = 2.0
"""Seconds after which a leader that has not turned is asked again."""

MOST_SCALE = 1.0


class Pair:
    """A leader that may drive a follower; ``wanted``: whether it should, as far as the pair is selected."""

    def __init__(
        self, leader: Leader, arm: Arm | Proxy, seat: Seat, handset: Handset, device: Device | None, topics: PairTopics
    ) -> None:
        self.leader, self.arm, self.topics = leader, arm, topics
        self._seat, self._handset, self._device = seat, handset, device
        self.wanted = False
        self.state = DISABLED
        self._turn_asked = -np.inf
        self._turns = True
        self._kept = False

    @property
    def selected(self) -> bool:
        """Whether the leader drives this follower rather than another one."""
        return self.leader.selected == self.arm.name

    def want(self, on: bool) -> None:
        """Switch on or off; on also trusts a leader again that was not."""
        self.wanted = on
        self.arm.forget_asking()
        if on and self.selected and self.leader.pairing.status in HOLDING:
            self._seat.rearm(self.leader.name)

    def align(self) -> None:
        """Bring the leader to the follower's orientation again before it drives on."""
        if self.selected and self.state == ENABLED:
            self._seat.allow(self.leader.name, False)
            self._enter(ALIGNING, "aligning")

    def advance(self, now: float, tip: Tip | None, idle: str) -> None:
        """Take the next step; ``idle`` is the reason why no pair may be enabled now, empty if all may."""
        why = "" if self.wanted and self.selected else "not selected" if self.wanted else "disabled"
        if why or idle:
            self._enter(DISABLED, why or idle)
        elif obstacle := self._obstacle(now, tip):
            self._enter(SETTING, obstacle)
        elif remaining := self._misaligned(now, tip):
            self._enter(ALIGNING, remaining)
        else:
            self._enter(ENABLED, self.leader.pairing.status.value)
        self._keep_orientation()
        if self.selected:
            self._seat.allow(self.leader.name, self.state == ENABLED)
        topics = self.topics
        topics.publish("desired_state", DISABLED if why else ENABLED)
        topics.publish("following", self.selected and self.leader.pairing.status is Status.FOLLOWING)

    def _enter(self, state: str, status: str) -> None:
        if state == ENABLED and self.state != ENABLED and self._device is not None:
            self._device.begin()
        if state != ALIGNING:
            self._turn_asked = -np.inf
        self.state = state
        self.topics.publish("current_state", state)
        self.topics.publish("status", status)

    def _obstacle(self, now: float, tip: Tip | None) -> str:
        """The part that is not ready, or empty; requests power and homing of the follower."""
        obstacle = self.arm.obstacle()
        if obstacle:
            if self.arm.reports:
                self.arm.make_ready()
            return obstacle
        if tip is None:
            return f"no pose of {self.arm.name} relative to the camera is published"
        hand = self.leader.hand
        if self.leader.pairing.status is Status.IDLE and (hand is None or self._old(hand, now)):
            return f"{self.leader.name} is silent"
        return ""

    def _old(self, hand: Hand, now: float) -> bool:
        return now - hand.time > self.leader.pairing.settings.timeout

    def _misaligned(self, now: float, tip: Tip | None) -> str:
        """Why the leader is not aligned with the follower; empty when it is, or need not be."""
        settings, hand = self.leader.pairing.settings, self.leader.hand
        waits = self.leader.pairing.status is Status.IDLE and not self._seat.is_clutched(self.leader.name)
        if not (waits and settings.align and self._turns) or settings.lock_rotation or hand is None or tip is None:
            return ""
        R = tip.T_camera_tip[:3, :3]
        angle = float(np.linalg.norm(rotation_vector(hand.T_view_hand[:3, :3].T @ R)))
        if not np.isfinite(angle) or angle <= ALIGNED:
            return ""
        if now - self._turn_asked > TURN_AGAIN:
            self._turn_asked = now
            waits_for = self._device.make_ready() if self._device is not None else ""
            if waits_for:
                return waits_for
            goal = self._handset.calibration.orientation_on_device(R)
            self._turns = self._device is not None and self._device.turn_to(goal)
        return f"{self.leader.name} aligns with {self.arm.name}" if self._turns else ""

    def _keep_orientation(self) -> None:
        """Keep the leader's orientation while the clutch is pressed, so that it stays aligned."""
        clutched = self.selected and self.leader.pairing.status is Status.CLUTCHED
        if self._device is None or clutched == self._kept:
            return
        self._kept = clutched
        if not clutched:
            self._device.begin()
        elif self.leader.pairing.settings.align and self.leader.hand is not None:
            R = self._handset.calibration.orientation_on_device(self.leader.hand.T_view_hand[:3, :3])
            self._device.hold_orientation(R)
