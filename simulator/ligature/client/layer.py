"""``ros_abstraction_layer.ral`` for ROS 1: node, names, time, topics and services behind one object.

It has what AMBF's clients call and what `crtk_python_client`'s own class of that name offers, so that either kind of
client can be handed one. Times are seconds of ROS time; namespaces are written without slashes at their ends.
"""

from __future__ import annotations

import threading
import time
import xmlrpc.client
from collections.abc import Callable, Sequence
from typing import Any

import rosgraph
import rospy

from ligature.ros.master import NO_ANSWER, Hasty, MasterWatch

MASTER_TIMEOUT = 10.0
"""Seconds to wait for a ROS master; rospy alone would wait for ever."""

_POLL = 0.05
_starting = threading.Lock()


class ral:  # noqa: N801 - the name that clients import
    """One view of this process's ROS node: topic names begin with ``namespace``.

    A process has one node. The first ``ral`` starts it, with an anonymous name made of ``node_name``; later ones
    share it. A master that restarts is informed about all topics again. Raises ConnectionError when no ROS master
    answers within `MASTER_TIMEOUT`.
    """

    def __init__(self, node_name: str, namespace: str = "", node: Any = None) -> None:
        _start_node(node_name)
        self._node_name = node_name
        self._namespace = namespace.strip("/")
        self._node = node
        self._children: dict[str, ral] = {}
        self._publishers: list[Any] = []
        self._subscribers: list[Any] = []
        self._services: list[Any] = []

    @staticmethod
    def ros_version() -> int:
        """1."""
        return 1

    @staticmethod
    def parse_argv(argv: Sequence[str]) -> list[str]:
        """The arguments without ROS's own remappings (``name:=value``)."""
        return list(rospy.myargv(list(argv)))

    def create_child(self, child_namespace: str) -> ral:
        """A ``ral`` of a namespace below this one; RuntimeError when that child exists, as in CRTK's."""
        name = child_namespace.strip("/")
        if name in self._children:
            raise RuntimeError(f"ral {self._namespace or '/'!r} has a child {name!r} already")
        child = ral(self._node_name, f"{self._namespace}/{name}", self._node)
        self._children[name] = child
        return child

    def node_name(self) -> str:
        """The name given at construction; rospy appends digits to make it unique."""
        return self._node_name

    def namespace(self) -> str:
        """Namespace without slashes at its ends; empty for none."""
        return self._namespace

    def now(self) -> rospy.Time:
        """ROS time."""
        return rospy.Time.now()

    def now_msg(self) -> rospy.Time:
        """ROS time as messages carry it: in ROS 1 the same as `now`."""
        return rospy.Time.now()

    def get_timestamp(self, message: Any) -> rospy.Time:
        """Stamp of a message with a header, or of a header."""
        return getattr(message, "header", message).stamp

    def set_timestamp(self, message: Any) -> None:
        """Stamp a message with now."""
        message.header.stamp = self.now()

    def to_sec(self, moment: Any) -> float:
        """Seconds of a time, a duration, a header, a message with a header, or a number."""
        if hasattr(moment, "header") or hasattr(moment, "stamp"):
            moment = self.get_timestamp(moment)
        return float(moment.to_sec() if hasattr(moment, "to_sec") else moment)

    def create_duration(self, seconds: float) -> rospy.Duration:
        """A duration."""
        return rospy.Duration.from_sec(float(seconds))

    def create_rate(self, hz: float) -> rospy.Rate:
        """A rate whose ``sleep()`` keeps a loop at ``hz``; a number in text, as from a command line, will do."""
        return rospy.Rate(float(hz))

    def sleep(self, seconds: Any) -> None:
        """Wait for ``seconds``, a number or a duration."""
        time.sleep(max(0.0, self.to_sec(seconds) if hasattr(seconds, "to_sec") else float(seconds)))

    def create_time(self) -> rospy.Time:
        """The time zero."""
        return rospy.Time()

    def spin(self) -> None:
        """Nothing to do: rospy takes messages on its own threads."""

    def spin_and_execute(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call ``function(*arguments)`` while messages are received; returns its result."""
        return function(*arguments)

    def shutdown(self) -> None:
        """Not available in ROS 1: raises RuntimeError."""
        raise RuntimeError("a ROS 1 node ends with its process: let the script end, or call rospy.signal_shutdown()")

    def on_shutdown(self, callback: Callable[[], Any]) -> None:
        """Have ``callback()`` called when the node ends."""
        rospy.on_shutdown(callback)

    def is_shutdown(self) -> bool:
        """Whether the node has ended."""
        return bool(rospy.is_shutdown())

    def publisher(self, topic: str, type_: type, queue_size: int = 10, latch: bool = False) -> rospy.Publisher:
        """A publisher of messages ``type_`` on ``topic`` below the namespace.

        ``queue_size`` and ``latch`` as in rospy.
        """
        publisher = rospy.Publisher(self._resolved(topic), type_, queue_size=queue_size, latch=latch, tcp_nodelay=True)
        self._publishers.append(publisher)
        return publisher

    def subscriber(
        self, topic: str, type_: type, callback: Callable[[Any], Any], queue_size: int = 10, latch: bool = False
    ) -> rospy.Subscriber:
        """A subscriber that calls ``callback`` with messages ``type_`` on ``topic`` below the namespace.

        ``queue_size`` as in rospy; ``latch`` has no meaning in ROS 1.
        """
        subscriber = rospy.Subscriber(self._resolved(topic), type_, callback, queue_size=queue_size, tcp_nodelay=True)
        self._subscribers.append(subscriber)
        return subscriber

    def service_client(self, name: str, type_: type) -> rospy.ServiceProxy:
        """A callable for the service ``name`` of ``type_`` below the namespace."""
        service = rospy.ServiceProxy(self._resolved(name), type_)
        self._services.append(service)
        return service

    def get_topic_name(self, end: Any) -> str:
        """Full name of the topic of a publisher or subscriber."""
        return str(end.name)

    def get_published_topics(self) -> list[tuple[str, str]]:
        """Name and type of every published topic; ConnectionError when the master does not answer."""
        try:
            return [(name, type_) for name, type_ in rospy.get_published_topics()]
        except OSError as error:
            raise ConnectionError(f"the ROS master at {rosgraph.get_master_uri()} does not answer: {error}") from error

    def forget(self, end: Any) -> None:
        """Unregister a publisher or subscriber of this ``ral``."""
        for ends in (self._publishers, self._subscribers):
            if end in ends:
                ends.remove(end)
        end.unregister()

    def check_connections(self, timeout_seconds: float = 5.0, check_children: bool = True) -> None:
        """Wait until every publisher is listened to and every subscriber is served.

        With ``check_children`` also in children.

        TimeoutError names what is missing after ``timeout_seconds``; with zero nothing is checked, as in CRTK's.
        Services are not checked.
        """
        if timeout_seconds == 0:
            return
        deadline = time.monotonic() + timeout_seconds
        while unheard := self._unconnected(check_children):
            if time.monotonic() >= deadline:
                raise TimeoutError(
                    f"not connected within {timeout_seconds:g} s: {', '.join(unheard)}; is the other side running?"
                )
            time.sleep(_POLL)

    def _unconnected(self, check_children: bool) -> list[str]:
        missing = [f"publisher of {end.name}" for end in self._publishers if end.get_num_connections() == 0]
        missing += [f"subscriber of {end.name}" for end in self._subscribers if end.get_num_connections() == 0]
        if check_children:
            for child in self._children.values():
                missing += child._unconnected(True)
        return missing

    def _resolved(self, name: str) -> str:
        # an empty namespace makes the name absolute; any other is relative, so that __ns:= moves it
        return f"{self._namespace}/{name.strip('/')}"


def _start_node(name: str) -> None:
    with _starting:
        if rospy.core.is_initialized():
            return
        _await_master()
        in_main = threading.current_thread() is threading.main_thread()
        rospy.init_node(name, anonymous=True, disable_signals=not in_main)
        MasterWatch().start()


def _await_master() -> None:
    uri = rosgraph.get_master_uri()
    deadline = time.monotonic() + MASTER_TIMEOUT
    while not _answers(uri):
        if time.monotonic() > deadline:
            raise ConnectionError(
                f"no ROS master answers at {uri}: start the simulator (`ligature run …` starts a master too), "
                "or set ROS_MASTER_URI to where it runs"
            )
        time.sleep(_POLL)


def _answers(uri: str) -> bool:
    try:
        xmlrpc.client.ServerProxy(uri, transport=Hasty()).getPid("/ligature_client")
    except NO_ANSWER:
        return False
    return True
