"""What all object handles share: the newest state, the command that is published, poses and names.

Poses of bodies are in the world, all others in the parent's frame; metres and radians; quaternions x, y, z, w.
"""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Sequence
from typing import Any, ClassVar

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion

from ligature.client.euler import euler_from_quaternion, quaternion_from_euler

BODY_TIME_OUT = 0.1


class BaseObject:
    """A handle of one object of the simulator.

    Built as ``Kind(ral, name, time_out)`` (AMBF 3.0) or ``Kind(name)`` (2.0); a `Client` connects it to its topics.
    Setters change a stored command, which the client's thread publishes as long as the object is active: a target
    holds until the next one. Before the first message the state is an empty message: zero everywhere.

    ``ral`` is the layer to ROS, ``a_name`` the object's name. ``time_out`` (seconds) is taken as AMBF takes it and
    clears nothing here: a client that lives repeats its command, and of one that died the simulator releases it.
    """

    State: ClassVar[type]
    Command: ClassVar[type]

    def __init__(self, ral: Any = None, a_name: str | None = None, time_out: float = BODY_TIME_OUT) -> None:
        if isinstance(ral, str):
            # AMBF 2.0: (name) or (name, time_out)
            time_out = time_out if a_name is None else float(a_name)
            ral, a_name = None, ral
        if a_name is None:
            raise TypeError(f"{type(self).__name__} needs a name: (ral, name) as in AMBF 3.0, or (name) as in 2.0")
        self.ral = ral
        self._name = a_name
        self._time_out = time_out
        self._state: Any = self.State()
        self._cmd: Any = self.Command()
        self._pub: Any = None
        self._sub: Any = None
        self._active = False
        self._received = threading.Event()
        self._posed = False
        # a command is several fields: nobody may publish it half written
        self._lock = threading.RLock()

    def ros_cb(self, state: Any) -> None:
        """Take a state message."""
        self._state = state
        self._received.set()

    def set_name(self, name: str) -> None:
        """Change the name of this handle; its topics stay."""
        self._name = name

    def set_active(self) -> None:
        """Have the command published from now on."""
        self._active = True

    def is_active(self) -> bool:
        """Whether the command is published."""
        return self._active

    def get_name(self) -> str:
        """The key in the client's list: the topic without ``/State``."""
        return self._name

    def get_identifier(self) -> str:
        """Namespace and key of the object in its file, with spaces: ``/ambf/env/phantom/BODY Needle``."""
        return _text(self._state, "identifier")

    def get_parent_name(self) -> str:
        """The parent as the file names it; empty for none, and for kinds whose messages lack it."""
        return _text(self._state, "parent_name")

    def get_sim_step(self) -> int:
        """Counter of the simulator's updates."""
        return self._state.sim_step

    def get_msg_header(self) -> Any:
        """Header of the newest state."""
        return self._state.header

    def get_msg_time_stamp(self) -> rospy.Time:
        """Wall time of the newest state."""
        return self._state.header.stamp

    def get_msg_seq_num(self) -> int:
        """Sequence number of the newest state."""
        return self._state.header.seq

    def get_msg_frame_id(self) -> str:
        """Frame id of the newest state: empty."""
        return self._state.header.frame_id

    def get_pos(self) -> Point:
        """Position."""
        return self._state.pose.position

    def get_rot(self) -> Quaternion:
        """Orientation."""
        return self._state.pose.orientation

    def get_rpy(self) -> tuple[float, float, float]:
        """Roll, pitch, yaw; zeros before the first message."""
        q = self.get_rot()
        return euler_from_quaternion((q.x, q.y, q.z, q.w))

    def get_pose(self) -> Any:
        """``[x, y, z, roll, pitch, yaw]``."""
        p = self.get_pos()
        return [p.x, p.y, p.z, *self.get_rpy()]

    def get_pos_command(self) -> Point:
        """The position last commanded; the measured one before any."""
        return self._wanted_pose().position

    def get_rot_command(self) -> Quaternion:
        """The orientation last commanded; the measured one before any."""
        return self._wanted_pose().orientation

    def set_pos(self, px: float, py: float, pz: float) -> None:
        """Command a position ``px``, ``py``, ``pz`` (m).

        The orientation stays the commanded one, or the measured one before any.
        """
        self._move(Point(float(px), float(py), float(pz)), self.get_rot_command())

    def set_rpy(self, roll: float, pitch: float, yaw: float) -> None:
        """Command an orientation by ``roll``, ``pitch``, ``yaw`` (rad).

        The position stays the commanded one, or the measured one before any.
        """
        self._move(self.get_pos_command(), Quaternion(*quaternion_from_euler(roll, pitch, yaw)))

    def set_rot(self, quat: Sequence[float]) -> None:
        """Command an orientation x, y, z, w; the position as in `set_rpy`."""
        x, y, z, w = (float(value) for value in quat)
        self._move(self.get_pos_command(), Quaternion(x, y, z, w))

    def set_pose(self, pose: Pose) -> None:
        """Command a pose."""
        self._move(pose.position, pose.orientation)

    def clear_command(self) -> None:
        """What is published when the command has become stale; bodies keep theirs."""

    def connect(self, ral: Any) -> None:
        """Advertise the command and subscribe to the state, below the object's name."""
        self.ral = ral
        self._pub = ral.publisher(f"{self._name}/Command", self.Command)
        self._sub = ral.subscriber(f"{self._name}/State", self.State, self.ros_cb)

    def disconnect(self) -> None:
        """Leave all topics."""
        for end in self.ends():
            self.ral.forget(end)

    def await_state(self, seconds: float) -> bool:
        """Wait for the first state; whether there is one."""
        return self._received.wait(seconds)

    def ends(self) -> list[Any]:
        """The publishers and subscribers of this handle; empty until a client has connected it."""
        return [end for end in (self._sub, self._pub) if end is not None]

    def publish(self) -> None:
        """Send the stored command now. Raises RuntimeError before the object is connected."""
        if self._pub is None:
            raise RuntimeError(f"{self._name} is not connected: get its handle from a Client after connect()")
        with self._lock:
            if hasattr(self._cmd, "header"):
                self._cmd.header.stamp = rospy.Time.now()
            self._pub.publish(self._cmd)

    def _move(self, position: Point, orientation: Quaternion) -> None:
        if not hasattr(self._cmd, "pose"):
            raise TypeError(f"{self._name}: a {type(self).__name__} cannot be moved, its command has no pose")
        p, q = position, orientation
        if not self._takes(p.x, p.y, p.z, q.x, q.y, q.z, q.w):
            return
        with self._lock:
            self._cmd.pose = Pose(copy.copy(position), copy.copy(orientation))
            self._posed = True
            self._pose_commanded()

    def _takes(self, *values: float) -> bool:
        """Whether all numbers of a command are finite; otherwise it is reported and the previous command remains.

        The simulator would refuse the whole message, and release the object when nothing better follows.
        """
        if all(map(math.isfinite, values)):
            return True
        rospy.logwarn(
            f"{self._name}: {', '.join(map(str, values))} are not valid commands; keeping the previous command"
        )
        return False

    def _pose_commanded(self) -> None:
        """Mark the command as a pose command."""

    def _wanted_pose(self) -> Pose:
        return self._cmd.pose if self._posed else self._state.pose


def _text(state: Any, field: str) -> str:
    return str(getattr(state, field).data) if hasattr(state, field) else ""
