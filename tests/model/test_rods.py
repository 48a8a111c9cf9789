"""Rods recognised in scenes: where their elements start when locations and joints differ."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import ligature
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.suture.description import from_chain

N, LENGTH = 8, 0.02


def xyz(*values: float) -> dict[str, float]:
    return dict(zip("xyz", values, strict=True))


def thread(
    folder: Path,
    shifts: dict[int, list[float]],
    bodies: Sequence[int] = range(N),
    joints: Sequence[int] = range(N - 1),
    left_out: Sequence[int] = (),
    turned: frozenset[int] = frozenset(),
) -> ligature.Scene:
    """A straight thread along x, elements of it ``shifts`` metres off.

    The file lists ``bodies`` and ``joints`` in these orders, those ``left_out`` of the joints not at all; in the joints
    ``turned`` parent and child change places.
    """
    model: dict[str, object] = {
        "bodies": [f"BODY {i}" for i in bodies], "joints": [f"JOINT {i}" for i in joints if i not in left_out],
    }  # fmt: skip
    for i in range(N):
        place = np.array([LENGTH * i, 0.0, 1.0]) + shifts.get(i, [0.0, 0.0, 0.0])
        model[f"BODY {i}"] = {
            "name": str(i), "mass": 1e-4, "collision shape": "CAPSULE",
            "collision geometry": {"radius": 5e-4, "height": LENGTH, "axis": "X"},
            "location": {"position": xyz(*place.tolist()), "orientation": {"r": 0.0, "p": 0.0, "y": 0.0}},
        }  # fmt: skip
    for i in range(N - 1):
        ends, half = ((i + 1, i), -LENGTH / 2) if i in turned else ((i, i + 1), LENGTH / 2)
        model[f"JOINT {i}"] = {
            "name": str(i), "type": "six dof spring", "parent": f"BODY {ends[0]}", "child": f"BODY {ends[1]}",
            "parent pivot": xyz(half, 0, 0), "child pivot": xyz(-half, 0, 0),
            "parent axis": xyz(1, 0, 0), "child axis": xyz(1, 0, 0),
            "joint limits": {
                "linear": {end: xyz(0, 0, 0) for end in ("low", "high")},
                "angular": {"low": xyz(-3, -3, -3), "high": xyz(3, 3, 3)},
            },
            "stiffness": {half: xyz(1e-3, 1e-3, 1e-3) for half in ("linear", "angular")},
            "damping": {half: xyz(1e-5, 1e-5, 1e-5) for half in ("linear", "angular")},
        }  # fmt: skip
    path = folder / "model.yaml"
    path.write_text(yaml.safe_dump(model, sort_keys=False))
    return ligature.load(path)


@settings(max_examples=25, deadline=None)
@given(
    bodies=st.permutations(range(N)),
    joints=st.permutations(range(N - 1)),
    left_out=st.sets(st.integers(0, N - 2), max_size=3),
    turned=st.frozensets(st.integers(0, N - 2)),
)
def test_a_thread_is_found_whole_whatever_the_order_of_its_file(
    tmp_path_factory: pytest.TempPathFactory,
    bodies: list[int],
    joints: list[int],
    left_out: set[int],
    turned: frozenset[int],
) -> None:
    scene = thread(tmp_path_factory.mktemp("thread"), {}, bodies, joints, sorted(left_out), turned)
    cuts = [-1, *sorted(left_out), N - 1]
    pieces = [range(a + 1, b + 1) for a, b in pairwise(cuts)]
    found = []
    for chain in scene.rods:
        places = [round(float(scene.bodies[b].T_world_body[0, 3]) / LENGTH) for b in chain.bodies]
        found.append(sorted(places))
        assert chain.bodies[0] < chain.bodies[-1], "a rod begins with the end that its file lists first"
        assert set(np.diff(places)) in ({1}, {-1}), "elements that follow each other are neighbours"
        for joint, ends in zip(chain.joints, pairwise(chain.bodies), strict=True):
            assert {scene.joints[joint].parent, scene.joints[joint].child} == set(ends)
        assert chain.anchors == ()
        assert np.allclose(chain.lengths, LENGTH) and chain.radius == 5e-4
    assert sorted(found) == [list(piece) for piece in pieces if len(piece) >= 4]


shift = st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3)


@settings(max_examples=40, deadline=None)
@given(shifts=st.dictionaries(st.integers(0, N - 1), shift, max_size=N))
def test_elements_start_no_further_from_their_joints_than_they_are_long(
    tmp_path_factory: pytest.TempPathFactory, shifts: dict[int, list[float]]
) -> None:
    scene = thread(tmp_path_factory.mktemp("thread"), shifts)
    (chain,) = scene.rods
    rod = from_chain(scene, chain)
    ends = [
        np.einsum("nij,nj->ni", rod.T_world_inertial[k : N - 1 + k, :3, :3], rod.pivots[:, k])
        + rod.T_world_inertial[k : N - 1 + k, :3, 3]
        for k in (0, 1)
    ]
    assert np.linalg.norm(ends[1] - ends[0], axis=1).max() <= LENGTH * 1.001
    reported = {f.message.split("'")[1] for f in scene.diagnostics if f.code == "moved"}
    written = [np.array([LENGTH * i, 0.0, 1.0]) + shifts.get(i, [0.0, 0.0, 0.0]) for i in range(N)]
    stayed = [i for i in range(N) if (scene.bodies[chain.bodies[i]].T_world_body[:3, 3] == written[i]).all()]
    assert len(reported) == N - len(stayed)


def test_a_thread_with_elements_at_the_wrong_place_stays_in_one_piece(tmp_path: Path) -> None:
    simulation = ligature.Simulation(thread(tmp_path, {1: [1e3, 0.0, 0.0], 5: [0.0, -0.5, 0.0]}))
    try:
        simulation.step(200)
        assert simulation.problems == []
        places = simulation.state["body_pose"][0, :, :3]
        assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 1.05 * LENGTH
    finally:
        simulation.close()


def with_length(folder: Path, which: int, length: float) -> ligature.Scene:
    """A straight thread in which the joints of one element give it this ``length``, in metres."""
    thread(folder, {})
    path = folder / "model.yaml"
    model = yaml.safe_load(path.read_text())
    for joint, side, sign in ((which - 1, "child", -0.5), (which, "parent", 0.5)):
        if f"JOINT {joint}" in model:
            model[f"JOINT {joint}"][f"{side} pivot"] = xyz(sign * length, 0, 0)
    path.write_text(yaml.safe_dump(model, sort_keys=False))
    return ligature.load(path)


@given(which=st.integers(0, N - 1), length=st.sampled_from([0.0, 1e-9, 4e-7, 20.0, 190.0]))
@settings(max_examples=20, deadline=None)
def test_a_chain_with_an_element_of_no_length_or_of_far_too_much_stays_bodies_and_is_reported(
    tmp_path_factory: pytest.TempPathFactory, which: int, length: float
) -> None:
    """Its joints meet the element at one place, or one at the middle of an end; or a pivot is far out."""
    scene = with_length(tmp_path_factory.mktemp("length"), which, length)
    (found,) = [d for d in scene.diagnostics if d.code == "rod"]
    assert not scene.rods and f"the joints of 'BODY {which}' " in found.message
    assert ("leave it no length" in found.message) == (length < 1.0)
    simulation = ligature.Simulation(scene)
    simulation.step(10)
    simulation.close()


@pytest.mark.parametrize("which", [0, 3, N - 1])
@pytest.mark.parametrize("length", [1e-6, 0.1, 2.0])
def test_what_is_simulated_as_a_rod_moves_whatever_the_length_of_an_element(
    tmp_path: Path, which: int, length: float
) -> None:
    scene = with_length(tmp_path, which, length)
    assert scene.rods
    simulation = ligature.Simulation(scene)
    try:
        simulation.step(500)
        assert simulation.problems == []
        assert np.linalg.norm(simulation.state["body_twist"][0, :, :3], axis=1).max() < 6.0
    finally:
        simulation.close()
