"""What takes long: progress in words, errors whole, the thread that moves, CoACD that is fetched."""

import os
import sys
import time

import bpy
import numpy as np
import pytest
from adf_studio import decompose_operators
from adf_studio.decompose_operators import Job, fetch_command, packages
from adf_studio.simulate_operators import elements_of, nodes_of, progress
from adf_studio.waiting import Process

from .scene import body, model, select


def test_words_of_the_simulator_become_progress():
    assert progress("") == ("Starting the simulator; after an installation it compiles first, for 1 to 3 minutes", None)
    line = "compiling for this machine, once: 12 kernels after 4 s\n"
    assert progress(line) == ("Compiling the simulator for this machine: 1 to 3 minutes, once", None)
    assert progress(line + "3 of 12 frames\n6 of 12 frames\n") == ("Simulating: frame 6 of 12", 0.5)


@pytest.mark.parametrize("seed", range(5))
def test_elements_of_a_thread_become_its_line(seed):
    """Elements of a line of equal parts, each turned by some angle about its own axis, give its corners again."""
    rng = np.random.default_rng(seed)
    count, length = int(rng.integers(2, 20)), 0.005
    steps = rng.normal(size=(count, 3))
    nodes = np.concatenate(
        [np.zeros((1, 3)), np.cumsum(length * steps / np.linalg.norm(steps, axis=1)[:, None], axis=0)]
    )
    poses = np.zeros((1, count, 7))
    for i, along in enumerate(np.diff(nodes, axis=0) / length):
        turn = np.array([-along[1], along[0], 0.0, 1.0 + along[2]])  # from z to the element's direction
        twist = rng.uniform(-3.0, 3.0)
        x, y, z, w = turn / np.linalg.norm(turn)
        s, c = np.sin(twist / 2), np.cos(twist / 2)
        poses[0, i] = [*(nodes[i] + nodes[i + 1]) / 2, x * c + y * s, y * c - x * s, z * c + w * s, w * c - z * s]
    np.testing.assert_allclose(nodes_of(poses, length)[0], nodes, atol=1e-9)
    names = [f"/x/SUTURE t_{i:03d}" for i in range(count)]
    order = rng.permutation(count)
    mixed = ["/x/BODY a", *(names[i] for i in order), "/x/SUTURE t2_000"]
    assert [mixed[i] for i in elements_of("/x/SUTURE t", mixed)] == names


def test_a_process_imports_nothing_from_the_folder_that_blender_was_started_in(tmp_path, monkeypatch):
    """Which may be one of files that others made."""
    (tmp_path / "json.py").write_text("raise SystemExit('imported')")
    monkeypatch.chdir(tmp_path)
    job = Process("test")
    job.start([sys.executable, "-m", "json.tool", os.devnull])
    while not job.finished:
        time.sleep(0.01)
    assert "imported" not in job.words and "Expecting value" in job.words


def use_simulator(monkeypatch):
    python = os.environ.get("LIGATURE_PYTHON")
    if python is None:
        pytest.skip("set LIGATURE_PYTHON to a Python that has ligature")
    monkeypatch.setenv("PYTHONPATH", os.path.join(os.environ["LIGATURE_ROOT"], "simulator"))
    preferences = bpy.context.preferences.addons["adf_studio"].preferences
    preferences.simulator = os.path.join(os.path.dirname(python), "ligature")


def test_the_thread_moves_with_its_needle(monkeypatch):
    use_simulator(monkeypatch)
    model()
    bpy.context.scene.cursor.location = (0.0, 0.0, 0.5)
    bpy.ops.adf.add_needle(with_thread="PHYSICAL", length=0.05, elements=10)
    assert bpy.ops.adf.simulate(seconds=0.2) == {"FINISHED"}
    motion = bpy.data.collections["ADF Motion"].objects
    tube = next(o for o in motion if o.type == "CURVE")
    assert len(tube.data.splines[0].points) == 11 and tube.data.bevel_depth > 0.0
    heights = []
    for frame in (0, 4):
        bpy.context.scene.frame_set(bpy.context.scene.frame_start + frame)
        shape = tube.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
        heights.append(np.mean([(tube.matrix_world @ v.co).z for v in shape.vertices]))
    fps = bpy.context.scene.render.fps / bpy.context.scene.render.fps_base
    fallen = 0.5 * 9.8 * (4 / fps) ** 2
    assert heights[0] - heights[1] == pytest.approx(fallen, rel=0.1)
    bpy.ops.adf.clear_motion()
    assert not [c for c in bpy.data.curves if c.name.endswith("motion")]


