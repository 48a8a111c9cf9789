"""The example that drills: forces of the burr, what collides and is drawn afterwards, and snapshots to the bit."""

from __future__ import annotations

import importlib.util
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.model.commands import PluginCommand
from ligature.model.scene import Scene

from tests.conftest import ROOT

FOLDER = ROOT / "examples" / "plugins" / "drilling"
TOP = 0.015
"""Height of the bone's top."""


@cache
def scene() -> Scene:
    return ligature.load(FOLDER / "drilling.yaml")


def drilling(made: Scene | None = None, spin: bool = True) -> Simulation:
    sim = Simulation(made or scene(), allow_plugins=True)
    sim.apply(PluginCommand(0, 0, (float(spin),)))
    return sim


def module() -> Any:
    spec = importlib.util.spec_from_file_location("drilling_example", FOLDER / "drilling.py")
    assert spec is not None and spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def published(sim: Simulation) -> tuple[np.ndarray, int, float]:
    """Force (3,), removed voxels, depth."""
    values = sim.state["plugin_value"][0]
    return values[:3].copy(), int(values[3]), float(values[4])


def go(sim: Simulation, at: list[float], ticks: int) -> None:
    sim.bodies["Drill"].command_pose([*at, 0, 0, 0, 1])
    sim.step(ticks)


def bone(sim: Simulation) -> Any:
    return sim._parts.plugins._plugins[0].volume


def test_the_slices_are_those_of_the_script(tmp_path: Path) -> None:
    shutil.copy(FOLDER / "make_bone.py", tmp_path)
    spec = importlib.util.spec_from_file_location("make_bone", tmp_path / "make_bone.py")
    assert spec is not None and spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    body = next(body for body in scene().bodies if body.volume is not None)
    assert body.volume is not None
    assert np.abs(body.volume.values.astype(int) - made.bone()).max() <= 1  # SciPy's filters differ by a bit


@given(share=st.floats(0.0, 1.0), radius=st.floats(1e-4, 0.1))
def test_the_depth_of_a_cap_is_that_of_its_volume(share: float, radius: float) -> None:
    height = 2 * radius * share
    assert module().cap_depth(np.pi * height**2 * (radius - height / 3), radius) == pytest.approx(
        height, abs=1e-6 * radius
    )


