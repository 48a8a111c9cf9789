"""Ends runs at random moments by bursts of signals: ``python -m tests.fuzz.kills --kills 200 --load 2``.

A run has all the processes that it can have. The supervisor gets three signals within a millisecond; two seconds later
none of the processes may be left, whatever each of them was doing, on a machine that is busy with other things.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from ligature.bus.leftovers import FOLDER
from ligature.process import end_with_parent

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "scenes" / "suturing_small" / "launch.yaml"
FLAGS = ("-p", "200", "--cameras", "--cockpit-at", "127.0.0.1:{port}", "--task", "pose_estimation")

LIMIT = 2.0
"""Seconds after the first signal in which every process must have ended."""

STAGES = ("loading", "starting one", "physics ready", "ros ready", "first state", "")
"""What a run has stated when the time until its end begins; nothing stands for its start."""

LONGEST = 1.5
"""Seconds from there to the end of a run at most: until it has reached the next stage or two."""

START = 300.0
"""Seconds that a run is given to reach its stage."""

_MARK = "LIGATURE_KILLS"
"""Environment variable by which the processes of one run are found, also those whose parent is gone."""


@dataclass(frozen=True)
class Kill:
    """How one run ended: stage that it had reached, seconds that it lived, processes it had, seconds until the last one had gone."""

    stage: str
    lived: float
    processes: int
    ended: float
    left: tuple[str, ...]

    def __str__(self) -> str:
        words = (
            f"after {self.lived:.2f} s, behind '{self.stage}': {self.processes} processes ended in {self.ended:.2f} s"
        )
        return words + (f"; LEFT: {', '.join(self.left)}" if self.left else "")


def kill(number: int, scene: Path = SCENE) -> Kill:
    """Run ``scene`` and end it; the moment and the signals are the same for each ``number``."""
    rng = random.Random(number)
    mark = f"{_MARK}={uuid.uuid4().hex}"
    ports = _free_ports(2)
    env = dict(os.environ, ROS_MASTER_URI=f"http://127.0.0.1:{ports[0]}", ROS_IP="127.0.0.1")
    env[_MARK] = mark.partition("=")[2]
    env["PYTHONPATH"] = os.pathsep.join([str(ROOT / "build" / "python"), env.get("PYTHONPATH", "")])
    flags = [flag.format(port=ports[1]) for flag in FLAGS]
    program = subprocess.Popen(
        [str(Path(sys.executable).parent / "ligature"), "run", str(scene), *flags], env=env,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, preexec_fn=end_with_parent,
    )  # fmt: skip
    started, stage = time.monotonic(), STAGES[number % len(STAGES)]
    _wait_for(program, stage)
    time.sleep(rng.uniform(0.0, LONGEST))
    lived = time.monotonic() - started
    found = _marked(mark)
    begin = time.monotonic()
    for _ in range(3):
        with suppress(ProcessLookupError):
            os.kill(program.pid, rng.choice((signal.SIGTERM, signal.SIGINT, signal.SIGHUP)))
        time.sleep(rng.uniform(0.0, 3e-4))
    while (left := _marked(mark, program)) and time.monotonic() - begin < LIMIT:
        time.sleep(0.01)
    ended = time.monotonic() - begin
    for pid in left:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    program.wait()
    blocks = [f"shared memory {path.name}" for path in FOLDER.glob(f"ligature-{program.pid}-*")]
    return Kill(stage, lived, len(found), ended, (*left.values(), *blocks))


def _wait_for(program: subprocess.Popen[bytes], stage: str) -> None:
    """Wait until the run has stated ``stage``; goes on taking what it states."""
    reached = threading.Event()

    def take() -> None:
        assert program.stdout is not None
        for line in program.stdout:
            if stage.encode() in line:
                reached.set()

    threading.Thread(target=take, daemon=True).start()
    deadline = time.monotonic() + START
    while stage and not reached.wait(0.01):
        if program.poll() is not None or time.monotonic() > deadline:
            raise RuntimeError(f"the run did not state '{stage}' within {START:g} s, or ended before")


@contextmanager
def busy(count: int) -> Iterator[None]:
    """``count`` processes that take all the time they can get."""
    code = "while True: sum(range(100000))"
    others = [subprocess.Popen([sys.executable, "-c", code], preexec_fn=end_with_parent) for _ in range(count)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def _marked(mark: str, program: subprocess.Popen[bytes] | None = None) -> dict[int, str]:
    """Process ids and commands of the living processes that carry ``mark``."""
    if program is not None:
        program.poll()
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if f"\0{mark}\0".encode() in b"\0" + (folder / "environ").read_bytes():
                words = (folder / "cmdline").read_bytes().split(b"\0")
                found[int(folder.name)] = b" ".join(words[:3]).decode("utf-8", "replace")
    return found


def _free_ports(count: int) -> list[int]:
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [int(probe.getsockname()[1]) for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def main() -> int:
    """Entry point."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--kills", type=int, default=200)
    flags.add_argument("--first", type=int, default=0, help="number of the first run")
    flags.add_argument("--load", type=int, default=os.cpu_count() or 1, help="busy processes beside the run")
    given = flags.parse_args()
    kills = []
    with busy(given.load):
        for number in range(given.first, given.first + given.kills):
            kills.append(kill(number))
            sys.stdout.write(f"run {number} {kills[-1]}\n")
            sys.stdout.flush()
    survived = sum(bool(one.left) for one in kills)
    slowest = max((one.ended for one in kills), default=0.0)
    sys.stdout.write(f"{len(kills)} runs ended, the slowest in {slowest:.2f} s; {survived} with survivors\n")
    return int(survived > 0)


if __name__ == "__main__":
    sys.exit(main())
