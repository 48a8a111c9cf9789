"""One process of a run: what it states arrives, and it ends when reported, or is killed."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from queue import Queue

import pytest
from ligature.bus.leftovers import FOLDER
from ligature.cli.options import RunOptions
from ligature.cli.supervisor import Child, Event, Output, Supervisor
from rich.console import Console

from tests.conftest import ROOT


def child(code: str) -> tuple[Child, Queue[Event]]:
    events: Queue[Event] = Queue()
    return Child("tester", [sys.executable, "-u", "-c", code], events, dict(os.environ)), events


def next_of(events: Queue[Event]) -> Event:
    return events.get(timeout=10)


def test_events_and_log_lines_are_distinguished() -> None:
    _, events = child("print('@ready 3 bodies'); print('hello'); print('@beat')")
    assert next_of(events) == ("tester", "ready", "3 bodies")
    assert next_of(events) == ("tester", "log", "hello")
    assert next_of(events) == ("tester", "beat", "")
    assert next_of(events) == ("tester", "ended", "0")


def test_a_process_that_draws_stands_behind_those_in_other_sessions_too() -> None:
    """Its session's group is nice, where the kernel shares the processor among sessions."""
    code = "import os; print(os.nice(0), open('/proc/self/autogroup').read().strip())"
    events: Queue[Event] = Queue()
    Child("drawing", [sys.executable, "-c", code], events, dict(os.environ), nice=7)
    _, event, text = next_of(events)
    if not Path("/proc/self/autogroup").exists():
        pytest.skip("this kernel shares the processor among processes alone")
    assert event == "log"
    assert text.startswith("7 /autogroup-") and text.endswith(" nice 7")


def test_bytes_that_are_no_text_do_not_hide_the_end() -> None:
    _, events = child("import os; os.write(1, bytes([0xff, 0xfe, 10])); raise SystemExit(3)")
    assert next_of(events) == ("tester", "log", "\ufffd\ufffd")
    assert next_of(events) == ("tester", "ended", "3")


def test_a_process_that_does_not_want_to_end_is_killed() -> None:
    process, events = child("import signal, time; signal.signal(15, signal.SIG_IGN); print('up'); time.sleep(60)")
    assert next_of(events) == ("tester", "log", "up")
    begin = time.monotonic()
    process.end(0.2)
    assert time.monotonic() - begin < 2.0
    assert next_of(events) == ("tester", "ended", "-9")


def test_a_process_starts_again() -> None:
    process, events = child("print('once')")
    assert [next_of(events)[1] for _ in range(2)] == ["log", "ended"]
    process.start()
    assert [next_of(events)[1] for _ in range(2)] == ["log", "ended"]


@pytest.fixture
def handlers() -> Iterator[None]:
    """The handlers of signals stay those of the tests."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("handlers")
def test_a_master_that_ends_is_reported_with_its_last_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{port}")
    failing = [sys.executable, "-c", "import sys; print('first'); sys.exit('its log is somebody else\\'s')"]
    monkeypatch.setattr("ligature.cli.master.command", lambda _: failing)
    text = io.StringIO()
    scene = ROOT / "scenes" / "suturing_small" / "launch.yaml"
    assert Supervisor(RunOptions(str(scene)), Console(file=text, soft_wrap=True)).run() == 1
    assert (
        f"for http://127.0.0.1:{port} does not answer: its log is somebody else's; start 'roscore'" in text.getvalue()
    )


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("gone", ["full", "closed"])
def test_a_run_goes_on_when_its_output_cannot_be_written(gone: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A log on a full disk, and a reader such as `head` that has left."""
    monkeypatch.setenv("ROS_MASTER_URI", "foo")
    if gone == "full":
        file = open("/dev/full", "w", encoding="utf-8")  # noqa: SIM115
    else:
        reader, pipe = os.pipe()
        os.close(reader)
        file = os.fdopen(pipe, "w")
    console = Console(file=Output(file), soft_wrap=True)  # type: ignore[arg-type]
    assert Supervisor(RunOptions("none.yaml"), console).run() == 1
    with contextlib.suppress(OSError):
        file.close()


@pytest.mark.usefixtures("handlers")
def test_a_run_that_cannot_have_a_master_states_why_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", "foo")
    text = io.StringIO()
    options = RunOptions(str(tmp_path / "[red]launch.yaml"), notes=("-t 0: the step is fixed",))
    supervisor = Supervisor(options, Console(file=text, soft_wrap=True))
    assert supervisor.run() == 1
    lines = text.getvalue().splitlines()
    assert lines == [
        f"loading {tmp_path}/[red]launch.yaml",
        "-t 0: the step is fixed",
        "ROS_MASTER_URI 'foo' is not an address; write one such as http://127.0.0.1:11311",
        "ended",
    ]
    assert not list(FOLDER.glob(f"ligature-{os.getpid()}-*"))
