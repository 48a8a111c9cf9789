"""Hours of servo on both arms, as fast as the machine allows: memory, speed and tracking must not drift.

``python -m tests.bench.soak [HOURS [MODELS]]`` (2 hours of the small scene by default; `make soak`). The loop is that of the physics process, with its
shared memory, mailbox and event log; commands come at 200 Hz of simulated time, joint values to PSM1, poses to PSM2,
jaws to both. Exit status 1 when something drifted.
"""

from __future__ import annotations

import gc
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from ligature.bus import Block
from ligature.bus.outbox import Outbox
from ligature.cli.loop import Loop
from ligature.cli.options import RunOptions, model_indices
from ligature.model.frames import matrix_pose7
from ligature.model.state import new_state
from ligature.robots.commands import VERBS
from ligature.simulation import Simulation
from numpy.typing import NDArray

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "scenes" / "suturing_small" / "launch.yaml"
RATE = 200.0
SAMPLES = 60
MEMORY_GROWTH = 0.01
SPEED_DRIFT = 0.10
SWING = np.array([0.2, 0.15, 0.02, 0.5, 0.3, 0.3])
HOME = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class Sample:
    """What one part of the run took: seconds of processor an update, resident bytes, worst following error."""

    cpu: float
    memory: int
    astray: float


def resident_bytes() -> int:
    """Resident memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


class Operator:
    """Commands both arms through the bus and looks at what the bus states of them."""

    def __init__(self, simulation: Simulation, block: Block) -> None:
        names = list(simulation.arms)
        self._arms = {name: names.index(name) for name in ("PSM1", "PSM2")}
        self._kinematics = {name: simulation.arms[name].kinematics for name in self._arms}
        self._block, self._ring = block, block.rings["ros"]
        self._outbox = Outbox(self._ring)
        self._state = new_state(simulation.scene)
        self.seen = 0

    def command(self, name: str, verb: str, value: Array | list[float] | str) -> None:
        self._outbox.push(VERBS[verb](self._arms[name], value if isinstance(value, str) else tuple(map(float, value))))

    def ready(self) -> None:
        """Switch both arms on."""
        for name in self._arms:
            self.command(name, "state_command", "home")

    def servo(self, t: float) -> float:
        """Send the set-points of time ``t``; returns the worst following error that the newest state shows."""
        self._ring.beat()
        q = HOME + SWING * np.sin(2.0 * np.pi * 0.2 * t + np.arange(6))
        self.command("PSM1", "servo_jp", q)
        self.command("PSM2", "servo_cp", matrix_pose7(self._kinematics["PSM2"].forward(q)))
        for name in self._arms:
            self.command(name, "jaw/servo_jp", [0.3 + 0.3 * np.sin(t)])
        self.seen += self._block.read(self._state)
        arms = self._state["arm"][0][list(self._arms.values())]
        error: Array = np.abs(arms["measured_js"][:, 0, :6] - arms["setpoint_js"][:, 0, :6])
        return float(error.max())


def run(loop: Loop, operator: Operator, updates: int, begin: float) -> Sample:
    """Some updates of servo."""
    cpu, astray = time.process_time(), 0.0
    for k in range(updates):
        astray = max(astray, operator.servo(begin + k / RATE))
        loop.turn()
    return Sample((time.process_time() - cpu) / updates, resident_bytes(), astray)


def verdict(samples: list[Sample]) -> list[str]:
    """What drifted between the first and the last part of a run."""
    quarter = max(1, len(samples) // 4)
    first, last = samples[:quarter], samples[-quarter:]
    growth = last[-1].memory / first[0].memory - 1.0
    slower = np.median([s.cpu for s in last]) / np.median([s.cpu for s in first]) - 1.0
    wander = max(s.astray for s in last) / max(s.astray for s in first) - 1.0
    sys.stdout.write(
        f"memory {first[0].memory / 1e6:.1f} MB, growth {100 * growth:+.2f} %; processor time an update "
        f"{1e6 * np.median([s.cpu for s in first]):.0f} µs, drift {100 * slower:+.1f} %; worst following error "
        f"{max(s.astray for s in samples):.5f}, drift {100 * wander:+.1f} %\n"
    )
    limits = (("memory", growth, MEMORY_GROWTH), ("processor time", slower, SPEED_DRIFT), ("tracking", wander, 0.1))
    return [f"{what} grew by {100 * value:.1f} %" for what, value, limit in limits if value > limit]


def main() -> int:
    """Entry point."""
    hours = float(sys.argv[1]) if len(sys.argv) > 1 else 2.0
    updates = int(hours * 3600.0 * RATE / SAMPLES)
    models = model_indices(sys.argv[2]) if len(sys.argv) > 2 else None
    options = RunOptions(str(SCENE), models, rate=RATE, speed=0.0, bus=f"ligature-{os.getpid()}-50a4")
    simulation = Simulation(options.load(), 1e-3, 1.0 / RATE)
    block = Block.create(options.bus, simulation.state.dtype)
    try:
        loop, operator = Loop(simulation, block, options), Operator(simulation, block)
        operator.ready()
        for _ in range(int(5.0 * RATE)):  # power up and home
            loop.turn()
        run(loop, operator, int(20.0 * RATE), 0.0)
        gc.collect()
        gc.freeze()
        gc.disable()
        samples = []
        begin = time.monotonic()
        for k in range(SAMPLES):
            samples.append(run(loop, operator, updates, 20.0 + k * updates / RATE))
            if k % 10 == 9:
                done = (k + 1) * updates / RATE
                sys.stdout.write(
                    f"{done / 3600.0:.2f} h: {done / (time.monotonic() - begin):.2f} times real time, "
                    f"{samples[-1].memory / 1e6:.1f} MB\n"
                )
                sys.stdout.flush()
        problems = verdict(samples)
    finally:
        block.close()
    sys.stdout.write("".join(f"{problem}\n" for problem in problems) or f"nothing drifted in {hours:g} h\n")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
