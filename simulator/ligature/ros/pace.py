"""Pause, single updates and speed of a run as ROS services; AMBF's stepping by clock edges is in `reception`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import rospy
from std_msgs.msg import Bool, Float64
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

from ligature.bus import Block, Pace, Throttle
from ligature.bus.codec import Message
from ligature.model.scene import Scene
from ligature.model.state import new_state

TIMEOUT = 10.0
"""Seconds that an update may take."""
NAP = 0.001


class PaceServices:
    """``pause``, ``step`` and ``set_speed`` below ``root``; ``push`` sends commands to the physics."""

    def __init__(self, root: str, scene: Scene, block: Block, push: Callable[[Message], None]) -> None:
        self._block, self._push = block, push
        self._state = new_state(scene)
        self._lock = threading.Lock()
        self._paused = self._clock = False
        self._reported = rospy.Publisher(f"{root}/paused", Bool, queue_size=1, latch=True)
        self._reported.publish(False)
        rospy.Service(f"{root}/pause", SetBool, self._pause)
        rospy.Service(f"{root}/step", Trigger, self._step)
        rospy.Subscriber(f"{root}/set_speed", Float64, self._set_speed, queue_size=1)

    def _pause(self, request: SetBool) -> SetBoolResponse:
        """Pause or resume; replies when the run has stopped or resumed."""
        with self._lock:
            self._push(Throttle(request.data, self._clock, 1 if request.data else 0))
            self._paused = request.data
            self._reported.publish(self._paused)
            at = self._settled() if self._paused else self._update()
        return SetBoolResponse(True, f"{'paused at' if self._paused else 'goes on from'} update {at}")

    def _step(self, _: Trigger) -> TriggerResponse:
        """Simulate one update; answers when it is done."""
        with self._lock:
            if not self._paused:
                return TriggerResponse(False, "the run is not paused; call 'pause' with 'true' first")
            before = self._update()
            self._clock = not self._clock
            self._push(Throttle(True, self._clock, 1))
            deadline = time.monotonic() + TIMEOUT
            while (now := self._update()) == before:
                if time.monotonic() > deadline:
                    return TriggerResponse(False, f"update {before + 1} is not done after {TIMEOUT:g} s")
                time.sleep(NAP)
        return TriggerResponse(True, f"update {now}")

    def _set_speed(self, message: Float64) -> None:
        command = Pace(message.data)
        try:
            command.check()
        except ValueError as error:
            rospy.logwarn(f"set_speed: {error}")
            return
        self._push(command)

    def _update(self) -> int:
        self._block.read(self._state)
        return int(self._state["update"][0])

    def _settled(self) -> int:
        """Wait until no update follows; returns the last one."""
        before, since = self._update(), time.monotonic()
        begin = since
        while time.monotonic() - since < 0.05 and time.monotonic() - begin < TIMEOUT:
            time.sleep(NAP)
            now = self._update()
            if now != before:
                before, since = now, time.monotonic()
        return before
