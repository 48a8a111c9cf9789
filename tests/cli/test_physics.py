"""The loop of the physics process: it obeys the clock of a client and survives whatever commands state."""

from __future__ import annotations

import math
import os
import random
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from ligature import Simulation, load
from ligature.adf import Diagnostic, Mark, Severity
from ligature.bus import Block, Mailbox, Throttle
from ligature.bus.codec import Message, encode
from ligature.cli.loop import Loop
from ligature.cli.options import RunOptions
from ligature.model.commands import (
    MAX_FORCE,
    MAX_POSITION,
    MAX_VELOCITY,
    ActuatorCommand,
    BodyCommand,
    CommandType,
    PlaceCommand,
    Release,
    Reset,
)
from ligature.model.scene import Scene

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


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


def test_an_alarm_of_a_file_whose_name_is_no_utf_8_ends_no_run(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    place = Mark(Path("no UTF-8 \udcff", "model.yaml"), 1, 1)
    run.simulation.problems.append(Diagnostic(Severity.WARNING, "too fast", place, code="speed"))
    run.loop._mark -= 2.0
    run.loop._figures()
    assert b"no UTF-8 \\udcff/model.yaml:1:1: warning: too fast" in run.block.figures["alarm"][0]
    assert b"too fast" in run.block.figures["findings"]["text"].tobytes()
    assert "too fast" in capsys.readouterr().out


def test_what_fails_again_and_again_hides_nothing_and_fills_no_terminal(
    run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a client does that asks at 120 Hz for a missing body."""
    lines, noted = list[str](), set[bytes]()
    for second in range(6):
        run.simulation.problems.clear()
        run.simulation.problems.extend([Diagnostic(Severity.WARNING, "no such body")] * 120)
        run.simulation.problems.extend([Diagnostic(Severity.ERROR, "diverged")] * (second == 3))
        run.loop._report(100.0 + second)
        lines += [line for line in capsys.readouterr().out.splitlines() if line.startswith("@warning")]
        noted |= set(run.block.figures["findings"]["text"].reshape(-1).tolist())
    assert [line for line in lines if "diverged" in line] == ["@warning error: diverged"]
    assert lines.count("@warning warning: no such body (120 times)") == 3, "every two seconds"
    assert len(lines) == 4
    assert {b"error: diverged", b"warning: no such body"} <= noted


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


def test_figures_report_rate_and_rejections_once_a_second(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    bad = BodyCommand(0, CommandType.FORCE, (float("nan"),) * 6)
    run.push(bad, bad, Reset())
    run.turn_for(1.1)
    figures = run.block.figures[0]
    assert figures["received"] == 3 and figures["rejected"] == 2
    assert figures["loop_hz"] == pytest.approx(200, rel=0.15)
    assert figures["real_time_factor"] == pytest.approx(1.0, rel=0.15)
    assert figures["tick_p50"] <= figures["tick_p99"] <= figures["tick_max"] < 0.1
    assert "@warning 2 commands rejected: the command must be finite" in capsys.readouterr().out


def random_commands(scene: Scene, rng: random.Random) -> Iterator[Message]:
    """Commands of all kinds with good, absurd and impossible numbers."""

    def number(bound: float) -> float:
        return rng.choice([0.0, bound, -bound, 5e-324, math.nan, math.inf, 1e300, *(rng.gauss(0, 1),) * 20])

    def pose() -> tuple[float, ...]:
        quaternion = [rng.gauss(0, 1) for _ in range(4)]
        length = math.hypot(*quaternion) * rng.choice([1.0, 1.0, 1.05, 0.5])
        return (*(number(MAX_POSITION) for _ in range(3)), *(v / length for v in quaternion))

    names = [body.identity.identifier for body in scene.bodies]
    while True:
        type_, count = rng.choice(list(CommandType)), rng.choice([0, 8, 64])
        bound = MAX_VELOCITY if type_ is CommandType.VELOCITY else MAX_FORCE
        target = pose() if type_ is CommandType.POSITION else tuple(number(bound) for _ in range(6))
        types = tuple(rng.choice(list(CommandType)) for _ in range(count))
        values = tuple(number(MAX_FORCE) for _ in range(count))
        yield BodyCommand(rng.randrange(len(scene.bodies) + 1), type_, target, types, values)
        yield ActuatorCommand(rng.randrange(3), rng.random() < 0.6, rng.choice(names), rng.choice([None, pose()]))
        yield PlaceCommand(rng.choice(["camera", "light"]), rng.randrange(2), rng.choice([None, pose()]))
        yield Release(rng.choice(["body", "actuator", "camera"]), rng.randrange(3))
        if rng.random() < 0.02:
            yield Reset(rng.random() < 0.5)


def test_no_command_makes_the_state_anything_but_finite() -> None:
    simulation = Simulation(load(SMALL))
    block = Block.create(f"ligature-{os.getpid()}-f0", simulation.state.dtype)
    mailbox = Mailbox(simulation.scene, block.rings)
    commands = random_commands(simulation.scene, random.Random(5))
    for _ in range(300):
        for _ in range(3):
            block.rings["ros"].push(encode(next(commands)))
        for message in mailbox.take():
            simulation.apply(message)  # type: ignore[arg-type]
        simulation.step()
        for name in ("body_pose", "body_twist", "joint_position", "joint_velocity", "camera_world"):
            assert np.isfinite(simulation.state[name]).all(), name
    assert mailbox.rejected > 50
    block.close()
    simulation.close()
