"""The cockpit process: serves the page of the newest state of the bus, and sends what its operator does."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from ligature.cli.process import Run, run_process
from ligature.cockpit.address import TOKEN_VARIABLE, AddressError, read_address
from ligature.cockpit.pictures import Pictures
from ligature.paths import printable, real_path
from ligature.process import report

if TYPE_CHECKING:
    from ligature.ros.health import TopicHealth
    from ligature.teleop.remote import TeleopRemote


def main() -> None:
    """Entry point; see `ligature.cli.process`."""
    run_process(_serve)


def _serve(run: Run) -> None:
    options, scene = run.options, run.scene
    pictures = Pictures(scene, options.bus)  # a fork: before any thread
    from ligature.cockpit.cockpit import Cockpit

    try:
        address = read_address(options.cockpit)
        cockpit = Cockpit(
            scene, run.block, pictures, address, os.environ.get(TOKEN_VARIABLE, ""),
            lambda text: report("warning", text),
            _on_ros(options.prefix) if options.ros else None,
            printable(f"{real_path(Path(options.scene)).parent.name}/{Path(options.scene).stem}"), options.task,
        )  # fmt: skip
    except AddressError as error:
        run.fail(error)
    report("ready", cockpit.url)
    while run.active:
        cockpit.turn()
    cockpit.close()


def _on_ros(prefix: str) -> tuple[TopicHealth, TeleopRemote]:
    """The state of ROS for the page."""
    from ligature.ros.health import TopicHealth
    from ligature.ros.start import start_node
    from ligature.teleop.remote import TeleopRemote

    start_node("ligature_cockpit", several=True)
    remote = TeleopRemote("/" + "".join(f"{part}/" for part in prefix.split("/") if part))
    health = TopicHealth(remote.find_pairs)
    health.start()
    return health, remote
