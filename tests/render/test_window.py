"""The window under Xvfb: it shows the viewer's picture, and mouse and keys arrive."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.bus.pacing import Throttle
from ligature.render import RenderUnavailable
from ligature.render.viewer import Figures, Viewer
from ligature.render.window import SIZE, Window
from ligature.robots.commands import StateCommand

from tests.render.screen import Hands, Screen, xvfb

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


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
    assert "the display ':987' cannot be opened" in done.stderr


def test_the_window_shows_the_picture_and_passes_mouse_and_keys_on(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", screen.display)
    simulation = Simulation(ligature.load(SMALL))
    simulation.step(5)
    window, sent = Window("test"), []
    try:
        viewer = Viewer(simulation.scene, sent.append, window.context)
        window.listen(viewer)

        def turn() -> np.ndarray:
            picture = viewer.picture(simulation.state, window.size, Figures(20.0, 1.0))
            window.show(picture)
            return picture

        def same() -> bool:
            return bool(
                (
                    screen.picture()[: SIZE[1], : SIZE[0]] == viewer.picture(simulation.state, SIZE, Figures(20.0, 1.0))
                ).all()
            )

        wait(same, turn)
        hands = Hands(screen.display)
        hands.move(300, 300)
        hands.key(" ")
        wait(lambda: sent == [Throttle(True, False, 1)], turn)
        hands.key("F")
        wait(lambda: viewer.shown == {"frames"}, turn)
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
        assert not window.closed
    finally:
        window.close()
