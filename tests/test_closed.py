"""Simulations that are closed, copied, or given the snapshot of another scene: reported in words, never a crash."""

from __future__ import annotations

import copy
import gc
import pickle  # noqa: TID251 (what a user would try)
import subprocess
import sys
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path

import ligature
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.simulation.unreferenced import simulations

SMALL = Path(__file__).resolve().parents[1] / "scenes" / "suturing_small" / "launch.yaml"
BOX = "{{name: {name}, mass: 1, shape: BOX, geometry: {{x: 1, y: 1, z: 1}}, location: {{position: {{x: {x}, y: 0, z: 0}}}}}}"

AFTER_CLOSE = """
import inspect, sys, ligature
simulation = ligature.Simulation(ligature.load(sys.argv[1]))
before = simulation.snapshot()
arms = list(simulation.arms.values())
handles = [simulation, *list(simulation.bodies.values())[:5], *simulation.joints.values(), *arms, *(a.jaw for a in arms
           if getattr(a, "jaw", None) is not None), simulation.grasps, simulation.tissues, *simulation.cameras.values()]
simulation.close()
values = (before, 0, 1, 1.0, "a", True, [0.0] * 6, [0.0] * 7, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], None)
used = 0
for handle in handles:
    for name in dir(handle):
        if name.startswith("_"):
            continue
        print(type(handle).__name__, name, flush=True)
        try:
            member = getattr(handle, name)
        except Exception as error:
            assert str(error), name
            continue
        if not callable(member) or inspect.isclass(member):
            continue
        for words in ((), *((value,) for value in values), *((0, value) for value in values[-4:])):
            used += 1
            try:
                member(*words)
            except Exception as error:
                assert str(error), name
print("used", used)
"""


@pytest.mark.timeout(600)
def test_nothing_of_a_closed_simulation_crashes() -> None:
    done = subprocess.run([sys.executable, "-c", AFTER_CLOSE, str(SMALL)], capture_output=True, text=True, timeout=580)
    assert done.returncode == 0, done.stdout[-300:] + done.stderr[-2000:]
    assert int(done.stdout.split()[-1]) > 500


def _box(folder: Path, names: list[str], x: float = 0.0) -> Path:
    keys = [f"BODY {name}" for name in names]
    bodies = "".join(
        f"{key}: {BOX.format(name=name, x=x + 2 * n)}\n" for n, (key, name) in enumerate(zip(keys, names, strict=True))
    )
    file = folder / "box.yaml"
    file.write_text(f"bodies: [{', '.join(keys)}]\n{bodies}")
    return file


@pytest.mark.parametrize(
    "act",
    [
        lambda s: s.step(),
        lambda s: s.reset(),
        lambda s: s.snapshot(),
        lambda s: s.touched(0),
        lambda s: next(iter(s.bodies.values())).set_pose([0, 0, 0, 0, 0, 0, 1]),
        lambda s: next(iter(s.bodies.values())).release(),
    ],
)
def test_a_closed_simulation_reports_it(act: Callable[[Simulation], object], tmp_path: Path) -> None:
    simulation = Simulation(ligature.load(_box(tmp_path, ["a"])))
    before = simulation.state_hash()
    simulation.close()
    simulation.close()
    assert simulation.state_hash() == before
    with pytest.raises(RuntimeError, match="the simulation is closed"):
        act(simulation)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_copies_are_refused_with_the_way_to_do_it(copied: Callable[[object], object], tmp_path: Path) -> None:
    simulation = Simulation(ligature.load(_box(tmp_path, ["a"])))
    for thing in (simulation, simulation.bodies["a"]):
        with pytest.raises(TypeError, match="restore its 'snapshot'"):
            copied(thing if copied is not copy.copy else simulation)
    simulation.close()


@pytest.fixture
def no_collector() -> Iterator[None]:
    """Python's collector does not run by itself, as when a program makes few objects."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.mark.parametrize("closes", [True, False])
def test_simulations_that_nobody_holds_are_freed(tmp_path: Path, no_collector: None, closes: bool) -> None:
    scene, made = ligature.load(_box(tmp_path, ["a"])), []
    most = 10 + 2 * len(simulations)  # of other tests too
    for _ in range(30):
        simulation = Simulation(scene)
        simulation.step(2)
        made.append(weakref.ref(simulation))
        if closes:
            simulation.close()
        del simulation
        assert sum(each() is not None for each in made) <= most


names = st.lists(st.sampled_from("abcd"), min_size=1, max_size=3, unique=True)


@settings(max_examples=15, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(first=names, second=names, ticks=st.integers(0, 20), dt=st.sampled_from((1e-3, 1e-3, 2e-3)))
def test_a_snapshot_fits_its_own_scene_and_tick_alone(
    tmp_path: Path, first: list[str], second: list[str], ticks: int, dt: float
) -> None:
    taken_of = Simulation(ligature.load(_box(tmp_path, first)))
    other = Simulation(ligature.load(_box(tmp_path, second)), dt)
    taken_of.step(ticks)
    snapshot = pickle.loads(pickle.dumps(taken_of.snapshot()))
    before = other.state_hash()
    if first == second and dt == taken_of.dt:
        other.restore(snapshot)
        assert other.state_hash() == taken_of.state_hash()
    else:
        with pytest.raises(ValueError, match="of another scene"):
            other.restore(snapshot)
        assert other.state_hash() == before
    with pytest.raises(TypeError, match="is not a snapshot"):
        other.restore({})  # type: ignore[arg-type]
    taken_of.close()
    other.close()


@pytest.mark.parametrize("seconds", [0.0, -1e-3, float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("name", ["dt", "update"])
def test_a_tick_and_an_update_are_finite_and_above_zero(name: str, seconds: float, tmp_path: Path) -> None:
    scene = ligature.load(_box(tmp_path, ["a"]))
    with pytest.raises(ValueError, match=f"{name} is .*; it must be a number of seconds above 0"):
        Simulation(scene, **{name: seconds})


@settings(max_examples=20, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ticks=st.integers(max_value=-1))
def test_time_does_not_run_backwards(tmp_path: Path, ticks: int) -> None:
    simulation = Simulation(ligature.load(_box(tmp_path, ["a"])))
    with pytest.raises(ValueError, match="it must be 0 or more"):
        simulation.step(ticks)
    simulation.close()


def test_a_name_that_finds_nothing_is_reported_without_quotation_marks_around_it(tmp_path: Path) -> None:
    simulation = Simulation(ligature.load(_box(tmp_path, ["a"])))
    for things in (simulation.bodies, simulation.joints, simulation.cameras, simulation.arms):
        with pytest.raises(KeyError) as raised:
            things["nobody"]
        assert str(raised.value) == raised.value.args[0]
    simulation.close()