def test_all_that_a_failed_simulator_printed_is_kept(monkeypatch, tmp_path):
    model()
    body("part")
    script = tmp_path / "fails"
    script.write_text("#!/bin/sh\nfor i in 1 2 3 4 5 6 7 8; do echo line $i of the reason; done\nexit 3\n")
    script.chmod(0o755)
    bpy.context.preferences.addons["adf_studio"].preferences.simulator = str(script)
    with pytest.raises(RuntimeError, match="The simulator failed: line 8 of the reason; the text 'Simulator' has all"):
        bpy.ops.adf.simulate(seconds=0.1)
    assert bpy.data.texts["Simulator"].as_string().count("of the reason") == 8
    bpy.context.preferences.addons["adf_studio"].preferences.simulator = str(tmp_path / "gone")
    with pytest.raises(RuntimeError, match="The simulator cannot be started: .*gone"):
        bpy.ops.adf.simulate(seconds=0.1)


def test_all_that_a_failed_worker_printed_is_kept(monkeypatch, tmp_path):
    monkeypatch.setattr("adf_studio.compat.cache_folder", lambda: str(tmp_path))
    words = "import sys; print('first words'); print('last words'); sys.exit(5)"
    monkeypatch.setattr(decompose_operators, "_worker", lambda: [sys.executable, "-c", words])
    job = Job(np.zeros((3, 3)), np.array([[0, 1, 2]]), {})
    while not job.finished:
        pass
    with pytest.raises(ValueError, match="CoACD failed: last words; the text 'CoACD' has all that it printed"):
        job.pieces()
    assert "first words" in bpy.data.texts["CoACD"].as_string()


def test_a_process_that_is_cancelled_ends_at_once():
    job, start = Process("wait"), time.monotonic()
    job.start([sys.executable, "-c", "import time; time.sleep(60)"])
    job.cancel()
    assert job.finished and time.monotonic() - start < 30.0


@pytest.fixture
def without_coacd(monkeypatch, tmp_path):
    """A Python that has no CoACD, and an empty folder for what is fetched."""
    monkeypatch.setattr("adf_studio.compat.cache_folder", lambda: str(tmp_path / "cache"))
    monkeypatch.setattr("adf_studio.compat.is_online", lambda: True)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    packages.cache_clear()
    yield tmp_path
    packages.cache_clear()


def test_without_coacd_the_button_tells_what_to_do_and_the_command_fetches_it(without_coacd, monkeypatch):
    model()
    select(body("part"))
    with pytest.raises(RuntimeError, match="has no CoACD; use Fetch CoACD first"):
        bpy.ops.adf.decompose()
    command = fetch_command()
    assert command[:4] == ["python3", "-m", "pip", "install"] and command[-1] == "coacd==1.0.14"
    assert command[command.index("--target") + 1].startswith(str(without_coacd))
    fake = without_coacd / "python"
    fake.write_text('#!/bin/sh\nwhile [ "$1" != --target ]; do shift; done\nmkdir -p "$2/coacd"\n')
    fake.chmod(0o755)
    monkeypatch.setattr("adf_studio.compat.python", lambda: str(fake))
    assert bpy.ops.adf.fetch_coacd() == {"FINISHED"}
    assert packages() == (str(without_coacd / "cache" / "packages"),)


def test_a_blender_that_is_offline_names_the_command_instead(without_coacd, monkeypatch):
    monkeypatch.setattr("adf_studio.compat.is_online", lambda: False)
    with pytest.raises(RuntimeError, match="Go online in .* or run python3 -m pip install --no-deps .*coacd==1.0.14"):
        bpy.ops.adf.fetch_coacd()


def test_a_fetch_that_fails_tells_why_and_names_the_command(without_coacd, monkeypatch):
    fake = without_coacd / "python"
    fake.write_text("#!/bin/sh\necho ERROR: no network\nexit 1\n")
    fake.chmod(0o755)
    monkeypatch.setattr("adf_studio.compat.python", lambda: str(fake))
    with pytest.raises(RuntimeError, match="(?s)no network.*In a terminal the same is: python3 -m pip install"):
        bpy.ops.adf.fetch_coacd()
