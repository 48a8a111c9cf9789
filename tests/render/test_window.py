"""Windows under Xvfb: they show the viewers' pictures, stand where they should, and mouse and keys arrive."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import glfw
import ligature
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature import Simulation
from ligature.bus.pacing import Throttle
from ligature.render import RenderUnavailable
from ligature.render.viewer import Figures
from ligature.render.window import SIZE, Window, placed
from ligature.render.windows import Windows
from ligature.robots.commands import StateCommand

from tests.render import screen as of_screen
from tests.render.screen import Hands, Screen, xvfb

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"
FIGURES = Figures(20.0, 1.0)


@pytest.fixture(scope="module")
def screen(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Screen]:
    with xvfb(tmp_path_factory.mktemp("screen")) as found:
        yield found


def wait(condition: Callable[[], bool], turn: Callable[[], object], seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        turn()


def test_without_a_display_the_message_states_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(RenderUnavailable, match="there is no display; set DISPLAY, or run without '--window'"):
        Window("x")


def test_a_display_that_cannot_be_opened_is_named() -> None:
    code = "from ligature.render.window import Window; Window('x')"
    done = subprocess.run(
        [sys.executable, "-c", code], env=dict(os.environ, DISPLAY=":987"), capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert "the display ':987' cannot be opened; set DISPLAY, or run without '--window'" in done.stderr


def test_the_window_shows_the_picture_and_passes_mouse_and_keys_on(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", screen.display)
    simulation = Simulation(ligature.load(SMALL))
    simulation.step(5)
    sent: list[Any] = []
    windows = Windows(simulation.scene, sent.append)
    try:
        viewer, controls = windows.viewers[0], windows.controls

        def turn() -> np.ndarray:
            windows.show(simulation.state, FIGURES)
            return viewer.picture(simulation.state, SIZE, FIGURES)

        def same() -> bool:
            left, top, width, height = windows.windows[0].box
            shown = screen.picture()[top : top + height, left : left + width]
            return bool((shown == viewer.picture(simulation.state, SIZE, FIGURES)).all())

        wait(same, turn)
        hands = Hands(screen.display)
        hands.move(300, 300)
        hands.key(" ")
        wait(lambda: sent == [Throttle(True, False, 1)], turn)
        hands.key("F")
        wait(lambda: controls.shown == {"frames"}, turn)
        wait(same, turn)
        hands.key("Control", True)
        hands.key("R")
        hands.key("Control", False)
        wait(lambda: len(sent) == 2, turn)
        before = turn()
        hands.button(1, True)
        hands.move(380, 330)
        wait(lambda: viewer.camera is None, turn)
        hands.button(1, False)
        assert (turn() != before).any()
        hands.key("A")
        wait(lambda: viewer.arm == "PSM1", turn)
        count = len(sent)
        assert isinstance(sent[-1], StateCommand), "the arm is asked for power and homing"
        hands.key("Shift", True)
        hands.button(1, True)
        hands.move(400, 340)
        wait(lambda: len(sent) > count, turn)
        hands.button(1, False)
        hands.key("Shift", False)
        assert windows.open
    finally:
        windows.close()


@pytest.fixture
def opened(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Windows]]:
    """Opens a window for each camera of a simulation, whose commands it obeys."""
    monkeypatch.setenv("DISPLAY", screen.display)
    yield lambda simulation: Windows(simulation.scene, simulation.apply, each_camera=True)
    glfw.terminate()


def test_each_camera_has_its_window_and_the_mouse_moves_the_pair(
    screen: Screen, opened: Callable[..., Windows]
) -> None:
    simulation = Simulation(ligature.load(SMALL))
    simulation.step(5)
    windows = opened(simulation)
    assert [window.title.split()[-1] for window in windows.windows] == ["cameraL", "cameraR"]
    boxes = [window.box for window in windows.windows]
    assert len({box[:2] for box in boxes}) == 2 and all(box[2:] == SIZE for box in boxes)

    def turn() -> None:
        simulation.step()
        windows.show(simulation.state, FIGURES)

    def look(number: int) -> np.ndarray:
        """The camera of a window by itself, as another program sees it."""
        camera = windows.viewers[number].camera
        assert camera is not None
        return simulation.cameras[simulation.scene.cameras[camera].identity.name].capture(SIZE, passes=("rgb",)).rgb  # type: ignore[no-any-return]

    turn()
    first = [look(0), look(1)]
    before = simulation.state["camera_world"][0].copy()
    hands = Hands(screen.display)
    hands.move(boxes[0][0] + 10, boxes[0][1] + 20)  # the first window shows its corner beside the second
    turn()
    hands.button(3, True)
    hands.move(boxes[0][0] + 10, boxes[0][1] + 80)
    wait(lambda: bool((simulation.state["camera_world"][0, 0] != before[0]).any()), turn)
    hands.button(3, False)
    for _ in range(3):
        turn()
    after = simulation.state["camera_world"][0]
    assert after[0, :3] - before[0, :3] == pytest.approx(after[1, :3] - before[1, :3], abs=1e-9)
    assert after[:, 3:] == pytest.approx(before[:, 3:], abs=1e-6), "a right drag turns nothing"
    for number in (0, 1):
        assert (look(number) != first[number]).any(axis=2).mean() > 0.2, "its published pictures move too"
        shown = windows.viewers[number].picture(simulation.state, SIZE, FIGURES)
        assert np.abs(shown[60:].astype(int) - look(number)[60:]).max() <= 2


def test_f11_fills_the_monitor_and_goes_back(screen: Screen, opened: Callable[..., Windows]) -> None:
    simulation = Simulation(ligature.load(SMALL))
    simulation.step(5)
    windows = opened(simulation)
    window, turn = windows.windows[1], lambda: windows.show(simulation.state, FIGURES)
    box = window.box
    hands = Hands(screen.display)
    hands.move(box[0] + 300, box[1] + 300)
    turn()
    hands.key("F11")
    wait(lambda: window.full_screen and window.size == of_screen.SIZE, turn)

    def same() -> bool:
        picture = windows.viewers[1].picture(simulation.state, of_screen.SIZE, FIGURES)
        return bool((screen.picture() == picture).all())

    wait(same, turn)
    assert not windows.windows[0].full_screen
    hands.key("F11")
    wait(lambda: not window.full_screen and window.box == box, turn)


def test_a_window_that_is_closed_leaves_the_others(opened: Callable[..., Windows]) -> None:
    simulation = Simulation(ligature.load(SMALL))
    simulation.step(5)
    windows = opened(simulation)
    glfw.set_window_should_close(windows.windows[0]._window, True)
    for _ in range(2):
        windows.show(simulation.state, FIGURES)
    assert windows.open
    assert [glfw.get_window_attrib(window._window, glfw.VISIBLE) for window in windows.windows] == [0, 1]
    glfw.set_window_should_close(windows.windows[1]._window, True)
    assert not windows.open


SCENE = """
bodies: [Ball]
cameras: [One, Two, Three]
namespace: /ambf/env/
Ball: {name: Ball, mass: 0.0, shape: SPHERE, geometry: {radius: 0.1}}
One: {name: One, location: {x: 2, y: 0, z: 0}, look at: {x: 0, y: 0, z: 0}, monitor: 0, window resolution: {width: 320, height: 200}, controlling devices: [MTML, MTMR]}
Two: {name: Two, location: {x: 2, y: 0, z: 0}, look at: {x: 0, y: 0, z: 0}, visible: false}
Three: {name: Three, location: {x: 2, y: 0, z: 0}, look at: {x: 0, y: 0, z: 0}, monitor: 1, window resolution: {width: 400, height: 300}, stereo: {mode: PASSIVE_LEFT_RIGHT, eye separation: 0.2, focal length: 2.0}}
"""


def test_windows_are_as_the_cameras_of_the_file_describe(
    opened: Callable[..., Windows], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Size, title, monitor, visibility and stereo; the second monitor is one that is made up: Xvfb has but one."""
    path = tmp_path / "m.yaml"
    path.write_text(SCENE)
    simulation = Simulation(ligature.load(path))
    simulation.step()
    asked = []
    areas = {"left": (0, 0, 500, 700), "right": (500, 0, 524, 700)}
    monkeypatch.setattr(glfw, "get_monitors", lambda: list(areas))
    monkeypatch.setattr(glfw, "get_monitor_workarea", lambda monitor: asked.append(monitor) or areas[monitor])
    windows = opened(simulation)
    assert [window.title for window in windows.windows] == ["Ligature: m: One [MTML, MTMR]", "Ligature: m: Three"]
    assert [window.box for window in windows.windows] == [(90, 250, 320, 200), (562, 200, 400, 300)]
    assert asked == ["left", "right"]
    windows.show(simulation.state, FIGURES)
    pair = windows.viewers[1].picture(simulation.state, (400, 300), FIGURES)[60:]
    left, right = pair[:, :200].astype(int), pair[:, 200:].astype(int)
    assert windows.viewers[1].stereo and not windows.viewers[0].stereo
    for half, eye in ((left, "left"), (right, "right")):
        assert (
            np.abs(half - simulation.cameras["Three"].capture((200, 300), passes=("rgb",), eye=eye).rgb[60:]).max() <= 2
        )
    assert np.abs(left - right).max() > 40, "two eyes see it from two places"


@given(
    monitor=st.tuples(
        st.integers(-4000, 4000), st.integers(-4000, 4000), st.integers(300, 8000), st.integers(200, 4000)
    ),
    size=st.tuples(st.integers(1, 5000), st.integers(1, 5000)),
    number=st.integers(0, 40),
)
def test_a_window_opens_inside_its_monitor(
    monitor: tuple[int, int, int, int], size: tuple[int, int], number: int
) -> None:
    left, top, width, height = placed(monitor, size, number)
    assert monitor[0] <= left and left + width <= monitor[0] + monitor[2]
    assert monitor[1] <= top and top + height <= monitor[1] + monitor[3]
    assert (width, height) == (min(size[0], monitor[2]), min(size[1], monitor[3]))
    if number == 0:
        assert abs((2 * left + width) - (2 * monitor[0] + monitor[2])) <= 1
