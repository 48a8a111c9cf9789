"""Recorded runs on a page: a slider goes through their time, and two of them are compared."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.bus.record import Header, RecordWriter
from ligature.cli.options import RunOptions
from ligature.cockpit.replay_page import MOST_STATES, PERIOD, Reel, apart
from ligature.model.state import new_state
from ligature.process import end_with_parent
from ligature.robots.commands import VERBS

from tests.cockpit.conftest import SMALL, Person, until

pytestmark = pytest.mark.timeout(300)

LIGATURE = Path(sys.executable).parent / "ligature"
BALL = "bodies: [BODY Ball]\nBODY Ball:\n  name: Ball\n  mass: 1.0\n  inertia: {ix: 1, iy: 1, iz: 1}\n"


def recorded(path: Path, yaw: float) -> Path:
    """Two seconds in which PSM1 is placed, and after half a second at another ``yaw``."""
    options = RunOptions(str(SMALL), (0, 1, 2), rate=200.0)
    simulation = ligature.Simulation(options.load(), 1e-3, 5e-3)
    simulation.step(5)
    writer = RecordWriter(path, Header(options.to_text(), simulation.state_hash()))
    for update in range(1, 400):
        if update in (1, 100):
            command = VERBS["place_jp"](0, (0.1 if update == 1 else yaw, 0.1, 0.12, 0.0, 0.0, 0.0))
            writer.write(update, command)
            simulation.apply(command)
        simulation.step(5)
    writer.finish(400, simulation.state_hash())
    simulation.close()
    return path


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A page of two runs."""
    folder = tmp_path_factory.mktemp("runs")
    files = [recorded(folder / f"{name}.record", yaw) for name, yaw in (("left", 0.1), ("right", 0.3))]
    command = [LIGATURE, "replay", files[0], "--page", "--compare", files[1], "--at", "127.0.0.1:0"]
    process = subprocess.Popen(
        list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        preexec_fn=end_with_parent,
    )  # fmt: skip
    lines: list[str] = []
    assert process.stdout is not None
    threading.Thread(target=lambda: lines.extend(iter(process.stdout.readline, "")), daemon=True).start()  # type: ignore[union-attr]
    ready = until(lambda: next((x for x in lines if x.startswith("replay ready: ")), ""), lambda: "".join(lines))
    yield ready.partition(": ")[2].strip()
    process.terminate()
    assert process.wait(20) == 0


def shown(person: Person) -> str:
    return str(person.driver.execute_script("return document.getElementById('replay')?.innerText ?? ''"))


def distance(person: Person) -> float:
    """Millimetres that the tips of both runs are apart where the slider is."""
    return float(shown(person).partition("PSM1 ")[2].partition(" mm")[0])


def test_a_slider_goes_through_a_run_and_shows_how_far_another_is_apart(url: str, person: Person) -> None:
    person.opens(url)
    until(lambda: "left: 0.00 s" in shown(person), "the first run is shown")
    assert distance(person) == 0.0, "they begin alike"
    assert "tip force" in person.text and "PSM1, right" in person.text, "curves of both"
    assert not any(e.is_displayed() for e in person.driver.find_elements("id", "lig")), "there is nothing to operate"
    person.drags(person.slider("Time, s"), 90)
    until(lambda: distance(person) > 5.0, "later they are apart")
    person.drags(person.slider("Time, s"), -120)
    until(lambda: distance(person) == 0.0, "and the way back is shown, too")
    person.clicks("Play")
    until(lambda: distance(person) > 5.0, "it plays")


def test_records_of_different_scenes_and_bad_files_are_reported(tmp_path: Path) -> None:
    file = recorded(tmp_path / "a.record", 0.2)
    (tmp_path / "b.record").write_text("no record")
    done = subprocess.run(
        [LIGATURE, "replay", file, "--page", "--compare", tmp_path / "b.record", "--at", "127.0.0.1:0"],
        capture_output=True, text=True, timeout=200,
    )  # fmt: skip
    assert done.returncode == 1
    assert "b.record" in done.stdout and "Traceback" not in done.stdout + done.stderr


@given(st.integers(1, 400), st.floats(0.001, 0.2), st.floats(-0.5, 30.0))
def test_the_state_shown_is_the_nearest_that_was_kept(count: int, step: float, when: float) -> None:
    reel = _ball("a")
    for k in range(count):
        state = new_state(reel.scene)
        state["sim_time"] = 5.0 + k * step
        reel.take(state)
    there = float(reel.at(when)["sim_time"][0]) - 5.0
    assert abs(there - when) == pytest.approx(np.abs(np.array(reel.times) - when).min(), abs=1e-9)
    assert np.all(np.diff(reel.times) >= PERIOD * (1.0 - 1e-5))
    assert reel.duration >= (count - 1) * step - max(PERIOD, step) - 1e-9, "it covers the run"


def test_a_long_run_takes_bounded_memory() -> None:
    reel = _ball("a")
    for k in range(5 * MOST_STATES):
        state = new_state(reel.scene)
        state["sim_time"] = k * PERIOD
        reel.take(state)
    assert len(reel.states) <= MOST_STATES
    assert reel.duration > 0.98 * 5 * MOST_STATES * PERIOD


def test_equal_states_are_not_apart() -> None:
    scene = ligature.load(SMALL)
    state = new_state(scene)
    assert {name for name, _ in apart(scene, state, state)} == {"PSM1", "PSM2", "needle"}
    assert all(metres == 0.0 for _, metres in apart(scene, state, state))


def _ball(name: str) -> Reel:
    return Reel(name, _SCENE)


def _scene() -> ligature.Scene:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "ball.yaml"
        model.write_text(BALL)
        return ligature.load(model)


_SCENE = _scene()
