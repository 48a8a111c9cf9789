"""The client: finds the simulator's objects by their topics, hands out handles, publishes their commands."""

from __future__ import annotations

import os.path
import threading
import time
from collections.abc import Sequence
from difflib import SequenceMatcher
from typing import Any

import rospy

from ligature.client import layer
from ligature.client.actuator import Actuator
from ligature.client.base_object import BaseObject
from ligature.client.legacy import Object
from ligature.client.placed import Camera, Light
from ligature.client.rigid_body import RigidBody
from ligature.client.sensors import ContactSensor, GhostObject, Sensor
from ligature.client.vehicle import Vehicle
from ligature.client.world import World

KINDS: dict[str, type[BaseObject]] = {
    f"ambf_msgs/{kind.State.__name__}": kind
    for kind in (Actuator, Camera, ContactSensor, GhostObject, Light, Object, RigidBody, Sensor, Vehicle, World)
}
"""The handle of every type of state message."""

STATE = "/State"
DISCOVERY_PERIOD = 1.0
"""Seconds between two attempts to find a simulator."""
SETTLING_TIME = 0.1
"""Seconds in which a simulator that is just starting must not have advertised more, to be taken as complete."""
CONNECTING = 2.0
"""Seconds that the simulator has to connect to all topics; what is sent before that is lost."""
FIRST_STATE_TIMEOUT = 0.5
"""Seconds to wait for an object's first state when its handle is given out."""
POLL = 0.02
WARNING_PERIOD = 5.0
NAMED, LINES, LINE = 4, 2, 120
"""Closest objects that the error of a failed look-up names, its lines, and characters of a line."""


