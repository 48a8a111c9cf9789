"""Starts a node that many clients connect to at the same moment, whatever some of them do.

rospy's queue holds five connections. A recorder of all topics, or a surgeon's console, opens a hundred at once; the
kernel drops those beyond the queue, and they are retried after 1, 3, 7, 15 seconds: topics seem silent meanwhile.
"""

from __future__ import annotations

import ipaddress
import os
import resource
from urllib.parse import urlparse

import rospy
import rospy.impl.tcpros_base as tcpros
from rosgraph.xmlrpc import ThreadingXMLRPCServer

from ligature.ros.connections import give_up_publishers
from ligature.ros.handshakes import apart
from ligature.ros.hosts import is_here, places
from ligature.ros.intake import bound_messages
from ligature.ros.registrations import claim

WAITING = 512
"""Connections that may wait; the kernel's own limit is in /proc/sys/net/core/somaxconn."""

MOST_FILES = 65536
"""Files and connections that a node may have open."""


def start_node(name: str, several: bool = False) -> None:
    """Make this process the node ``name``, which takes `WAITING` connections at once and no message of any length.

    With ``several`` its name gets an ending of its own, so that many may run side by side. The name is in no namespace.
    Signals stay the caller's. Its time is the wall clock whatever ``/use_sim_time`` is, for states are stamped by it.
    Raises `ligature.ros.registrations.NameTaken`.
    """
    _allow_files()
    rospy.names._set_caller_id("/unnamed")  # a namespace of ROS_NAMESPACE would hide this node from `claim` of others
    removed = "" if several else claim(f"/{name}")
    ThreadingXMLRPCServer.request_queue_size = WAITING
    bound_messages()
    give_up_publishers()
    rospy.init_node(name, anonymous=several, disable_signals=True, disable_rostime=True)
    namespace = os.environ.get("ROS_NAMESPACE", "").strip("/")
    if namespace and not several:
        rospy.logwarn(f"ROS_NAMESPACE '{namespace}' has no effect: topics are those of AMBF; --ns gives them a prefix")
    if removed:
        rospy.logwarn(removed)
    tcpros.start_tcpros_server()
    server = tcpros._tcpros_server.tcp_ros_server
    server.inbound_handler = apart(server.inbound_handler)
    server.server_sock.listen(WAITING)


def _allow_files() -> None:
    """Open as many files as the system lets this process: a scene of two arms has 400 topics, of one file each.

    A recorder of all opens as many connections, and most shells allow 1024 files unless asked.
    """
    soft, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MOST_FILES if most == resource.RLIM_INFINITY else min(MOST_FILES, most)
    if soft not in (resource.RLIM_INFINITY, wanted) and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


def address_problem(uri: str, master: str) -> str:
    """Why programs elsewhere may not reach the node at ``uri`` of the ``master`` at another; empty where they may."""
    host, other = (urlparse(address).hostname or "" for address in (uri, master))
    found = places(host)
    alone = all(ipaddress.ip_address(place[0]).is_loopback for _, place in found)
    if not found:
        why = "is unknown to this machine"
    elif not any(map(is_here, found)):
        why = "is not an address of this machine"
    elif alone and not any(map(is_here, places(other))):
        why = f"is known on this machine alone, but the ROS master is on {other}"
    else:
        return ""
    return (
        f"programs look for the topics at '{host}', which {why}: those that cannot reach it get no messages; "
        "set ROS_IP to the address of this machine"
    )
