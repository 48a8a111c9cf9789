"""Starts a node that many clients connect to at the same moment, whatever some of them do.

rospy's queue holds five connections. A recorder of all topics, or a surgeon's console, opens a hundred at once; the
kernel drops those beyond the queue, and they are retried after 1, 3, 7, 15 seconds: topics seem silent meanwhile.
"""

from __future__ import annotations

import rospy
import rospy.impl.tcpros_base as tcpros
from rosgraph.xmlrpc import ThreadingXMLRPCServer

from ligature.ros.connections import give_up_publishers
from ligature.ros.handshakes import apart
from ligature.ros.intake import bound_messages
from ligature.ros.registrations import claim

WAITING = 512
"""Connections that may wait; the kernel's own limit is in /proc/sys/net/core/somaxconn."""


def start_node(name: str, several: bool = False) -> None:
    """Make this process the node ``name``, which takes `WAITING` connections at once and no message of any length.

    With ``several`` its name gets an ending of its own, so that many may run side by side. Signals stay the caller's.
    Raises `ligature.ros.registrations.NameTaken`.
    """
    removed = "" if several else claim(f"/{name}")
    ThreadingXMLRPCServer.request_queue_size = WAITING
    bound_messages()
    give_up_publishers()
    rospy.init_node(name, anonymous=several, disable_signals=True)
    if removed:
        rospy.logwarn(removed)
    tcpros.start_tcpros_server()
    server = tcpros._tcpros_server.tcp_ros_server
    server.inbound_handler = apart(server.inbound_handler)
    server.server_sock.listen(WAITING)
