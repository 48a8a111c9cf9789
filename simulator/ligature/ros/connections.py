"""Connections to publishers that cannot be made: tried again, and given up when nobody publishes any more.

rospy keeps a connection that it has given up, such as one to a publisher of the wrong type, among those of the topic.
It then counts as connected to that process: what the process publishes there later, of the right type, is never heard.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import rospy
import rospy.impl.tcpros_pubsub as pubsub
from rospy.impl.registration import Registration, get_topic_manager

RETRY_SECONDS = 1.0
"""Seconds between two tries; rospy's own double from 1 to 32."""

CONNECT_TIMEOUT = 60.0
"""Seconds in which a publisher answers, as in rospy."""


def give_up_publishers() -> None:
    """Have this process's subscribers connect by `connect`."""
    pubsub.robust_connect_subscriber = connect


def connect(connection: Any, address: str, port: int, publisher: str, receive: Callable[..., None], topic: str) -> None:
    """Connect a subscriber to ``publisher``, the address of a node, and receive; forget it when it cannot be.

    Runs in a thread of its own, which rospy starts.
    """
    reported = False
    while connection.socket is None and not connection.done and not rospy.is_shutdown():
        try:
            connection.connect(address, port, publisher, timeout=CONNECT_TIMEOUT)
        except rospy.exceptions.TransportInitError as error:
            if not reported:
                rospy.logwarn("'%s' of %s is not received: %s", topic, publisher, error)
                reported = True
            if connection.protocol is None:  # closed on purpose
                break
            time.sleep(RETRY_SECONDS)
            if not pubsub.check_if_still_publisher(topic, publisher):
                break
    if connection.socket is not None and not connection.done:
        connection.receive_loop(receive)
        return
    connection.done = True
    subscriber = get_topic_manager().get_impl(Registration.SUB, topic)
    if subscriber is not None:
        subscriber.remove_connection(connection)
