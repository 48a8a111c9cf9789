"""Removes registrations of killed nodes from a ROS master, which keeps them.

A name is free if its node does not answer. The node's registrations are removed before another node takes the name:
otherwise the master would shut down the program that has the old address now, and would not notify clients of topics
that no longer exist.
"""

from __future__ import annotations

import xmlrpc.client
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import rosgraph

from ligature.ros.master import NO_ANSWER, WATCHER, Hasty

CALLER = "/ligature_look"
COMMON = frozenset({"/rosout", "/rosout_agg", "/tf", "/tf_static", "/diagnostics"})
"""Topics that many nodes publish or listen to."""


class NameTaken(RuntimeError):
    """Another simulator of the same world runs on this master; the message lists what to do."""


@dataclass(frozen=True)
class Registrations:
    """What a master holds of ``node``: its address, topics by their names, services with their addresses."""

    node: str
    uri: str
    published: tuple[str, ...]
    subscribed: tuple[str, ...]
    services: tuple[str, ...]

    @property
    def count(self) -> int:
        """Number of topics and services; a topic that is both published and subscribed counts twice."""
        return len(self.published) + len(self.subscribed) + len(self.services)

    @property
    def answers(self) -> bool:
        """Whether the node lives; what answers at its address may be another one, which has none of its topics."""
        node = xmlrpc.client.ServerProxy(self.uri, Hasty())
        try:
            code, _, _ = node.getPid(CALLER)  # type: ignore[misc]
        except (*NO_ANSWER, ValueError):
            return False
        topics = {*self.published, *self.subscribed} - COMMON
        if code != 1 or not topics:
            return bool(code == 1)
        try:
            (_, _, published), (_, _, subscribed) = node.getPublications(CALLER), node.getSubscriptions(CALLER)  # type: ignore[misc]
            return not topics.isdisjoint(topic for topic, _ in (*published, *subscribed))  # type: ignore[misc]
        except (*NO_ANSWER, ValueError, TypeError):
            return True  # not every node can list its topics

    def remove(self) -> None:
        """Have the master forget all of it; raises one of `NO_ANSWER`."""
        master = xmlrpc.client.ServerProxy(rosgraph.get_master_uri(), Hasty())
        calls = xmlrpc.client.MultiCall(master)
        for topic in self.published:
            calls.unregisterPublisher(self.node, topic, self.uri)
        for topic in self.subscribed:
            calls.unregisterSubscriber(self.node, topic, self.uri)
        for service in self.services:
            code, _, address = master.lookupService(CALLER, service)  # type: ignore[misc]
            if code == 1:
                calls.unregisterService(self.node, service, address)
        calls()


def registrations(names: Iterable[str]) -> list[Registrations]:
    """What the master holds of the nodes of these names, those that it knows; raises one of `NO_ANSWER`."""
    master = rosgraph.Master(CALLER)
    kinds = master.getSystemState()
    found = []
    for name in names:
        held = [tuple(what for what, nodes in kind if name in nodes) for kind in kinds]
        if any(held):
            found.append(Registrations(name, master.lookupNode(name), *held))
    return found


def lives(node: str) -> bool:
    """Whether the node of this name answers; one that was killed is still known to the master."""
    try:
        return any(held.answers for held in registrations([node]))
    except NO_ANSWER:
        return False


def claim(name: str) -> str:
    """Take the name of a node; returns what was removed of a killed one that had it, nothing where there was none.

    Raises `NameTaken` when a living node has the name: ROS would let the two end each other in turns.
    """
    removed = 0
    try:
        for held in registrations([name, name + WATCHER]):
            if held.answers:
                raise NameTaken(
                    f"another simulator runs on this ROS master (node {name} at {held.uri}); end it, give this one a"
                    " prefix with '--ns', or set ROS_MASTER_URI to another master"
                )
            held.remove()
            removed += held.count
    except NO_ANSWER:
        return ""
    if not removed:
        return ""
    return f"node {name} was killed; its entries at the ROS master ({removed} topics and services) were removed"


def dead_neighbours(me: str, topics: Sequence[str]) -> list[str]:
    """A line for each node but ``me`` that is registered for some of ``topics`` and does not answer.

    Raises one of `NO_ANSWER`.
    """
    ours = set(topics) - COMMON
    published, subscribed, _ = rosgraph.Master(CALLER).getSystemState()
    shared: dict[str, list[str]] = {}
    for topic, nodes in (*published, *subscribed):
        for node in nodes if topic in ours else ():
            shared.setdefault(node, []).append(topic)
    shared.pop(me, None)
    return [
        f"node {held.node} does not answer, but the ROS master still has it for {len(shared[held.node])} topics of this"
        f" run, such as {shared[held.node][0]}; 'rosnode cleanup' removes it"
        for held in registrations(sorted(shared))
        if not held.answers
    ]
