"""How evenly an arm's readings arrive while the machine is busy: intervals of ``measured_cp`` at a client of its own.

``python -m tests.bench.arm_liveness [SECONDS] [BURNERS…]``: the suturing scene with its two cameras, both heard, and two
clients in the main topics of PSM1 and MTMR; beside that as many processes that only calculate as each number of
``BURNERS`` names (0 2 4). The client reads sockets and nothing else, in real time where that is allowed. The yardstick is
a process of ordinary priority that sleeps until every fifth millisecond. Printed are intervals in milliseconds, and how
many were above 20 ms, the time-out of dVRK's teleoperation at its default rate, and above 40 ms.
"""

from __future__ import annotations

import os
import select
import socket
import struct
import subprocess
import sys
import threading
import time
import xmlrpc.client
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from ligature.cli.master import master_answers
from ligature.process import run_in_real_time
from numpy.typing import NDArray

from tests.waiting import until

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
PERIOD = 0.005
TIMEOUT = 0.02
SETTLING = 0.5
"""Seconds before intervals count."""
READINGS = (
    ("measured_cp", "geometry_msgs/PoseStamped"), ("setpoint_cp", "geometry_msgs/PoseStamped"),
    ("measured_js", "sensor_msgs/JointState"), ("setpoint_js", "sensor_msgs/JointState"),
    ("measured_cv", "geometry_msgs/TwistStamped"), ("body/measured_cf", "geometry_msgs/WrenchStamped"),
)  # fmt: skip
SUMS = {
    "geometry_msgs/PoseStamped": "d3812c3cbc69362b77dc0b19b345f8f5",
    "sensor_msgs/JointState": "3066dcd76a6cfaef579bd0f34173e9fd",
    "geometry_msgs/TwistStamped": "98d34b0043a2093cf9d9345ab6eef12e",
    "geometry_msgs/WrenchStamped": "d78d3cb249ce23087ade7e7d0c40cfa7",
    "sensor_msgs/Image": "060021388200f6f0f447d0fcd9c64743",
}
BURNER = "while True: pass"
YARDSTICK = """
import sys, time
end, last, found = time.monotonic() + float(sys.argv[1]), time.monotonic(), []
due = last
while last < end:
    due += 0.005
    time.sleep(max(due - time.monotonic(), 0.0))
    now = time.monotonic()
    found.append(now - last)
    last = now
    due = max(due, now - 0.005)
print(" ".join(f"{each:.6f}" for each in found))
"""


def connect(master: str, topic: str, type_: str, number: int = 0) -> socket.socket:
    """A connection of TCPROS to the one who publishes ``topic``, as client ``number``."""
    me = f"/arm_liveness_{number}"
    publishers: list[str] = []

    def published() -> bool:
        answer = xmlrpc.client.ServerProxy(master).registerSubscriber(me, topic, type_, "http://127.0.0.1:1/")
        publishers[:] = answer[2]  # type: ignore[index]
        return bool(publishers)

    until(published, f"{topic} is published", 60.0)
    _, _, (_, host, port) = xmlrpc.client.ServerProxy(publishers[0]).requestTopic(me, topic, [["TCPROS"]])
    link = socket.create_connection((host, port))
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    fields = {"callerid": me, "topic": topic, "type": type_, "md5sum": SUMS[type_], "tcp_nodelay": "1"}
    lines = b"".join(struct.pack("<I", len(line)) + line for line in (f"{k}={v}".encode() for k, v in fields.items()))
    link.sendall(struct.pack("<I", len(lines)) + lines)
    size = struct.unpack("<I", link.recv(4, socket.MSG_WAITALL))[0]
    link.recv(size, socket.MSG_WAITALL)
    return link


class Reader:
    """The messages of one connection, and when each was complete."""

    def __init__(self, link: socket.socket) -> None:
        self.link, self.times = link, []
        self._buffer = b""

    def read(self) -> None:
        """Take what is there."""
        self._buffer += self.link.recv(1 << 20)
        now, at = time.monotonic(), 0
        while len(self._buffer) - at >= 4:
            size = struct.unpack_from("<I", self._buffer, at)[0]
            if len(self._buffer) - at < 4 + size:
                break
            self.times.append(now)
            at += 4 + size
        self._buffer = self._buffer[at:]


