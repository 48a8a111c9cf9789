"""Cameras of a running simulation: pictures, calibration and stereo agree with closed forms."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.model.frames import inverse, pose7_matrix
from ligature.model.optics import T_CAMERA_OPTICAL
from ligature.render import Renderer, unproject, view_of

from tests.opengl import opengl
from tests.render.conftest import BEADS, LENS, camera

Make = Callable[..., Simulation]


def seen(simulation: Simulation, name: str, body: str, **how) -> np.ndarray:
    """Mean column and row of the pixels that show ``body``."""
    frame = simulation.cameras[name].capture(**how)
    rows, columns = np.nonzero(frame.ids == 1 + simulation.bodies[body].body.index)
    assert len(rows) > 10
    return np.array([columns.mean(), rows.mean()])


def optical(simulation: Simulation, name: str, point: tuple[float, ...]) -> np.ndarray:
    """``point`` of the world in the optical frame of a camera."""
    T = inverse(pose7_matrix(simulation.cameras[name].pose) @ T_CAMERA_OPTICAL)
    return T[:3, :3] @ point + T[:3, 3]


def test_importing_the_package_and_simulating_load_no_opengl() -> None:
    code = "import sys, ligature; ligature.Simulation; sys.exit('moderngl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_picture_has_colour_depth_and_ids_and_repeats_bit_for_bit(simulate: Make) -> None:
    eye = simulate(C=camera("C")).cameras["C"]
    frame, again = eye.capture(), eye.capture()
    assert frame.rgb.shape == (240, 320, 3) and frame.rgb.dtype == np.uint8
    assert frame.depth.shape == (240, 320) and frame.depth.dtype == np.float32
    assert frame.ids.shape == (240, 320) and frame.ids.dtype == np.int32
    for name in ("rgb", "depth", "ids"):
        assert (getattr(frame, name) == getattr(again, name)).all()
    normals = eye.capture(passes=("ids", "normals"))
    assert normals.rgb.size == 0 and np.allclose(normals.normals[normals.ids == 1], [0, 0, 1])


def test_a_resolution_given_with_the_capture_goes_before_the_cameras_own(simulate: Make) -> None:
    assert simulate(C=camera("C")).cameras["C"].capture((64, 48)).ids.shape == (48, 64)


def test_a_camera_is_found_by_its_name_though_another_name_contains_it(simulate: Make) -> None:
    cameras = simulate(cameraL=camera("cameraL"), cameraL2=camera("cameraL2", 0.1)).cameras
    assert cameras["cameraL"].camera.index == 0 and cameras["cameraL2"].camera.index == 1
    with pytest.raises(KeyError, match="'cameraX' does not name exactly one camera"):
        cameras["cameraX"]


def test_a_scene_without_cameras_reports_where_they_are_listed(simulate: Make) -> None:
    with pytest.raises(KeyError, match="no camera 'C': the scene has none; list one in 'cameras' of a file"):
        simulate().cameras["C"]


def test_a_camera_shows_the_state_as_it_is(simulate: Make) -> None:
    simulation = simulate(C=camera("C"))
    before = seen(simulation, "C", "Bead")
    simulation.bodies["Bead"].set_pose([-1.2, 0.35, 0.3, 0, 0, 0, 1])
    after = seen(simulation, "C", "Bead")
    f = simulation.cameras["C"].view().intrinsics[0, 0]
    assert before[0] - after[0] == pytest.approx(f * 0.1 / 1.2, abs=0.3)  # a bead is 20 pixels


def test_pictures_of_two_cameras_in_turn_are_those_that_a_fresh_renderer_draws() -> None:
    simulation = Simulation(ligature.load("suturing_small", (0, 1, 2)))
    begun, moments = simulation.snapshot(), []
    with opengl():
        used = Renderer(simulation.scene)
    for ticks in (20, 40):
        simulation.step(ticks)
        moments.append(simulation.state.copy())
    simulation.restore(begun)
    left, right = simulation.scene.cameras[:2]
    for moment, looking in ((0, left), (0, right), (1, right), (1, left), (0, left)):
        state = moments[moment]
        view = view_of(looking, state["camera_world"][0, looking.index], (160, 120))
        frame = used.render(state, view)
        fresh = Renderer(simulation.scene)
        expected = fresh.render(state, view)
        fresh.release()
        for name in ("rgb", "depth", "ids", "normals"):
            assert (getattr(frame, name) == getattr(expected, name)).all(), (moment, looking.identity.name, name)
    used.release()


def test_no_picture_wakes_the_threads_of_openblas(simulate: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    def woken(matrix: np.ndarray) -> np.ndarray:
        raise AssertionError("numpy.linalg was asked for an inverse: its threads spin for longer than a picture takes")

    simulation = simulate(C=camera("C"))
    lit = replace(simulation.scene.lights[0], shadow_quality=1)
    renderer = Renderer(replace(simulation.scene, lights=(lit,)))
    monkeypatch.setattr(np.linalg, "inv", woken)
    monkeypatch.setattr(np.linalg, "solve", woken)
    view = simulation.cameras["C"].view((64, 48))
    assert renderer.render(simulation.state, view).rgb.any()
    renderer.release()


def test_a_camera_that_is_placed_looks_from_there(simulate: Make) -> None:
    simulation = simulate(C=camera("C"))
    simulation.cameras["C"].place([-0.5, 0, 0, 0, 0, 0, 1])
    simulation.step()
    frame = simulation.cameras["C"].capture()
    assert np.abs(frame.depth[frame.ids == 1] - 1.5).max() < 1.5e-5


@pytest.mark.parametrize("bead", BEADS)
@pytest.mark.parametrize(
    "lens",
    [
        LENS,
        LENS + ", camera intrinsics: {fx: 260, fy: 250, cx: 150, cy: 130}",
        LENS + ", projection matrix: [[1.5, 0, 0.1, 0], [0, 2, -0.05, 0], [0, 0, -1.01, -0.1], [0, 0, -1, 0]]",
    ],
    ids=["field of view", "intrinsics", "projection matrix"],
)
def test_known_points_are_seen_where_the_calibration_projects_them(simulate: Make, lens: str, bead: str) -> None:
    simulation = simulate(C=camera("C", 0.05, lens=lens))
    calibration = simulation.cameras["C"].calibration((1280, 960))
    u, v, w = calibration.P @ [*optical(simulation, "C", BEADS[bead]), 1.0]
    assert np.abs(seen(simulation, "C", bead, resolution=(1280, 960)) - (u / w, v / w)).max() < 0.1


def test_the_matrix_of_a_field_of_view_is_the_specifications(simulate: Make) -> None:
    K = simulate(C=camera("C")).cameras["C"].calibration().K
    f = 120 / np.tan(0.45)
    assert np.allclose(K, [[f, 0, 159.5], [0, f, 119.5], [0, 0, 1]])


def test_an_orthographic_camera_sees_size_without_distance(simulate: Make) -> None:
    simulation = simulate(C=camera("C", lens=LENS + ", orthographic view width: 1.6"))
    frame = simulation.cameras["C"].capture()
    assert (frame.ids == 2).sum() == pytest.approx(np.pi * (0.3 * 200) ** 2, rel=0.02)
    assert seen(simulation, "C", "Bead") == pytest.approx([159.5 + 0.45 * 200, 119.5 - 0.3 * 200], abs=0.2)


@pytest.mark.parametrize("width", ["", ", orthographic view width: 1.6"])
def test_points_of_a_depth_picture_lie_on_the_things_they_show(simulate: Make, width: str) -> None:
    eye = simulate(C=camera("C", lens=LENS + width)).cameras["C"]
    frame = eye.capture()
    points = unproject(frame.depth, eye.view())
    assert np.abs(points[frame.ids == 1][:, 2] - 2.0).max() < 2e-5
    distance = np.linalg.norm(points[frame.ids == 2] - (0, 0, 1.0), axis=1)
    assert distance.max() < 0.3 + 1e-5 and distance.min() > 0.3 * 0.985
    assert np.isnan(points[frame.ids == 0]).all()


def test_a_pair_of_parallel_cameras_has_its_baseline_in_the_right_projection(simulate: Make) -> None:
    cameras = simulate(cameraL=camera("cameraL", -0.03), cameraR=camera("cameraR", 0.03)).cameras
    left, right = cameras["cameraL"].calibration(), cameras["cameraR"].calibration()
    assert np.array_equal(left.R, np.eye(3)) and np.array_equal(right.R, np.eye(3))
    assert np.array_equal(left.P, np.hstack([left.K, np.zeros((3, 1))]))
    assert right.P[0, 3] == pytest.approx(-left.K[0, 0] * 0.06)


@pytest.mark.parametrize("aim", [None, 0.0], ids=["parallel", "aimed at one point"])
def test_disparity_of_a_pair_is_that_of_its_depth(simulate: Make, aim: float | None) -> None:
    simulation = simulate(cameraL=camera("cameraL", -0.03, aim), cameraR=camera("cameraR", 0.03, aim))
    left, right = (simulation.cameras[name].calibration((1280, 960)) for name in ("cameraL", "cameraR"))
    for bead, point in BEADS.items():
        rectified = left.R @ optical(simulation, "cameraL", point)
        pixels = []
        for name, c in (("cameraL", left), ("cameraR", right)):
            ray = c.R @ np.linalg.inv(c.K) @ [*seen(simulation, name, bead, resolution=(1280, 960)), 1.0]
            pixels.append((c.P[:, :3] @ ray)[:2] / ray[2])
        assert pixels[0][1] == pytest.approx(pixels[1][1], abs=0.1)
        assert pixels[0][0] - pixels[1][0] == pytest.approx(-right.P[0, 3] / rectified[2], abs=0.15)


def test_left_and_right_pictures_match_pixel_for_pixel_by_depth(simulate: Make) -> None:
    simulation = simulate(cameraL=camera("cameraL", -0.03), cameraR=camera("cameraR", 0.03))
    left, right = (simulation.cameras[name].capture() for name in ("cameraL", "cameraR"))
    shift = -simulation.cameras["cameraR"].calibration().P[0, 3] / left.depth
    rows, columns = np.nonzero(left.ids == 1)
    there = np.rint(columns - shift[rows, columns]).astype(int)
    inside = there >= 0
    same = right.ids[rows[inside], there[inside]] == 1
    assert same.mean() > 0.9
    matched = (
        right.depth[rows[inside][same], there[inside][same]] - left.depth[rows[inside][same], columns[inside][same]]
    )
    assert np.abs(matched).max() < 1e-4


def test_the_eyes_of_a_stereo_camera_stand_apart_and_lean_inwards(simulate: Make) -> None:
    lens = LENS + ", stereo: {mode: PASSIVE, eye separation: 0.06, focal length: 0.5}"
    simulation = simulate(C=camera("C", lens=lens))
    eye = simulation.cameras["C"]
    left, right = eye.calibration(eye="left"), eye.calibration(eye="right")
    f = left.K[0, 0]
    assert right.P[0, 3] == pytest.approx(-f * 0.06)
    assert left.K[0, 2] - 159.5 == pytest.approx(-0.25 * 0.06 / 0.5 * f)
    assert right.K[0, 2] - 159.5 == pytest.approx(0.25 * 0.06 / 0.5 * f)
    columns = [seen(simulation, "C", "Bead", eye=e)[0] for e in ("left", "right")]
    wanted = f * 0.06 / 1.2 - 2 * 0.25 * 0.06 / 0.5 * f
    assert columns[0] - columns[1] == pytest.approx(wanted, abs=0.3)


def test_another_lens_can_be_put_on(simulate: Make) -> None:
    eye = simulate(C=camera("C")).cameras["C"]
    small = (eye.capture().ids == 2).sum()
    eye.camera = replace(eye.camera, field_of_view=0.45)
    f = 120 / np.tan(0.225)
    assert eye.calibration().K[0, 0] == pytest.approx(f)
    assert (eye.capture().ids == 2).sum() > 3 * small
