"""The command ``ligature teleop``: devices control arms on ROS, simulated or real."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from rich.console import Console

from ligature.adf.diagnostics import AdfError
from ligature.bus.stop import stop_on_signal
from ligature.cli.master import DEFAULT_MASTER, master_answers
from ligature.cli.options import name_prefix
from ligature.paths import reason
from ligature.teleop import config
from ligature.teleop.config import TeleopConfig
from ligature.teleop.ready import of_devices

END_TIMEOUT = 10.0
"""Seconds that the end may take: a recording is written, and arms are left in order."""


def teleop(
    file: Path | None, ready: Sequence[str], record: Path | None, replay: Path | None, calibrate: str | None,
    check: bool, timeout: float | None, devices: tuple[int, ...] | None, prefix: str, console: Console,
) -> int:  # fmt: skip
    """Drive until Ctrl-C; returns the exit status."""
    try:
        wanted = _configuration(file, ready, devices)
        if timeout is not None:
            wanted = config.with_timeout(wanted, timeout)
        if prefix:
            wanted = config.with_prefix(wanted, name_prefix(prefix))
    except (AdfError, ValueError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    for note in wanted.notes:
        console.print(note, style="yellow", markup=False)
    if check:
        for leader, arms in wanted.pairs.items():
            waits = "waits, and " if leader in wanted.waiting else ""
            followers = ", ".join(arms) or "the camera alone"
            console.print(f"{leader} ({wanted.devices[leader].kind}) {waits}drives {followers}", markup=False)
        if wanted.phases:
            console.print(f"phases: {', '.join(wanted.phases)}", markup=False)
        return 0
    uri = os.environ.setdefault("ROS_MASTER_URI", DEFAULT_MASTER)
    if not master_answers(uri):
        console.print(f"no ROS master answers at {uri}; start the simulator with 'ligature run' first", markup=False)
        return 1
    return _on_ros(wanted, record, replay, calibrate, console)


def _configuration(file: Path | None, ready: Sequence[str], devices: tuple[int, ...] | None) -> TeleopConfig:
    """That of a teleoperation file, what the input devices of a launch file state, or devices that need no file."""
    if (file is None) is not bool(ready):
        raise ValueError("write either a file or --device, such as 'ligature teleop --device keyboard'")
    if file is None:
        return of_devices(ready)
    text = config.text_of(file)
    if "multibody configs" in text:
        from ligature.teleop.launch import of_launch_file

        return of_launch_file(file, devices)
    return config.from_text(text, file)


def _on_ros(
    wanted: TeleopConfig, record: Path | None, replay: Path | None, calibrate: str | None, console: Console
) -> int:
    from ligature.ros.start import start_node
    from ligature.teleop.guide import calibration_of
    from ligature.teleop.node import Teleop
    from ligature.teleop.record import Replay, recording

    start_node("ligature_teleop", several=True)
    try:
        if calibrate is not None:
            block = calibration_of(
                wanted, calibrate, lambda text: console.input(text, markup=False),
                lambda text: console.print(text, markup=False),
            )  # fmt: skip
            console.print(block, markup=False, end="")
            return 0
        stop = stop_on_signal(
            (signal.SIGINT, signal.SIGTERM), END_TIMEOUT
        )  # not before: Ctrl-C ends a question of the guide
        with ExitStack() as files:
            played = Replay(replay) if replay else None
            node = Teleop(wanted, files.enter_context(recording(record)) if record else None, played)
            pairs = (f"{leader} → {wanted.begins_with(leader) or config.NOBODY}" for leader in wanted.pairs)
            console.print(f"driving: {', '.join(pairs)}", markup=False)
            node.run(stop.is_set)
    except OSError as error:
        named = f"{error.filename}: " if error.filename else ""
        console.print(f"{named}{reason(error)}", style="red", markup=False)
        return 1
    except (ValueError, RuntimeError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    return 0
