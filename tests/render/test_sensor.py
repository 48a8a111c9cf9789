"""Lens and sensor: what they do to a picture is what they state."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from ligature import Simulation
from ligature.render import ImageSensor
from ligature.render.sensor import distort, undistort

from tests.render.conftest import BEADS, LENS, camera
from tests.render.test_cameras import optical, seen

Make = Callable[..., Simulation]
BARREL = (-0.3, 0.09, 0.001, -0.002, 0.01)


def test_undistort_undoes_distort() -> None:
    points = np.random.default_rng(0).uniform(-0.6, 0.6, (100, 2))
    assert np.allclose(undistort(distort(points, BARREL), BARREL), points, atol=1e-7)


@pytest.mark.parametrize("lens", [BARREL, (0.2, 0.0, 0.0, 0.0, 0.0)], ids=["barrel", "cushion"])
def test_a_lens_shows_known_points_where_its_coefficients_state(simulate: Make, lens: tuple[float, ...]) -> None:
    simulation = simulate(C=camera("C"))
    how = {"resolution": (1280, 960), "sensor": ImageSensor(distortion=lens)}
    calibration = simulation.cameras["C"].calibration(**how)
    assert tuple(calibration.D) == lens
    for bead, point in BEADS.items():
        x, y, z = optical(simulation, "C", point)
        ray = distort(np.array([x / z, y / z]), lens)
        u, v, _ = calibration.K @ [*ray, 1.0]
        assert np.abs(seen(simulation, "C", bead, **how) - (u, v)).max() < 0.2


def test_a_lens_leaves_no_corner_empty(simulate: Make) -> None:
    frame = simulate(C=camera("C")).cameras["C"].capture(sensor=ImageSensor(distortion=BARREL))
    assert frame.ids.shape == (240, 320) and (frame.ids > 0).all()


def test_noise_is_as_strong_as_asked_and_repeats_with_its_seed(simulate: Make) -> None:
    simulation = simulate(C=camera("C"))
    eye = simulation.cameras["C"]
    ideal = eye.capture()
    sensor = ImageSensor(noise=0.02, depth_noise=0.003, seed=5)
    noisy, again = eye.capture(sensor=sensor), eye.capture(sensor=sensor)
    wall = (ideal.ids == 1) & (ideal.rgb.min(axis=2) > 30) & (ideal.rgb.max(axis=2) < 225)
    difference = noisy.rgb[wall].astype(float) - ideal.rgb[wall]
    assert difference.std() == pytest.approx(0.02 * 255, rel=0.05) and abs(difference.mean()) < 0.1
    assert (noisy.depth - ideal.depth)[ideal.ids == 1].std() == pytest.approx(0.003, rel=0.05)
    assert (noisy.rgb == again.rgb).all() and (noisy.depth == again.depth).all()
    assert (eye.capture(sensor=ImageSensor(noise=0.02, seed=6)).rgb != noisy.rgb).any()
    simulation.step()
    assert (eye.capture(sensor=sensor).rgb != noisy.rgb).any()


def test_a_stop_more_doubles_the_light(simulate: Make) -> None:
    eye = simulate(C=camera("C")).cameras["C"]
    dark, bright = eye.capture(), eye.capture(sensor=ImageSensor(exposure=1.0))

    def light(rgb: np.ndarray) -> np.ndarray:
        return ((rgb / 255.0 + 0.055) / 1.055) ** 2.4

    usable = (dark.rgb > 40) & (bright.rgb < 250)
    assert usable.sum() > 100
    assert (light(bright.rgb[usable]) / light(dark.rgb[usable])).mean() == pytest.approx(2.0, rel=0.03)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"noise": float("nan")}, "the noise of a sensor lies between 0 and 10, not at nan"),
        ({"depth_noise": -1.0}, "the depth_noise of a sensor lies between 0 and 1000, not at -1"),
        ({"exposure": 1e9}, "the exposure of a sensor lies between -32 and 32, not at 1e[+]09"),
        ({"distortion": (0.0, float("inf"), 0.0, 0.0, 0.0)}, "the distortion of a sensor must be finite"),
    ],
)
def test_a_sensor_that_is_invalid_is_refused(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ImageSensor(**wrong)


def test_a_lens_that_cannot_be_undone_is_refused(simulate: Make) -> None:
    sensor = ImageSensor(distortion=(-5.0, 0.0, 0.0, 0.0, 0.0))
    wide = LENS.replace("angle: 0.9", "angle: 2.0")
    with pytest.raises(ValueError, match="cannot be inverted over the whole picture"):
        simulate(C=camera("C", lens=wide)).cameras["C"].capture(sensor=sensor)
