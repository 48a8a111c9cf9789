"""The reference beside which benchmarks state times: a step of a chain of 40 bodies and point joints in Bullet.

It runs in a process of its own, in Bullet as it is by default. Bullet keeps the distance from which on contacts are
made in a variable of the whole process, and the simulator sets it to 2 mm instead of 20 mm: beside a simulation the
capsules of the chain have no contacts with their neighbours, and a step takes two thirds of the time.

A shared machine is up to twice as slow for tenths of a second: `Reference` is timed in turn with short spans of
what is measured, and the median of their ratios counts.

``python -m tests.bench.reference`` prints both.
"""

from __future__ import annotations

import contextlib
import statistics
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

BODIES, STEPS = 40, 1000
SPAN = 50
"""Steps of the reference after each span of what is measured."""

BY_DEFAULT, BESIDE_A_SIMULATION = 0.02, 0.002
"""Distances in metres from which on Bullet makes contacts."""


class Times(NamedTuple):
    """Microseconds of one step, on the clock and of the processor."""

    wall: float
    processor: float


class Reference:
    """The reference in another process, to be timed again and again; a context manager that ends it."""

    def __init__(self, contacts_within: float = BY_DEFAULT) -> None:
        words = [sys.executable, str(Path(__file__).resolve()), str(contacts_within)]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=pipe, text=True)

    def __enter__(self) -> Reference:
        self.time(STEPS)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._process.communicate()

    def time(self, steps: int = SPAN) -> Times:
        """Take ``steps`` steps now; the process of the caller waits."""
        own = self._process
        assert own.stdin is not None and own.stdout is not None and own.stderr is not None
        with contextlib.suppress(BrokenPipeError):  # no answer comes then
            own.stdin.write(f"{steps}\n")
            own.stdin.flush()
        answer = own.stdout.readline().split()
        if not answer:
            raise RuntimeError(f"the reference ended: {own.stderr.read()}")
        return Times(*map(float, answer))


def chain_step_us(contacts_within: float = BY_DEFAULT) -> float:
    """Microseconds of one step of the reference in another process, on the clock."""
    with Reference(contacts_within) as reference:
        return reference.time(STEPS).wall


def ratio(pairs: list[tuple[float, float]]) -> float:
    """Median of times over the reference's times that were taken in turn with them."""
    return statistics.median(one / other for one, other in pairs)


def _chain(contacts_within: float) -> int:
    """The chain as it hangs, in a world of its own; returns Bullet's number of that world."""
    import pybullet

    client = int(pybullet.connect(pybullet.DIRECT))
    pybullet.setGravity(0, 0, -9.8, physicsClientId=client)
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=1e-3, numSolverIterations=50, contactBreakingThreshold=contacts_within, physicsClientId=client
    )
    shape = pybullet.createCollisionShape(pybullet.GEOM_CAPSULE, radius=2e-3, height=8e-3, physicsClientId=client)
    last = pybullet.createMultiBody(0, -1, physicsClientId=client)
    for i in range(BODIES):
        body = pybullet.createMultiBody(0.03, shape, basePosition=[0, 0, -0.012 * (i + 0.5)], physicsClientId=client)
        low, high = [0, 0, -0.006 if i else 0], [0, 0, 0.006]
        pybullet.createConstraint(
            last, -1, body, -1, pybullet.JOINT_POINT2POINT, [0, 0, 0], low, high, physicsClientId=client
        )
        last = body
    return client


def serve(contacts_within: float) -> None:
    """Take as many steps as each line of standard input says, and answer with what one took.

    After `STEPS` of them the chain hangs as at first.
    """
    import pybullet

    client, left = _chain(contacts_within), STEPS
    for line in sys.stdin:
        steps = int(line)
        if left < steps:
            pybullet.disconnect(client)
            client, left = _chain(contacts_within), STEPS
        left -= steps
        wall, processor = time.perf_counter(), time.process_time()
        for _ in range(steps):
            pybullet.stepSimulation(physicsClientId=client)
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        sys.stdout.write(f"{wall / steps * 1e6} {processor / steps * 1e6}\n")
        sys.stdout.flush()


def main() -> int:
    """Entry point: serve a distance, or print what a step takes with both."""
    if sys.argv[1:]:
        serve(float(sys.argv[1]))
        return 0
    for within in (BY_DEFAULT, BESIDE_A_SIMULATION) * 3:
        sys.stdout.write(f"contacts within {within * 1e3:g} mm: {chain_step_us(within):.0f} us a step\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