def intervals(master: str, seconds: float, pictures: bool = True) -> tuple[dict[str, Array], Array]:
    """Intervals in seconds of ``measured_cp`` of PSM1 and MTMR, and of a process that only sleeps.

    They are taken on a thread that runs in real time where that is allowed: an instrument is not to be late itself.
    """
    found: list[tuple[dict[str, Array], Array]] = []
    reading = threading.Thread(target=lambda: found.append(_intervals(master, seconds, pictures)))
    reading.start()
    reading.join()
    return found[0]


def _intervals(master: str, seconds: float, pictures: bool) -> tuple[dict[str, Array], Array]:
    named = {f"/{arm}/{name}": type_ for arm in ("PSM1", "MTMR") for name, type_ in READINGS}
    readers = {topic: [Reader(connect(master, topic, type_, k)) for k in range(2)] for topic, type_ in named.items()}
    watchers = [
        subprocess.Popen([sys.executable, "-m", "tests.bench.arm_liveness", "watch", master, topic], cwd=ROOT)
        for topic in (f"/ambf/env/cameras/{camera}/ImageData" for camera in ("cameraL", "cameraR") if pictures)
    ]
    yardstick = subprocess.Popen(
        [sys.executable, "-c", YARDSTICK, str(seconds)], stdout=subprocess.PIPE, text=True
    )  # fmt: skip
    every = [reader for pair in readers.values() for reader in pair]
    poll, by_number = select.epoll(), {reader.link.fileno(): reader for reader in every}
    for number in by_number:
        poll.register(number, select.EPOLLIN)
    run_in_real_time()
    for length in (SETTLING, seconds):
        for reader in every:
            reader.times.clear()  # what came while others were connected arrives at once
        end = time.monotonic() + length
        while time.monotonic() < end:
            for number, _ in poll.poll(0.1):
                by_number[number].read()
    for reader in every:
        reader.link.close()
    silent = [topic for topic, pair in readers.items() if not all(reader.times for reader in pair)]
    assert not silent, f"not heard: {', '.join(silent)}"
    for watcher in watchers:
        watcher.kill()
        watcher.wait()
    found = {arm: np.diff(readers[f"/{arm}/measured_cp"][0].times) for arm in ("PSM1", "MTMR")}
    return found, np.array([float(each) for each in yardstick.communicate()[0].split()])


def watch(master: str, topic: str) -> None:
    """Listen to pictures for ever."""
    reader = Reader(connect(master, topic, "sensor_msgs/Image"))
    while True:
        reader.read()


def line(name: str, gaps: Array, seconds: float) -> str:
    """Percentiles in milliseconds, and how many intervals exceed the time-out once and twice, within an hour."""
    p50, p99, p999 = np.percentile(gaps, (50, 99, 99.9)) * 1e3
    above = [int((gaps > factor * TIMEOUT).sum()) for factor in (1, 2)]
    return (
        f"{name:10s} n {len(gaps):6d}  p50 {p50:6.2f}  p99 {p99:6.2f}  p99.9 {p999:6.2f}  max {gaps.max() * 1e3:6.2f} ms"
        f"  above 20 ms: {above[0]}, above 40 ms: {above[1]} in {seconds:g} s"
    )


def main(arguments: Sequence[str]) -> None:
    """Measure with each number of burners."""
    if arguments[:1] == ["watch"]:
        watch(*arguments[1:])
    seconds = float(arguments[0]) if arguments else 60.0
    port = 11700 + os.getpid() % 200
    master = f"http://127.0.0.1:{port}/"
    env = {**os.environ, "ROS_MASTER_URI": master, "ROS_IP": "127.0.0.1"}
    command = [str(ROOT / ".venv/bin/ligature"), "run", "scenes/suturing/launch.yaml"]
    program = subprocess.Popen(command, env=env, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    try:
        until(lambda: "first state published" in program.stdout.readline(), "the first state", 600.0)
        assert master_answers(master)
        time.sleep(3.0)
        for count in map(int, arguments[1:] or ("0", "2", "4")):
            burners = [subprocess.Popen([sys.executable, "-c", BURNER]) for _ in range(count)]
            try:
                gaps, yardstick = intervals(master, seconds)
            finally:
                for burner in burners:
                    burner.kill()
            sys.stdout.write(
                f"{count} processes that calculate; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors\n"
            )
            for name, each in (*gaps.items(), ("yardstick", yardstick)):
                sys.stdout.write(f"{line(name, each, seconds)}\n")
    finally:
        program.terminate()
        program.wait(20.0)


if __name__ == "__main__":
    main(sys.argv[1:])
