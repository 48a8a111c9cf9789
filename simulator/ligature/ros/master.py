"""Notices a restarted ROS master and registers everything again, keeping open connections."""

from __future__ import annotations

import xmlrpc.client

import rospy
from rospy.impl.registration import Registration, get_topic_manager

PERIOD = 1.0


class MasterWatch:
    """Looks at the master once a second."""

    def __init__(self) -> None:
        self._pid = self._ask()
        self._next = 0.0

    def check(self, now: float) -> None:
        """Register again when the master is another process than before."""
        if now < self._next:
            return
        self._next = now + PERIOD
        pid = self._ask()
        if pid is None or pid == self._pid:
            return
        self._pid = pid
        rospy.logwarn("the ROS master was restarted; registering again")
        register_again()

    @staticmethod
    def _ask() -> int | None:
        try:
            code, _, pid = rospy.get_master().getPid()
        except (OSError, xmlrpc.client.Error):
            return None
        return int(pid) if code == 1 else None


def register_again() -> None:
    """Tell the master about every publication and subscription of this node."""
    manager = get_topic_manager()
    master, uri = rospy.get_master(), rospy.get_node_uri()
    for name, type_ in manager.get_publications():
        master.registerPublisher(name, type_, uri)
    for name, type_ in manager.get_subscriptions():
        code, _, publishers = master.registerSubscriber(name, type_, uri)
        if code == 1:
            subscriber = manager.get_subscriber_impl(name)
            for publisher in publishers:
                if subscriber is not None and publisher != uri:
                    rospy.impl.registration.get_registration_listeners().notify_added(name, publisher, Registration.SUB)
