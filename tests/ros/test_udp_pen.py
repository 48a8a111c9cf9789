"""The example that makes a haptic pen of a driver by UDP: what is sent arrives, and forces come back."""

from __future__ import annotations

import socket
import struct
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.conftest import ROOT
from tests.waiting import until

pytestmark = pytest.mark.ros


def test_readings_and_forces_pass(start: Callable[..., Any], node: Any) -> None:
    from geometry_msgs.msg import PoseStamped, Wrench

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    start(sys.executable, ROOT / "examples" / "teleop" / "udp_pen.py", "--port", str(port), "--topic", "/udp/")
    poses: list[Any] = []
    buttons: list[Any] = []
    heard = [
        node.Subscriber("/udp/pose", PoseStamped, poses.append),
        node.Subscriber("/udp/button", node.AnyMsg, buttons.append),
    ]
    force = node.Publisher("/udp/force_feedback", Wrench, queue_size=1)
    rng = np.random.default_rng(0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as driver:
        driver.settimeout(0.05)
        driver.bind(("127.0.0.1", 0))

        def send(values: Any, *pressed: int) -> None:
            driver.sendto(struct.pack("<7d2B", *values, *pressed), ("127.0.0.1", port))

        def arrives(values: Any, *pressed: int) -> bool:
            send(values, *pressed)
            return bool(poses)

        first = [0.0, 0, 0, 0, 0, 0, 1]
        until(lambda: arrives(first, 0, 0) and heard[1].get_num_connections() > 0, every=0.05)
        for _ in range(5):
            wanted = rng.normal(size=7)
            send(wanted, 1, 0)
            until(lambda wanted=wanted: numbers(poses[-1]) == wanted.tolist())
        assert struct.unpack("<2i", buttons[-1]._buff[-8:]) == (1, 0)
        before = len(poses)
        for odd in (b"", b"x" * 57, b"x" * 59, struct.pack("<7d2B", *first[:6], float("nan"), 0, 0)):
            driver.sendto(odd, ("127.0.0.1", port))
        send([9.0] * 7, 0, 1)
        until(lambda: numbers(poses[-1]) == [9.0] * 7)
        assert len(poses) == before + 1, "what is no reading is left out, and ends nothing"
        until(lambda: force.get_num_connections() > 0)
        wrench = Wrench()
        wrench.force.x, wrench.force.y, wrench.force.z = 1.5, -0.25, 0.125

        def felt() -> bool:
            force.publish(wrench)
            try:
                return driver.recv(100) == struct.pack("<3d", 1.5, -0.25, 0.125)
            except TimeoutError:
                return False

        until(felt)
    for one in (*heard, force):
        one.unregister()


def numbers(message: Any) -> list[float]:
    p, q = message.pose.position, message.pose.orientation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
