"""``ligature record``: everything on ROS into one bag by ROS's own recorder; a whole bag gets its name."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

from rich.console import Console

from ligature.bus.stop import stop_on_signal
from ligature.cli.master import DEFAULT_MASTER, master_answers
from ligature.paths import give_name, reason
from ligature.process import end_with_parent

_COLOUR = re.compile(r"\x1b\[[0-9;]*m|\[[0-9.]+\]: |\[ ?(INFO|WARN|ERROR)\] ")
_LOUD = ("error", "less than", "what()")
"""Beginnings, in lower case, of lines by which the recorder reports why it failed."""

END_TIMEOUT = 60.0
"""Seconds that the recorder is given to write its index."""


def recorder() -> Path | None:
    """ROS's recorder, beside the program ``rosbag``."""
    program = shutil.which("rosbag")
    found = None if program is None else Path(program).resolve().parents[1] / "lib" / "rosbag" / "record"
    return found if found is not None and found.is_file() else None


def record(out: Path, exclude: str, seconds: float, keep_free: float, console: Console) -> int:
    """Record until Ctrl-C, or for ``seconds``; ``keep_free`` gigabytes stay free. Returns the exit status."""
    part = out.with_name(f"{out.stem}.part.bag")
    problem = _obstacle(out) or _reserved(part)
    if problem:
        console.print(problem, style="red", markup=False)
        return 1
    command = [str(recorder()), "-a", "-O", str(part), f"--min-space={max(1, round(1e6 * keep_free))}k", *_commanded()]
    if exclude:
        command += ["-x", exclude]
    console.print(f"recording to '{out}'; Ctrl-C ends it", markup=False)
    lines, status = _run(command, seconds)
    why = _reason(lines)
    if why or status != 0 or not part.stat().st_size:
        free = shutil.disk_usage(out.parent).free / 1e9
        why = why or (f"the recorder ended with status {status}" if status else _why_nothing())
        console.print(f"the recording failed: {why}; {free:.3g} GB of disk space are free", style="red", markup=False)
        _report_rest(part, console)
        return 1
    try:
        give_name(part, out)
    except OSError as error:
        console.print(str(error), style="red", markup=False)
        return 1
    console.print(f"{out}: {out.stat().st_size / 1e6:.1f} MB", markup=False)
    return 0


def _obstacle(out: Path) -> str:
    """Why nothing can be recorded; empty when it can."""
    if recorder() is None:
        return "ROS's bag recorder is not installed (Debian package python3-rosbag)"
    if out.suffix != ".bag":
        return f"'{out}' must end in .bag"
    if out.exists():
        return f"'{out}' exists already; choose another name"
    if not out.parent.is_dir():
        return f"the folder '{out.parent}' does not exist; create it first"
    if not os.access(out.parent, os.W_OK):
        return f"the folder '{out.parent}' is not writable"
    uri = os.environ.setdefault("ROS_MASTER_URI", DEFAULT_MASTER)
    if not master_answers(uri):
        return f"no ROS master answers at {uri}; start the simulator with 'ligature run' first"
    return ""


def _reserved(part: Path) -> str:
    """Take the name ``part`` for a recording; else the reason why not. The recorder would write over what has it."""
    if (active := _active(part)).exists():
        return f"'{active}' belongs to a recording that is still running or was cut off; choose another name"
    try:
        part.touch(exist_ok=False)
    except FileExistsError:
        return f"'{part}' belongs to a recording that is still running or was killed; delete it or choose another name"
    except OSError as error:
        return f"'{part}' cannot be written: {reason(error)}; choose another folder or name"
    return ""


def _active(part: Path) -> Path:
    """What the recorder calls ``part`` while it writes."""
    return part.with_name(f"{part.name}.active")


def _commanded() -> list[str]:
    """Topics of commands: the recorder listens from the start, not a second or more after a client came up."""
    from ligature.ros.master import NO_ANSWER, commanded_topics

    try:
        return sorted(commanded_topics())
    except NO_ANSWER:
        return []


def _run(command: list[str], seconds: float) -> tuple[list[str], int]:
    """Output and exit status of the recorder, which a signal to this program or the duration interrupts."""
    stop = stop_on_signal((signal.SIGINT, signal.SIGTERM), timeout=None)
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
        start_new_session=True, preexec_fn=end_with_parent,
    )  # fmt: skip
    output: list[str] = []
    deadline = time.monotonic() + seconds if seconds > 0 else float("inf")
    asked = False
    while True:
        if not asked and (stop.is_set() or time.monotonic() > deadline):
            process.send_signal(signal.SIGINT)
            deadline, asked = time.monotonic() + END_TIMEOUT, True
        elif asked and time.monotonic() > deadline:
            process.kill()
        try:
            text, _ = process.communicate(timeout=0.1)
        except subprocess.TimeoutExpired:
            continue
        output += text.splitlines()
        return output, process.returncode


def _why_nothing() -> str:
    """Why a recorder that ended well has recorded nothing."""
    from ligature.ros.master import NO_ANSWER, takes_time_from_clock

    with suppress(*NO_ANSWER):
        if takes_time_from_clock():
            return (
                "nothing was recorded: /use_sim_time is true, and nobody publishes /clock; set the parameter to false"
            )
    return "nothing was recorded"


def _reason(lines: list[str]) -> str:
    """Why the recorder failed; empty when it did not."""
    plain = [_COLOUR.sub("", line).strip() for line in lines]
    loud = [line for line in plain if line.lower().startswith(_LOUD)]
    return loud[-1].removeprefix("what():").strip() if loud else ""


def _report_rest(part: Path, console: Console) -> None:
    """Remove an empty bag; name the file of one that was cut off."""
    part.unlink(missing_ok=True)
    active = _active(part)
    if active.exists():
        console.print(f"the part recorded before is in '{active}'; 'rosbag reindex' may repair it", markup=False)
