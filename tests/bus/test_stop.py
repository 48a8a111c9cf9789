"""What signals set: by any number of them, at any moment, and the kernel's end of what does not end."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest
from ligature.process import end_with_parent

BEGIN = """
import os, signal, sys, threading, time
from ligature.bus.stop import stop_on_signal
"""
STORM = """
stop = stop_on_signal({numbers}, timeout=None)
def storm():
    for number in {numbers} * 10_000:
        os.kill(os.getpid(), number)
sender = threading.Thread(target=storm)
sender.start()
while not stop.wait(0.0):
    pass
while sender.is_alive():  # every bytecode of the handler may be interrupted by the handler
    stop.is_set()
sender.join()
print("ended")
"""


def run(code: str, seconds: float = 60.0) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", BEGIN + code], capture_output=True, text=True, timeout=seconds, check=False,
        preexec_fn=end_with_parent,
    )  # fmt: skip


@pytest.mark.parametrize("numbers", ["[signal.SIGTERM]", "[signal.SIGTERM, signal.SIGINT]"])
def test_a_storm_of_signals_within_their_own_handlers_holds_nothing_up(numbers: str) -> None:
    done = run(STORM.format(numbers=numbers))
    assert (done.returncode, done.stdout) == (0, "ended\n"), done.stderr


@pytest.mark.parametrize(
    "stuck",
    [
        "threading.Lock().acquire(); lock = threading.Lock(); lock.acquire(); lock.acquire()",
        "read, write = os.pipe()\nwhile True: os.write(write, bytes(1 << 16))",
        "while True: pass",
    ],
)
def test_the_kernel_ends_a_process_that_is_stuck(stuck: str) -> None:
    arm = "stop = stop_on_signal(timeout=0.3)\nthreading.Timer(0.1, os.kill, (os.getpid(), signal.SIGTERM)).start()\n"
    assert run(arm + stuck).returncode == -signal.SIGALRM


def test_waiting_ends_with_the_signal_or_with_time() -> None:
    code = """
stop = stop_on_signal(timeout=None)
print(stop.wait(0.05), stop.is_set())
threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGTERM)).start()
print(stop.wait(30.0), stop.is_set(), stop.wait())
"""
    assert run(code, 20.0).stdout.split() == ["False", "False", "True", "True", "True"]


def test_the_terminals_interrupt_is_left_to_the_parent() -> None:
    code = "stop = stop_on_signal()\nos.kill(os.getpid(), signal.SIGINT)\nprint(stop.wait(0.05))"
    assert run(code).stdout == "False\n"