class Client:
    """Handles of all objects of a running simulator.

    ``get_obj_handle`` makes an object *active*: one daemon thread publishes the commands of all active objects at the
    rate given to `connect`, so that targets hold until they are changed. Objects that appear after `connect` are
    found by `refresh`. Names that match no object or several give None, with a message that lists what there is.

    ``client_name`` is the name of the ROS node; `connect` looks for objects ``max_discovery_attempts`` times.
    """

    def __init__(self, client_name: str = "ambf_client", max_discovery_attempts: int = 5) -> None:
        self._client_name = client_name
        self._attempts = max_discovery_attempts
        self._ral: layer.ral | None = None
        self._objects: dict[str, BaseObject] = {}
        self._common_namespace = ""
        self._period = 1.0 / 120.0
        self._thread: threading.Thread | None = None

    @property
    def ral(self) -> layer.ral:
        """The ROS node of this process; started when it is first needed."""
        if self._ral is None:
            self._ral = layer.ral(self._client_name)
        return self._ral

    def get_ral(self) -> layer.ral:
        """The ROS node of this process."""
        return self.ral

    def connect(self, default_publish_rate: float = 120) -> None:
        """Start the node, find all objects, and publish commands at ``default_publish_rate`` (Hz) from now on.

        Without a simulator it continues without objects after ``max_discovery_attempts`` attempts, and logs it.
        ConnectionError when there is no ROS master.

        Raises ValueError unless the rate is above 0.
        """
        if not default_publish_rate > 0:
            raise ValueError(f"a publish rate of {default_publish_rate} Hz: must be above 0")
        self._period = 1.0 / float(default_publish_rate)
        kinds = self._discover()
        for name, handle in list(self._objects.items()):
            if kinds.get(name) is not type(handle):
                self._objects.pop(name).disconnect()
        for name in kinds.keys() - self._objects.keys():
            self._objects[name] = kinds[name](self.ral, name)
            self._objects[name].connect(self.ral)
        self._await_connections()
        self._common_namespace = os.path.commonprefix(list(self._objects))
        if self._thread is None:
            self._thread = threading.Thread(target=self._publish, name="ambf_client commands", daemon=True)
            self._thread.start()

    def refresh(self) -> None:
        """Look for objects again; handles of those that are still there stay as they are."""
        self.connect(1.0 / self._period)

    def clean_up(self) -> None:
        """Forget all objects and publish their commands no more."""
        self._objects = {}

    def get_common_namespace(self) -> str:
        """What the names of all objects begin with."""
        return self._common_namespace

    def get_obj_names(self) -> list[str]:
        """Names of all objects: their topics without ``/State``."""
        return sorted(self._objects)

    def get_obj_handle(self, name: str) -> Any:
        """The object of that name, or the only one whose name contains ``name``, made active; None for none or many.

        Waits for its first state, for `FIRST_STATE_TIMEOUT` at most.
        """
        handle = self._find(name)
        if handle is not None:
            handle.set_active()
            handle.await_state(FIRST_STATE_TIMEOUT)
        return handle

    def get_world_handle(self) -> World | None:
        """The world, not made active; None when no simulator was found."""
        world = next((handle for handle in self._objects.values() if isinstance(handle, World)), None)
        if world is not None:
            world.await_state(FIRST_STATE_TIMEOUT)
        return world

    def get_obj_pose(self, name: str) -> Any:
        """Pose of the object of that name; None when there is none."""
        handle = self._find(name)
        return None if handle is None else handle.get_pose()

    def set_obj_cmd(self, name: str, fx: float, fy: float, fz: float, nx: float, ny: float, nz: float) -> None:
        """Command force ``fx``, ``fy``, ``fz`` (N) and torque ``nx``, ``ny``, ``nz`` (N m) on the body ``name``."""
        handle = self.get_obj_handle(name)
        if handle is not None:
            handle.wrench_command(fx, fy, fz, nx, ny, nz)

    def is_shutdown(self) -> bool:
        """Whether the node has ended."""
        return self.ral.is_shutdown()

    def get_time(self) -> float:
        """ROS time in seconds."""
        return self.ral.to_sec(self.ral.now())

    def create_rate(self, hz: float) -> rospy.Rate:
        """A rate whose ``sleep()`` keeps a loop at ``hz``."""
        return self.ral.create_rate(hz)

    def _discover(self) -> dict[str, type[BaseObject]]:
        for attempt in range(max(self._attempts, 1)):
            if attempt:
                time.sleep(DISCOVERY_PERIOD)
            found = self._advertised()
            while found and not rospy.is_shutdown():
                time.sleep(SETTLING_TIME)
                before, found = found, self._advertised()
                if found == before:
                    return found
        rospy.logwarn(f"no AMBF objects on the ROS master after {self._attempts} attempts: is the simulator running?")
        return {}

    def _advertised(self) -> dict[str, type[BaseObject]]:
        found = {}
        for topic, type_ in sorted(self.ral.get_published_topics()):
            if topic.endswith(STATE) and type_ in KINDS:
                found[topic[: -len(STATE)]] = KINDS[type_]
        return found

    def _await_connections(self) -> None:
        ends = [end for handle in self._objects.values() for end in handle.ends()]
        deadline = time.monotonic() + CONNECTING
        while missing := [end.name for end in ends if end.get_num_connections() == 0]:
            if time.monotonic() > deadline or rospy.is_shutdown():
                rospy.logwarn(f"not connected within {CONNECTING:g} s: {', '.join(missing)}")
                return
            time.sleep(POLL)

    def _find(self, name: str) -> BaseObject | None:
        if name in self._objects:
            return self._objects[name]
        if name == "World":
            return self.get_world_handle()
        matches = [key for key in self._objects if name in key]
        if len(matches) == 1:
            return self._objects[matches[0]]
        if matches:
            rospy.logwarn(f"{name!r} is a part of {len(matches)} names, give more of one\n" + _listed(matches))
        elif self._objects:
            close = sorted(self._objects, key=lambda key: -SequenceMatcher(None, name, key).ratio())
            rospy.logwarn(
                f"no object's name contains {name!r} (get_obj_names() lists all {len(close)}); the closest are\n"
                + _listed(close[:NAMED])
            )
        else:
            rospy.logwarn(f"no object's name contains {name!r}: there are no objects; is the simulator running?")
        return None

    def _publish(self) -> None:
        due = time.monotonic()
        while not rospy.is_shutdown():
            for handle in list(self._objects.values()):
                if handle.is_active():
                    _send(handle)
            now = time.monotonic()
            due = max(due + self._period, now)
            time.sleep(due - now)


def _listed(names: Sequence[str]) -> str:
    """One or two lines of names, and how many more there are."""
    lines = [""]
    for count, name in enumerate(names):
        if len(lines[-1]) + len(name) > LINE and lines[-1]:
            if len(lines) == LINES:
                return "\n".join(lines) + f" and {len(names) - count} more"
            lines.append("")
        lines[-1] += ("  " if not lines[-1] else ", ") + name
    return "\n".join(lines)


def _send(handle: BaseObject) -> None:
    """Publish one command; one that cannot be sent must not end the thread that keeps all others alive."""
    handle.clear_command()
    try:
        handle.publish()
    except (rospy.ROSException, rospy.ROSSerializationException) as error:
        if rospy.core.is_shutdown_requested():
            return
        rospy.logerr_throttle(WARNING_PERIOD, f"{handle.get_name()}: cannot send the command: {error}")
