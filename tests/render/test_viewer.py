"""What the window shows and does: views, toggles, dragging, pause, resets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.bus.pacing import Throttle
from ligature.model.commands import BodyCommand, PlaceCommand, Release, Reset
from ligature.model.frames import axis_rotation, frame, inverse, matrix_pose7, pose7_matrix
from ligature.model.mounted import camera_frame
from ligature.render import view_of
from ligature.render.controls import Controls
from ligature.render.viewer import Figures, Viewer

from tests.opengl import opengl

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"
SIZE = (320, 200)


@pytest.fixture(scope="module")
def small() -> Simulation:
    simulation = Simulation(ligature.load(SMALL))
    simulation.step(5)
    return simulation


@pytest.fixture
def sent() -> list[Any]:
    return []


@pytest.fixture
def viewer(small: Simulation, sent: list[Any]) -> Viewer:
    with opengl():
        return Viewer(Controls(small.scene, sent.append), 0)


@pytest.fixture
def shown(viewer: Viewer, small: Simulation) -> Callable[[], np.ndarray]:
    return lambda: viewer.picture(small.state, SIZE, Figures(25.0, 1.0))


def test_every_camera_and_the_free_view_come_in_turn(viewer: Viewer, shown: Callable[[], np.ndarray]) -> None:
    seen = []
    for _ in range(4):
        seen.append(viewer.camera)
        assert shown().shape == (200, 320, 3)
        viewer.key("V")
    assert seen == [0, 1, None, 0]


@pytest.mark.parametrize("key", "CFJTSH")
def test_every_toggle_changes_the_picture_and_changes_it_back(
    viewer: Viewer, shown: Callable[[], np.ndarray], key: str
) -> None:
    before = shown()
    viewer.key(key)
    assert (shown() != before).any(axis=2).sum() > 30
    viewer.key(key)
    assert (shown() == before).all()


def test_stereo_shows_the_pair_of_cameras_side_by_side(viewer: Viewer, small: Simulation) -> None:
    viewer.key("S")
    picture = viewer.picture(small.state, (321, 200), Figures())
    for side, name in ((slice(0, 160), "cameraL"), (slice(160, 320), "cameraR")):
        half = small.cameras[name].capture((160, 200), passes=("rgb",)).rgb
        assert np.abs(picture[60:, side].astype(int) - half[60:]).max() <= 2


def test_a_mouse_that_turns_the_view_leaves_the_camera_where_it_is(
    viewer: Viewer, shown: Callable[[], np.ndarray], sent: list[Any]
) -> None:
    before = shown()
    viewer.orbit(0, 0)
    assert viewer.camera is None and sent == []
    same = shown()
    changed = np.abs(same[60:].astype(int) - before[60:]).max(axis=2) > 40
    assert changed.mean() < 0.05, "the free view begins where the camera stands"
    for move in (viewer.orbit, viewer.pan):
        move(40, 20)
        after = shown()
        assert (after != same).any()
        same = after
    viewer.zoom(2)
    assert (shown() != same).any()


def test_contact_forces_are_asked_for_and_carry_the_weight_of_what_lies_there(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(
        "bodies: [Cube, Floor]\nnamespace: /ambf/env/\n"
        "Cube: {name: Cube, mass: 0.5, shape: BOX, geometry: {x: 0.1, y: 0.1, z: 0.1}, collision shape: BOX, collision geometry: {x: 0.1, y: 0.1, z: 0.1}, inertia: {ix: 0.01, iy: 0.01, iz: 0.01}, location: {position: {x: 0, y: 0, z: 0.05}}}\n"
        "Floor: {name: Floor, mass: 0, shape: BOX, geometry: {x: 1, y: 1, z: 0.1}, collision shape: BOX, collision geometry: {x: 1, y: 1, z: 0.1}, location: {position: {x: 0, y: 0, z: -0.05}}}\n"
    )
    simulation = Simulation(ligature.load(path))
    with opengl():
        viewer = Viewer(Controls(simulation.scene, simulation.apply), None)
    simulation.step(300)
    assert simulation.state["touch_count"][0] == 0
    before = viewer.picture(simulation.state, SIZE, Figures())
    viewer.key("N")
    for _ in range(16):
        simulation.step()
    count = int(simulation.state["touch_count"][0])
    assert abs(simulation.state["touch_force"][0, :count].sum(axis=0)[2]) == pytest.approx(0.5 * 9.8, rel=0.05)
    assert (viewer.picture(simulation.state, SIZE, Figures()) != before).any(axis=2).sum() > 60
    viewer.key("N")
    simulation.step()
    assert simulation.state["touch_count"][0] == 0


def test_pause_step_and_go_on_are_world_commands(viewer: Viewer, sent: list[Any]) -> None:
    viewer.key(".")
    assert sent == []
    for key in " .. ":
        viewer.key(key)
    assert sent == [
        Throttle(True, False, 1),
        Throttle(True, True, 1),
        Throttle(True, False, 1),
        Throttle(False, False, 0),
    ]


def test_the_references_keys_reset_bodies_and_cameras(viewer: Viewer, small: Simulation, sent: list[Any]) -> None:
    viewer.key("R")
    assert sent == []
    viewer.key("R", control=True)
    assert sent == [Reset(bodies_only=True)]
    viewer.key("V", control=True)
    assert [type(c) for c in sent[1:]] == [PlaceCommand, PlaceCommand]
    assert sent[1].pose == pytest.approx(small.state["camera_pose"][0, 0])


def test_a_body_follows_the_mouse_against_its_weight_and_is_let_go(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(
        "bodies: [Ball, Wall]\ncameras: [C]\nnamespace: /ambf/env/\n"
        "Ball: {name: Ball, mass: 0.3, shape: SPHERE, geometry: {radius: 0.1}, inertia: {ix: 0.01, iy: 0.01, iz: 0.01}}\n"
        "Wall: {name: Wall, mass: 0, shape: BOX, geometry: {x: 0.1, y: 9, z: 9}, location: {position: {x: -3, y: 0, z: 0}}}\n"
        "C: {name: C, location: {x: 2, y: 0, z: 0}, look at: {x: 0, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}, field view angle: 0.9}\n"
    )
    simulation, sent = Simulation(ligature.load(path)), []
    with opengl():
        viewer = Viewer(
            Controls(simulation.scene, lambda message: (sent.append(message), simulation.apply(message))), 0
        )
    viewer.picture(simulation.state, SIZE, Figures())
    assert viewer.grab(5, 5) is None, "a wall does not move"
    assert viewer.grab(160, 100) == "/ambf/env/Ball"
    viewer.drag(200, 60)
    for _ in range(60):
        simulation.step(33)
        viewer.picture(simulation.state, SIZE, Figures())
        viewer.pull()
    f = 100 / np.tan(0.45)
    wanted = np.array([(200 - 160) / f * 1.9, (100 - 60) / f * 1.9])
    assert simulation.bodies["Ball"].pose[1:3] == pytest.approx(wanted, abs=0.1)  # it hangs by a point of its surface
    assert isinstance(sent[-1], BodyCommand)
    viewer.let_go()
    assert sent[-1] == Release("body", simulation.bodies["Ball"].body.index) and not viewer.holds
    simulation.step(300)
    assert simulation.bodies["Ball"].pose[2] < wanted[1] - 0.2


@pytest.mark.parametrize("view", ["camera", "free"])
def test_an_arm_goes_where_the_mouse_goes(view: str) -> None:
    """Whichever way the view looks: the tip's pixel moves as the mouse did, the wheel takes it away, a turn turns it."""
    simulation, sent = Simulation(ligature.load(SMALL)), []
    with opengl():
        viewer = Viewer(
            Controls(simulation.scene, lambda message: (sent.append(message), simulation.apply(message))), 0
        )
    viewer.picture(simulation.state, SIZE, Figures())
    viewer.move_arm(10, 0)
    assert viewer.arm == "" and sent == [], "no arm is chosen"
    viewer.key("A")
    assert viewer.arm == "PSM1"
    psm = simulation.arms["PSM1"]
    for _ in range(400):
        simulation.step(10)
        if psm.is_homed and not psm.is_busy:
            break
    if view == "free":
        viewer.orbit(150, 40)

    def seen() -> np.ndarray:
        """The tip by the eye: right, down, away."""
        viewer.picture(simulation.state, SIZE, Figures())
        return (
            (viewer._view.view @ np.append(viewer._controls.arm._tip(simulation.state)[:3, 3], 1.0)) * [1, -1, -1, 1]
        )[:3]

    def steps(act: Callable[[], None], count: int) -> None:
        for _ in range(count):
            act()
            simulation.step(20)
            viewer.picture(simulation.state, SIZE, Figures())
        simulation.step(200)

    start = seen()
    steps(lambda: viewer.move_arm(0.5, 0.25), 20)
    moved, reach = seen() - start, start[2] if start[2] > 0 else np.linalg.norm(start)
    f = viewer._view.intrinsics[0, 0]
    assert moved == pytest.approx([10.0 * reach / f, 5.0 * reach / f, 0.0], rel=0.1, abs=3e-4)
    before = seen()
    steps(lambda: viewer.advance_arm(1.0), 2)
    assert seen() - before == pytest.approx([0.0, 0.0, 0.004], abs=3e-4)
    before, q = seen(), psm.setpoint_cp()[3:]
    steps(lambda: viewer.turn_arm(4.0, 0.0), 5)
    assert seen() == pytest.approx(before, abs=3e-4)
    assert 2.0 * np.arccos(min(abs(float(q @ psm.setpoint_cp()[3:])), 1.0)) == pytest.approx(0.1, abs=0.02)
    viewer.key("G")
    simulation.step(1500)
    closed = psm.jaw.setpoint_js().position[0]
    viewer.picture(simulation.state, SIZE, Figures())
    viewer.key("G")
    simulation.step(1500)
    assert psm.jaw.setpoint_js().position[0] - closed > 0.5
    viewer.key("A")
    viewer.key("A")
    assert viewer.arm == ""


