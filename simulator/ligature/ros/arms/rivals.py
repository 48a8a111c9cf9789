"""Who else publishes what simulated arms publish: a real arm or console on the same master has precedence.

The master calls whoever listens to a topic as soon as another node publishes it, and gives no other sign. So a node of
its own is registered as a listener, which never connects to anybody: its name ends in `WATCHER`.
"""

from __future__ import annotations

import os
import threading
import xmlrpc.client
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import rosgraph
import rospy
from rosgraph.xmlrpc import XmlRpcHandler, XmlRpcNode

from ligature.ros.master import NO_ANSWER, WATCHER, Hasty, is_simulator
from ligature.ros.registrations import lives

PERIOD = 5.0
"""Seconds between two looks without a call of the master, which may have been restarted."""

READY = 5.0
"""Seconds that the listener has to get its address."""

WATCHED = ("/measured_cp", "/measured_js", "/operating_state", "/teleop/enabled")
"""Topics, by their ends, of which the master calls; every look compares all."""


class Rival(NamedTuple):
    """Another node and the topic that it publishes."""

    node: str
    topic: str


class Rivals(threading.Thread):
    """Looks for other nodes that publish topics of ``parts``, each a name with the topics of it.

    Only nodes that answer count: a console that was killed is still known to the master. Of two simulators that start
    at the same moment the one whose name comes first keeps its topics.
    """

    def __init__(self, parts: Mapping[str, Sequence[str]]) -> None:
        super().__init__(name="rivals", daemon=True)
        self._me = rospy.get_name()
        self._part_of = {topic: part for part, topics in parts.items() for topic in topics}
        self._found: dict[str, Rival] = {}
        self._fresh: list[str] = []
        self._called = threading.Event()
        self._uri = ""
        self._lock = threading.Lock()

    @property
    def found(self) -> Mapping[str, Rival]:
        """The rival of each part that has one."""
        return self._found

    def take(self) -> list[tuple[str, Rival]]:
        """Parts whose rivals were found since the last call."""
        if not self._fresh:
            return []
        with self._lock:
            fresh, self._fresh = self._fresh, []
        return [(part, self._found[part]) for part in fresh]

    def look(self) -> None:
        """Ask the master once; raises one of `NO_ANSWER` when it does not answer."""
        published, subscribed, _ = rosgraph.Master(self._me).getSystemState()
        alive: dict[str, bool] = {}
        for topic, nodes in published:
            part = self._part_of.get(topic)
            if part is None or part in self._found:
                continue
            for node in nodes:
                if not self._precedes(node):
                    continue
                if node not in alive:
                    alive[node] = lives(node)
                if alive[node]:
                    self._note(part, Rival(node, topic))
                    break
        if self._uri:
            self._register({topic for topic, nodes in subscribed if self._me + WATCHER in nodes})

    def _precedes(self, node: str) -> bool:
        """Whether this simulator yields to ``node``; once it runs, to other simulators only by name."""
        return node != self._me and not (self._uri and is_simulator(node) and node > self._me)

    def _note(self, part: str, rival: Rival) -> None:
        with self._lock:
            self._found[part] = rival
            self._fresh.append(part)

    def run(self) -> None:
        """Look whenever the master calls, and now and then, until the node ends."""
        node = XmlRpcNode(0, _Listener(self._called))
        node.start()
        for _ in range(int(READY / 0.01)):
            if node.uri:
                break
            rospy.rostime.wallsleep(0.01)
        self._uri = node.uri or ""
        rospy.on_shutdown(self._leave)
        while not rospy.core.is_shutdown_requested():
            self._called.clear()
            with suppress(*NO_ANSWER):  # the watch of the master reports it
                self.look()
            self._called.wait(PERIOD)

    def _register(self, known: set[str]) -> None:
        """Subscribe at the master to the publishers of topics that are not watched yet."""
        missing = [topic for topic in self._part_of if topic.endswith(WATCHED) and topic not in known]
        if missing:
            self._ask_all("registerSubscriber", [(topic, "*", self._uri) for topic in missing])
            self._called.set()  # whoever came between the look and this is seen by another look

    def _leave(self) -> None:
        """Unregister this listener at the master."""
        with suppress(*NO_ANSWER):
            topics = [topic for topic in self._part_of if topic.endswith(WATCHED)]
            self._ask_all("unregisterSubscriber", [(topic, self._uri) for topic in topics])

    def _ask_all(self, method: str, arguments: Sequence[tuple[str, ...]]) -> None:
        """Have the master do the same with each of ``arguments``, in one request."""
        calls = xmlrpc.client.MultiCall(xmlrpc.client.ServerProxy(rosgraph.get_master_uri(), Hasty()))
        for each in arguments:
            getattr(calls, method)(self._me + WATCHER, *each)
        calls()


class _Listener(XmlRpcHandler):  # type: ignore[misc]
    """XML-RPC server of a listener: the master reports publishers to it, and nodes ask whether it is alive."""

    def __init__(self, called: threading.Event) -> None:
        self._called = called

    def publisherUpdate(self, caller_id: str, topic: str, publishers: Any) -> tuple[int, str, int]:  # noqa: N802
        """The master's call: ``publishers`` of ``topic`` changed."""
        self._called.set()
        return 1, "", 0

    def getPid(self, caller_id: str) -> tuple[int, str, int]:  # noqa: N802
        """The process id, by which others see that the node is alive."""
        return 1, "", os.getpid()
