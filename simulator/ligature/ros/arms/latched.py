"""Latched topics that can stop publishing while others of this process continue."""

from __future__ import annotations

from typing import Any

import rospy

QUEUE = 100


class Latched:
    """A topic whose newest message everybody gets who comes later; after `close` it publishes nothing.

    A ``silent`` one is not even advertised.
    """

    def __init__(self, topic: str, type_: type, silent: bool = False) -> None:
        self._publisher = None if silent else rospy.Publisher(topic, type_, latch=True, queue_size=QUEUE)
        self._closed = silent

    def publish(self, *content: Any) -> None:
        """Publish a message, or what one is made of."""
        if self._publisher is not None and not self._closed:
            try:
                self._publisher.publish(*content)
            except rospy.ROSException:  # closed meanwhile by another thread
                if not self._closed:
                    raise

    def close(self) -> None:
        """Publish no more; the master forgets the topic."""
        self._closed = True
        if self._publisher is not None:
            self._publisher.unregister()
