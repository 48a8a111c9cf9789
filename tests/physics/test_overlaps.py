"""Bodies that start inside each other: joints that hold them there, and bodies that are free to part."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.cli import check

EDGE = 0.04


def box(name: str, x: float, mass: float) -> dict[str, object]:
    return {
        "name": name, "mass": mass, "collision shape": "BOX", "collision geometry": dict.fromkeys("xyz", EDGE),
        "location": {"position": {"x": x, "y": 0.0, "z": 0.0}, "orientation": {"r": 0.0, "p": 0.0, "y": 0.0}},
    }  # fmt: skip


def scene(folder: Path, apart: float, joined: bool) -> ligature.Scene:
    """A static wall and a box ``apart`` metres beside it, on a slider along x when ``joined``."""
    model: dict[str, object] = {
        "bodies": ["BODY wall", "BODY base", "BODY box"], "joints": ["JOINT slide"] if joined else [],
        "BODY wall": box("wall", 0.0, 0.0), "BODY base": box("base", 1.0, 0.0), "BODY box": box("box", apart, 0.1),
        "JOINT slide": {
            "name": "slide", "type": "prismatic", "parent": "BODY base", "child": "BODY box",
            "parent pivot": {"x": apart - 1.0, "y": 0.0, "z": 0.0}, "child pivot": dict.fromkeys("xyz", 0.0),
            "parent axis": {"x": 1.0, "y": 0.0, "z": 0.0}, "child axis": {"x": 1.0, "y": 0.0, "z": 0.0},
            "joint limits": {"low": -0.2, "high": 0.2},
        },
    }  # fmt: skip
    path = folder / "model.yaml"
    path.write_text(yaml.safe_dump(model, sort_keys=False))
    return ligature.load(path)


@settings(max_examples=12, deadline=None)
@given(depth=st.floats(0.006, 0.03))
def test_what_joints_hold_inside_is_reported_and_still_until_it_has_parted(
    tmp_path_factory: pytest.TempPathFactory, depth: float
) -> None:
    folder = tmp_path_factory.mktemp("held")
    loaded = scene(folder, EDGE - depth, joined=True)
    simulation = ligature.Simulation(loaded)
    try:
        (found,) = [str(problem) for problem in simulation.problems if problem.code == "overlap"]
        assert [found] == [str(f) for f in check.findings(folder / "model.yaml", [], False) if f.code == "overlap"]
        assert "'BODY box'" in found and "'BODY wall'" in found and f"{1e3 * depth:.3g} mm" in found
        simulation.step(300)
        assert np.abs(simulation.state["body_twist"][0]).max() < 0.1
    finally:
        simulation.close()


def test_it_collides_again_once_it_has_parted(tmp_path: Path) -> None:
    loaded = scene(tmp_path, EDGE - 0.01, joined=True)
    simulation = ligature.Simulation(loaded)
    box_index = next(b.index for b in loaded.bodies if b.identity.key == "BODY box")
    world = simulation._world
    try:
        world.set_joint_position(0, 0.05)
        simulation.step(100)
        snapshot = simulation.snapshot()
        for _run in range(2):
            for _ in range(400):
                world.apply_force(box_index, np.array([-2.0, 0.0, 0.0]), np.zeros(3))
                simulation.step(1)
            assert simulation.state["body_pose"][0, box_index, 0] > EDGE - 0.002
            simulation.restore(snapshot)
    finally:
        simulation.close()


def test_free_bodies_are_parted_by_contact_without_a_word(tmp_path: Path) -> None:
    loaded = scene(tmp_path, EDGE - 0.02, joined=False)
    simulation = ligature.Simulation(loaded)
    try:
        simulation.step(100)
        box_index = next(b.index for b in loaded.bodies if b.identity.key == "BODY box")
        assert simulation.state["body_pose"][0, box_index, 0] > EDGE - 0.002
        assert not [problem for problem in simulation.problems if problem.code == "overlap"]
    finally:
        simulation.close()


def xyz(v: object) -> dict[str, float]:
    return {k: float(c) for k, c in zip("xyz", v, strict=True)}  # type: ignore[call-overload]


@pytest.mark.parametrize("seed", range(16))
def test_what_joints_let_part_only_nearly_across_the_contact_is_not_thrown(seed: int, tmp_path: Path) -> None:
    """A box that starts slightly inside a wall, on a slider or an arm that moves along the wall but for a tiny angle."""
    rng = np.random.default_rng(seed)
    at = EDGE - 10.0 ** rng.uniform(-4, -2.4)
    tilt, around = 10.0 ** rng.uniform(-6, 0) * rng.choice((-1, 1)), rng.uniform(0, 6.28)
    axis = np.array([np.sin(tilt), np.cos(tilt) * np.cos(around), np.cos(tilt) * np.sin(around)])
    type_, pivot = "prismatic", np.zeros(3)
    if seed % 2:  # an arm that swings the box along the same direction
        along, axis = axis, np.cross(axis, rng.normal(size=3))
        axis /= np.linalg.norm(axis)
        type_, pivot = "revolute", 0.1 * np.cross(axis, along)
    wall, held = box("wall", 0.0, 0.0), box("box", at, 10.0 ** rng.uniform(-3, 1))
    wall["collision geometry"] = {"x": EDGE, "y": 1.0, "z": 1.0}
    model = {
        "bodies": ["BODY wall", "BODY base", "BODY box"], "joints": ["JOINT hold"],
        "BODY wall": wall, "BODY base": {"name": "base", "mass": 0.0}, "BODY box": held,
        "JOINT hold": {
            "name": "hold", "type": type_, "parent": "BODY base", "child": "BODY box",
            "parent pivot": xyz(pivot + (at, 0.0, 0.0)), "child pivot": xyz(pivot),
            "parent axis": xyz(axis), "child axis": xyz(axis), "joint limits": {"low": -0.3, "high": 0.3},
        },
    }  # fmt: skip
    path = tmp_path / "model.yaml"
    path.write_text(yaml.safe_dump(model, sort_keys=False))
    simulation = ligature.Simulation(ligature.load(path))
    try:
        for _ in range(100):
            simulation.step(1)
            assert np.abs(simulation.state["body_twist"][0, :, :3]).max() < 12.0
    finally:
        simulation.close()
