"""The teleoperation node: devices and pedals in, goals for arms and forces for hands out, all by CRTK topics.

Everything that comes in waits in one queue, so that one thread decides who drives. A reading is answered at once;
what is slower (readiness, alignment, devices that do not speak by themselves) is looked at every `PERIOD`.
Metres, radians, seconds, newtons.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from tf2_msgs.msg import TFMessage

from ligature.robots.poses import rotation_vector
from ligature.teleop.calibration import pose_of
from ligature.teleop.component import DISABLED, ENABLED, SETTING, CameraTopics, PairTopics
from ligature.teleop.config import DeviceSpec, TeleopConfig
from ligature.teleop.console import ConsoleTopics
from ligature.teleop.devices import module
from ligature.teleop.devices.device import Device, Reading
from ligature.teleop.follower import Arm
from ligature.teleop.frames import Frames
from ligature.teleop.handset import MARKS, Handset
from ligature.teleop.haptics import Haptics, period_of, step_of
from ligature.teleop.messages import pose_numbers
from ligature.teleop.pair import MOST_SCALE, Pair
from ligature.teleop.pairing import HOLDING, Status, Tip
from ligature.teleop.phases import Phases
from ligature.teleop.proxy import Proxy
from ligature.teleop.record import Recorder, Replay
from ligature.teleop.seat import Conflict, Leader, Seat

Array = NDArray[np.float64]

PERIOD = 0.005
READINGS_PERIOD = 0.02
HELD_UP = 0.05
"""Seconds between two turns above which this process was delayed: waiting messages are read before timeouts."""

VIEW = "teleoperation view"
"""Name of the camera's frame at the start of a drive: oscillation of the camera must not move the instruments."""

CAMERA_MOVED = (5e-4, np.deg2rad(0.2))
"""Metres and radians by which the camera may differ from the view before all begin anew."""

NOT_RECORDED = ("reading", "rival")


def _asked_of_haptics(prefix: str) -> dict[str, Any]:
    """Settings of force feedback that the simulator was started with, ``-d``, ``-e``, ``-f``; empty for none."""
    try:
        found = rospy.get_param(f"{prefix}ligature/haptics", {})
    except OSError:
        return {}
    return found if isinstance(found, dict) else {}


