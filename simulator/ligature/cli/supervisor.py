"""The supervisor: starts the processes of a run, reports how they are, restarts or ends them."""

from __future__ import annotations

import os
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from queue import Empty, Queue
from typing import Any, NoReturn, TextIO, cast

from rich.console import Console
from rich.text import Text

from ligature.bus.leftovers import remove, remove_leftovers
from ligature.bus.stop import END_TIMEOUT, Stop, stop_on_signal
from ligature.cli.options import RunOptions
from ligature.cli.ros_packages import ros_problem
from ligature.process import end_with_parent, lower_priority, program

MASTER_TIMEOUT = 15.0
LAST_TIMEOUT = 1.8
"""Seconds after a signal at which the supervisor ends even if its output is no longer read."""

RESTART_PAUSE = 0.3
QUICK_DEATH, MAX_QUICK_DEATHS = 5.0, 5

_ENVIRONMENT = {
    "PYTHONUNBUFFERED": "1",
    "PYTHONIOENCODING": "utf-8",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
_DRAWING = ("window", "render", "cockpit")
"""Processes that a run can do without; status 0 means that they cannot draw here or have nothing to draw."""

_DRAWING_NICE = 10
"""Nice level of the processes that draw: software rendering at normal priority starves physics."""

_STYLES = {"error": "red", "problem": "red", "warning": "yellow", "finding": "dim"}

Event = tuple[str, str, str]
"""Process, event, text."""


def supervise(options: RunOptions) -> NoReturn:
    """Run from start to end, then leave with the exit status.

    Everything that the run had is gone by then. The interpreter would take apart what the simulator's modules hold,
    which takes a second on a busy machine.
    """
    output = Output(sys.stdout)
    status = Supervisor(options, Console(file=cast("TextIO", output), highlight=False, soft_wrap=True)).run()
    output.flush()
    os._exit(status)


class Output:
    """A text file whose failures end nothing: a run goes on when its log's disk is full, or nobody reads its output."""

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def write(self, text: str) -> int:
        """Write what can be written."""
        with suppress(OSError):
            self._file.write(text)
        return len(text)

    def flush(self) -> None:
        """Hand on what can be handed on."""
        with suppress(OSError):
            self._file.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


class Child:
    """One process of a run and the thread that listens to it."""

    def __init__(
        self, name: str, command: Sequence[str], events: Queue[Event], env: dict[str, str], nice: int = 0,
        inherited: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self.name, self._command, self._events, self._env, self._nice = name, list(command), events, env, nice
        self._inherited = inherited
        self.quick_deaths = 0
        self.start()

    def start(self) -> None:
        """Start the process, again after it died."""
        self.started = time.monotonic()
        self.process = subprocess.Popen(
            self._command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", errors="replace",
            bufsize=1, env=self._env, preexec_fn=self._prepare, start_new_session=True,
            pass_fds=self._inherited,
        )  # fmt: skip
        threading.Thread(target=self._listen, args=(self.process,), daemon=True).start()

    def _prepare(self) -> None:
        """Prepare the forked process, in its own session, before it executes the program."""
        end_with_parent()
        if self._nice:
            lower_priority(self._nice)

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("@"):
                event, _, text = line[1:].rstrip("\n").partition(" ")
                self._events.put((self.name, event, text))
            else:
                self._events.put((self.name, "log", line.rstrip("\n")))
        self._events.put((self.name, "ended", str(process.wait())))

    def end(self, timeout: float) -> None:
        """Ask the process to end; kill it after ``timeout`` seconds."""
        if self.process.poll() is None:
            self.process.terminate()
        try:
            self.process.wait(max(timeout, 0.0))
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


class Supervisor:
    """One run from start to end; `run` returns the exit status."""

    def __init__(self, options: RunOptions, console: Console) -> None:
        remove_leftovers()
        self._options = replace(options, bus=f"ligature-{os.getpid()}-{secrets.token_hex(4)}")
        self._console = console
        self._progress = self._console.status("loading the scene")
        self._events: Queue[Event] = Queue()
        self._scene = os.memfd_create("ligature-scene")  # physics puts it there for all other processes
        self._children: dict[str, Child] = {}
        self._begin = time.monotonic()
        self._published = self._over = False
        self._signalled = Stop(None)
        self._status = 0
        self._env = dict(os.environ, **_ENVIRONMENT)

    def run(self) -> int:
        """Run until Ctrl-C, a signal, the end of the terminal, or the end of the physics process."""
        asked = [signal.SIGINT, signal.SIGTERM]
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as under nohup
            asked.append(signal.SIGHUP)
        self._signalled = stop_on_signal(asked, LAST_TIMEOUT)
        try:
            self._start()
            while not self._stopping:
                try:
                    self._handle(*self._events.get(timeout=0.1))
                except Empty:
                    continue
        finally:
            self._end_all()
        return self._status

    @property
    def _stopping(self) -> bool:
        """Whether the run is over, by a signal or by itself."""
        return self._over or self._signalled.is_set()

    def _start(self) -> None:
        self._console.print(Text.assemble("loading ", (self._options.scene, "bold")))
        for note in self._options.notes:
            self._print(note, "dim")
        problem = ros_problem() if self._options.ros else ""
        if problem:
            self._fail(problem)
            return
        self._progress.start()
        self._start_process("physics", "ligature.cli.physics")
        if self._options.ros and self._master_begun():
            self._start_process("ros", "ligature.cli.ros_process")
            if self._master_answers() and self._options.task:
                self._start_process("tasks", "ligature.cli.tasks_process")

    def _start_process(self, name: str, module: str, nice: int = 0) -> None:
        """Start a process of `ligature.cli.process`."""
        command = program(module, self._options.to_text(), str(self._scene))
        self._children[name] = Child(name, command, self._events, self._env, nice, [self._scene])

    def _start_drawing(self, name: str, module: str, nice: int = _DRAWING_NICE) -> None:
        """Start a process that draws, by default at a lower scheduling priority; without a master the run is over."""
        if "ros" in self._children or not self._options.ros:
            self._start_process(name, module, nice)

    def _master_begun(self) -> bool:
        """Whether a ROS master answers or was started now, which may take another second to answer."""
        from ligature.cli import master  # HTTP, which physics does not wait for

        uri = self._env["ROS_MASTER_URI"] = self._env.get("ROS_MASTER_URI") or master.DEFAULT_MASTER
        if master.master_answers(uri):
            self._print(f"using the ROS master at {uri}")
            return True
        problem = master.obstacle(uri)
        if problem:
            self._fail(problem)
            return False
        self._print(f"no ROS master answers at {uri}: starting one")
        self._children["master"] = Child("master", master.command(uri), self._events, self._env)
        return True

    def _master_answers(self) -> bool:
        """Wait until the started master answers; the run ends when it does not."""
        from ligature.cli import master

        child, uri = self._children.get("master"), self._env["ROS_MASTER_URI"]
        if child is None:
            return True
        deadline = time.monotonic() + MASTER_TIMEOUT
        while time.monotonic() < deadline and not self._stopping and child.process.poll() is None:
            if master.master_answers(uri):
                return True
            time.sleep(0.05)
        if not self._stopping:
            why = "" if child.process.poll() is None else self._last_line("master")
            self._fail(f"the ROS master started for {uri} does not answer{why}; start 'roscore' and try again")
        return False

    def _last_line(self, process: str) -> str:
        """The last line that a process that has ended printed, for a message; takes all events till then."""
        line = ""
        with suppress(Empty):
            while (event := self._events.get(timeout=1.0))[:2] != (process, "ended"):
                line = f": {event[2].strip()}" if event[:2] == (process, "log") and event[2].strip() else line
        return line

    def _handle(self, process: str, event: str, text: str) -> None:
        if event == "ready":
            self._print(f"{process} ready: {text}")
            if process == "physics" and self._options.window:
                self._start_drawing("window", "ligature.cli.window_process")
            if process == "physics" and self._options.cockpit:
                # the page drives arms; a process of lower priority draws its pictures
                self._start_drawing("cockpit", "ligature.cli.cockpit_process", 0)
            if self._options.ros:
                self._progress.update("connecting to ROS")
            else:
                self._progress.stop()
        elif event == "cameras" and self._options.ros:
            self._start_drawing("render", "ligature.cli.render_process")
        elif event == "first-state":
            self._progress.stop()
            if not self._published:
                seconds = f" after {time.monotonic() - self._begin:.1f} s"
                self._console.print(Text.assemble(("first state published", "green"), seconds))
            self._published = True
        elif event in _STYLES:
            self._print(text, _STYLES[event])
            if event == "error":
                self._status = 2
        elif event == "fatal":
            self._fail(text)
        elif event == "ended":
            self._ended(process, int(text))
        elif process != "master" and text:
            self._print(f"{process}: {text}", "dim")

    def _ended(self, process: str, status: int) -> None:
        if self._stopping:
            return
        child = self._children[process]
        if process == "physics":
            self._fail(f"the physics process ended with status {status}; the run is over")
            return
        if process in _DRAWING and status == 0:
            return
        lived = time.monotonic() - child.started
        child.quick_deaths = child.quick_deaths + 1 if lived < QUICK_DEATH else 0
        if child.quick_deaths > MAX_QUICK_DEATHS and process in _DRAWING:
            self._print(f"the {process} process keeps failing (status {status}); continuing without it", "yellow")
            return
        if child.quick_deaths > MAX_QUICK_DEATHS:
            self._fail(f"the {process} process keeps failing (status {status}); the run is over")
            return
        self._print(f"the {process} process ended with status {status}; restarting it", "yellow")
        time.sleep(RESTART_PAUSE if child.quick_deaths else 0.0)
        child.start()

    def _fail(self, text: str) -> None:
        self._print(text, "red")
        self._status = self._status or 1
        self._over = True

    def _end_all(self) -> None:
        self._over = True
        self._progress.stop()
        deadline = time.monotonic() + END_TIMEOUT
        order = [self._children[n] for n in (*_DRAWING, "tasks", "ros", "physics", "master") if n in self._children]
        for child in order[:-1] if "master" in self._children else order:
            if child.process.poll() is None:
                child.process.terminate()
        for child in order:
            child.end(deadline - time.monotonic())
        remove(self._options.bus)
        os.close(self._scene)
        self._print("ended")

    def _print(self, text: str, style: str = "") -> None:
        self._console.print(text, style=style, markup=False)
