"""The ROS master: names of running simulators, and whether the master still has this node.

A thread of its own watches the master, so that a master that hangs or restarts does not delay publishing.
`ligature.client` uses this module too, so it imports nothing of the simulator.
"""

from __future__ import annotations

import http.client
import re
import threading
import xmlrpc.client
from collections.abc import Callable
from typing import Any

import rosgraph
import rospy
from rospy.impl.registration import Registration, get_registration_listeners, get_service_manager, get_topic_manager

DEFAULT_WORLD = "/ambf/env/World"
PERIOD = 1.0
"""Seconds between checks of the master."""

NO_ANSWER = (OSError, http.client.HTTPException, xmlrpc.client.Error, rosgraph.MasterException)
TIMEOUT = 2.0
"""Seconds that a master or another node is given to answer."""


def node_name(world: str) -> str:
    """The node's name: one for each world, so that simulators of different worlds live side by side."""
    return "ligature" if world == DEFAULT_WORLD else "ligature" + re.sub(r"\W+", "_", world.rpartition("/")[0])


_SIMULATORS = re.compile(r"/(ligature|ambf)(?!.*_\d+_\d+\Z)")
"""Nodes of simulators, ours and AMBF's; those of programs beside them have names that end in process and time."""


WATCHER = "_rivals"
"""How names of nodes end that listen to topics only to know who publishes them (`ligature.ros.arms.rivals`)."""


def commanded_topics() -> set[str]:
    """Topics that a simulator on this master listens to; raises one of `NO_ANSWER`."""
    _, subscribers, _ = rosgraph.Master("/ligature_look").getSystemState()
    return {topic for topic, nodes in subscribers if any(map(is_simulator, nodes))}


def takes_time_from_clock() -> bool:
    """Whether programs on this master wait for messages on ``/clock``; raises one of `NO_ANSWER`."""
    master = rosgraph.Master("/ligature_look")
    return master.hasParam("/use_sim_time") and master.getParam("/use_sim_time") is True


def is_simulator(node: str) -> bool:
    """Whether a node of this name is a simulator, and not a program beside it or what only watches for rivals."""
    return _SIMULATORS.match(node) is not None and not node.endswith(WATCHER)


class Hasty(xmlrpc.client.Transport):
    """A transport that gives up after `TIMEOUT`."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """A connection with a time limit."""
        connection = super().make_connection(host)
        connection.timeout = TIMEOUT
        return connection


class MasterWatch(threading.Thread):
    """Registers everything again with a master that has forgotten this node; ``also`` runs at every look."""

    def __init__(self, also: Callable[[], None] = lambda: None) -> None:
        super().__init__(name="master watch", daemon=True)
        self._also = also
        self._answers = True

    def run(self) -> None:
        """Look once a second until the node ends."""
        while not rospy.core.is_shutdown_requested():
            rospy.rostime.wallsleep(PERIOD)
            try:
                self.look()
            except NO_ANSWER:
                if self._answers:
                    rospy.logwarn("the ROS master does not answer; existing connections continue")
                self._answers = False

    def look(self) -> None:
        """Look once; raises one of `NO_ANSWER` when the master does not answer."""
        code, _, _ = rospy.get_master().lookupNode(rospy.get_name())
        if code != 1 or not self._answers:
            register_again()
            rospy.logwarn("the ROS master answers again; all topics and services are registered again")
            self._answers = True
        self._also()


def register_again() -> None:
    """Register every publication, subscription and service of this node with the master; connections stay."""
    topics, listeners = get_topic_manager(), get_registration_listeners()
    for name, type_ in topics.get_publications():
        listeners.notify_added(name, type_, Registration.PUB)
    for name, type_ in topics.get_subscriptions():
        listeners.notify_added(name, type_, Registration.SUB)
    for name, address in get_service_manager().get_services():
        listeners.notify_added(name, address, Registration.SRV)
