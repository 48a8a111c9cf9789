"""The reference beside which benchmarks state times: a step of a chain of 40 bodies and point joints in Bullet.

It runs in a process of its own, in Bullet as it is by default. Bullet keeps the distance from which on contacts are
made in a variable of the whole process, and the simulator sets it to 2 mm instead of 20 mm: beside a simulation the
capsules of the chain have no contacts with their neighbours, and a step takes two thirds of the time.

``python -m tests.bench.reference`` prints both.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

BODIES, STEPS = 40, 1000
BY_DEFAULT, BESIDE_A_SIMULATION = 0.02, 0.002
"""Distances in metres from which on Bullet makes contacts."""


def chain_step_us(contacts_within: float = BY_DEFAULT, clock: str = "perf_counter") -> float:
    """Microseconds of one step of the reference in another process; of the processor by the clock "process_time"."""
    words = [sys.executable, str(Path(__file__).resolve()), str(contacts_within), clock]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    return float(done.stdout.splitlines()[-1])


def measure(contacts_within: float, clock: str) -> float:
    """Microseconds of one step of the reference in this process, by a clock of the module `time`."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
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
    now = getattr(time, clock)
    begin = now()
    for _ in range(STEPS):
        pybullet.stepSimulation(physicsClientId=client)
    taken = now() - begin
    pybullet.disconnect(client)
    return taken / STEPS * 1e6


def main() -> int:
    """Entry point: the reference with the distance and the clock of the arguments, or with both distances in turn."""
    if sys.argv[1:]:
        sys.stdout.write(f"{measure(float(sys.argv[1]), sys.argv[2])}\n")
        return 0
    for within in (BY_DEFAULT, BESIDE_A_SIMULATION) * 3:
        sys.stdout.write(f"contacts within {within * 1e3:g} mm: {chain_step_us(within):.0f} us a step\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
