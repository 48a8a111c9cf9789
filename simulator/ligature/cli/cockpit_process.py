"""The cockpit process: serves the page of the newest state of the bus, and sends what its operator does."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import ligature
from ligature.bus import Block, BusError
from ligature.bus.stop import stop_on_signal
from ligature.cli.options import RunOptions
from ligature.cockpit.address import TOKEN_VARIABLE, AddressError, read_address
from ligature.cockpit.pictures import Pictures
from ligature.model.state import state_dtype
from ligature.process import end_with_parent, tell

if TYPE_CHECKING:
    from ligature.ros.health import TopicHealth
    from ligature.teleop.remote import TeleopRemote

PHYSICS_SILENCE = 5.0
"""Seconds without a sign of life of the physics process after which this one ends."""


def main() -> None:
    """Entry point: one argument, the run's options as text."""
    end_with_parent()
    stop = stop_on_signal()
    options = RunOptions.from_text(sys.argv[1])
    try:
        scene = options.load()
    except ligature.SceneError:
        sys.exit(0)
    pictures = Pictures(scene, options.bus)  # a fork: before any thread
    try:
        block = Block.attach(options.bus, state_dtype(scene), cancelled=stop.is_set)
    except BusError:
        sys.exit(0)
    from ligature.cockpit.cockpit import Cockpit

    try:
        address = read_address(options.cockpit)
        cockpit = Cockpit(
            scene, block, pictures, address, os.environ.get(TOKEN_VARIABLE, ""), lambda text: tell("warning", text),
            _on_ros(options.prefix) if options.ros else None,
            f"{Path(options.scene).resolve().parent.name}/{scene.name}", options.task,
        )  # fmt: skip
    except AddressError as error:
        tell("fatal", str(error))
        stop.wait()
        sys.exit(0)
    tell("ready", cockpit.url)
    while not stop.is_set() and block.age < PHYSICS_SILENCE:
        cockpit.turn()
    cockpit.close()


def _on_ros(prefix: str) -> tuple[TopicHealth, TeleopRemote]:
    """What the page shows of ROS."""
    from ligature.ros.health import TopicHealth, begin_node
    from ligature.teleop.remote import TeleopRemote

    begin_node()
    remote = TeleopRemote("/" + "".join(f"{part}/" for part in prefix.split("/") if part))
    health = TopicHealth(remote.look)
    health.start()
    return health, remote


if __name__ == "__main__":
    main()
