"""Makes a haptic pen of a driver that knows no ROS: readings come and forces go by UDP.

The driver sends, as often as it reads its device, 58 bytes: x y z in metres (right, up, near), the quaternion x y z w,
both as little-endian doubles, and two bytes, 1 while the grey and the white button are down. To the address from which
the last reading came it gets 24 bytes for each force: x y z in newtons, in the same axes. A program of OpenHaptics
sends what HD_CURRENT_TRANSFORM states, in metres, and sets HD_CURRENT_FORCE::

    python examples/teleop/udp_pen.py --port 5005 --topic /pen/      # first shell, after `. ./env.sh`
    ligature teleop --device touch=/pen/                             # second shell

The topics are those of OpenHaptics' drivers for ROS: ``pose``, ``button`` and ``force_feedback`` below ``--topic``. A
driver that stops to send releases the arm, as one that stops to publish does.
"""

from __future__ import annotations

import argparse
import math
import socket
import struct

import genpy.dynamic
import rospy
from geometry_msgs.msg import PoseStamped, Wrench

READING, FORCE = struct.Struct("<7d2B"), struct.Struct("<3d")
BUTTON = genpy.dynamic.generate_dynamic("omni_msgs/OmniButtonEvent", "int32 grey_button\nint32 white_button\n")[
    "omni_msgs/OmniButtonEvent"
]


class Bridge:
    """Passes on the readings that come to ``host`` and ``port``, and forces to where the last one came from."""

    def __init__(self, host: str, port: int, topic: str) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((host, port))
        self._socket.settimeout(0.5)
        self._driver: tuple[str, int] | None = None
        self._pressed: tuple[int, int] | None = None
        self._pose = rospy.Publisher(f"{topic}pose", PoseStamped, queue_size=1, tcp_nodelay=True)
        self._button = rospy.Publisher(f"{topic}button", BUTTON, queue_size=10, latch=True)
        rospy.Subscriber(f"{topic}force_feedback", Wrench, self._press, queue_size=1, tcp_nodelay=True)

    def run(self) -> None:
        """Pass on until ROS shuts down."""
        while not rospy.is_shutdown():
            try:
                data, sender = self._socket.recvfrom(READING.size + 1)
            except TimeoutError:
                continue
            if len(data) != READING.size:
                rospy.logwarn_throttle(5.0, f"a reading has {READING.size} bytes, not {len(data)}: it is left out")
                continue
            *values, grey, white = READING.unpack(data)
            if all(map(math.isfinite, values)):
                self._driver = sender
                self._send(values, (grey, white))
            else:
                rospy.logwarn_throttle(5.0, "a reading has numbers that are not finite: it is left out")
        self._socket.close()

    def _send(self, values: list[float], pressed: tuple[int, int]) -> None:
        message = PoseStamped()
        message.header.stamp = rospy.Time.now()
        p, q = message.pose.position, message.pose.orientation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = values
        self._pose.publish(message)
        if pressed != self._pressed:
            self._pressed = pressed
            self._button.publish(BUTTON(*pressed))

    def _press(self, wrench: Wrench) -> None:
        if self._driver is not None:
            force = wrench.force
            self._socket.sendto(FORCE.pack(force.x, force.y, force.z), self._driver)


def main() -> None:
    """Read the options and pass on."""
    options = argparse.ArgumentParser(description="A haptic pen by UDP")
    options.add_argument(
        "--host", default="127.0.0.1", help="address to listen on; 0.0.0.0 for other machines' drivers"
    )
    options.add_argument("--port", type=int, default=5005)
    options.add_argument("--topic", default="/pen/", help="beginning of the topics, with a slash at its end")
    chosen = options.parse_args(rospy.myargv()[1:])
    rospy.init_node("udp_pen", anonymous=True)
    Bridge(chosen.host, chosen.port, chosen.topic).run()


if __name__ == "__main__":
    main()
