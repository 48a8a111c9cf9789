"""Curves of the page: what they show of a task goes with what the needle does."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import ligature
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.cockpit.curves import Curves, span_of
from ligature.model.scene import Scene
from ligature.model.state import new_state
from PIL import Image
from viser import ViserServer

from tests.cockpit.conftest import Person, Served, until
from tests.tasks.test_attempt import driven_through

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return ligature.load(SCENES / "suturing" / "launch.yaml")


@pytest.fixture(scope="module")
def server() -> Iterator[ViserServer]:
    made = ViserServer("127.0.0.1", 0, verbose=False)
    yield made
    made.stop()


def score_of(curves: Curves) -> Any:
    """The chart of the task's score."""
    return next(handle for handle in curves._handles if handle.title.startswith("task score"))


@pytest.mark.parametrize(("task", "share"), [("suture", 25.0), ("insertion", 100.0), ("", 25.0)])
def test_the_score_rises_with_each_hole_and_falls_with_a_reset(
    scene: Scene, server: ViserServer, task: str, share: float
) -> None:
    curves = Curves(scene, task)
    curves.show(server.gui)
    assert curves._attempt is not None
    state = driven_through(SimpleNamespace(monitor=curves._attempt.monitor, observe=curves.observe), scene, 1)
    curves.refresh(state)
    times, score = score_of(curves).data
    assert np.all(np.diff(times) > 0)
    assert set(score) == {0.0, share / 2, share}
    assert np.all(np.diff(score) >= 0)
    assert "exit 1" in curves._task.content
    state["resets"] += 1
    state["sim_time"] = 9.0
    curves.observe(state)
    curves.refresh(state)
    assert score_of(curves).data[1][-1] == 0.0
    assert "none yet" in curves._task.content


def test_a_scene_without_a_task_has_no_score(server: ViserServer) -> None:
    small = ligature.load(SCENES / "suturing_small" / "launch.yaml")
    curves = Curves(small)
    curves.show(server.gui)
    curves.observe(new_state(small)[0])
    curves.refresh(new_state(small)[0])
    assert not any(handle.title.startswith("task score") for handle in curves._handles)
    assert "No suturing task" in curves._task.content


@given(st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=30), st.sampled_from([0.1, 1.0]))
def test_an_axis_shows_all_values_and_is_not_much_too_long(values: list[float], least: float) -> None:
    low, high = span_of(np.array(values), least)
    assert low <= min(*values, 0.0)
    assert high >= max(*values, 0.0)
    assert high <= max(3.0 * max(values), least * (1.0 + 1e-9))
    assert -low <= max(-3.0 * min(values), 0.0)


def test_the_table_has_a_row_for_each_sample(scene: Scene, server: ViserServer) -> None:
    curves = Curves(scene)
    curves.show(server.gui)
    state = new_state(scene)[0]
    for tick in range(5):
        state["sim_time"] = 0.2 * tick
        curves.observe(state, 0.5)
    rows = list(csv.reader(io.StringIO(curves.table())))
    names, numbers = rows[0], np.array(rows[1:], dtype=float)
    assert names[0] == "time, s"
    assert numbers.shape == (5, len(names))
    assert numbers[:, 0] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8])
    assert (numbers[:, names.index("real-time factor: physics")] == 0.5).all()
    for word in ("thread tension", "tip force", "depth in tissue", "task score"):
        assert any(name.startswith(word) for name in names)


def test_save_as_picture_downloads_all_charts(served: Served, person: Person, tmp_path: Path) -> None:
    person.opens(served.url)
    charts = "return document.querySelectorAll('.uplot canvas').length"
    until(lambda: person.driver.execute_script(charts) >= 2, "charts are drawn")
    params = {"behavior": "allow", "downloadPath": str(tmp_path)}
    person.driver.execute_cdp_cmd("Browser.setDownloadBehavior", params)
    person.driver.execute_script("document.querySelector('[data-ligature=png]').click()")
    file = tmp_path / "ligature-curves.png"
    until(file.is_file, "a picture is saved")
    picture = np.asarray(Image.open(file).convert("RGB"), dtype=int)
    high = person.driver.execute_script(
        "return [...document.querySelectorAll('.uplot canvas')].reduce((sum, c) => sum + c.height, 0)"
    )
    assert picture.shape[0] >= high, "all charts, one below the other"
    ground = picture[0, -1]
    marked = np.abs(picture - ground).max(axis=2) > 60
    bands = np.array_split(marked, int(person.driver.execute_script(charts)))
    assert all(band.mean() > 0.001 for band in bands), "each has lines and labels"
    blue = (picture[..., 2] > 200) & (picture[..., 0] < 120)
    assert blue.any(), "curves are drawn in their colours"
