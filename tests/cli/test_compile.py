"""`ligature compile`: what is compiled ahead is what a run needs, so that none stops for seconds when a needle goes in."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from ligature import Simulation
from ligature.cli import compile as ahead

ROOT = Path(__file__).resolve().parents[2]
LATE = """
import runpy, sys
from numba.core import event
import ligature
late = []
class Listener(event.Listener):
    def on_start(self, event):
        pass
    def on_end(self, event):
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith("ligature"):
            late.append(f"{function.__module__}.{function.__name__}")
event.register("numba:compile", Listener())
sys.argv = sys.argv[1:]
try:
    runpy.run_path(sys.argv[0], run_name="__main__")
finally:
    print("late:", late)
"""


@pytest.mark.parametrize("scene", chain(*ahead.COMPILED_SCENES), ids=lambda path: path.parent.name)
def test_a_scene_that_is_compiled_has_needle_and_thread_pass_through_tissue(
    scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    passed: set[int] = set()
    most, step = [0.0, 0], Simulation.step

    def watched(self: Simulation, ticks: int = 1) -> None:
        step(self, ticks)
        passed.update(insertion.body for insertion in self.insertions)
        most[0] = max(most[0], float(np.linalg.norm(self.state["body_twist"][0, :, :3], axis=1).max()))
        most[1] = max(most[1], int(self.state["puncture_count"].sum()))
        watched.scene = self.scene  # type: ignore[attr-defined]

    monkeypatch.setattr(Simulation, "step", watched)
    ahead.run_for_a_moment(scene)
    loaded = watched.scene  # type: ignore[attr-defined]
    assert most[0] < 10.0
    if loaded.holes:
        assert loaded.needles[0].body in passed and passed & set(loaded.rods[0].bodies)
    else:
        assert most[1] == (4 if loaded.rods else 2)  # two lips of a wound, or a block; in and out


@pytest.mark.slow
def test_the_demonstrations_compile_nothing_after_what_is_compiled_ahead(tmp_path: Path) -> None:
    """Minutes: everything is compiled in a cache of its own."""
    env = {**os.environ, "LIGATURE_CACHE": str(tmp_path)}
    words = [sys.executable, "-m", "ligature", "compile"]
    subprocess.run(words, env=env, check=True, capture_output=True, timeout=1800)
    for example, options in (("record_dataset", [str(tmp_path / "throw.h5")]), ("suture_tissue", [])):
        words = [sys.executable, "-c", LATE, str(ROOT / "examples" / f"{example}.py"), *options]
        done = subprocess.run(words, env=env, capture_output=True, text=True, timeout=1800)
        assert done.stdout.splitlines()[-1] == "late: []", done.stdout + done.stderr
