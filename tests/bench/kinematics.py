"""How long forward and inverse kinematics take: one pose by call, and a pose among 100 000.

``python -m tests.bench.kinematics``
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
from ligature.robots.ecm import Ecm
from ligature.robots.mtm import Mtm
from ligature.robots.psm import Psm

POSES = 100_000
CALLS = 2000
ROUNDS = 5


def microseconds(function: Callable[[], object], calls: int) -> float:
    """Best of some rounds of ``calls`` calls, a call."""
    best = np.inf
    for _ in range(ROUNDS + 1):  # the first compiles
        begin = time.perf_counter()
        for _ in range(calls):
            function()
        best = min(best, time.perf_counter() - begin)
    return best / calls * 1e6


def figures(arm: Psm | Ecm | Mtm) -> dict[str, tuple[float, float]]:
    """Microseconds a call with one pose, and a pose among many, for each thing that an arm computes."""
    lower = arm.lower.copy()
    if not isinstance(arm, Mtm):
        lower[2] = arm.insertion_at(1e-3)
    q = np.random.default_rng(0).uniform(lower, arm.upper, (POSES, arm.n))
    T = arm.forward(q)
    pairs = {
        "forward": (lambda: arm.forward(q[0]), lambda: arm.forward(q)),
        "inverse": (lambda: arm.inverse(T[0], q[0]), lambda: arm.inverse(T, q)),
        "body Jacobian": (lambda: arm.jacobian_body(q[0]), lambda: arm.jacobian_body(q)),
    }
    return {what: (microseconds(one, CALLS), microseconds(many, 1) / POSES) for what, (one, many) in pairs.items()}


def main() -> int:
    """Entry point."""
    for name, arm in (("PSM", Psm(400006)), ("ECM", Ecm()), ("MTM", Mtm("left"))):
        for what, (one, among) in figures(arm).items():
            sys.stdout.write(f"{name} {what}: {one:.1f} µs a call, {among:.2f} µs a pose among {POSES}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
