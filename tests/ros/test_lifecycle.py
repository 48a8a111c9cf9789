"""What happens when processes die, masters restart and users press Ctrl-C."""

from __future__ import annotations

import fcntl
import os
import pty
import signal
import subprocess
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from ligature.cli.master import master_answers

from tests.fuzz.kills import STAGES, kill
from tests.ros.conftest import BIN, SMALL, Program, free_port, start_master
from tests.waiting import stays, until

pytestmark = pytest.mark.ros
WORLD = "/ambf/env/World/State"

WATCH = """
import sys, time, rospy
from ambf_msgs.msg import WorldState
rospy.init_node("watch", anonymous=True, disable_signals=True)
rospy.Subscriber("/ambf/env/World/State", WorldState, lambda m: print(time.time(), m.sim_time, m.sim_step, flush=True))
while True: time.sleep(0.1)
"""


@pytest.fixture
def own_env(ros_env: dict[str, str]) -> dict[str, str]:
    """Environment of a master that does not run yet, on a port of its own."""
    return dict(ros_env, ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}")


@pytest.mark.parametrize("files", [20, 70, 150])
def test_a_run_that_may_not_open_enough_files_ends_with_the_limit_and_the_remedy(
    files: int, own_env: dict[str, str]
) -> None:
    """Each ROS topic takes one: wherever the start is when no more may be opened."""
    words = [
        "bash",
        "-c",
        f'ulimit -n {files}; exec "$@"',
        "bash",
        str(BIN / "ligature"),
        "run",
        str(SMALL),
        "--no-cameras",
    ]
    done = subprocess.run(words, env=own_env, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and "Traceback" not in done.stdout + done.stderr
    assert f"the system lets this process open {files} files" in done.stdout and "ulimit -n 4096" in done.stdout


@pytest.fixture
def watch(tmp_path: Path) -> Iterator[Callable[[dict[str, str]], Program]]:
    """Starts a client that prints wall time, sim time and step of every world state."""
    programs: list[Program] = []

    def run(env: dict[str, str]) -> Program:
        script = tmp_path / "watch.py"
        script.write_text(WATCH)
        programs.append(Program([str(BIN / "python"), "-u", str(script)], env))
        return programs[-1]

    yield run
    for program in programs:
        program.process.kill()
        program.process.wait()


def seen(program: Program) -> list[tuple[float, float, int]]:
    rows = [line.split() for line in list(program.lines) if len(line.split()) == 3]
    return [(float(a), float(b), int(c)) for a, b, c in rows]


@pytest.fixture
def start(start: Callable[..., Program]) -> Iterator[Callable[..., Program]]:
    """Starts commands that end with the test: one that failed leaves no node whose name the next test needs."""
    programs: list[Program] = []

    def run(*command: object, **options: Any) -> Program:
        programs.append(start(*command, **options))
        return programs[-1]

    yield run
    for program in programs:
        program.end(30.0)


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_master_is_started_when_none_answers_and_all_ends_within_two_seconds(
    start: Callable[..., Program], own_env: dict[str, str]
) -> None:
    program = start(BIN / "ligature", "run", SMALL, "-p", "200", env=own_env)
    program.wait_for("first state published")
    assert f"no ROS master answers at {own_env['ROS_MASTER_URI']}: starting one" in program.output
    assert master_answers(own_env["ROS_MASTER_URI"])
    pids = program.children()
    assert set(pids) >= {"physics", "ros_process", "rosmaster"}
    begin = time.monotonic()
    assert program.end() == 0
    assert time.monotonic() - begin < 2.0
    assert not any(alive(pid) for pid in pids.values())
    assert not list(Path("/dev/shm").glob(f"ligature-{program.process.pid}-*"))


def test_a_killed_ros_process_comes_back_and_physics_never_pauses(
    start: Callable[..., Program], ros_env: dict[str, str], watch: Callable[..., Program]
) -> None:
    program = start(BIN / "ligature", "run", SMALL, "-p", "200")
    program.wait_for("first state published")
    client = watch(ros_env)
    until(lambda: len(seen(client)) > 20, seconds=15)
    killed_at = time.time()
    os.kill(program.children()["ros_process"], signal.SIGKILL)
    back = until(lambda: [row for row in seen(client) if row[0] > killed_at + 0.3], seconds=60)
    before = [row for row in seen(client) if row[0] <= killed_at][-1]
    wall, simulated = back[0][0] - before[0], back[0][1] - before[1]
    # a pause would leave it near zero; a busy machine may be slower than the wall clock meanwhile
    assert simulated > 0.5 * wall
    assert "the ros process ended with status -9; restarting it" in program.output
    assert program.end() == 0


def test_a_restarted_master_finds_the_simulator_again(
    start: Callable[..., Program], own_env: dict[str, str], watch: Callable[..., Program]
) -> None:
    port = int(own_env["ROS_MASTER_URI"].rpartition(":")[2])
    master = start_master(port, own_env)
    program = start(BIN / "ligature", "run", SMALL, "-p", "200", env=own_env)
    program.wait_for("first state published")
    master.kill()
    master.wait()
    stays(lambda: program.process.poll() is None, "the simulator goes on without a master", 1.5)
    master = start_master(port, own_env)
    try:
        client = watch(own_env)
        until(lambda: len(seen(client)) > 10, seconds=15)
        listing = subprocess.run(["rostopic", "list"], env=own_env, capture_output=True, text=True, check=True).stdout
        assert "/ambf/env/phantom/Needle/Command" in listing.split()
        moved = start(
            "/usr/bin/rostopic", "pub", "-r", "20", "/ambf/env/World/Command", "ambf_msgs/WorldCmd",
            "{enable_step_throttling: true, step_clock: true, n_skip_steps: 1}", env=own_env,
        )  # fmt: skip
        until(lambda: seen(client)[-1][2] == seen(client)[-20][2], seconds=10)
        moved.process.kill()
    finally:
        assert program.end() == 0
        master.kill()
        master.wait()


def test_the_end_of_the_physics_process_ends_the_run_with_a_message(start: Callable[..., Program]) -> None:
    program = start(BIN / "ligature", "run", SMALL, "-p", "200")
    program.wait_for("first state published")
    os.kill(program.children()["physics"], signal.SIGKILL)
    assert program.process.wait(5) == 1
    assert "the physics process ended with status -9; the run is over" in program.output


def test_no_process_survives_a_killed_supervisor(start: Callable[..., Program]) -> None:
    program = start(BIN / "ligature", "run", SMALL, "-p", "200")
    program.wait_for("first state published")
    pids = program.children()
    program.process.kill()
    until(lambda: not any(alive(pid) for pid in pids.values()), seconds=5)


@pytest.mark.parametrize("number", [2, 4], ids=lambda number: STAGES[number])
def test_three_signals_within_a_millisecond_leave_no_process(number: int) -> None:
    """`python -m tests.fuzz.kills` does so at 200 moments on a busy machine."""
    done = kill(number)
    assert done.processes >= 3 and not done.left, str(done)


@pytest.mark.parametrize("hears", [True, False], ids=["terminal", "nohup"])
def test_a_terminal_that_is_closed_ends_a_run_unless_that_is_ignored(own_env: dict[str, str], hears: bool) -> None:
    terminal, its_end = pty.openpty()

    def begin() -> None:
        fcntl.ioctl(its_end, termios.TIOCSCTTY, 0)
        signal.signal(signal.SIGHUP, signal.SIG_DFL if hears else signal.SIG_IGN)

    command = [BIN / "ligature", "run", SMALL, "-p", "200", "--no-cameras"]
    run = subprocess.Popen(
        command, env=own_env, stdin=its_end, stdout=its_end, stderr=its_end, start_new_session=True, preexec_fn=begin
    )
    os.close(its_end)
    output = b""
    while b"physics ready" not in output:
        output += os.read(terminal, 4096)
    os.close(terminal)
    try:
        if not hears:
            stays(lambda: run.poll() is None, "the run goes on", 0.5)
            run.terminate()
        assert run.wait(5.0) >= 0, "it ended by itself"
        assert not list(Path("/dev/shm").glob(f"ligature-{run.pid}-*"))
    finally:
        run.kill()
        run.wait()
