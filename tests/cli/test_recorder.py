"""Parts of a run are recorded on demand: simulated again they end in the same bits, and what fails is reported."""

from __future__ import annotations

import io
import os
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from ligature import Simulation
from ligature.bus import Block, Recording, Throttle
from ligature.bus.codec import Message, encode
from ligature.bus.events import RUN
from ligature.bus.record import Record
from ligature.cli.loop import Loop
from ligature.cli.options import RunOptions
from ligature.cli.replay import replay
from ligature.model.commands import Reset
from ligature.robots.commands import PlaceJp, ServoJp
from rich.console import Console

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"
MODELS = (3, 4)
"""The second arm and its jaw alone."""

HOME = (0.1, 0.1, 0.12, 0.0, 0.0, 0.0)


class Run:
    """The physics of a run in this process, with a page's ring and what is asked to it."""

    def __init__(self, **options: Any) -> None:
        self.options = RunOptions(str(SCENE), MODELS, rate=500.0, speed=20.0, **options)
        self.simulation = Simulation(self.options.load(), 1e-3, 2e-3)
        self.simulation.step(2)
        self.block = Block.create(f"ligature-{os.getpid()}-{id(self):x}", self.simulation.state.dtype)
        self.loop = Loop(self.simulation, self.block, self.options)
        self.output: list[str] = []

    def push(self, *messages: Message) -> None:
        for message in messages:
            assert self.block.rings["cockpit"].push(encode(message))
        self.loop.turn()

    def updates(self, count: int) -> None:
        goal = int(self.simulation.state["update"][0]) + count
        while self.simulation.state["update"][0] < goal:
            self.loop.turn()

    def hears(self, text: str) -> None:
        deadline = time.monotonic() + 20.0
        while not any(text in output for output in self.output):
            assert time.monotonic() < deadline, f"'{text}' is not among {self.output}"
            self.loop.turn()
            self.output += [event.value for event in self.block.events.read() if event.arm == RUN]

    def close(self) -> None:
        self.block.close()
        self.simulation.close()


@pytest.fixture
def start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Run]]:
    monkeypatch.chdir(tmp_path)
    runs: list[Run] = []

    def begin(**options: Any) -> Run:
        runs.append(Run(**options))
        return runs[-1]

    yield begin
    for run in runs:
        run.close()


def again(file: Path) -> tuple[int, str]:
    console = Console(file=io.StringIO(), soft_wrap=True)
    return replay(file, None, "", 1.0, console), console.file.getvalue()  # type: ignore[attr-defined]


def moved(run: Run) -> None:
    """The arm goes somewhere, the scene is reset, and the arm goes on."""
    run.push(ServoJp(0, (0.12, 0.1, 0.12, 0.0, 0.0, 0.1)))
    run.updates(20)
    run.push(Reset())
    run.updates(5)
    run.push(ServoJp(0, (0.14, 0.1, 0.12, 0.1, 0.0, 0.1)))
    run.updates(20)


def test_two_parts_of_a_run_are_simulated_again_bit_for_bit(start: Callable[..., Run]) -> None:
    run = start(cockpit="127.0.0.1:0")
    run.push(PlaceJp(0, HOME))
    run.updates(10)
    for name in ("first", "second.record"):
        run.push(Recording(name))
        run.hears("recording to 'recordings/")
        assert run.block.figures["recording"][0] == 1
        assert not Path("recordings", "first.record").exists() or name != "first"
        begun = run.simulation.time
        moved(run)
        run.push(Recording(""))
        length = run.simulation.time - begun
        run.hears(f"recorded {length:.1f} s to 'recordings/{name.removesuffix('.record')}.record'")
        assert run.block.figures["recording"][0] == 0
        status, output = again(Path("recordings", f"{name.removesuffix('.record')}.record"))
        assert status == 0, output
        assert "the same bits: " in output
        found = re.search(r"the recording covers the last (\S+) s", output)
        assert found and float(found[1]) == pytest.approx(length, abs=0.01)
        run.output.clear()
    assert sorted(path.name for path in Path("recordings").iterdir()) == ["first.record", "second.record"]