SIGHT = """
bodies: [Ball, Carrier]
cameras: [Eye]
namespace: /ambf/env/
Ball: {name: Ball, mass: 0, shape: SPHERE, geometry: {radius: 0.01}}
Carrier: {name: Carrier, mass: 0, location: {position: {x: 0.3, y: -0.2, z: 0.1}, orientation: {r: 0.7, p: -0.4, y: 2.0}}}
Eye: {name: Eye, parent: Carrier, location: {x: 0.1, y: 0, z: 0}, look at: {x: 0, y: 0, z: 0}, mouse control multipliers: {pan: 1, rotate: 1, scroll: 1, arcball: 1}}
"""


@pytest.fixture(scope="module")
def sight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Simulation, Controls]:
    path = tmp_path_factory.mktemp("sight") / "m.yaml"
    path.write_text(SIGHT)
    simulation = Simulation(ligature.load(path))
    with opengl():
        controls = Controls(simulation.scene, simulation.apply)
    controls.key("M", False, None)
    return simulation, controls


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_scene_follows_a_mouse_that_moves_the_camera(sight: tuple[Simulation, Controls], seed: int) -> None:
    """From wherever the camera looks at the ball, rolled too: what is seen goes where the mouse went, the camera with it."""
    simulation, controls = sight
    rng = np.random.default_rng(seed)
    T_world_carrier = pose7_matrix(simulation.bodies["Carrier"].pose)
    back, roll, reach = rng.normal(size=3), rng.uniform(-np.pi, np.pi), rng.uniform(0.2, 0.8)
    back /= np.linalg.norm(back)
    if abs(back[2]) > 0.9:
        back = np.array([0.6, 0.0, 0.8])
    T = camera_frame(reach * back, np.zeros(3), np.array([0.0, 0.0, 1.0])) @ frame(
        axis_rotation((1, 0, 0), roll), np.zeros(3)
    )
    simulation.apply(PlaceCommand("camera", 0, tuple(matrix_pose7(inverse(T_world_carrier) @ T))))
    simulation.step()
    viewer = Viewer(controls, 0)
    viewer.picture(simulation.state, SIZE, Figures())
    middle = np.array([(SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2])

    def pixel(point: np.ndarray) -> np.ndarray:
        simulation.step()
        viewer.picture(simulation.state, SIZE, Figures())
        view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0], SIZE)
        x, y, z, _ = view.view @ np.append(point, 1.0)
        K = view.intrinsics
        return np.array([K[0, 2] + K[0, 0] * x / -z, K[1, 2] - K[1, 1] * y / -z])

    assert pixel(np.zeros(3)) == pytest.approx(middle, abs=0.6)
    drag = np.array([9.0, -6.0]) * rng.choice([-1.0, 1.0], 2)
    for act in (viewer.pan, viewer.look):
        act(*drag)
        moved = pixel(np.zeros(3)) - middle
        assert moved @ drag / np.linalg.norm(moved) / np.linalg.norm(drag) > 0.95, f"{act.__name__}: {moved} for {drag}"
        act(*-drag)
        assert pixel(np.zeros(3)) == pytest.approx(middle, abs=1.5)
    viewer.orbit(*drag)
    assert pixel(np.zeros(3)) == pytest.approx(middle, abs=1.5), "it turns about what it shows"
    assert np.linalg.norm(simulation.state["camera_world"][0, 0, :3]) == pytest.approx(reach, abs=0.02)
    viewer.zoom(3.0)
    simulation.step()
    assert np.linalg.norm(simulation.state["camera_world"][0, 0, :3]) < reach - 0.04
    assert viewer.camera == 0, "no free view"


