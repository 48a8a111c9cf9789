"""A running teleoperation from afar: what its pairs report, what a console may ask (as in the dVRK)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import rosgraph
import rospy
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool, Float64, String

_PAIR = re.compile(r"/(?P<leader>[A-Za-z]\w*?)_(?P<follower>[A-Za-z][A-Za-z0-9]*)/align_mtm\Z")
"""Topics of a pair that the camera drive does not have."""

PEDALS = ("clutch", "camera")


@dataclass
class PairState:
    """What a pair reports of itself."""

    leader: str
    follower: str
    current_state: str = ""
    status: str = ""
    following: bool = False
    selected: bool = False

    @property
    def name(self) -> str:
        """As the topics have it."""
        return f"{self.leader}_{self.follower}"


class TeleopRemote:
    """Listens to the pairs below ``prefix`` (such as ``/``) once they are there, and speaks as the console does."""

    def __init__(self, prefix: str = "/") -> None:
        self._prefix = prefix
        self.pairs: dict[str, PairState] = {}
        self.scale = 0.0
        self._selected: dict[str, bool] = {}
        self._subscribers: list[Any] = []
        console = f"{prefix}console/"
        self._enable = rospy.Publisher(f"{console}teleop/enable", Bool, queue_size=5)
        self._select = rospy.Publisher(f"{console}teleop/select", String, queue_size=5)
        self._unselect = rospy.Publisher(f"{console}teleop/unselect", String, queue_size=5)
        self._set_scale = rospy.Publisher(f"{console}teleop/set_scale", Float64, queue_size=5)
        self._pedals = {name: rospy.Publisher(f"{console}emulate_{name}", Joy, queue_size=5) for name in PEDALS}
        self._listen(f"{console}teleop/selected", String, lambda m: self._choose(m.data, True))
        self._listen(f"{console}teleop/unselected", String, lambda m: self._choose(m.data, False))
        self._listen(f"{console}teleop/scale", Float64, lambda m: setattr(self, "scale", float(m.data)))

    def _listen(self, topic: str, type_: type, take: Any) -> None:
        self._subscribers.append(rospy.Subscriber(topic, type_, take, queue_size=10))

    def _choose(self, pair: str, selected: bool) -> None:
        self._selected[pair] = selected
        if pair in self.pairs:
            self.pairs[pair].selected = selected

    def find_pairs(self) -> None:
        """Ask the master for pairs that were missing before; raises `rosgraph.MasterException`, OSError."""
        for topic, type_ in rosgraph.Master(rospy.get_name()).getTopicTypes():
            match = _PAIR.match("/" + topic.removeprefix(self._prefix)) if type_ == "std_msgs/Bool" else None
            if match is None:
                continue
            pair = PairState(match["leader"], match["follower"])
            if pair.name in self.pairs:
                continue
            pair.selected = self._selected.get(pair.name, False)
            self.pairs[pair.name] = pair
            root = topic.rpartition("/")[0]
            for name, kind in (("current_state", String), ("status", String), ("following", Bool)):
                self._listen(f"{root}/{name}", kind, self._setter(pair, name))

    @staticmethod
    def _setter(pair: PairState, name: str) -> Any:
        return lambda message: setattr(pair, name, message.data)

    # --- what a console asks for ---------------------------------------------------------------

    def enable(self, on: bool) -> None:
        """Let selected pairs drive, or stop them all."""
        self._enable.publish(on)

    def select(self, pair: str) -> None:
        """Let the leader of ``pair`` drive its follower."""
        self._select.publish(pair)

    def unselect(self, pair: str) -> None:
        """Let the leader of ``pair`` drive its follower no more."""
        self._unselect.publish(pair)

    def set_scale(self, scale: float) -> None:
        """Follower metres for a leader metre."""
        self._set_scale.publish(scale)

    def press(self, pedal: str, down: bool) -> None:
        """Press or release the ``clutch`` or the ``camera`` pedal of the simulated console."""
        message = Joy(buttons=[int(down)])
        message.header.stamp = rospy.Time.now()
        self._pedals[pedal].publish(message)
