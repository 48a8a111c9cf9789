"""Messages of packages that need not be installed: what is heard brings its own definition along.

A publisher reports the definition of its messages when a subscriber connects, so readings of any driver's generation
are understood. To send a message its package must be there; it is imported when the device is asked for.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import rospy

from ligature import definitions


class MissingPackage(RuntimeError):
    """The package of a message type is not installed; the message names it."""


def message_class(type_: str, what: str) -> Any:
    """The class of ``package/Name``; raises `MissingPackage`, which names ``what`` needs it."""
    package, _, name = type_.partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as error:
        raise MissingPackage(
            f"{what} needs messages {type_}: install the ROS package '{package}' and source its workspace ({error})"
        ) from error


class Listener:
    """Hears a topic whatever its type; ``take`` gets messages, and the name of the node that sent each."""

    def __init__(self, topic: str, take: Callable[[Any, str], None]) -> None:
        self._take, self._topic = take, topic
        self._classes: dict[str, Any] = {}
        self._subscriber = rospy.Subscriber(topic, rospy.AnyMsg, self._decode, queue_size=10, tcp_nodelay=True)

    def _decode(self, raw: Any) -> None:
        header = raw._connection_header
        cls = self._class_of(header["md5sum"], header["type"], header.get("message_definition", ""))
        if cls is None:
            return
        message = cls()
        message.deserialize(raw._buff)
        try:
            self._take(message, header["callerid"])
        except AttributeError as error:
            sender = header["callerid"]
            rospy.logerr_throttle_identical(
                10.0, f"{self._topic}: {sender} sends {header['type']}, which cannot be decoded: {error}"
            )

    def _class_of(self, md5: str, type_: str, definition: str) -> Any:
        if md5 not in self._classes:
            try:
                self._classes[md5] = definitions.message_class(type_, md5, definition)
            except definitions.DefinitionError as error:
                self._classes[md5] = None
                rospy.logerr(f"{self._topic}: {error}")
        return self._classes[md5]

    def close(self) -> None:
        """Listen no more."""
        self._subscriber.unregister()


def pose_numbers(message: Any) -> list[float]:
    """Seven numbers of a PoseStamped, a TransformStamped (older systems), a Pose or a Transform."""
    inner = getattr(message, "pose", None) or getattr(message, "transform", None) or message
    p = getattr(inner, "position", None) or inner.translation
    q = getattr(inner, "orientation", None) or inner.rotation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
