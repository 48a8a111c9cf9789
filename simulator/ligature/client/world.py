"""Handle of the world: its times, resets, and stepping by a client's clock; seconds."""

from __future__ import annotations

import time
from typing import Any

import rospy
from ambf_msgs.msg import WorldCmd, WorldState
from std_msgs.msg import Empty

from ligature.client.base_object import BaseObject

TIME_OUT = 2.0
"""Seconds after the last `World.update` at which a world that is published periodically runs freely again."""

STEPS = 10
LISTENER_TIMEOUT = 1.0
_POLL = 0.01


class World(BaseObject):
    """The world. It is published by `update`, and periodically only after `set_active`.

    ``ral``, ``a_name`` and ``time_out`` are those of `BaseObject`.
    """

    State = WorldState
    Command = WorldCmd

    def __init__(self, ral: Any = None, a_name: str | None = None, time_out: float = TIME_OUT) -> None:
        super().__init__(ral, a_name, time_out)
        self._cmd.n_skip_steps = STEPS
        self._updated = time.monotonic()
        self._reset_pub: Any = None
        self._reset_bodies_pub: Any = None

    def connect(self, ral: Any) -> None:
        """Advertise command and resets, and subscribe to the state."""
        super().connect(ral)
        self._reset_pub = ral.publisher(f"{self._name}/Command/Reset", Empty)
        self._reset_bodies_pub = ral.publisher(f"{self._name}/Command/Reset/Bodies", Empty)

    def ends(self) -> list[Any]:
        """The publishers and subscribers, with those of the resets."""
        return [*super().ends(), *(end for end in (self._reset_pub, self._reset_bodies_pub) if end is not None)]

    def enable_throttling(self, flag: bool) -> None:
        """Have the simulator wait for `update`; takes effect with the next one."""
        with self._lock:
            self._cmd.enable_step_throttling = bool(flag)
            self._updated = time.monotonic()

    def set_num_step_skips(self, num: int) -> None:
        """How many updates of the simulator one `update` releases; ValueError outside 1..100."""
        if not 1 <= num <= 100:
            raise ValueError(f"the number of steps per update must be 1 to 100, not {num}")
        self._cmd.n_skip_steps = int(num)

    def update(self) -> None:
        """Toggle the clock and send it; a message and nothing sent when no simulator listens."""
        if not _heard(self._pub, self._name):
            return
        with self._lock:
            self._cmd.step_clock = not self._cmd.step_clock
            self._updated = time.monotonic()
            self.publish()

    def reset(self) -> None:
        """Reset everything to the start of the scene; time continues."""
        if _heard(self._reset_pub, self._name):
            self._reset_pub.publish(Empty())

    def reset_bodies(self) -> None:
        """Put bodies back to where they began; cameras and lights stay."""
        if _heard(self._reset_bodies_pub, self._name):
            self._reset_bodies_pub.publish(Empty())

    def clear_command(self) -> None:
        """End throttling when no `update` was called for the timeout."""
        with self._lock:
            if time.monotonic() - self._updated > self._time_out:
                self._cmd.enable_step_throttling = False


def _heard(publisher: Any, name: str) -> bool:
    """Whether a simulator subscribes; waits a moment for a connection that is being made."""
    if publisher is None:
        raise RuntimeError(f"{name} is not connected: get its handle from a Client after connect()")
    deadline = time.monotonic() + LISTENER_TIMEOUT
    while publisher.get_num_connections() == 0:
        if time.monotonic() > deadline or rospy.is_shutdown():
            rospy.logwarn(f"no subscriber of {publisher.name}: is the simulator running?")
            return False
        time.sleep(_POLL)
    return True
