"""The state after n ticks is a function of scene, commands and n alone; snapshots and resets are exact to the bit."""

from __future__ import annotations

import multiprocessing
import os
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import ligature
import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.cache import cache_folder
from ligature.model.scene import Scene
from ligature.model.subsystem import Subsystem
from ligature.physics import control, engine, impulses
from ligature.sensing import rays
from ligature.simulation import Snapshot
from ligature.soft.frame import Frame
from ligature.suture import colliders, rod
from ligature.tissue.block import TissueBlock
from ligature.tissue.interface import Interface

from tests.attributes import attributes
from tests.conftest import CORPUS, ROOT
from tests.driving import Driver
from tests.fuzz.kills import busy
from tests.soft import conftest as tissue_kit

TICKS = 120
OURS = sorted(path.parent.name for path in ROOT.glob("scenes/*/launch.yaml"))
THEIRS = sorted(
    str(path.relative_to(CORPUS))
    for path in (*CORPUS.rglob("grippers/**/*.yaml"), *CORPUS.rglob("suturing_scene/launch.yaml"))
)
QUICK = ["needle_pick", "suturing_small", *(name for name in THEIRS if "gripper2/" in name or "gripper3/" in name)]
"""Scenes of which many examples are tried."""


@pytest.fixture(autouse=True)
def pieces_of_others(request: pytest.FixtureRequest) -> None:
    """CoACD decomposes no mesh of others here."""
    if hasattr(request.node, "callspec") and set(THEIRS) & set(map(str, request.node.callspec.params.values())):
        request.getfixturevalue("hulls")


FALLING = "a pad of tissue that falls, and a needle"
"""A scene of its own, for all pads of ours lie on what does not move."""


@cache
def scene_of(name: str) -> Scene:
    if name == FALLING:
        with TemporaryDirectory() as folder:
            return tissue_kit.load(Path(folder), tissue_kit.pad(mass="0.1"), tissue_kit.needle())
    path = ROOT / "scenes" / name / "launch.yaml" if name in OURS else CORPUS / name
    try:
        return ligature.load(path, roots=[CORPUS])
    except ligature.SceneError as error:
        pytest.skip(f"{name} does not load: {error.diagnostics[0]}")


@cache
def driven(name: str) -> tuple[Simulation, Snapshot, str]:
    """A simulation, a snapshot of its start, and its hash after `TICKS` ticks one by one."""
    simulation = Simulation(scene_of(name))
    start = simulation.snapshot()
    Driver(simulation.scene, 0).run(simulation, 0, TICKS, list(range(TICKS)))
    return simulation, start, simulation.state_hash()


@pytest.mark.parametrize("name", QUICK)
@settings(max_examples=5)
@given(calls=st.lists(st.integers(1, TICKS - 1), max_size=20))
def test_how_ticks_are_shared_out_over_calls_changes_nothing(name: str, calls: list[int]) -> None:
    simulation, start, expected = driven(name)
    simulation.restore(start)
    Driver(simulation.scene, 0).run(simulation, 0, TICKS, calls)
    assert simulation.state_hash() == expected


@pytest.mark.parametrize("rate", [1, 30, 200, 1000])
@pytest.mark.parametrize("name", QUICK[:3])
def test_the_rate_of_updates_changes_nothing(name: str, rate: int) -> None:
    simulation = Simulation(scene_of(name), update=1.0 / rate)
    simulation.restore(driven(name)[1])
    Driver(simulation.scene, 0).run(simulation, 0, TICKS)
    assert simulation.state_hash() == driven(name)[2]


@pytest.mark.parametrize("name", QUICK[:3])
def test_looking_changes_nothing(name: str) -> None:
    simulation, start, expected = driven(name)
    simulation.restore(start)
    for tick in range(0, TICKS, 7):
        Driver(simulation.scene, 0).run(simulation, tick, min(tick + 7, TICKS))
        simulation.state_hash(), simulation.insertions, dict(simulation.grasps), simulation.step(0)
    assert simulation.state_hash() == expected


@pytest.mark.parametrize("name", [*OURS, *THEIRS])
def test_snapshots_and_resets_are_exact_at_random_times(name: str) -> None:
    scene, rng = scene_of(name), np.random.default_rng(len(name))
    at, more, seed = (int(k) for k in rng.integers(20, 60, 3))
    driver, one = Driver(scene, seed), Simulation(scene)
    fresh = one.state_hash()
    driver.run(one, 0, at)
    before = one.state_hash()
    taken = one.snapshot()
    assert one.state_hash() == before
    driver.run(one, at, at + more)
    expected = one.state_hash()
    for other in (one, Simulation(scene)):
        other.restore(taken)
        other.restore(other.snapshot())
        assert other.state_hash() == before
        driver.run(other, at, at + more)
        assert other.state_hash() == expected
    untouched = Simulation(scene)
    untouched.step(at)
    untouched.reset()
    assert untouched.state_hash(clock=False) == Simulation(scene).state_hash(clock=False)
    assert untouched.state_hash() != fresh
    again = Simulation(scene)
    for simulation in (untouched, again):
        simulation.step(more)
    assert untouched.state_hash(clock=False) == again.state_hash(clock=False)