def test_a_camera_that_is_moved_while_the_run_is_paused_is_shown_so(
    viewer: Viewer, small: Simulation, sent: list[Any]
) -> None:
    """The state does not change then; once it does, the camera is where the state has it."""
    viewer.key("M")
    before = viewer.picture(small.state, SIZE, Figures())
    viewer.pan(60.0, 0.0)
    assert [command.index for command in sent] == [0, 1], "both of the pair"
    for _ in range(40):
        after = viewer.picture(small.state, SIZE, Figures())
    assert (after[60:] != before[60:]).any(axis=2).mean() > 0.2
    later = small.state.copy()
    later["sim_time"] += 0.1
    assert (viewer.picture(later, SIZE, Figures())[60:] == before[60:]).all()


def test_cameras_that_the_mouse_moved_go_back(viewer: Viewer, small: Simulation, sent: list[Any]) -> None:
    viewer.key("M")
    before = viewer.picture(small.state, SIZE, Figures())
    viewer.orbit(60.0, 0.0)
    assert (viewer.picture(small.state, SIZE, Figures()) != before).any()
    viewer.key("V", control=True)
    assert (viewer.picture(small.state, SIZE, Figures()) == before).all()
    assert sent[-2].pose == pytest.approx(small.state["camera_pose"][0, 0])
