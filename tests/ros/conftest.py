"""A ROS master of our own on a free port, and simulators started on it as a user would."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest
from ligature.process import end_with_parent

from tests.network import HERE, THERE
from tests.waiting import until

ROOT = Path(__file__).resolve().parents[2]
SMALL = ROOT / "scenes" / "suturing_small" / "launch.yaml"
BIN = Path(sys.executable).parent


PROCESSES = (
    *(f"ligature.cli.{name}" for name in (
        "physics", "ros_process", "render_process", "tasks_process", "window_process", "cockpit_process",
    )), "rosmaster",
)  # fmt: skip
"""What the processes of a run are called in a list of processes."""


FAR = os.environ.get("LIGATURE_TEST_FAR", "")
"""A process in the network namespace in which master and simulator are to run (`tests.ros.test_bad_network`)."""

_PREFIX = ["nsenter", "-t", FAR, "-n"] if FAR else []
MASTER = THERE if FAR else "127.0.0.1"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Program:
    """A running command with its output; ended by its own process id."""

    def __init__(self, command: Sequence[str], env: dict[str, str]) -> None:
        self.lines: list[str] = []
        self.process = subprocess.Popen(
            [str(word) for word in command], env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            preexec_fn=end_with_parent,
        )  # fmt: skip
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))

    @property
    def output(self) -> str:
        return "\n".join(self.lines)

    def wait_for(self, text: str, seconds: float = 60.0) -> None:
        """Wait until a line holds ``text``."""

        def written() -> bool:
            if any(text in line for line in self.lines):
                return True
            assert self.process.poll() is None, f"ended with {self.process.poll()}:\n{self.output}"
            return False

        until(written, lambda: f"'{text}' in:\n{self.output}", seconds)

    def children(self) -> dict[str, int]:
        """Process ids of the simulator's processes by module name."""
        found = {}
        listing = subprocess.run(["ps", "-wweo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout
        for line in listing.splitlines()[1:]:
            pid, parent, args = line.split(None, 2)
            if int(parent) == self.process.pid:
                for name in PROCESSES:
                    if name in args:
                        found[name.rpartition(".")[2]] = int(pid)
        return found

    def end(self, timeout: float = 5.0) -> int:
        """Ctrl-C; returns the exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            for pid in (self.process.pid, *self.children().values()):  # a node that stays keeps its name
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            self.process.wait()
            raise


@pytest.fixture(scope="session")
def ros_env() -> Iterator[dict[str, str]]:
    """Environment of a ROS master that lives for the whole test session; also set for this process."""
    port = free_port()
    env = dict(os.environ, ROS_MASTER_URI=f"http://{MASTER}:{port}", ROS_IP=HERE if FAR else "127.0.0.1")
    env["PYTHONPATH"] = os.pathsep.join([str(ROOT / "build" / "python"), env.get("PYTHONPATH", "")])
    os.environ["ROS_MASTER_URI"], os.environ["ROS_IP"] = env["ROS_MASTER_URI"], env["ROS_IP"]
    master = start_master(port, env)
    yield env
    master.terminate()
    master.wait()


def start_master(port: int, env: dict[str, str]) -> subprocess.Popen[bytes]:
    """A ROS master on ``port``, answering."""
    from ligature.cli.master import master_answers

    master = subprocess.Popen(
        [*_PREFIX, "/usr/bin/python3", "/usr/bin/rosmaster", "--core", "-p", str(port)],
        env=dict(env, ROS_IP=MASTER),
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=end_with_parent,
    )  # fmt: skip
    try:
        until(lambda: master_answers(f"http://{MASTER}:{port}"), "the ROS master answers", every=0.05)
    except AssertionError:
        master.kill()
        master.wait()
        raise
    return master


@pytest.fixture(scope="session")
def node(ros_env: dict[str, str]) -> Any:
    """This process as a ROS node; the module rospy."""
    import rospy

    rospy.init_node("ligature_tests", disable_signals=True, anonymous=True)
    return rospy


@pytest.fixture(scope="module")
def start(ros_env: dict[str, str]) -> Iterator[Callable[..., Program]]:
    """Starts commands; all of them have ended when the module is done."""
    programs: list[Program] = []

    def run(*command: object, env: dict[str, str] | None = None) -> Program:
        words, there = [str(word) for word in command], env or ros_env
        if FAR and "run" in words[:2]:
            words, there = [*_PREFIX, *words], dict(there, ROS_IP=THERE)
        programs.append(Program(words, there))
        return programs[-1]

    yield run
    with ExitStack() as ending:  # all of them, also when one has to be killed
        for program in programs:
            ending.callback(program.end, 30.0)


class Listener:
    """Collects the messages of one topic with their arrival times."""

    def __init__(self, rospy: Any, topic: str, type_: Any) -> None:
        self.messages: list[Any] = []
        self.times: list[float] = []
        self._subscriber = rospy.Subscriber(topic, type_, self._take, queue_size=1000, tcp_nodelay=True)

    def _take(self, message: Any) -> None:
        self.times.append(time.monotonic())
        self.messages.append(message)

    def wait(self, condition: Callable[[Any], bool] = lambda _: True, seconds: float = 20.0) -> Any:
        """The newest message once it satisfies ``condition``."""
        try:
            until(lambda: self.messages and condition(self.messages[-1]), seconds=seconds, every=0.005)
        except AssertionError as error:
            raise AssertionError(f"last message: {self.messages[-1:]}") from error
        return self.messages[-1]

    def rate(self, seconds: float) -> float:
        """Messages a second over the coming ``seconds``."""
        before, start = len(self.messages), time.monotonic()
        time.sleep(seconds)
        return (len(self.messages) - before) / (time.monotonic() - start)

    def comes_at(self, low: float, high: float = float("inf"), seconds: float = 1.0) -> bool:
        """Wait for a span of ``seconds`` in which ``low`` to ``high`` messages a second arrive.

        One span alone says little: whatever else the machine did in it counts against the sender.
        """
        rates: list[float] = []

        def fits() -> bool:
            rates.append(self.rate(seconds))
            return low <= rates[-1] <= high

        return until(fits, lambda: f"{low} to {high} messages a second; came: {rates}", 30.0)

    def close(self) -> None:
        self._subscriber.unregister()


CAMERA = """
bodies: [BODY CameraFrame]
joints: []
namespace: /ambf/env/phantom/
BODY CameraFrame:
  name: CameraFrame
  mesh: ''
  mass: 0.0
  location:
    position: {x: 0.0307, y: 0.25102, z: 0.81025}
    orientation: {r: 0.69813, p: 0.0, y: -3.14158}
"""


ARMS = ("PSM1", "PSM2", "ECM", "MTML", "MTMR")


@pytest.fixture(scope="session")
def arms_scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A launch file with the arms of the small scene and nothing that they could touch."""
    folder = tmp_path_factory.mktemp("arms")
    for name in ("world", "environment", "colors", "input_devices", "psm1", "psm2"):
        shutil.copy(SMALL.parent / f"{name}.yaml", folder)
    shutil.copytree(SMALL.parent / "high_res", folder / "high_res")
    (folder / "camera.yaml").write_text(CAMERA)
    launch = SMALL.read_text().partition("multibody configs")[0]
    (folder / "launch.yaml").write_text(launch + "multibody configs: [camera.yaml, psm1.yaml, psm2.yaml]\n")
    return folder / "launch.yaml"


@pytest.fixture(scope="module")
def simulator(start: Callable[..., Program], arms_scene: Path) -> Program:
    """A simulator of `arms_scene` that runs."""
    program = start(BIN / "ligature", "run", arms_scene, "-p", "500", "--no-cameras")
    program.wait_for("first state published")
    return program


@pytest.fixture(scope="module")
def arms(simulator: Program, node: Any) -> Iterator[dict[str, Any]]:
    """A connected client for each of its arms."""
    from tests.ros import crtk

    kinds = {"PSM": crtk.Psm, "ECM": crtk.Arm, "MTM": crtk.Mtm}
    clients = {name: kinds[name[:3]](node, name) for name in ARMS}
    for client in clients.values():
        client.check_connections(10.0)
    yield clients
    for client in clients.values():
        client.close()


@pytest.fixture
def listen(node: Any) -> Iterator[Callable[..., Listener]]:
    """Makes listeners that end with the test."""
    listeners: list[Listener] = []

    def make(topic: str, type_: Any) -> Listener:
        listeners.append(Listener(node, topic, type_))
        return listeners[-1]

    yield make
    for listener in listeners:
        listener.close()


@pytest.fixture
def publish(node: Any) -> Iterator[Callable[..., Any]]:
    """Makes publishers that are connected to the simulator."""
    publishers: list[Any] = []

    def make(topic: str, type_: Any) -> Any:
        publisher = node.Publisher(topic, type_, queue_size=1000, tcp_nodelay=True)
        publishers.append(publisher)
        until(publisher.get_num_connections, f"somebody subscribes to {topic}", 10.0)
        return publisher

    yield make
    for publisher in publishers:
        publisher.unregister()


@pytest.fixture
def env(ros_env: dict[str, str]) -> Iterator[dict[str, str]]:
    """Environment of a master of its own, which is not the simulator's."""
    port = free_port()
    master = start_master(port, ros_env)
    yield dict(ros_env, ROS_MASTER_URI=f"http://127.0.0.1:{port}", PYTHONPATH=f"{ROOT}:{ros_env['PYTHONPATH']}")
    master.terminate()
    master.wait()


@pytest.fixture
def begin(env: dict[str, str]) -> Iterator[Callable[..., Program]]:
    """Starts programs on that master, which end with the test."""
    programs: list[Program] = []

    def run(*command: object) -> Program:
        programs.append(Program([str(word) for word in command], env))
        return programs[-1]

    yield run
    for program in reversed(programs):
        program.end(30.0)
