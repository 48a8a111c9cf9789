"""Bodies that hang on much lighter ones, or on joints about three axes: however they fall, they gain no energy."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
import yaml
from ligature import Simulation
from ligature.adf.frames import rpy_matrix
from ligature.model.frames import pose7_matrix

GRAVITY = 9.8
GAIN = 3.0
"""Height in metres by which a mechanism may rise for what ticks of 1 ms add: 15 of 300 gain 0.02 m, 3 of 300 this.

As long as Bullet bounded the speed of each coordinate by itself, 179 of 300 gained 0.02 m, the worst 1.8 km.
"""

ZERO, UP = dict.fromkeys("xyz", 0.0), {"x": 0.0, "y": 0.0, "z": 1.0}
LOCKED, FREE = {"low": ZERO, "high": ZERO}, {"low": dict.fromkeys("xyz", 1.0), "high": dict.fromkeys("xyz", -1.0)}
KINDS: dict[str, dict[str, Any]] = {
    "revolute": {},
    "cone twist": {"joint limits": dict.fromkeys("xyz", 3.0)},
    "six dof": {"joint limits": {"linear": LOCKED, "angular": FREE}},
}


def xyz(values: Any) -> dict[str, float]:
    return dict(zip("xyz", (float(v) for v in values), strict=True))


def falling(rng: np.random.Generator) -> str:
    """Two to four bodies in a row: the first is a ball of 1 g to 10 kg, the others weigh 0.2 to 5 kg."""
    count = int(rng.integers(2, 5))
    masses = np.append(10.0 ** rng.uniform(-3, 1), 10.0 ** rng.uniform(-0.7, 0.7, count - 1))
    model: dict[str, Any] = {"gravity": {"x": 0.0, "y": 0.0, "z": -GRAVITY}, "bodies": ["F"], "joints": []}
    model["F"] = {
        "name": "F", "mass": 0, "collision shape": "BOX", "collision geometry": {"x": 100.0, "y": 100.0, "z": 0.1},
        "location": {"position": {"x": 0.0, "y": 0.0, "z": -1.0}},
    }  # fmt: skip
    at = np.zeros(3)
    for i, mass in enumerate(masses):
        key = f"B{i}"
        model["bodies"].append(key)
        if i:
            arms = rng.uniform(-0.15, 0.15, (2, 3))
            kind = str(rng.choice(list(KINDS)))
            model["joints"].append(f"J{i}")
            model[f"J{i}"] = {
                "name": f"J{i}", "type": kind, "parent": f"B{i - 1}", "child": key, "parent axis": UP, "child axis": UP,
                "parent pivot": xyz(arms[0]), "child pivot": xyz(arms[1]), **KINDS[kind],
            }  # fmt: skip
            at = at + arms[0] - arms[1]
        model[key] = {
            "name": key, "mass": float(mass), "location": {"position": xyz(at)}, "restitution": 0.0,
            "inertia": dict(zip(("ix", "iy", "iz"), (mass * rng.uniform(1e-3, 1.5e-3, 3)).tolist(), strict=True)),
            "damping": {"linear": 0.0, "angular": 0.0},
        }  # fmt: skip
        if i == 0:
            model[key] |= {"collision shape": "SPHERE", "collision geometry": {"radius": 0.1}}
    return yaml.safe_dump(model, sort_keys=False)


def energy(sim: Simulation) -> float:
    """Kinetic energy of all bodies and potential energy of their weight, in J."""
    total = 0.0
    for body in sim.scene.bodies:
        if not body.static:
            pose, twist = sim.state["body_pose"][0, body.index], sim.state["body_twist"][0, body.index]
            turning = pose7_matrix(pose)[:3, :3].T @ twist[3:]
            total += 0.5 * float(body.mass * twist[:3] @ twist[:3] + body.inertia @ turning**2)
            total += body.mass * GRAVITY * float(pose[2])
    return total


@pytest.mark.parametrize("seed", range(24))
def test_what_hangs_on_light_links_gains_no_energy_as_it_falls_on_a_floor(seed: int, tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(falling(np.random.default_rng((13, seed))))
    with closing(Simulation(ligature.load(file))) as sim:
        begun, most = energy(sim), -np.inf
        for _ in range(1000):
            sim.step()
            most = max(most, energy(sim))
        assert not [problem for problem in sim.problems if problem.code == "diverged"]
        assert (most - begun) / (GRAVITY * sum(body.mass for body in sim.scene.bodies)) < GAIN


def limp_chain(rng: np.random.Generator) -> str:
    """Three capsules, too few for a rod, on springs of any stiffness, whose moments the file leaves open."""
    model: dict[str, Any] = {"bodies": ["F", "B0", "B1", "B2"], "joints": ["J0", "J1"]}
    model["F"] = {
        "name": "F", "mass": 0, "collision shape": "BOX", "collision geometry": {"x": 100.0, "y": 100.0, "z": 0.1},
        "location": {"position": {"x": 0.0, "y": 0.0, "z": -0.4}},
    }  # fmt: skip
    radius, height = 10.0 ** rng.uniform(-3.3, -2.7), 10.0 ** rng.uniform(-2.5, -1.5)
    turn = rng.uniform(-np.pi, np.pi, 3)
    along = rpy_matrix(*turn)[:, 2] * height
    for i in range(3):
        model[f"B{i}"] = {
            "name": f"B{i}", "mass": float(10.0 ** rng.uniform(-5, -3)), "collision shape": "CAPSULE",
            "collision geometry": {"radius": float(radius), "height": float(height), "axis": "Z"},
            "location": {"position": xyz(i * along), "orientation": dict(zip("rpy", turn.tolist(), strict=True))},
        }  # fmt: skip
    turns = {"low": dict.fromkeys("xyz", -3.0), "high": dict.fromkeys("xyz", 3.0)}
    for i in range(2):
        stiffness = float(10.0 ** rng.uniform(-4, 0))
        model[f"J{i}"] = {
            "name": f"J{i}", "type": "six dof spring", "parent": f"B{i}", "child": f"B{i + 1}",
            "parent axis": UP, "child axis": UP,
            "parent pivot": xyz((0, 0, height / 2)), "child pivot": xyz((0, 0, -height / 2)),
            "joint limits": {"linear": LOCKED, "angular": turns},
            **{key: {half: dict.fromkeys("xyz", value) for half in ("linear", "angular")}
               for key, value in (("stiffness", stiffness), ("damping", 0.01 * stiffness))},
        }  # fmt: skip
    return yaml.safe_dump(model, sort_keys=False)


@pytest.mark.parametrize("seed", [*range(12), 30])  # 30 was the one of 500 that came to 106 m/s
def test_a_light_limp_chain_that_falls_on_a_floor_is_not_thrown(seed: int, tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(limp_chain(np.random.default_rng((19, seed))))
    with closing(Simulation(ligature.load(file))) as sim:
        assert not sim.scene.rods
        for _ in range(50):
            sim.step(20)
            assert np.linalg.norm(sim.state["body_twist"][0, :, :3], axis=1).max() < 6.0
