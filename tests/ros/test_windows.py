"""`ambf_simulator -g 1`: a window for each camera, and its mouse moves the camera for everybody on ROS."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.render.screen import Hands, xvfb
from tests.ros.conftest import BIN, SMALL
from tests.waiting import until

pytestmark = pytest.mark.ros


def test_a_mouse_in_a_camera_s_window_moves_the_pair_on_ros(
    start: Callable[..., Any], listen: Callable[..., Any], ros_env: dict[str, str], tmp_path: Path
) -> None:
    from ambf_msgs.msg import CameraState

    from tests.ros.crtk import pose7

    with xvfb(tmp_path) as screen:
        command = ["--launch_file", SMALL, "-l", "0", "-p", "200", "-g", "1", "--no-cameras"]
        program = start(BIN / "ambf_simulator", *command, env=dict(ros_env, DISPLAY=screen.display))
        program.wait_for("window ready")
        states = [listen(f"/ambf/env/cameras/camera{side}/State", CameraState) for side in "LR"]

        def places() -> np.ndarray:
            return np.array([pose7(state.wait().pose) for state in states])

        until(
            lambda: len(np.unique(screen.picture().reshape(-1, 3), axis=0)) > 1000, "the windows show something", 30.0
        )
        before = places()
        hands = Hands(screen.display)
        hands.move(500, 400)
        hands.button(3, True)
        hands.move(560, 380)
        until(lambda: np.abs(places() - before).max() > 1e-3, "the camera moves", 20.0)
        hands.button(3, False)
        after = places()
        assert after[0] - before[0] == pytest.approx(after[1] - before[1], abs=1e-6), "side by side as before"
        assert "window: " not in program.output, program.output
        assert program.end() == 0
