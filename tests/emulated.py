"""Runs scenes and environments as another processor would, and prints a digest of each.

    python -m tests.emulated TICKS SCENE|ENVIRONMENT ...

NumPy and SciPy are imported first, as a user's program may do. OpenBLAS then has the routines of the kind of processor
that ``OPENBLAS_CORETYPE`` names, and Ligature finds it as it would on such a processor: without the variable.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import sys


def main(ticks: int, names: list[str]) -> None:
    """Print ``name digest`` for the scenes and environments ``names`` after ``ticks``, with random commands."""
    for library in ("numpy", "scipy.linalg", "scipy.sparse"):
        importlib.import_module(library)
    os.environ.pop("OPENBLAS_CORETYPE", None)
    for name in names:
        digest = environment(name, ticks) if name.startswith("ligature/") else scene(name, ticks)
        sys.stdout.write(f"{name} {digest}\n")


def scene(name: str, ticks: int) -> str:
    """The state hash of a scene of ours."""
    import ligature

    from tests.driving import Driver

    description = ligature.load(name)
    with ligature.Simulation(description) as simulation:
        Driver(description, seed=1).run(simulation, 0, ticks)
        return str(simulation.state_hash())


def environment(name: str, ticks: int) -> str:
    """A digest of all that an environment returns in two episodes of random actions."""
    gymnasium = importlib.import_module("gymnasium")
    importlib.import_module("ligature.environments")
    digest, env = hashlib.sha256(), gymnasium.make(name)
    env.action_space.seed(1)
    for seed in range(2):
        digest.update(env.reset(seed=seed)[0].tobytes())
        for _ in range(ticks // 40):
            observation, *rest = env.step(env.action_space.sample())
            digest.update(observation.tobytes() + repr(rest[:3]).encode())
    env.close()
    return digest.hexdigest()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
