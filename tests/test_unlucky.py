"""What befalls files and clocks: a full disk, folders that cannot be written, links that leave, clocks that jump."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.cli.test_physics import Run

ROOT = Path(__file__).resolve().parents[1]
LIGATURE = Path(sys.executable).parent / "ligature"
MEGABYTES = 3

FILLING = """
import json, sys
from pathlib import Path
import h5py, ligature
from ligature.datasets import DatasetError, DatasetWriter
from ligature.datasets.store import episode_names
path = Path(sys.argv[1]) / "a.h5"
simulation = ligature.Simulation(ligature.load(sys.argv[2], (3, 4)))
ended, printed = 0, ""
try:
    with DatasetWriter(path, simulation, cameras=(), rate=500.0) as writer:
        for number in range(10_000):
            for _ in range(100):
                simulation.step(2)
                writer.sample()
            writer.end_episode(True, number=number)
            ended += 1
except DatasetError as error:
    printed = str(error)
whole = 0
with h5py.File(path) as file:
    for name in episode_names(file):
        whole += len(file[name]["time"][:]) == 100
print(json.dumps({"ended": ended, "whole": whole, "printed": printed}))
"""


def in_mounts(script: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Run a shell script that mounts what it likes, without anybody else seeing it; skips where that is not allowed."""
    if shutil.which("unshare") is None:
        pytest.skip("unshare is not installed")
    allowed = subprocess.run(["unshare", "-m", "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True, text=True)
    if allowed.returncode != 0:
        pytest.skip(f"nothing can be mounted here: {allowed.stderr.strip()}")
    command = ["unshare", "-m", "sh", "-ec", script, "sh", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=280, cwd=ROOT)


def test_a_full_disk_ends_a_dataset_with_words_and_keeps_its_episodes(tmp_path: Path) -> None:
    disk, script = tmp_path / "disk", tmp_path / "fill.py"
    disk.mkdir()
    script.write_text(FILLING)
    mount = f'mount -t tmpfs -o size={MEGABYTES}m none "$1"; exec "$2" "$3" "$1" "$4"'
    done = in_mounts(mount, disk, sys.executable, script, ROOT / "scenes" / "suturing_small" / "launch.yaml")
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["ended"] >= 1, "there was room for an episode"
    assert "No space left on device" in found["printed"], found
    assert found["whole"] >= found["ended"], "what had ended can be read"


def test_a_scene_on_a_read_only_disk_is_checked_and_simulated(tmp_path: Path) -> None:
    here = tmp_path / "scenes"
    shutil.copytree(ROOT / "scenes", here)
    mount = 'mount --bind "$1" "$1"; mount -o remount,ro,bind "$1"; cd "$1"; ! touch "$1/x" 2>/dev/null; exec "$2" check "$3"'
    done = in_mounts(mount, here, LIGATURE, here / "peg_transfer" / "launch.yaml")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr


def test_a_mesh_that_is_a_link_out_of_the_scene_is_reported_and_not_read(tmp_path: Path) -> None:
    here, secret = tmp_path / "lab" / "scenes", tmp_path / "secret.obj"
    shutil.copytree(ROOT / "scenes", here)
    (tmp_path / "lab" / "package.xml").write_text("<package/>")
    mesh = next((here / "peg_transfer" / "high_res").glob("*.obj"))
    shutil.move(mesh, secret)
    mesh.symlink_to(secret)
    done = subprocess.run(
        [LIGATURE, "check", here / "peg_transfer" / "launch.yaml"], capture_output=True, text=True, timeout=200
    )
    printed = " ".join((done.stdout + done.stderr).split())
    assert re.search(r"task\.yaml:\d+:\d+: error: '\S*secret\.obj' lies outside the scene's folders", printed), printed
    assert "Traceback" not in printed


def test_a_clock_that_jumps_changes_stamps_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The wall clock is set by an hour either way, or stands: what is simulated goes by the monotonic clock."""
    begin = time.monotonic()
    run = Run(tmp_path)
    try:
        run.turn_for(0.2)
        for jump in (3600.0, -7200.0, 1e9, 0.0):
            monkeypatch.setattr("ligature.cli.loop.time.time", lambda jump=jump: 1.7e9 + jump)
            before, updates = float(run.simulation.state["sim_time"][0]), 0
            while updates < 20:
                updates += run.turn_for(0.02)
            simulated = float(run.simulation.state["sim_time"][0])
            assert simulated - before == pytest.approx(0.005 * updates)
            # since the run began, for it may catch up with what a busy machine kept from it
            assert simulated < time.monotonic() - begin + 0.02, "it does not run to catch up with the jump"
            assert float(run.simulation.state["stamp"][0]) == 1.7e9 + jump
    finally:
        run.loop.end()
        run.block.close()


def test_the_wall_clock_decides_nothing() -> None:
    """It is read for stamps and the age of files alone; durations and deadlines are those of the monotonic clock."""
    readers = [
        path.relative_to(ROOT / "simulator" / "ligature").as_posix()
        for path in (ROOT / "simulator" / "ligature").rglob("*.py")
        if "time.time()" in path.read_text("utf-8")
    ]
    assert sorted(readers) == ["cli/loop.py", "kernel_cache.py"]
