"""Topics of plug-ins: ``std_msgs/Float64MultiArray`` below ``/ligature/plugins/NAME/``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from std_msgs.msg import Float64MultiArray

from ligature.model.commands import PluginCommand
from ligature.model.plugins import topic_rows
from ligature.model.scene import Scene
from ligature.process import REPEAT
from ligature.ros.conversion import Record

QUEUE = 10


class PluginTemplate:
    """The message of one topic that a plug-in publishes, filled again for every publication."""

    kind = "plugin"

    def __init__(self, index: int, topic: str, rows: slice) -> None:
        self.index, self.topic, self._rows = index, topic, rows
        self.message = Float64MultiArray()

    def fill(self, state: Record, stamp: rospy.Time) -> Float64MultiArray:
        """The message of ``state`` (a record scalar)."""
        self.message.data = state["plugin_value"][self._rows].tolist()
        return self.message


def plugin_templates(scene: Scene) -> list[PluginTemplate]:
    """One for each topic that a plug-in of the scene publishes."""
    places = topic_rows([plugin.publishes for plugin in scene.plugins])
    named = [
        (f"{_root(scene)}{plugin.name}/{name}", place)
        for plugin, rows in zip(scene.plugins, places, strict=True)
        for name, place in rows.items()
    ]
    return [PluginTemplate(index, topic, place) for index, (topic, place) in enumerate(named)]


def subscribe_plugins(scene: Scene, push: Callable[[PluginCommand], None]) -> None:
    """Take messages for plug-ins and hand them to ``push``."""
    for number, plugin in enumerate(scene.plugins):
        for place, (name, size) in enumerate(plugin.subscribes.items()):
            topic = f"{_root(scene)}{plugin.name}/{name}"
            rospy.Subscriber(
                topic, Float64MultiArray, _taker(topic, number, place, size, push), queue_size=QUEUE, tcp_nodelay=True
            )


def _taker(
    topic: str, number: int, place: int, size: int, push: Callable[[PluginCommand], None]
) -> Callable[[Any], None]:
    def take(message: Any) -> None:
        try:
            if len(message.data) != size:
                raise ValueError(f"the message has {len(message.data)} numbers, not {size}")
            command = PluginCommand(number, place, tuple(message.data))
            command.check()
            push(command)
        except ValueError as error:
            rospy.logwarn_throttle(REPEAT, f"{topic}: {error}")

    return take


def _root(scene: Scene) -> str:
    return f"{scene.world.root}ligature/plugins/"
