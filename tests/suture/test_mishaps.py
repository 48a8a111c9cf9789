"""What a user may do to a thread in a running scene: teleport bodies into it, load it inside a hull, give it no length."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
import yaml
from ligature.model.frames import axis_rotation
from ligature.model.shapes import Capsule

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small"


@pytest.fixture
def sim():
    simulation = ligature.Simulation(ligature.load(SMALL / "launch.yaml"))
    yield simulation
    simulation.close()


def _thread(sim):
    index = list(sim.scene.rods[0].bodies)
    return sim.state["body_pose"][0, index, :3], sim.state["body_twist"][0, index, :3]


def test_needle_put_elsewhere_takes_its_thread_along_at_rest(sim):
    sim.step(100)
    before = _thread(sim)[0] - sim.bodies["Needle"].pose[:3]
    sim.bodies["Needle"].set_pose([0.1, 0.3, 0.9, 0.0, 0.0, 1.0, 0.0])
    after = _thread(sim)[0] - [0.1, 0.3, 0.9]
    # Half a turn about z; the needle had the pose of the file, but for its settling.
    assert after == pytest.approx(before * [-1.0, -1.0, 1.0], abs=1e-3)
    sim.step(2)
    assert np.abs(_thread(sim)[1]).max() < 0.05


def test_needle_put_elsewhere_again_and_again_never_makes_its_thread_diverge(sim):
    random = np.random.default_rng(3)
    for _ in range(20):
        q = random.normal(size=4)
        sim.bodies["Needle"].set_pose(
            [*random.uniform(-0.1, 0.1, 2), random.uniform(0.68, 0.9), *(q / np.linalg.norm(q))]
        )
        sim.step(20)
    assert np.isfinite(sim.state["body_pose"]).all()
    assert sim.problems == []


def test_tool_that_jumps_into_the_thread_pushes_it_out_gently(sim):
    sim.step(50)
    block = sim.bodies["Block"]
    up = block.pose
    up[2] += 0.001
    block.set_pose(up)
    sim.step(300)
    at, speed = _thread(sim)
    assert np.isfinite(at).all()
    assert np.abs(speed).max() < 1.0
    assert sim.problems == []


def test_thread_that_starts_inside_a_hull_comes_out(tmp_path):
    box = {
        "shape": "BOX",
        "geometry": {"x": 0.1, "y": 0.1, "z": 0.02},
        "offset": {"position": {"x": 0, "y": 0, "z": 0}},
    }
    model = {
        "bodies": ["BODY block"],
        "BODY block": {"name": "block", "mass": 0.0, "mesh": "", "compound collision shape": [box]},
        "sutures": ["SUTURE thread"],
        "SUTURE thread": {"name": "thread", "length": 0.04, "diameter": 4e-4, "elements": 20, "location": {
            "position": {"x": -0.02, "y": 0.0, "z": 0.005}, "orientation": {"r": 0.0, "p": 1.5708, "y": 0.0}}},
    }  # fmt: skip
    file = tmp_path / "inside.yaml"
    file.write_text(yaml.safe_dump(model, sort_keys=False))
    sim = ligature.Simulation(ligature.load(file))
    sim.step(500)
    at, speed = _thread(sim)
    assert at[:, 2].min() > 0.0099
    assert np.abs(speed).max() < 0.3
    assert sim.problems == []


@pytest.mark.parametrize("seed", range(16))
def test_thread_that_starts_in_the_middle_of_a_thin_body_leaves_both_slow(seed, tmp_path):
    """A light body 0.6 to 2 mm thick, of any shape and pose, with a thread along any direction that it may hold."""
    rng = np.random.default_rng((7, seed))
    half, long = float(rng.uniform(3e-4, 1e-3)), float(rng.uniform(4e-3, 2e-2))
    kind = ("CAPSULE", "CYLINDER", "BOX", "CONE")[seed % 4]
    round_ = {"radius": half, "height": long, "axis": "Z"}
    body = {
        "name": "body", "mass": 10.0 ** float(rng.uniform(-5, -3)), "gravity": {"x": 0, "y": 0, "z": 0},
        "collision shape": kind,
        "collision geometry": {"x": 2 * half, "y": 2 * half, "z": long} if kind == "BOX" else round_,
        "location": {"position": dict(zip("xyz", rng.uniform(-1, 1, 3).tolist(), strict=True)),
                     "orientation": dict(zip("rpy", rng.uniform(-1, 1, 3).tolist(), strict=True))},
    }  # fmt: skip
    place = rng.uniform(-0.2, 0.2) * long
    thread = {
        "name": "thread", "length": 0.02, "diameter": 3e-4, "elements": 30, "parent": "BODY body",
        "location": {"position": {"x": 0.0, "y": 0.0, "z": place},
                     "orientation": {"r": float(rng.choice((0.0, 0.05, 1.5708))), "p": 0.0, "y": 0.0}},
    }  # fmt: skip
    model = {"bodies": ["BODY body"], "BODY body": body, "sutures": ["SUTURE thread"], "SUTURE thread": thread}
    file = tmp_path / "thin.yaml"
    file.write_text(yaml.safe_dump({"gravity": {"x": 0, "y": 0, "z": 0}, **model}, sort_keys=False))
    sim = ligature.Simulation(ligature.load(file))
    try:
        for _ in range(100):
            sim.step()
            assert np.abs(sim.state["body_twist"][0, :, :3]).max() < 1.0
        assert sim.problems == []
    finally:
        sim.close()


def test_thread_without_length_is_left_out_with_the_reason(tmp_path):
    model = {
        "bodies": ["BODY block"], "BODY block": {"name": "block", "mass": 0.0, "mesh": ""},
        "sutures": ["SUTURE thread"], "SUTURE thread": {"name": "thread", "length": 0.0, "diameter": 4e-4},
    }  # fmt: skip
    file = tmp_path / "none.yaml"
    file.write_text(yaml.safe_dump(model, sort_keys=False))
    scene = ligature.load(file)
    assert scene.rods == ()
    assert [d.message for d in scene.diagnostics if d.severity.name == "ERROR"] == [
        "suture 'SUTURE thread' has no length"
    ]


def test_light_thread_dragged_over_a_needle_between_two_hands_stays_whole(kit):
    """40 elements, 7 mg in all, drawn taut across a heavy needle-like post at 0.5 m/s and back, at 1 ms."""
    n, length = 40, 0.0976
    needle = kit.body(0, Capsule(4e-4, 0.03), at=(0.0, 0.0, -0.002), R=axis_rotation((1.0, 0.0, 0.0), np.pi / 2))
    bench = kit.Bench([needle])
    start = kit.line(n, length, start=(-length / 2, 0.0, 0.0))
    rod = bench.add(kit.from_material(start, 0.3e-3, 2e9, 1100.0, friction=0.4))
    rod.hold_element(0)
    rod.hold_element(n - 1)
    lowest = np.inf
    for tick in range(2400):
        twists = rod.twists
        twists[[0, -1]] = 0.0
        # Down over the needle, then to and fro along the thread, both hands together.
        if tick < 400:
            twists[[0, -1], 2] = -0.01
        else:
            twists[[0, -1], 0] = 0.5 * (1.0 if (tick // 40) % 2 else -1.0)
        rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
        bench.step()
        under = np.abs(rod.positions[:, 0]) < 3e-4
        if under.any():
            lowest = min(lowest, float((rod.positions[under, 2] + 0.002).min()))
    assert rod.finite()
    assert np.abs(rod.twists[:, :3]).max() < 5.0
    # Never through the needle.
    assert lowest > 4e-4 + 1.5e-4 - 0.1e-3
    assert rod.tension.max() < 100.0