@settings(max_examples=15, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(
    x=st.floats(-0.012, 0.012), y=st.floats(-0.008, 0.008), z=st.floats(-0.004, 0.006), spin=st.booleans(),
    speed=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
)  # fmt: skip
def test_the_force_is_none_off_the_bone_and_bounded_and_out_of_it(
    x: float, y: float, z: float, spin: bool, speed: tuple[float, float, float]
) -> None:
    """The burr is put somewhere about the top with some speed; the voxels near it decide, by brute force."""
    sim = driven()
    sim.reset()
    sim.apply(PluginCommand(0, 0, (float(spin),)))
    drill = sim.bodies["Drill"]
    at = np.array([x, y, TOP + z])
    drill.set_pose([*at, 0, 0, 0, 1])
    sim._world.engine.place_of[drill.body.index].set_twist(np.array(speed), np.zeros(3))
    volume = bone(sim)
    form = volume._voxels.form
    before = volume.values >= volume.level
    sim.step(1)
    force, removed, depth = published(sim)
    points = np.stack(np.meshgrid(*form.axes, indexing="ij"), axis=-1) + [0, 0, 0.008]
    away = np.linalg.norm(points - at, axis=-1)
    now = volume.values >= volume.level
    assert np.linalg.norm(force) <= 15.0 + 1e-9
    assert removed == np.count_nonzero(before & ~now)
    if not spin:
        assert removed == 0
    assert not (before & ~now & (away > 0.002 + 1e-9)).any(), "nothing outside the burr goes"
    if not (before & (away < 0.002)).any():
        assert not force.any() and depth == 0.0
    elif depth > 0.0 and np.linalg.norm(force) > 0.0:
        near = now & (away < 0.002 - 0.25e-3)
        if near.sum() < 0.8 * (away < 0.002 - 0.25e-3).sum():
            inwards = points[near].mean(axis=0) - at if near.any() else np.zeros(3)
            assert force @ inwards <= 1e-6, "it points away from what is there"
        if np.dot(force, speed) < 0:  # moving in
            assert np.linalg.norm(force) >= min(3000.0 * depth, 15.0) - 1e-9


@cache
def driven() -> Simulation:
    return drilling()


def test_a_burr_that_does_not_spin_rests_on_the_bone_and_one_that_does_goes_in() -> None:
    depths = []
    for spin in (False, True):
        sim = drilling(spin=spin)
        go(sim, [0, 0, TOP + 0.003], 300)
        assert published(sim)[1] == 0 and not published(sim)[0].any()
        go(sim, [0, 0, TOP - 0.002], 1500)
        force, removed, _ = published(sim)
        depths.append(TOP + 0.002 - sim.bodies["Drill"].pose[2])
        assert bool(removed) == spin
        if not spin:  # springs of 1000 N/m of the hand and 3000 N/m of the bone in balance
            assert force[2] == pytest.approx(1000 * (sim.bodies["Drill"].pose[2] - (TOP - 0.002)), rel=0.02)
            assert force[2] > 2.0
        sim.close()
    assert depths[0] < 0.0018
    assert depths[1] > 0.0038


def test_feeding_faster_takes_more_force() -> None:
    peaks = []
    for speed in (0.002, 0.008):
        sim = drilling()
        go(sim, [0, 0, TOP + 0.0025], 200)
        ticks, most = round(0.006 / speed * 1000), 0.0
        for tick in range(0, ticks, 5):
            go(sim, [0, 0, TOP + 0.0025 - speed * tick * 1e-3], 5)
            most = max(most, float(published(sim)[0][2]))
        peaks.append(most)
        sim.close()
    assert peaks[1] > 1.5 * peaks[0] > 0.0


# --- what collides ----------------------------------------------------------------------------

BALL = """\
BODY Ball:
  name: Ball
  mass: 0.01
  inertia: {ix: 1.0e-6, iy: 1.0e-6, iz: 1.0e-6}
  shape: SPHERE
  geometry: {radius: 0.0015}
  collision shape: SPHERE
  collision geometry: {radius: 0.0015}
  collision margin: 0.0002
  location: {position: {x: 0.0, y: 0, z: 0.0175}}
"""


@pytest.fixture(scope="module")
def with_ball(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = tmp_path_factory.mktemp("drilling")
    shutil.copytree(FOLDER, folder, dirs_exist_ok=True)
    text = (folder / "drilling.yaml").read_text("utf-8")
    text = text.replace("bodies: [BODY Table, BODY Drill]", "bodies: [BODY Table, BODY Drill, BODY Ball]")
    (folder / "drilling.yaml").write_text(text + BALL)
    return ligature.load(folder / "drilling.yaml")


def drill_hole(sim: Simulation, depth: float = 0.006) -> None:
    """A hole of 2.6 mm radius in the middle of the top: the burr of 2 mm goes down and around."""
    sim.apply(PluginCommand(0, 0, (1.0,)))
    for step in range(8):
        angle = 2 * np.pi * step / 4
        go(sim, [6e-4 * np.cos(angle), 6e-4 * np.sin(angle), TOP - depth * (step + 1) / 12], 160)
    go(sim, [0, 0, 0.03], 300)


def test_bodies_and_rays_meet_what_is_left(with_ball: Scene) -> None:
    sim = drilling(with_ball)
    ball, index = sim.bodies["Ball"], sim.bodies["Bone"].body.index
    ball.set_pose([0.006, 0.004, 0.02, 0, 0, 0, 1])

    def hit(x: float) -> tuple[int, float]:
        hits = sim._parts.plugins._host.rays([[x, 0, 0.1]], [[x, 0, -0.1]])
        return int(hits.body[0]), float(hits.point[0, 2])

    assert hit(0.001) == (index, pytest.approx(TOP, abs=1e-4))
    drill_hole(sim)
    volume = bone(sim)
    axes = volume._voxels.form.axes
    for x in (-0.001, 0.0, 0.001, 0.006):
        column = volume.values[np.abs(axes[0] - x).argmin(), np.abs(axes[1]).argmin()] >= volume.level
        assert hit(x) == (index, pytest.approx(axes[2][column].max() + 0.008, abs=6e-4))
    assert hit(0.001)[1] < TOP - 0.004
    assert hit(0.006)[1] > TOP - 0.001
    ball.set_pose([0, 0, TOP + 0.0016, 0, 0, 0, 1])
    sim.step(400)
    assert ball.pose[2] < TOP - 0.003, "the ball fell into the hole"
    touched = sim._world.queries.contacts(ball.body.index, 0.001)
    assert touched and {contact.body for contact in touched} == {index}
    sim.reset()
    ball.set_pose([0, 0, TOP + 0.0017, 0, 0, 0, 1])
    sim.step(5)
    assert hit(0.004)[1] == pytest.approx(TOP, abs=5e-4)
    assert ball.pose[2] > TOP, "after a reset the bone is whole"
    sim.close()


@pytest.mark.parametrize("after", [3, 890])
def test_snapshots_and_resets_are_exact_while_it_drills(with_ball: Scene, after: int) -> None:
    """With contacts of a ball on the bone beside the hole, which chunks replaced meanwhile must not change."""
    sim = drilling(with_ball)
    start = sim.state["volume_value"].copy()
    go(sim, [0.001, 0, TOP + 0.001], 350)
    assert published(sim)[1] > 0
    go(sim, [0.003, 0.001, TOP], after)
    taken = sim.snapshot()

    def goes_on(one: Simulation) -> list[str]:
        hashes = []
        for x in (0.004, 0.002, -0.001):
            go(one, [x, 0, TOP - 0.001], 250)
            hashes.append(one.state_hash())
        return hashes

    expected = goes_on(sim)
    sim.restore(taken)
    assert goes_on(sim) == expected
    other = drilling(with_ball)
    other.restore(taken)
    assert np.array_equal(other.state["volume_value"], taken.state["volume_value"])
    assert goes_on(other) == expected
    for one in (sim, other):
        one.reset()
        assert np.array_equal(one.state["volume_value"], start)
    assert goes_on(sim) == goes_on(other)
    sim.close()
    other.close()


def test_another_bullet_client_changes_nothing(with_ball: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bullet keeps the shapes of replaced chunks; so the world goes on in another client from time to time."""
    from ligature.physics import volumes, world

    runs = []
    for most in (3, 1000):
        monkeypatch.setattr(volumes, "MOST_REPLACED", most)
        monkeypatch.setattr(world, "MOST_REPLACED", most)
        sim = drilling(with_ball)
        clients = [sim._world.engine.motions]
        taken = sim.snapshot()
        for x in (0.001, 0.008, -0.006):
            go(sim, [x, 0, TOP - 0.001], 400)
            clients.append(sim._world.engine.motions)
        assert (clients[0] is not clients[-1]) == (most == 3)
        assert sim.bodies["Ball"].pose[2] > 0.001
        sim.restore(taken)
        go(sim, [0.002, 0, TOP], 200)
        runs.append(sim.state_hash())
        sim.close()
    assert runs[0] == runs[1]


# --- what is drawn ----------------------------------------------------------------------------


def test_a_hole_is_drawn_with_its_depth_and_number() -> None:
    pytest.importorskip("moderngl")
    from ligature.render.renderer import Renderer

    sim = drilling()
    camera = sim.cameras["main"]
    before = camera.capture((96, 72))
    volume = bone(sim)
    with sim._parts.plugins._host.before_step():
        removed = volume.cut([0, 0, 0.02], [0, 0, 0.009], 0.003)
    assert removed > 500
    sim.step(0)
    after = camera.capture((96, 72))
    fresh = Renderer(sim.scene)
    again = fresh.render(sim.state, camera.view((96, 72)), ("rgb", "depth", "ids", "normals"))
    for name in ("rgb", "depth", "ids"):
        assert np.array_equal(getattr(after, name), getattr(again, name)), name
    number = {name: n for n, name in sim.scene.drawn_names.items()}[sim.bodies["Bone"].body.identity.identifier]
    deeper = after.depth > before.depth + 5e-4
    assert 20 < deeper.sum() < 0.1 * deeper.size
    assert (after.ids[deeper] == number).all()
    sim.reset()
    assert np.array_equal(camera.capture((96, 72)).rgb, before.rgb)
    fresh.release()
    sim.close()


def test_a_bone_that_is_drilled_away_is_not_drawn() -> None:
    pytest.importorskip("moderngl")
    sim = drilling()
    with sim._parts.plugins._host.before_step():
        bone(sim).cut([0, 0, 0], [0, 0, 0], 1.0)
    sim.step(1500)
    assert bone(sim).count == 0 and not sim.problems
    frame = sim.cameras["main"].capture((64, 48))
    number = {name: n for n, name in sim.scene.drawn_names.items()}[sim.bodies["Bone"].body.identity.identifier]
    assert not (frame.ids == number).any()
    assert not len(sim._parts.plugins._host.contacts(sim.bodies["Bone"].body.index))
    sim.close()


# --- the host ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda host: host.volume("Table"), "'Table' does not name exactly one volume"),
        (lambda host: host.volume("Bone").cut([0, 0, 0], [0, 0], 1e-3), "three finite numbers"),
        (lambda host: host.volume("Bone").cut([0, 0, 0], [0, 0, np.nan], 1e-3), "three finite numbers"),
        (lambda host: host.volume("Bone").cut([0, 0, 0], [0, 0, 0], 0.0), "above 0"),
        (lambda host: host.volume("Bone").overlap([0, 0, 0], float("inf")), "above 0"),
        (lambda host: host.volume("Bone").values.__setitem__(0, 1), "read-only"),
    ],
)
def test_what_a_plugin_cannot_ask_of_a_volume_is_named(call: Any, reason: str) -> None:
    sim = driven()
    with sim._parts.plugins._host.before_step(), pytest.raises((ValueError, LookupError), match=reason):
        call(sim._parts.plugins._host)
    with pytest.raises(RuntimeError, match="cut in before_step"):
        bone(sim).cut([0, 0, 0], [0, 0, 0], 1e-3)


def test_without_permission_a_volume_is_as_it_was() -> None:
    sim = Simulation(scene())
    assert not sim.scene.volumes and not sim.state["volume_value"].size
    hit = sim._world.queries.ray_test(np.array([[0, 0, 0.1]]), np.array([[0, 0, -0.1]]))
    assert hit.body[0] == sim.bodies["Bone"].body.index
    assert hit.point[0, 2] == pytest.approx(TOP, abs=1e-4)
    sim.close()
