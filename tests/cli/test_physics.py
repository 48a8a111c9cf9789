"""The loop of the physics process: it obeys the clock of a client and outlives whatever commands say."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from ligature import Simulation, load
from ligature.bus import Block, Throttle
from ligature.bus.codec import Message, encode
from ligature.cli.options import RunOptions
from ligature.cli.physics import Loop
from ligature.model.commands import BodyCommand, CommandType, Reset


class Run:
    """A loop at 200 updates per second and the ring into which its commands go."""

    def __init__(self, folder: Path) -> None:
        model = folder / "ball.yaml"
        model.write_text(
            "bodies: [BODY Ball]\nBODY Ball:\n  name: Ball\n  mass: 1.0\n  inertia: {ix: 1, iy: 1, iz: 1}\n"
        )
        self.simulation = Simulation(load(model), update=0.005)
        self.block = Block.create(f"ligature-{os.getpid()}-{id(self):x}", self.simulation.state.dtype)
        self.loop = Loop(self.simulation, self.block, RunOptions(str(model), rate=200.0))

    def push(self, *messages: Message) -> None:
        for message in messages:
            assert self.block.rings["ros"].push(encode(message))

    def turn_for(self, seconds: float) -> int:
        """Updates made within ``seconds`` of the wall clock."""
        before = self.simulation.state["update"][0]
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.loop.turn()
        return int(self.simulation.state["update"][0] - before)


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    made = Run(tmp_path)
    yield made
    made.block.close()
    made.simulation.close()


def test_updates_keep_pace_with_the_wall_clock(run: Run) -> None:
    assert run.turn_for(0.5) == pytest.approx(100, abs=15)


def test_a_client_that_repeats_an_idle_world_command_changes_no_pace(run: Run) -> None:
    updates, begin = 0, time.monotonic()
    for _ in range(50):
        run.push(Throttle(False, False, 0))
        updates += run.turn_for(0.008)
    assert updates == pytest.approx(200 * (time.monotonic() - begin), abs=15)


def test_a_paused_world_waits_and_runs_one_batch_for_each_edge(run: Run) -> None:
    run.turn_for(0.05)
    run.push(Throttle(True, False, 7))
    run.turn_for(0.02)
    assert run.turn_for(0.1) == 0
    run.push(Throttle(True, True, 7))
    assert run.turn_for(0.1) == 7
    run.push(Throttle(True, True, 7))
    assert run.turn_for(0.05) == 0


def test_readers_see_what_the_loop_wrote(run: Run) -> None:
    run.turn_for(0.05)
    reader = Block.attach(run.block.path.name, run.simulation.state.dtype)
    seen = np.zeros_like(run.simulation.state)
    assert reader.read(seen) and seen["update"] == run.simulation.state["update"]
    assert seen["wall_time"] > 0 and abs(seen["stamp"] - time.time()) < 1
    reader.close()


def test_figures_tell_rate_and_rejections_once_a_second(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    bad = BodyCommand(0, CommandType.FORCE, (float("nan"),) * 6)
    run.push(bad, bad, Reset())
    run.turn_for(1.1)
    figures = run.block.figures[0]
    assert figures["received"] == 3 and figures["rejected"] == 2
    assert figures["loop_hz"] == pytest.approx(200, rel=0.15)
    assert figures["real_time_factor"] == pytest.approx(1.0, rel=0.15)
    assert figures["tick_p50"] <= figures["tick_p99"] <= figures["tick_max"] < 0.1
    assert "@warning 2 commands rejected: the command must be finite" in capsys.readouterr().out
