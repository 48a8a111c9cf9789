"""A joint trajectory recorded in a bag and replayed step by step gives the same bits, whatever came before."""

from __future__ import annotations

import hashlib
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.ros.conftest import BIN, SMALL, Listener

pytestmark = pytest.mark.ros

WORLD = "/ambf/env/World"
NEEDLE = "/ambf/env/phantom/Needle"
UPDATES = 5
"""Updates of the simulation from one recorded set-point to the next."""

DELIVERY = 0.05
"""Seconds that a message may take to reach the physics: far more than it does."""


class Late(Exception):
    """A command reached the physics after the clock edge that should have carried it out: replay again."""


class Replayer:
    """Steps a simulator by the edges of its clock and sends PSM1 where a bag states."""

    def __init__(self, node: Any) -> None:
        from ambf_msgs.msg import RigidBodyState, WorldCmd, WorldState
        from std_msgs.msg import Empty

        from tests.ros.crtk import Psm

        self._world_command, self._empty = WorldCmd, Empty
        self._world = Listener(node, f"{WORLD}/State", WorldState)
        self._needle = Listener(node, f"{NEEDLE}/State", RigidBodyState)
        self._command = node.Publisher(f"{WORLD}/Command", WorldCmd, queue_size=10, tcp_nodelay=True)
        self._reset = node.Publisher(f"{WORLD}/Command/Reset", Empty, queue_size=10, tcp_nodelay=True)
        self.psm = Psm(node, "PSM1")
        self.psm.check_connections(10.0)
        self._clock = False

    def close(self) -> None:
        self.psm.close()
        for end in (self._world._subscriber, self._needle._subscriber, self._command, self._reset):
            end.unregister()

    def _edge(self, steps: int = UPDATES) -> None:
        self._clock = not self._clock
        self._command.publish(
            self._world_command(enable_step_throttling=True, step_clock=self._clock, n_skip_steps=steps)
        )

    def _run(self) -> None:
        """One edge, and the updates that it allows."""
        goal = self._world.messages[-1].sim_step + UPDATES
        self._edge()
        self._world.wait(lambda message: message.sim_step >= goal)
        time.sleep(DELIVERY)

    def replay(self, trajectory: np.ndarray) -> str:
        """Hash of what the arm and the needle do along ``trajectory`` (m, 6), from the start of the scene."""
        self._edge()
        time.sleep(0.3)
        self._reset.publish(self._empty())
        time.sleep(0.1)
        self._run()
        digest = hashlib.sha256()
        for q in trajectory:
            self.psm.servo_jp(q)
            time.sleep(DELIVERY)
            self._run()
            if np.abs(self.psm.setpoint_jp() - q).max() > 0.0:
                raise Late
            position, velocity, _ = self.psm.measured_js()
            pose = self._needle.messages[-1].pose
            needle = (pose.position.x, pose.position.y, pose.position.z, pose.orientation.x, pose.orientation.w)
            digest.update(position.tobytes() + velocity.tobytes() + struct.pack("5d", *needle))
        self._command.publish(self._world_command(enable_step_throttling=False))
        return digest.hexdigest()

    def surely(self, trajectory: np.ndarray) -> str:
        """`replay`, again where the machine was too busy to deliver a command in time."""
        for _ in range(3):
            try:
                return self.replay(trajectory)
            except Late:
                continue
        raise AssertionError("commands were late three times")


def record(psm: Any, node: Any, path: Path) -> None:
    """A bag of the set-points of a move."""
    import rosbag
    from sensor_msgs.msg import JointState

    assert psm.enable(5.0)
    assert psm.home(10.0)
    listener = Listener(node, psm.topic("setpoint_js"), JointState)
    motion = psm.move_jp(psm.setpoint_jp() + [0.3, -0.2, 0.02, 0.5, 0.3, -0.3])
    assert motion.wait()
    listener._subscriber.unregister()
    with rosbag.Bag(str(path), "w") as bag:
        for message in listener.messages:
            bag.write(psm.topic("servo_jp"), message, message.header.stamp)


def trajectory_of(path: Path, samples: int) -> np.ndarray:
    """Some set-points (samples, 6) of a bag, evenly spread."""
    import rosbag

    with rosbag.Bag(str(path)) as bag:
        positions = [message.position for _, message, _ in bag.read_messages("/PSM1/servo_jp")]
    return np.array(positions)[np.linspace(0, len(positions) - 1, samples).astype(int)]


def test_a_recorded_trajectory_replayed_step_by_step_gives_equal_hashes(
    start: Callable[..., Any], node: Any, tmp_path: Path
) -> None:
    bag, hashes = tmp_path / "move.bag", []
    for _ in range(2):
        program = start(BIN / "ligature", "run", SMALL, "-p", "500", "--no-cameras")
        program.wait_for("first state published")
        replayer = Replayer(node)
        if not bag.exists():
            record(replayer.psm, node, bag)
        else:
            assert replayer.psm.enable(5.0)
            assert replayer.psm.home(10.0)
        path = trajectory_of(bag, 20)
        assert np.abs(np.diff(path, axis=0)).max() > 1e-3, "the recording does not move"
        hashes.append(replayer.surely(path))
        replayer.close()
        program.end()
    assert hashes[0] == hashes[1]