class Teleop:
    """All of a teleoperation; `run` drives until it is asked to stop.

    Parameters
    ----------
    config
        Devices, pairs, camera.
    recorder
        Records the input of devices and pedals.
    replay
        Speaks for the devices, which are not opened then, as soon as the arms are ready.
    """

    def __init__(self, config: TeleopConfig, recorder: Recorder | None = None, replay: Replay | None = None) -> None:
        self._config, self._recorder, self._replay = config, recorder, replay
        self._inbox: deque[tuple[str, Any]] = deque()
        self._wake = threading.Event()
        self._enabled, self._camera_pressed = config.enabled, False
        self._present = not any("present" in spec.buttons.values() for spec in config.devices.values())
        self._warned: dict[str, Status] = {}
        self._next_readings = 0.0
        self.frames = Frames(config.prefix.lstrip("/"))
        self._hear_frames()
        specs = {name: config.devices[name] for name in config.pairs}
        self.seat = Seat(config.pairs, camera_scale=config.camera_scale, waiting=config.waiting)
        self.seat.enable(True)
        self._handsets = {name: Handset(spec.calibration, spec.buttons) for name, spec in specs.items()}
        self._devices = {} if replay else {name: self._open(spec) for name, spec in specs.items()}
        for name, spec in specs.items():
            self.seat.change(name, **vars(spec.settings))
        asked = _asked_of_haptics(config.prefix)
        self._haptics = {
            name: Haptics(
                spec.force,
                self._devices[name],
                spec.calibration,
                period_of(asked.get("rate")),
                step_of(asked.get("step")),
            )
            for name, spec in specs.items()
            if spec.force is not None and name in self._devices and asked.get("forces") is not False
        }
        names = dict.fromkeys(arm for followers in config.pairs.values() for arm in followers)
        self.arms = {name: self._arm(name) for name in names}
        self._camera = self._arm(config.camera) if config.camera else None
        if config.T_world_camera is not None:
            self.frames.put("world", VIEW, config.T_world_camera, -1)
        self.pairs = {(name, arm): self._pair(name, arm) for name, arms in config.pairs.items() for arm in arms}
        self._console = ConsoleTopics(config.prefix, self.put, config.phase_pedal)
        self._phases = Phases(config.phases, config.prefix)
        self._camera_topics = CameraTopics(
            config.prefix + "_".join([*list(config.pairs)[:2], config.camera or "camera"]), config.camera_scale,
            lambda verb, value: self.put("drive camera", (verb, value)),
        )  # fmt: skip
        for pair in self.pairs.values():
            pair.want(self._enabled)
            if pair.selected:
                self._console.selected(pair.leader.name, pair.arm.name)

    # --- assembling -------------------------------------------------------------------------

    def _open(self, spec: DeviceSpec) -> Device:
        device: Device = module(spec.kind).Adapter(
            spec.topic, dict(spec.options), lambda reading: self.put("reading", (spec.name, reading))
        )
        return device

    def _arm(self, name: str) -> Arm | Proxy:
        if name in self._config.proxies:
            return Proxy(name, self._config.proxies[name], self.frames)
        return Arm(name, self._config.prefix + name, self.frames, lambda arm, sender: self.put("rival", (arm, sender)))

    def _pair(self, leader: str, arm: str) -> Pair:
        settings = self.seat.leaders[leader].pairing.settings
        name = f"{leader}_{arm}"
        topics = PairTopics(
            self._config.prefix + name, settings.scale, settings.align,
            lambda verb, value: self.put("component", (name, verb, value)),
        )  # fmt: skip
        return Pair(
            self.seat.leaders[leader], self.arms[arm], self.seat, self._handsets[leader], self._devices.get(leader),
            topics,
        )  # fmt: skip

    def _hear_frames(self) -> None:
        rospy.Subscriber("/tf", TFMessage, self._on_tf, queue_size=10)
        rospy.Subscriber("/tf_static", TFMessage, self._on_tf, queue_size=10)
        prefix = self._config.prefix
        names = dict.fromkeys([arm for arms in self._config.pairs.values() for arm in arms] + [self._config.camera])
        for name in filter(None, names):
            take = partial(self._on_base, f"{name}_base")
            rospy.Subscriber(f"{prefix}SUJ/{name}/measured_cp", PoseStamped, take, queue_size=1)

    def _on_tf(self, message: Any) -> None:
        for each in message.transforms:
            T = pose_of(np.array(pose_numbers(each)))
            rank = 0 if self.frames.has_prefix(each.child_frame_id) else 2  # may be another simulator's on this master
            self.frames.put(each.header.frame_id, each.child_frame_id, T, rank)

    def _on_base(self, base: str, message: Any) -> None:
        self.frames.put(message.header.frame_id, base, pose_of(np.array(pose_numbers(message))), 1)

    # --- time -------------------------------------------------------------------------------

    def put(self, name: str, value: Any) -> None:
        """Ask for something, from any thread."""
        self._inbox.append((name, value))
        self._wake.set()

    def run(self, stop: Callable[[], bool]) -> None:
        """Drive until ``stop`` is set, or a replay has ended."""
        last = time.monotonic()
        while not stop() and not (self._replay is not None and self._replay.finished):
            self._wake.wait(PERIOD)
            self._wake.clear()
            if time.monotonic() - last > HELD_UP:
                time.sleep(PERIOD)
            last = time.monotonic()
            self.tick(last)
        for haptics in self._haptics.values():
            haptics.rest()
        for device in self._devices.values():
            device.close()

    def tick(self, now: float) -> None:
        """Take what came in, and drive."""
        for device in self._devices.values():
            device.poll(now)
        self._look_at_camera()
        tips = {name: arm.tip(VIEW) for name, arm in self.arms.items()}
        if self._replay is not None and (self._replay.started or self._arms_ready(tips)):
            self._inbox.extend(self._replay.due(now))
        self._read_inbox(now, tips)
        idle = self._why_idle()
        for pair in self.pairs.values():
            pair.advance(now, tips[pair.arm.name], idle)
        self._drive(now, tips)
        for arm in self.arms.values():
            arm.keep()
        self._warn()
        if now >= self._next_readings:
            self._next_readings = now + READINGS_PERIOD
            self._publish_readings(tips)

    def _arms_ready(self, tips: dict[str, Tip | None]) -> bool:
        """Whether all arms that are to be driven are ready; a replay waits for that."""
        driven = [pair.arm for pair in self.pairs.values() if pair.wanted and pair.selected]
        return all(tips[arm.name] is not None and not arm.obstacle() for arm in driven)

    def _read_inbox(self, now: float, tips: dict[str, Tip | None]) -> None:
        """Empty the queue.

        No reading of a leader that drives is skipped, except those that arrived too late.
        """
        waiting: set[str] = set()
        for _ in range(len(self._inbox)):
            name, value = self._inbox.popleft()
            if name == "reading":
                leader, reading = value
                late = now - reading.time > HELD_UP
                if leader in waiting and not late and self.seat.status(leader) is Status.FOLLOWING:
                    self._drive(now, tips)
                    waiting.clear()
                waiting.add(leader)
            elif self._recorder is not None and name not in NOT_RECORDED:
                self._recorder.event(now, name, value)
            self._handle(name, value)

    def _why_idle(self) -> str:
        if not self._present:
            return "the operator is not present"
        return "the camera is driven" if self._camera_pressed else ""

    def _look_at_camera(self) -> None:
        """Update the view from the camera's pose, when the view is unknown or out of date."""
        if self._camera is None:
            return
        seen = self._camera.setpoint()
        if seen is None:
            return
        frame_id, T = seen
        view = self.frames.between(frame_id, VIEW)
        if view is not None:
            way = float(np.linalg.norm(T[:3, 3] - view[:3, 3]))
            turn = float(np.linalg.norm(rotation_vector(view[:3, :3].T @ T[:3, :3])))
            if way < CAMERA_MOVED[0] and turn < CAMERA_MOVED[1]:
                return
        self.frames.put(frame_id, VIEW, T, -1)
        for leader in self.seat.leaders.values():
            if leader.pairing.status is Status.FOLLOWING:
                leader.pairing.release()

    def _drive(self, now: float, tips: dict[str, Tip | None]) -> None:
        """Send the goals that follow from the hands to the arms."""
        seen = self._camera.setpoint() if self._camera is not None else None
        if self._camera_pressed and not self._camera_ready():
            return
        known = {name: tip for name, tip in tips.items() if tip is not None}
        orders = self.seat.update(now, known, np.eye(4) if seen is None else seen[1])
        for name, tip in orders.tips.items():
            self.arms[name].go(tip.T_camera_tip, VIEW, self._config.rcm_guard)
            hand = self._leader_of(name).hand
            if hand is not None and hand.grip is not None:
                self.arms[name].go_jaw(tip.jaw)
        if orders.camera is not None and self._camera is not None and seen is not None:
            self._camera.go(orders.camera, seen[0])
        if self._camera_pressed:
            self._publish_camera(orders.camera is not None)
        for name, haptics in self._haptics.items():
            leader = self.seat.leaders[name]
            if leader.selected is None or leader.pairing.status is not Status.FOLLOWING or leader.hand is None:
                haptics.rest()
                continue
            pair = self.pairs[name, leader.selected]
            haptics.press(leader.hand, pair.arm.wrench_in(VIEW), pair.topics.haptic)

    def _camera_ready(self) -> bool:
        """Whether the camera can be driven; it is asked for power and homing."""
        camera = self._camera
        obstacle = "the camera is fixed" if camera is None else camera.obstacle()
        if obstacle and camera is not None and camera.reports:
            camera.make_ready()
        self._camera_topics.publish("current_state", SETTING if obstacle else ENABLED)
        if obstacle:
            self._camera_topics.publish("status", obstacle)
        return not obstacle

    def _publish_camera(self, follows: bool) -> None:
        hands = " and ".join(self.seat.drives_camera)
        why = (
            "following"
            if follows
            else f"both of {hands} must send poses"
            if hands
            else "a hand jumped; press the pedal again"
        )
        self._camera_topics.publish("following", follows)
        self._camera_topics.publish("status", why)

    def _leader_of(self, follower: str) -> Leader:
        return next(leader for leader in self.seat.leaders.values() if leader.selected == follower)

    def _warn(self) -> None:
        """Report once when the readings of a leader are rejected."""
        for name, leader in self.seat.leaders.items():
            status = leader.pairing.status
            if status is not self._warned.get(name) and status in HOLDING:
                rospy.logwarn(f"{name}: {status.value}; {leader.selected} holds until the clutch is pressed")
            self._warned[name] = status

    def _publish_readings(self, tips: dict[str, Tip | None]) -> None:
        for pair in self.pairs.values():
            tip, hand = tips[pair.arm.name], pair.leader.hand
            pair.topics.read(
                pair.leader.pairing.alignment_offset, None if hand is None else hand.T_view_hand,
                None if tip is None else tip.T_camera_tip,
            )  # fmt: skip

    # --- what was asked for -----------------------------------------------------------------

    def _handle(self, name: str, value: Any) -> None:
        handler = getattr(self, f"_on_{name.replace(' ', '_')}", None)
        if handler is None:
            rospy.logwarn(f"'{name}' is not a topic of teleoperation")
            return
        try:
            handler(value)
        except Conflict as conflict:
            rospy.logwarn(f"{name} {value}: {conflict}")

    def _on_reading(self, value: tuple[str, Reading]) -> None:
        name, reading = value
        if name not in self._handsets:
            raise Conflict(f"unknown device '{name}'; choose one of {', '.join(self._handsets)}")
        if self._recorder is not None:
            self._recorder.reading(name, reading)
        hand, presses = self._handsets[name].take(reading)
        self.seat.sample(name, hand)
        for press in presses:
            if press.action in ("next", "previous") and press.pressed:
                self._on_cycle(name, 1 if press.action == "next" else -1)
            elif press.action == "clutch":
                self.seat.clutch(press.pressed, name)
            elif press.action == "camera":
                self._take_camera(press.pressed, [name])
            elif press.action == "present":
                self._on_present(press.pressed)
            elif press.action in MARKS and press.pressed:
                self._phases.go(MARKS[press.action])

    def _on_enable(self, on: bool) -> None:
        self._enabled = on
        for pair in self.pairs.values():
            pair.want(on)

    def _on_scale(self, scale: float) -> None:
        if not 0.0 < scale <= MOST_SCALE:
            raise Conflict(f"a scale is above 0 and at most {MOST_SCALE:g}, not {scale:g}")
        self.seat.change(scale=scale)
        for pair in self.pairs.values():
            pair.topics.publish("scale", scale)

    def _on_select(self, name: str) -> None:
        pair = self._pair_of(name)
        self._select(pair.leader.name, pair.arm.name)

    def _on_unselect(self, name: str) -> None:
        pair = self._pair_of(name)
        if pair.selected:
            self._select(pair.leader.name, None)

    def _on_pair(self, value: tuple[str, str]) -> None:
        leader, follower = value
        self._select(leader, follower or None)

    def _on_cycle(self, leader: str, step: int = 1) -> None:
        if leader not in self.seat.leaders:
            raise Conflict(f"unknown leader '{leader}'; choose one of {', '.join(self.seat.leaders)}")
        before = self.seat.leaders[leader].selected
        after = self.seat.next_follower(leader, step)
        self._selected(leader, before, after)

    def _on_clutch(self, pressed: bool) -> None:
        self.seat.clutch(pressed)

    def _on_camera(self, pressed: bool) -> None:
        self._take_camera(pressed, list(self.seat.leaders)[:2])

    def _on_present(self, present: bool) -> None:
        self._present = present

    def _on_phase(self, pressed: bool) -> None:
        if pressed:
            self._phases.go(1)

    def _on_drive_camera(self, value: tuple[str, Any]) -> None:
        verb, what = value
        if verb == "state_command" and what in ("enable", "disable"):
            self._on_camera(what == "enable")
        elif verb == "scale" and 0.0 < what <= MOST_SCALE:
            self.seat.camera_scale = what
            self._camera_topics.publish("scale", what)
        else:
            raise Conflict(
                f"'{verb}' does not take {what!r}; a state is enable or disable, "
                f"a scale above 0 and at most {MOST_SCALE:g}"
            )

    def _on_component(self, value: tuple[str, str, Any]) -> None:
        name, verb, what = value
        pair = self._pair_of(name)
        leader = pair.leader.name
        if verb == "state_command" and what in ("enable", "disable"):
            pair.want(what == "enable")
        elif verb == "state_command" and what == "align_MTM":
            pair.align()
        elif verb == "scale" and 0.0 < what <= MOST_SCALE:
            self.seat.change(leader, scale=what)
            pair.topics.publish("scale", what)
        elif verb in ("lock_rotation", "lock_translation"):
            self.seat.change(leader, **{verb: what})
            pair.topics.publish("rotation_locked" if verb == "lock_rotation" else "translation_locked", what)
        elif verb == "align":
            self.seat.change(leader, align=what)
            pair.topics.publish("align_mtm", what)
        else:
            raise Conflict(
                f"'{verb}' does not take {what!r}; a state is enable, disable or align_MTM, "
                f"a scale above 0 and at most {MOST_SCALE:g}"
            )

    def _on_rival(self, value: tuple[str, str]) -> None:
        """Hold an arm that another node moves too, so that the two do not alternate."""
        arm, sender = value
        for leader in self.seat.leaders.values():
            if leader.selected == arm and leader.pairing.status is Status.FOLLOWING:
                leader.pairing.contest()
                rospy.logwarn(f"{arm}: {sender} sends servo commands too; stop one of the two")

    # --- selection --------------------------------------------------------------------------

    def _pair_of(self, name: str) -> Pair:
        for pair in self.pairs.values():
            if f"{pair.leader.name}_{pair.arm.name}" == name:
                return pair
        names = ", ".join(f"{leader}_{arm}" for leader, arm in self.pairs)
        raise Conflict(f"unknown pair '{name[:40]}'; choose one of {names}")

    def _select(self, leader: str, follower: str | None) -> None:
        before = self.seat.leaders[leader].selected if leader in self.seat.leaders else None
        try:
            self.seat.select(leader, follower)
        except Conflict:
            self._contest(leader, follower)
            raise
        self._selected(leader, before, follower)

    def _contest(self, claimer: str, follower: str | None) -> None:
        """Hold an arm that another node commands, until its leader's clutch is pressed or the other node stops."""
        for leader in self.seat.leaders.values():
            if leader.selected == follower and follower is not None and (claimer, follower) in self.pairs:
                leader.pairing.contest()

    def _selected(self, leader: str, before: str | None, after: str | None) -> None:
        self.seat.allow(leader, False)
        if before is not None and before != after:
            self._console.unselected(leader, before)
        if after is not None:
            pair = self.pairs[leader, after]
            pair.want(pair.wanted or self._enabled)
            self._console.selected(leader, after)

    def _take_camera(self, pressed: bool, hands: list[str]) -> None:
        """Drive the camera by the hands, instead of the instruments, while the pedal is pressed."""
        self._camera_pressed = pressed
        self.seat.camera(pressed, hands)
        if pressed and self._camera is not None:
            self._camera.forget_asking()
        self._camera_topics.publish("desired_state", ENABLED if pressed else DISABLED)
        if not pressed:
            self._camera_topics.publish("current_state", DISABLED)
            self._camera_topics.publish("following", False)
