"""Point clouds of clients, which cameras draw: ``sensor_msgs/PointCloud`` on the topics of a parameter, as with AMBF.

``World/point_cloud_topics`` lists the topics; ``<topic>/radius`` sets the size of the points in pixels. The frame of a
cloud is the body with the identifier ``header.frame_id``, the world where that is empty (as in AMBF).
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud
from std_msgs.msg import Float32

from ligature.model.clouds import LARGEST, Cloud
from ligature.model.frames import pose7_matrix
from ligature.model.scene import Scene
from ligature.process import REPEAT
from ligature.ros.intake import allow_bytes
from ligature.ros.parameters import Server, look_up

PARAMETER = "point_cloud_topics"
MOST_TOPICS = 32
MOST_BYTES = 8 << 20
"""Most bytes of a cloud: some 600 000 points."""

DEFAULT_SIZE = 4
"""Size of a point in pixels until a client sets another."""

WHITE = 255


class Clouds:
    """The newest cloud of each topic; messages and parameters come in on other threads than `shown` is called on."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._lock = threading.Lock()
        self._subscribers: dict[str, list[Any]] = {}
        self._points: dict[str, tuple[int, NDArray[np.float64], NDArray[np.uint8]]] = {}
        self._sizes: dict[str, int] = {}
        self._server = Server()

    def poll(self) -> None:
        """Follow the list of topics, every two seconds."""
        tree = self._server.read()
        if tree is None:
            return
        found = look_up(tree, f"{self._scene.world.topic}/{PARAMETER}")
        wanted = [t for t in found if isinstance(t, str) and t][:MOST_TOPICS] if isinstance(found, list) else []
        for topic in set(self._subscribers) - set(wanted):
            for subscriber in self._subscribers.pop(topic):
                subscriber.unregister()
            with self._lock:
                self._points.pop(topic, None)
                self._sizes.pop(topic, None)
        for topic in wanted:
            if topic not in self._subscribers:
                self._subscribers[topic] = self._subscribe(topic)

    def _subscribe(self, topic: str) -> list[Any]:
        allow_bytes(rospy.resolve_name(topic), MOST_BYTES)
        return [
            rospy.Subscriber(topic, PointCloud, self._guarded(topic, self._take), queue_size=1),
            rospy.Subscriber(f"{topic}/radius", Float32, self._guarded(topic, self._resize), queue_size=1),
        ]

    def _guarded(self, topic: str, take: Callable[[str, Any], None]) -> Callable[[Any], None]:
        def receive(message: Any) -> None:
            try:
                take(topic, message)
            except ValueError as error:
                rospy.logwarn_throttle(REPEAT, f"{topic}: {error}")

        return receive

    def _take(self, topic: str, message: PointCloud) -> None:
        points = np.array([(p.x, p.y, p.z) for p in message.points], dtype=float).reshape(-1, 3)
        if not np.isfinite(points).all():
            raise ValueError("the cloud has coordinates that are not finite")
        body = -1
        if message.header.frame_id:
            body = self._scene.body_index.get(message.header.frame_id, -1)
            if body < 0:
                raise ValueError(
                    f"'{message.header.frame_id[:80]}' is not the identifier of a body; "
                    "write one, or leave 'frame_id' empty for world axes"
                )
        with self._lock:
            self._points[topic] = body, points, _colours(message, len(points))

    def _resize(self, topic: str, message: Float32) -> None:
        if not 1.0 <= message.data <= LARGEST:
            raise ValueError(f"the size of points is {message.data:g} pixels; it must be 1 to {LARGEST}")
        with self._lock:
            self._sizes[topic] = round(message.data)

    def shown(self, poses: NDArray[np.float64]) -> list[Cloud]:
        """All clouds with the bodies at ``poses`` (b, 7)."""
        with self._lock:
            found = [(*cloud, self._sizes.get(topic, DEFAULT_SIZE)) for topic, cloud in self._points.items()]
        clouds = []
        for body, points, colours, size in found:
            T = np.eye(4) if body < 0 else pose7_matrix(poses[body])
            clouds.append(Cloud(points @ T[:3, :3].T + T[:3, 3], colours, size))
        return clouds


def _colours(message: PointCloud, n: int) -> NDArray[np.uint8]:
    """Colours (n, 3) of the channel ``rgb``, packed as usual in ROS; white without it."""
    for channel in message.channels:
        if channel.name == "rgb" and len(channel.values) == n:
            packed = np.array(channel.values, dtype=np.float32).view(np.uint32)
            return np.column_stack([packed >> 16 & 255, packed >> 8 & 255, packed & 255]).astype(np.uint8)
    return np.full((n, 3), WHITE, dtype=np.uint8)
