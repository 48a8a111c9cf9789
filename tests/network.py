"""A bad network between two network namespaces: packets come late, and some never.

The kernel's own emulation (netem) is missing from many kernels; this one needs ``/dev/net/tun`` and the right to make
namespaces. Two tun devices, one in each namespace, are joined by a process that delays and drops real packets, so that
TCP of the kernel does what it does in a real network: ``python -m tests.network PID DELAY LOSS SEED``.
"""

from __future__ import annotations

import ctypes
import fcntl
import heapq
import os
import random
import select
import shutil
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from ligature.process import end_with_parent

from tests.waiting import until

TUNSETIFF, TUN_WITHOUT_HEADER = 0x400454CA, 0x1001
NEW_NETWORK = 0x40000000
HERE, THERE = "10.231.77.1", "10.231.77.2"
ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Far:
    """A network namespace behind a bad network, reached at the address ``THERE``.

    The process ``pid`` lives in it; ``link`` carries the packets.
    """

    pid: int
    link: int

    @property
    def prefix(self) -> list[str]:
        """What a command begins with that runs there."""
        return ["nsenter", "-t", str(self.pid), "-n"]


@contextmanager
def bad_network(delay: float, loss: float, seed: int = 1) -> Iterator[Far]:
    """A namespace from which packets come ``delay`` seconds late each way, and a share ``loss`` never."""
    for program in ("unshare", "nsenter", "ip"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed")
    if not os.access("/dev/net/tun", os.W_OK):
        pytest.skip("no network can be made here: /dev/net/tun cannot be opened")
    there = subprocess.Popen(["unshare", "-n", "sleep", "infinity"], preexec_fn=end_with_parent, stderr=subprocess.PIPE)
    command = [sys.executable, "-m", "tests.network", str(there.pid), str(delay), str(loss), str(seed)]
    own = os.readlink("/proc/self/ns/net")
    until(lambda: there.poll() is not None or os.readlink(f"/proc/{there.pid}/ns/net") != own, "a namespace")
    link = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=ROOT, preexec_fn=end_with_parent
    )
    try:
        assert link.stdout is not None
        first = link.stdout.readline()
        if first.strip() != "ready":
            pytest.skip(f"no network can be made here: {first + link.stdout.read()}")
        yield Far(there.pid, link.pid)
    finally:
        for process in (link, there):
            process.kill()
            process.wait()


def _device(name: str, address: str, peer: str) -> int:
    found = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(found, TUNSETIFF, struct.pack("16sH22x", name.encode(), TUN_WITHOUT_HEADER))
    for words in (f"addr add {address} peer {peer} dev {name}", f"link set {name} up", "link set lo up"):
        subprocess.run(["ip", *words.split()], check=True)
    return found


def _enter(pid: int) -> None:
    with open(f"/proc/{pid}/ns/net", encoding="ascii") as namespace:
        if ctypes.CDLL(None, use_errno=True).setns(namespace.fileno(), NEW_NETWORK) != 0:
            raise OSError(ctypes.get_errno(), "setns")


def main() -> None:
    """Join the namespace of this process with that of another."""
    end_with_parent()
    pid, delay, loss, rng = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]), random.Random(int(sys.argv[4]))
    here = _device(f"lig{os.getpid()}", HERE, THERE)
    _enter(pid)
    other = {here: (there := _device("lig", THERE, HERE)), there: here}
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    waiting: list[tuple[float, int, int, bytes]] = []
    count = 0
    while True:
        nap = max(waiting[0][0] - time.monotonic(), 0.0) if waiting else 1.0
        for device in select.select(list(other), [], [], nap)[0]:
            packet = os.read(device, 65536)
            if rng.random() >= loss:
                count += 1
                heapq.heappush(waiting, (time.monotonic() + delay, count, other[device], packet))
        while waiting and waiting[0][0] <= time.monotonic():
            os.write(waiting[0][2], waiting[0][3])
            heapq.heappop(waiting)


if __name__ == "__main__":
    main()
