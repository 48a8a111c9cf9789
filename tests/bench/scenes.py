"""How fast scenes run, beside a reference of the same run: a 40-body chain of point joints in Bullet.

``python -m tests.bench.scenes``
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

import ligature  # imports Bullet without its banner
from ligature.cli.bench import measure
from ligature.model.scene import Scene

ROOT = Path(__file__).resolve().parents[2]
ROUNDS = 3
SECONDS = 2.0


def chain_step_us() -> float:
    """Microseconds of one step of the reference: 40 bodies and point joints hanging in Bullet."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.8, physicsClientId=client)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=1e-3, numSolverIterations=50, physicsClientId=client)
    shape = pybullet.createCollisionShape(pybullet.GEOM_CAPSULE, radius=2e-3, height=8e-3, physicsClientId=client)
    last = pybullet.createMultiBody(0, -1, physicsClientId=client)
    for i in range(40):
        body = pybullet.createMultiBody(0.03, shape, basePosition=[0, 0, -0.012 * (i + 0.5)], physicsClientId=client)
        low, high = [0, 0, -0.006 if i else 0], [0, 0, 0.006]
        pybullet.createConstraint(
            last, -1, body, -1, pybullet.JOINT_POINT2POINT, [0, 0, 0], low, high, physicsClientId=client
        )
        last = body
    begin = time.perf_counter()
    for _ in range(1000):
        pybullet.stepSimulation(physicsClientId=client)
    pybullet.disconnect(client)
    return (time.perf_counter() - begin) * 1e3


def scenes() -> list[tuple[str, Scene]]:
    """Name and scene of what is measured."""
    corpus = (
        Path(os.environ.get("LIGATURE_CORPUS", ROOT.parent / "shared" / "corpus")) / "suturing_scene" / "launch.yaml"
    )
    found = [("suturing_small", ligature.load(ROOT / "scenes" / "suturing_small" / "launch.yaml"))]
    if corpus.exists():
        lab = ligature.load(corpus, (10, 11, 6, 7, 8, 9))
        found += [
            ("corpus: phantom, needle, thread, 2 PSMs", lab),
            ("corpus: phantom, needle, 2 PSMs, no thread", replace(lab, rods=())),
            ("corpus: 2 PSMs", ligature.load(corpus, (6, 7, 8, 9))),
        ]
    return found


def main() -> int:
    """Entry point."""
    reference = statistics.median(chain_step_us() for _ in range(ROUNDS))
    sys.stdout.write(f"reference, 40 Bullet bodies with point joints: {reference:.0f} us a step\n")
    for name, scene in scenes():
        for rate in (200.0, 1000.0):
            runs = [measure(scene, SECONDS, rate) for _ in range(ROUNDS)]
            figures = sorted(runs, key=lambda r: r["ticks_per_second"])[ROUNDS // 2]
            tick = 1e6 / figures["ticks_per_second"]
            phases = ", ".join(f"{k} {v:.0f}" for k, v in figures["phases_us"].items())
            sys.stdout.write(
                f"{name}, {rate:.0f} updates/s: {figures['ticks_per_second']:.0f} ticks/s, real-time factor "
                f"{figures['real_time_factor']:.2f}, p99 {figures['tick_p99_us']:.0f} us, {tick / reference:.2f} of the "
                f"reference; us: {phases}\n"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
