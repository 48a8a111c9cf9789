"""The state of the topics of a running system: publishers, subscribers, rates.

Rates are measured by subscribing to one topic at a time for a moment, so that the measurement itself costs little.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import rosgraph
import rospy

from ligature.ros.master import NO_ANSWER

LISTENING = 1.0
"""Seconds for which the rate of a topic is measured."""

HEAVY = ("sensor_msgs/Image", "sensor_msgs/CompressedImage", "sensor_msgs/PointCloud2")
"""Types without subscription: pictures and clouds are only rendered for other subscribers."""

QUIET = ("/rosout", "/rosout_agg", "/tf_static")

MOST = 60
"""Most topics that are measured in turn."""


@dataclass(frozen=True)
class Topic:
    """A topic; ``rate`` in Hz, None while it was not measured yet or is not to be."""

    name: str
    type: str
    publishers: int
    subscribers: int
    rate: float | None = None


class TopicHealth(threading.Thread):
    """Measures topics with subscribers, one after the other; ``also`` runs with every measurement."""

    def __init__(self, also: Callable[[], None] = lambda: None) -> None:
        super().__init__(name="topic health", daemon=True)
        self._also = also
        self._rates: dict[str, float] = {}
        self._topics: tuple[Topic, ...] = ()
        self._count = 0
        self.answers = True

    @property
    def topics(self) -> tuple[Topic, ...]:
        """Topics with subscribers other than this node, by name."""
        return self._topics

    @property
    def published(self) -> int:
        """How many topics are published at all."""
        return self._count

    def run(self) -> None:
        """Measure until the node ends."""
        while not rospy.is_shutdown():
            self.look()
            measured = [t for t in self._topics if t.type not in HEAVY and t.publishers][:MOST]
            for topic in measured:
                if rospy.is_shutdown():
                    return
                self._rates[topic.name] = rate_of(topic.name, LISTENING)
                self.look()
            if not measured:
                time.sleep(LISTENING)

    def look(self) -> None:
        """Ask the master who publishes and who listens."""
        me = rospy.get_name()
        try:
            master = rosgraph.Master(me)
            published, subscribed, _ = master.getSystemState()
            types = dict(master.getTopicTypes())
            self._also()
        except NO_ANSWER:
            self.answers = False
            return
        self.answers = True
        publishers = {name: len([node for node in nodes if node != me]) for name, nodes in published}
        self._count = sum(count > 0 for count in publishers.values())
        found = []
        for name, nodes in sorted(subscribed):
            listeners = len([node for node in nodes if node != me])
            if listeners and publishers.get(name, 0) and name not in QUIET:
                found.append(Topic(name, types.get(name, "?"), publishers[name], listeners, self._rates.get(name)))
        self._topics = tuple(found)


def rate_of(name: str, seconds: float) -> float:
    """Messages a second on a topic, listened to for ``seconds``; the first one only starts the clock."""
    arrivals: list[float] = []
    subscriber = rospy.Subscriber(name, rospy.AnyMsg, lambda _: arrivals.append(time.monotonic()), queue_size=100)
    time.sleep(seconds)
    subscriber.unregister()
    if len(arrivals) < 2:
        return len(arrivals) / seconds
    return (len(arrivals) - 1) / (arrivals[-1] - arrivals[0])