@pytest.mark.parametrize("name", QUICK)
def test_a_reset_scene_stands_as_a_fresh_one_whatever_was_commanded(name: str) -> None:
    scene = scene_of(name)
    simulation = Simulation(scene)
    Driver(scene, 3).run(simulation, 0, TICKS)
    simulation.reset()
    fresh = Simulation(scene).state
    for field in ("body_pose", "body_twist", "joint_position", "joint_velocity", "rod_tension", "insertion_count"):
        assert simulation.state[field].tobytes() == fresh[field].tobytes(), field


@pytest.mark.parametrize("name", QUICK[:2])
def test_a_scene_of_many_bodies_moves_alike_and_gets_another_bullet_world(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    simulation, start, expected = driven(name)
    assert simulation._world.engine.forgets
    monkeypatch.setattr(engine, "MOST_PAIRED", 0)
    large = Simulation(scene_of(name))
    assert not large._world.engine.forgets
    large.restore(start)
    trees = large._world.engine.trees
    for _ in range(2):
        large.restore(start)
        assert large._world.engine.trees is not trees
        Driver(large.scene, 0).run(large, 0, TICKS)
        assert large.state_hash() == expected


def test_a_restore_keeps_bullets_world_and_forgets_its_contacts() -> None:
    simulation = Simulation(scene_of("suturing_small"))
    bullet, needle = simulation._world.engine, simulation.bodies["BODY Needle"].body.index
    simulation.step(300)
    taken, trees = simulation.snapshot(), bullet.trees
    simulation.step(1)
    assert simulation._world.queries.contacts(needle, 0.0), "the needle lies on the pad"
    simulation.restore(taken)
    assert bullet.trees is trees
    assert not simulation._world.queries.contacts(needle, 0.0)


def test_what_diverged_gets_another_bullet_world_and_goes_on_as_a_fresh_one() -> None:
    scene = scene_of("needle_pick")
    simulation, fresh = Simulation(scene), Simulation(scene)
    trees, needle = simulation._world.engine.trees, simulation.bodies["BODY Needle"].body.index
    simulation._world.apply_force(needle, np.array([np.nan, 0.0, 0.0]), np.zeros(3))
    simulation.step(1)
    assert any(problem.code == "diverged" for problem in simulation.problems)
    simulation.reset()
    assert simulation._world.engine.trees is not trees
    for one in (simulation, fresh):
        one.step(100)
    assert simulation.state_hash(clock=False) == fresh.state_hash(clock=False)


def test_a_joint_that_nothing_drives_any_more_reports_no_effort() -> None:
    simulation = Simulation(scene_of("suturing_small"))
    base = simulation.bodies["psm1/baselink"]
    rows = simulation._world.joints.control_of(base.body.joints[0])
    base.command_joints([0.3, 0.2, 0.1, 0.3, 0.2, -0.2, 0.4, 0.4])
    simulation.step(3)
    assert np.abs(rows.read(np.arange(8))[2]).max() > 1e-3
    base.release()
    simulation.step(3)
    assert (rows.read(np.arange(8))[2] == 0.0).all()


def test_commands_that_hold_over_a_reset_act_as_if_they_were_sent_again() -> None:
    scene = scene_of("suturing_small")
    hashes = []
    for ticks in (0, 333):
        simulation = Simulation(scene)
        base, needle = simulation.bodies["psm1/baselink"], simulation.bodies["BODY Needle"]
        above = [*(needle.pose[:3] + [0, 0, 0.02]), *needle.pose[3:]]
        base.command_joints([0.1, -0.1, 0.12, 0.3, 0.2, -0.2, 0.4, 0.4])
        needle.command_pose(above)
        if ticks:
            simulation.step(ticks)
            simulation.reset()
        simulation.step(200)
        hashes.append(simulation.state_hash(clock=False))
    assert hashes[0] == hashes[1]


def _continue_elsewhere(name: str, taken: Snapshot, seed: int, begin: int, end: int) -> str:
    simulation = Simulation(scene_of(name))
    simulation.restore(taken)
    Driver(simulation.scene, seed).run(simulation, begin, end)
    return simulation.state_hash()


def test_a_snapshot_goes_on_in_another_process() -> None:
    jobs, expected = [], []
    for name in QUICK[1:3]:
        simulation = Simulation(scene_of(name))
        driver = Driver(simulation.scene, 5)
        driver.run(simulation, 0, 70)
        jobs.append((name, simulation.snapshot(), 5, 70, 130))
        driver.run(simulation, 70, 130)
        expected.append(simulation.state_hash())
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.starmap(_continue_elsewhere, jobs) == expected


# --- load -------------------------------------------------------------------------------------


def _fall(folder: Path, fresh: Path) -> tuple[bool, str]:
    """Whether a ring that falls over a peg has a hole, in an empty cache, and the hash of its state after `TICKS`."""
    os.environ["LIGATURE_CACHE"] = str(fresh)
    scene = ligature.load(folder / "model.yaml")
    simulation = Simulation(scene)
    simulation.step(TICKS)
    return bool(np.abs(simulation.state["body_twist"][0, 0, 2]) > 0.5), simulation.state_hash()


def test_load_changes_nothing_not_even_the_decomposition_of_a_mesh(tmp_path: Path) -> None:
    trimesh.creation.torus(0.05, 0.015, major_sections=24, minor_sections=12).export(tmp_path / "ring.obj")
    ring = {"mass": 0.1, "mesh": "ring.obj", "collision mesh": "ring.obj", "collision mesh type": "CONCAVE_MESH"}
    peg = {"mass": 0.0, "collision shape": "CYLINDER", "collision geometry": {"radius": 0.02, "height": 0.2}}
    pose = {"position": {"x": 0.005, "y": 0.0, "z": 0.0}, "orientation": {"r": 0.2, "p": 0.1, "y": 0.0}}
    model = {"bodies": ["BODY ring", "BODY peg"], "BODY ring": {"name": "ring", "location": pose, **ring},
             "BODY peg": {"name": "peg", **peg}}  # fmt: skip
    (tmp_path / "model.yaml").write_text(yaml.safe_dump(model))
    runs = []
    for others in (0, 3):
        fresh = tmp_path / f"cache{others}"
        fresh.mkdir()
        (fresh / "kernels").symlink_to(cache_folder() / "kernels")
        with busy(others), multiprocessing.get_context("spawn").Pool(1) as pool:
            runs.append(pool.apply(_fall, (tmp_path, fresh)))
    assert runs[0] == runs[1]
    assert runs[0][0], "the ring rests on the peg as a hull would"


@pytest.mark.parametrize("name", QUICK[:2])
def test_a_busy_machine_changes_nothing(name: str) -> None:
    simulation, start, expected = driven(name)
    simulation.restore(start)
    with busy(3):
        Driver(simulation.scene, 0).run(simulation, 0, TICKS, [3, 50, 51])
    assert simulation.state_hash() == expected


# --- nothing that steps can lack a snapshot ---------------------------------------------------


def forgotten(name: str, begin: int = 60, ticks: int = 60, seed: int = 1) -> set[str]:
    """Attributes that a step changed and a restore did not put back, here or in another simulation."""
    simulation = Simulation(scene_of(name))
    driver = Driver(simulation.scene, seed)
    driver.run(simulation, 0, begin)
    before = attributes(simulation)
    taken = simulation.snapshot()
    driver.run(simulation, begin, begin + ticks)
    moved = attributes(simulation)
    assert sum(moved.get(path) != value for path, value in before.items()) > 5, "nothing moved"
    simulation.restore(taken)
    other = Simulation(simulation.scene)
    other.restore(taken)
    return {
        path
        for restored in (attributes(simulation), attributes(other))
        for path in before.keys() | restored.keys()
        if restored.get(path) != before.get(path)
    }


@pytest.mark.parametrize("name", [*OURS, FALLING, *(name for name in QUICK if name in THEIRS)])
def test_a_restore_puts_back_every_attribute_that_steps_change(name: str) -> None:
    assert forgotten(name) == set()


@pytest.mark.parametrize(
    ("name", "module", "table", "field"),
    [
        ("suturing_small", control, "_KEPT", "mode"),
        ("suturing_small", control, "_KEPT", "target"),
        ("suturing_small", rod, "JOINTS_KEPT", "load"),
        ("suturing_small", rod, "NODES_KEPT", "w"),
        ("suturing_small", rod, "_KEPT", "tension"),
        ("suturing_small", colliders, "_KEPT", "near"),
        ("suturing_small", impulses, "_KEPT", "total"),
        (next((n for n in QUICK if "gripper2/" in n), ""), rays, "STICK_KEPT", "_on_sensed"),
    ],
)
def test_a_field_that_is_left_out_of_a_snapshot_is_found(
    monkeypatch: pytest.MonkeyPatch, name: str, module: Any, table: str, field: str
) -> None:
    if not name:
        pytest.skip("the corpus is absent")
    monkeypatch.setattr(module, table, tuple(f for f in getattr(module, table) if f != field))
    assert any(field in path for path in forgotten(name))


@pytest.mark.parametrize(("part", "field"), [(Frame, "before"), (Interface, "mean"), (TissueBlock, "x")])
def test_a_field_of_tissue_that_is_left_out_of_a_snapshot_is_found(
    monkeypatch: pytest.MonkeyPatch, part: Any, field: str
) -> None:
    whole = part.snapshot

    def snapshot(self: Any) -> dict[str, Any]:
        found = whole(self)
        return {**found, field: 0.0 * found[field]}

    monkeypatch.setattr(part, "snapshot", snapshot)
    found = forgotten(FALLING if part is Frame else "needle_insertion")
    assert any(path.rstrip("]").endswith(field) for path in found), found


def test_a_subsystem_cannot_be_made_without_a_snapshot() -> None:
    class Forgetful(Subsystem):
        def step(self, tick: int) -> None:
            self.count = tick

        def reset(self) -> None:
            self.count = 0

    with pytest.raises(TypeError, match="snapshot"):
        Forgetful()  # type: ignore[abstract]