def test_a_run_that_ends_ends_its_recordings(start: Callable[..., Run]) -> None:
    run = start(record="whole.record")
    run.push(PlaceJp(0, HOME), Recording("part"))
    run.updates(10)
    run.loop.end()
    part, whole = Record.read(Path("recordings/part.record")), Record.read(Path("whole.record"))
    assert part.end == whole.end == run.simulation.state_hash()
    assert part.begun and not whole.begun
    for file in ("recordings/part.record", "whole.record"):
        status, output = again(Path(file))
        assert status == 0, output


def test_a_paused_run_is_recorded_too(start: Callable[..., Run]) -> None:
    run = start(cockpit="127.0.0.1:0")
    run.push(Throttle(True, False, 1))
    run.push(Recording("paused"))
    before = int(run.simulation.state["update"][0])
    run.push(Throttle(True, True, 3))
    run.updates(before + 3 - int(run.simulation.state["update"][0]))
    run.push(Recording(""))
    run.hears("recorded 0.0 s to")
    record = Record.read(Path("recordings/paused.record"))
    assert record.updates - record.start == 3
    assert again(Path("recordings/paused.record"))[0] == 0


@pytest.mark.parametrize("what", ["exists", "folder", "name", "no page"])
def test_what_cannot_be_recorded_is_reported_and_the_run_goes_on(
    start: Callable[..., Run], what: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run = start() if what == "no page" else start(cockpit="127.0.0.1:0")
    if what == "exists":
        Path("recordings").mkdir()
        Path("recordings/mine.record").write_text("mine")
        words = "cannot record: 'recordings/mine.record' exists already"
    elif what == "folder":
        Path("recordings").write_text("a file")
        words = "cannot record: File exists: 'recordings/mine.record'"
    elif what == "no page":
        words = "cannot record this run: the run was started without --cockpit and without --record"
    if what == "name":
        run.push(Recording("../mine"))
        assert run.loop._mailbox.last_rejection.startswith("'../mine' is not a valid name of a recording")
    else:
        run.push(Recording("mine"))
        run.hears(words)
        assert f"@warning {words}" in capsys.readouterr().out
    assert run.block.figures["recording"][0] == 0
    run.updates(5)
    run.loop.end()
    assert not Path("../mine").exists()
    assert [path.name for path in Path().rglob("*.active")] == []


def test_a_disk_that_fills_up_ends_the_recording_and_not_the_run(start: Callable[..., Run]) -> None:
    """/dev/full is a disk without room: what the part is written to becomes it."""
    run = start(cockpit="127.0.0.1:0")
    run.push(Recording("part"))
    run.updates(5)
    with open("/dev/full", "wb") as full:
        os.dup2(full.fileno(), run.loop._recorder._excerpt._file.fileno())  # type: ignore[union-attr]
    run.push(Recording(""))
    run.hears("the recording failed: No space left on device: 'recordings/part.record'")
    assert list(Path("recordings").iterdir()) == []
    run.push(Recording("next"))
    run.updates(5)
    run.push(Recording(""))
    run.hears("recorded 0.0 s to 'recordings/next.record'")
    assert again(Path("recordings/next.record"))[0] == 0


def test_a_journal_without_room_is_reported_when_a_recording_is_asked_for(
    start: Callable[..., Run], capsys: pytest.CaptureFixture[str]
) -> None:
    run = start(cockpit="127.0.0.1:0")
    with open("/dev/full", "wb") as full:
        os.dup2(full.fileno(), run.loop._recorder._journal._file.fileno())  # type: ignore[union-attr]
    run.push(PlaceJp(0, HOME))
    run.push(Recording("part"))
    run.hears("cannot record: No space left on device: 'recordings/part.record'")
    run.loop._recorder.flush()
    run.push(Recording("part"))
    run.hears("cannot record this run: No space left on device")
    run.updates(5)
    run.loop.end()
    assert not list(Path("recordings").iterdir())
