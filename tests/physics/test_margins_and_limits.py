"""Legal numbers that mean little to Bullet: margins thicker than their shapes, and limits the wrong way round."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
import yaml
from ligature.adf import Severity
from ligature.model.scene import Scene

AXES = {
    "parent pivot": {"x": 0, "y": 0, "z": 0}, "child pivot": {"x": 0, "y": 0, "z": 0.1},
    "parent axis": {"x": 0, "y": 0, "z": 1}, "child axis": {"x": 0, "y": 0, "z": 1},
}  # fmt: skip
BALL = {"collision shape": "SPHERE", "collision geometry": {"radius": 0.01}}


def loaded(folder: Path, **objects: Any) -> Scene:
    """A model of bodies and joints by their keys."""
    model: dict[str, Any] = {
        "bodies": [k for k in objects if k[0] != "J"],
        "joints": [k for k in objects if k[0] == "J"],
    }
    (folder / "model.yaml").write_text(yaml.safe_dump({**model, **objects}, sort_keys=False))
    return ligature.load(folder / "model.yaml")


@pytest.mark.parametrize("number", range(12))
def test_nothing_falls_through_a_shape_that_is_thinner_than_its_margin(number: int, tmp_path: Path) -> None:
    """A ball and a cylinder on top of a block, of whatever thickness and margin."""
    rng = random.Random(number)
    height = 10 ** rng.uniform(-4, -0.5)
    margin = 10 ** rng.uniform(-5, 0.5)
    if rng.random() < 0.5:
        shape = {"collision shape": "BOX", "collision geometry": {"x": 0.3, "y": 0.3, "z": height}}
    else:
        shape = {"collision shape": "CYLINDER", "collision geometry": {"radius": 0.15, "height": height}}
    drop: dict[str, Any] = BALL
    if rng.random() < 0.5:
        drop = {"collision shape": "CYLINDER", "collision geometry": {"radius": 0.01, "height": 0.02}}
    at = {"position": {"x": 0.0, "y": 0.0, "z": height / 2 + 0.012}}
    scene = loaded(
        tmp_path,
        block={"name": "block", "mass": 0.0, "collision margin": margin, **shape},
        drop={"name": "drop", "mass": 0.1, "collision margin": 1e-4, "location": at, **drop},
    )
    simulation = ligature.Simulation(scene)
    simulation.step(300)
    rests = float(simulation.state["body_pose"][0, 1, 2]) - height / 2
    assert rests == pytest.approx(0.01, abs=1.5e-3)
    thin = margin >= min(height / 2, 0.15)
    assert thin == any("has a collision margin of" in d.message for d in scene.diagnostics)
    assert scene.bodies[0].collision_margin == pytest.approx(min(height / 4, 0.075) if thin else margin)


@pytest.mark.parametrize("number", range(24))
def test_limits_the_wrong_way_round_are_none(number: int, tmp_path: Path) -> None:
    """A joint moves as one whose limits are far away; of springs the middle of the limits stays the place at rest."""
    rng = random.Random(number)
    kind = ("revolute", "prismatic", "linear spring", "torsion spring")[number % 4]
    low = rng.uniform(0.0, 0.3)
    high = low - rng.uniform(0.01, 0.5)
    joint: dict[str, Any] = {"name": "j", "type": kind, "parent": "base", "child": "link", **AXES}
    if kind in ("linear spring", "torsion spring"):
        joint |= {"stiffness": rng.uniform(0.5, 5.0), "damping": rng.uniform(0.0, 0.1)}
        if rng.random() < 0.5:
            joint["equilibrium point"] = rng.uniform(-0.2, 0.2)
    far: dict[str, Any] = {"joint limits": {"low": -50.0 + (low + high) / 2, "high": 50.0 + (low + high) / 2}}
    bodies = {"base": {"name": "base", "mass": 0.0}, "link": {"name": "link", "mass": 0.2, **BALL}}
    ends, moved = [], 0.0
    for limits in ({"joint limits": {"low": low, "high": high}}, far if "spring" in kind else {}):
        scene = loaded(tmp_path, **bodies, J={**joint, **limits})
        simulation = ligature.Simulation(scene)
        begin = simulation.state["body_pose"][0, 1].copy()
        simulation.step(100)
        ends.append(simulation.state["body_pose"][0, 1].copy())
        moved = max(moved, float(np.abs(ends[-1] - begin).max()))
        reported = any("so it is unlimited" in d.message for d in scene.diagnostics if d.severity is Severity.WARNING)
        assert reported == (limits is not far and bool(limits))
    np.testing.assert_allclose(*ends, atol=1e-6)
    assert moved > 1e-4 or kind == "revolute", kind


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "linear spring", "torsion spring"])
@pytest.mark.parametrize("number", range(6))
def test_limits_where_no_joint_can_be_are_reported_and_left_out(kind: str, number: int, tmp_path: Path) -> None:
    """Both ends are on one side, farther than a body may be; a range that has its start within reach is taken."""
    rng = random.Random(number)
    far = rng.choice((-1, 1)) * 10.0 ** rng.uniform(4.1, 12.0)
    near = 0.0 if number % 2 else far
    low, high = sorted((near, far * rng.uniform(1.0, 2.0)))
    joint = {"name": "j", "type": kind, "parent": "base", "child": "link", **AXES}
    if "spring" in kind:
        joint |= {"stiffness": 1.0, "damping": 0.1, "equilibrium point": 0.0}
    bodies = {"base": {"name": "base", "mass": 0.0}, "link": {"name": "link", "mass": 0.2, **BALL}}
    scene = loaded(tmp_path, **bodies, J={**joint, "joint limits": {"low": low, "high": high}})
    found = [d for d in scene.diagnostics if "where it cannot be" in d.message]
    assert [d.severity for d in found] == ([] if number % 2 else [Severity.WARNING])
    assert (scene.joints[0].low is None) == bool(found)
    simulation = ligature.Simulation(scene)
    simulation.step(20)
    assert np.abs(simulation.state["body_pose"][0, :, :3]).max() < 10.0
    simulation.close()
