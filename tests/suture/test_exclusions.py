"""Attached threads that start inside bodies: held there without a fight, and colliding again once they have parted."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

LENGTH = 0.1


def block(name: str, mass: float, size: list[float], place: list[float]) -> dict[str, object]:
    return {
        "name": name, "mass": mass, "collision shape": "BOX",
        "collision geometry": dict(zip("xyz", size, strict=True)),
        "location": {"position": dict(zip("xyz", place, strict=True)), "orientation": {"r": 0.0, "p": 0.0, "y": 0.0}},
    }  # fmt: skip


def hung(folder: Path, wall: list[float], place: list[float], mass: float = 0.0) -> ligature.Scene:
    """A thread from the origin of a small holder, and a ``wall`` of that size at ``place``."""
    model = {
        "bodies": ["BODY holder", "BODY wall"], "sutures": ["SUTURE thread"],
        "BODY holder": block("holder", 0.0, [2e-3, 2e-3, 2e-3], [0.0, 0.0, 0.0]),
        "BODY wall": block("wall", mass, wall, place),
        "SUTURE thread": {
            "name": "thread", "length": LENGTH, "elements": 10, "USP size": "2-0", "parent": "BODY holder",
        },
    }  # fmt: skip
    path = folder / "model.yaml"
    path.write_text(yaml.safe_dump(model, sort_keys=False))
    return ligature.load(path)


def carried(folder: Path, size: list[float], mass: float, inside: list[float]) -> ligature.Scene:
    """A thread from a point ``inside`` a falling box of that ``size``, measured from its centre."""
    scene = hung(folder, size, [-x for x in inside], mass)
    path = folder / "model.yaml"
    model = yaml.safe_load(path.read_text())
    model["BODY holder"]["mass"] = 0.007
    model["joints"] = ["JOINT weld"]
    model["JOINT weld"] = {
        "name": "weld", "type": "fixed", "parent": "BODY wall", "child": "BODY holder",
        "parent pivot": dict(zip("xyz", inside, strict=True)), "child pivot": dict.fromkeys("xyz", 0.0),
        "parent axis": {"x": 0.0, "y": 0.0, "z": 1.0}, "child axis": {"x": 0.0, "y": 0.0, "z": 1.0},
    }  # fmt: skip
    path.write_text(yaml.safe_dump(model, sort_keys=False))
    assert len(scene.bodies) == 12
    return ligature.load(path)


edge = st.floats(0.03, 0.15)
offset = st.floats(-0.02, 0.02)


@settings(max_examples=20, deadline=None)
@given(
    size=st.lists(edge, min_size=3, max_size=3), inside=st.lists(offset, min_size=3, max_size=3),
    exponent=st.floats(-2.0, 0.0),
)  # fmt: skip
def test_a_thread_that_starts_in_its_falling_carrier_stays_quiet(
    tmp_path_factory: pytest.TempPathFactory, size: list[float], inside: list[float], exponent: float
) -> None:
    """Without exclusions elements of most examples pass 20 m/s, up to 110; shallow starts are pushed out at up to 9."""
    scene = carried(tmp_path_factory.mktemp("carried"), size, 10.0**exponent, inside)
    simulation = ligature.Simulation(scene)
    rods = sorted(scene.rod_bodies)
    (carrier,) = (b.index for b in scene.bodies if b.identity.key == "BODY wall")
    try:
        for _ in range(80):
            simulation.step(5)
            twist = simulation.state["body_twist"][0]
            assert np.linalg.norm(twist[rods, :3] - twist[carrier, :3], axis=1).max() < 15.0
        assert not [p for p in simulation.problems if p.code == "diverged"]
    finally:
        simulation.close()


def test_it_is_reported_and_collides_once_it_has_left(tmp_path: Path) -> None:
    scene = hung(tmp_path, [0.3, 0.3, 0.24], [0.0, 0.0, 0.0])
    simulation = ligature.Simulation(scene)
    rods = sorted(scene.rod_bodies)

    def put_wall(top: float) -> None:
        simulation.bodies["BODY wall"].set_pose([0.0, 0.0, top - 0.12, 0.0, 0.0, 0.0, 1.0])

    try:
        simulation.step(1)
        (found,) = [str(p) for p in simulation.problems if p.code == "overlap"]
        assert "starts 120 mm inside 'BODY wall'" in found
        put_wall(-0.15)
        simulation.bodies["BODY holder"].set_pose([0.0, 0.0, 0.0, 0.995, 0.0, 0.0, 0.1])
        simulation.step(200)
        snapshot, ends = simulation.snapshot(), []
        for _run in range(2):
            simulation.step(500)
            ends.append(simulation.state_hash())
            simulation.restore(snapshot)
        assert ends[0] == ends[1]
        simulation.step(1000)
        assert simulation.state["body_pose"][0, rods, 2].min() < -0.06, "it does not hang"
        for k in range(200):
            put_wall(-0.15 + 6e-4 * k)
            simulation.step(10)
        assert simulation.state["body_pose"][0, rods, 2].min() > -0.0325, "it does not lie on the wall"
    finally:
        simulation.close()
